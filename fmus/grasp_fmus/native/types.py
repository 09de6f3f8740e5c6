"""Types of the values of a block, and what they are called in an error."""

from collections.abc import Sequence
from dataclasses import dataclass, is_dataclass
from dataclasses import fields as dataclass_fields
from enum import IntEnum
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints


@dataclass(frozen=True)
class Scalar:
    """A number, or True or False: in C a double, or an int."""

    name: str


REAL, WHOLE, BOOLEAN = Scalar("float"), Scalar("int"), Scalar("bool")
NUMBER = Scalar("int or float")
"""Known when it runs only; the same double in C, but for the sign of zero."""
TEXT = Scalar("text")
"""For the reason of a check."""


@dataclass(frozen=True)
class Member:
    """A member of an IntEnum."""

    cls: type[IntEnum]


@dataclass(frozen=True)
class Tuple:
    """A tuple of a fixed length."""

    items: "tuple[Type, ...]"

    @property
    def is_array(self) -> bool:
        """True if all items are of one type."""
        return len(set(self.items)) == 1


@dataclass(frozen=True)
class Record:
    """A NamedTuple."""

    cls: type[Any]


@dataclass(frozen=True)
class Group:
    """A dataclass of parameters."""

    cls: type[Any]


Type = Scalar | Member | Tuple | Record | Group
NUMBERS = (REAL, WHOLE, NUMBER)


def is_record(cls: Any) -> bool:
    """True for a NamedTuple."""
    return isinstance(cls, type) and issubclass(cls, tuple) and hasattr(cls, "_fields")


def of_hint(hint: Any) -> Type | None:
    """The type that an annotation stands for; None for what is not in the subset."""
    if get_origin(hint) is Annotated:
        return of_hint(get_args(hint)[0])
    if get_origin(hint) is tuple:
        return of_items([of_hint(item) for item in get_args(hint)])
    if is_record(hint):
        return Record(hint)
    if not isinstance(hint, type):
        return None
    if issubclass(hint, IntEnum):
        return Member(hint)
    return Group(hint) if is_dataclass(hint) else _SCALARS.get(hint)


_SCALARS: dict[Any, Type] = {float: REAL, int: WHOLE, bool: BOOLEAN}


def of_value(value: Any) -> Type | None:
    """The type of a constant."""
    if type(value) is tuple:
        return of_items([of_value(item) for item in value])
    return None if is_dataclass(type(value)) else of_hint(type(value))


def of_items(items: Sequence[Type | None]) -> Tuple | None:
    """The type of a tuple; None where it is empty, or one of its items has none."""
    found = tuple(item for item in items if item is not None)
    return Tuple(found) if len(found) == len(items) > 0 else None


@cache
def fields(t: Record | Group) -> dict[str, Type | None]:
    """The fields of a class, in their order."""
    hints = get_type_hints(t.cls)
    names: Sequence[str] = t.cls._fields if isinstance(t, Record) else _names(t.cls)
    return {name: of_hint(hints[name]) for name in names}


def _names(cls: type[Any]) -> list[str]:
    return [f.name for f in dataclass_fields(cls)]


def joined(a: Type, b: Type) -> Type | None:
    """The type of what is one of two; None where they have nothing in common."""
    if a == b:
        return a
    if a in NUMBERS and b in NUMBERS:
        return NUMBER
    if isinstance(a, Tuple) and isinstance(b, Tuple) and len(a.items) == len(b.items):
        return of_items([joined(x, y) for x, y in zip(a.items, b.items, strict=True)])
    return None


def said(t: Type) -> str:
    """What Python calls it."""
    if isinstance(t, Scalar):
        return t.name
    return f"tuple[{', '.join(map(said, t.items))}]" if isinstance(t, Tuple) else t.cls.__name__


class Value(NamedTuple):
    """An expression in C: its text, its type, how tightly its operator binds.

    `items` are those of a tuple that stands item by item, which has no text yet. `is_int` is a
    whole number that C has as an int, from `low` to below `high` where that is known.
    """

    text: str
    type: Type
    level: int = 9
    items: "tuple[Value, ...] | None" = None
    is_int: bool = False
    span: tuple[int, int] | None = None
