"""The types of values in a translated block, and how C holds them."""

from dataclasses import dataclass, field
from typing import Any


class Type:
    """Of a value."""


@dataclass(frozen=True)
class Scalar(Type):
    """A number, a truth value, a text; NUMBER is an int or a float, which is not known before."""

    name: str


REAL = Scalar("float")
WHOLE = Scalar("int")
NUMBER = Scalar("int or float")
BOOLEAN = Scalar("bool")
TEXT = Scalar("str")
NOTHING = Scalar("None")

NUMBERS = (REAL, WHOLE, NUMBER)


@dataclass(frozen=True)
class Member(Type):
    """A member of an IntEnum."""

    enum: type[Any]


@dataclass(frozen=True)
class Tuple(Type):
    """A plain tuple; `alias` is what its C type is called where the source names it."""

    items: tuple[Type, ...]
    alias: str = field(default="", compare=False)


@dataclass(frozen=True)
class Record(Type):
    """A NamedTuple."""

    cls: type[Any]


@dataclass(frozen=True)
class Group(Type):
    """A frozen dataclass; C has its address."""

    cls: type[Any]


def joined(a: Type, b: Type) -> Type | None:
    """The type of a value that is of one of two; None where C has none."""
    if a == b:
        return a if getattr(a, "alias", "") else b
    if a in NUMBERS and b in NUMBERS:
        return NUMBER
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        items = [joined(x, y) for x, y in zip(a.items, b.items, strict=True)]
        if None not in items:
            return Tuple(tuple(i for i in items if i is not None), a.alias or b.alias)
    return None


def fits(given: Type, wanted: Type) -> bool:
    """True if a value of a type may stand where another is declared."""
    return joined(given, wanted) == wanted


def said(t: Type) -> str:
    """What a message calls a type."""
    if isinstance(t, Scalar):
        return t.name
    if isinstance(t, Tuple):
        return f"tuple[{', '.join(said(item) for item in t.items)}]"
    if isinstance(t, Member):
        return t.enum.__name__
    cls: type[Any] = t.cls  # type: ignore[attr-defined]  # of a NamedTuple or a dataclass
    return cls.__name__
