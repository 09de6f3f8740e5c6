"""The types of a block's values, and a value as C has it."""

from dataclasses import dataclass, is_dataclass
from enum import IntEnum
from functools import cache
from typing import Annotated, Any, NamedTuple, get_args, get_origin, get_type_hints


class UntranslatableError(ValueError):
    """A block has what cannot be C: where, what, and what to write instead, in one line."""


@dataclass(frozen=True)
class Scalar:
    """A number or a truth value, by its name in Python."""

    name: str


@dataclass(frozen=True)
class Tuple:
    """A tuple of fixed length."""

    items: "tuple[Type, ...]"


@dataclass(frozen=True)
class Record:
    """A NamedTuple."""

    cls: type[Any]


@dataclass(frozen=True)
class Group:
    """Parameters: a frozen dataclass, in C behind a pointer."""

    cls: type[Any]


Type = Scalar | Tuple | Record | Group

REAL, WHOLE, BOOLEAN = Scalar("float"), Scalar("int"), Scalar("bool")
NUMBERS = REAL, WHOLE


class Value(NamedTuple):
    """An expression in C, and how tightly it binds; of a tuple that was just made, its items."""

    text: str
    type: Type
    level: int = 9
    items: "tuple[Value, ...] | None" = None


def of_hint(hint: Any) -> Type | None:
    """The type that an annotation stands for; None for what cannot be in C."""
    if get_origin(hint) is Annotated:
        return of_hint(get_args(hint)[0])
    if get_origin(hint) is tuple:
        items = tuple(of_hint(item) for item in get_args(hint))
        return Tuple(tuple(i for i in items if i)) if all(items) else None
    if not isinstance(hint, type):
        return None
    if issubclass(hint, IntEnum):
        return WHOLE
    if hint in (float, int, bool):
        return Scalar(hint.__name__)
    if is_record(hint):
        return Record(hint)
    return Group(hint) if is_dataclass(hint) else None


def of_value(value: Any) -> Type | None:
    """The type of a constant."""
    if type(value) is tuple:
        items = tuple(of_value(item) for item in value)
        return Tuple(tuple(i for i in items if i)) if all(items) else None
    return of_hint(type(value))


def is_record(cls: Any) -> bool:
    """Return True for a NamedTuple."""
    return isinstance(cls, type) and issubclass(cls, tuple) and hasattr(cls, "_fields")


@cache
def fields(t: Record | Group) -> dict[str, Type]:
    """The fields of a class with their types; TypeError for one that C cannot have."""
    found = {}
    for name, hint in get_type_hints(t.cls, include_extras=True).items():
        kind = of_hint(hint)
        if kind is None:
            raise TypeError(f"{t.cls.__name__}.{name}: must be a number, a tuple or a NamedTuple")
        found[name] = kind
    return found


def parts(t: Type) -> tuple[Type, ...]:
    """The types of what a tuple is made of; empty for a number."""
    if isinstance(t, Tuple):
        return t.items
    return tuple(fields(t).values()) if isinstance(t, Record) else ()


def size(t: Type) -> int:
    """How many numbers there are in it."""
    return sum(map(size, parts(t))) or 1


def plain(t: Type) -> Type:
    """The type as C has it: a whole number is a double."""
    if isinstance(t, Tuple):
        return Tuple(tuple(plain(item) for item in t.items))
    return REAL if t == WHOLE else t


def said(t: Type) -> str:
    """A type in words."""
    if isinstance(t, Tuple):
        return f"tuple[{', '.join(map(said, t.items))}]"
    return t.name if isinstance(t, Scalar) else t.cls.__name__
