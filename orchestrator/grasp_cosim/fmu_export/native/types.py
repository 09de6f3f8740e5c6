"""The types of a block's values, and what its C is made of: structs, constants and functions."""

import re
import sys
from collections.abc import Iterable, Iterator
from dataclasses import is_dataclass
from enum import IntEnum
from functools import cache
from pathlib import Path
from types import GenericAlias
from typing import Annotated, Any, NamedTuple, cast, get_args, get_origin, get_type_hints

from .text import WIDTH, Source, comment, identifier, number, wrapped

Type = type[Any] | GenericAlias
"""The types of Python: float, int, bool, tuple[...], a NamedTuple, or a dataclass of parameters.

The last is in C behind a pointer.
"""

REAL, WHOLE, BOOLEAN = SCALARS = float, int, bool


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
        return _tuple_of(map(of_hint, get_args(hint)))
    if isinstance(hint, type) and issubclass(hint, IntEnum):
        return WHOLE
    return hint if hint in SCALARS or is_record(hint) or is_dataclass(hint) else None


def of_value(value: Any) -> Type | None:
    """The type of a constant."""
    return _tuple_of(map(of_value, value)) if type(value) is tuple else of_hint(type(value))


def _tuple_of(items: Iterable[Type | None]) -> Type | None:
    types = [*items]
    return GenericAlias(tuple, tuple(types)) if all(types) else None


def is_record(cls: Any) -> bool:
    """Return True for a NamedTuple."""
    return isinstance(cls, type) and issubclass(cls, tuple) and hasattr(cls, "_fields")


def fields(t: Any) -> dict[str, Type]:
    """The fields of a class with their types; TypeError for one that C cannot have."""
    kinds = {}
    for name, hint in get_type_hints(t, include_extras=True).items():
        kind = of_hint(hint)
        if kind is None:
            raise TypeError(f"{t.__name__}.{name}: must be a number, a tuple or a NamedTuple")
        kinds[name] = kind
    return kinds


def parts(t: Type) -> tuple[Type, ...]:
    """The types of what a tuple is made of; empty for a number."""
    if isinstance(t, GenericAlias):
        return t.__args__
    return tuple(fields(t).values()) if is_record(t) else ()


def size(t: Type) -> int:
    """How many numbers there are in it."""
    return sum(map(size, parts(t))) or 1


def plain(t: Type) -> Type:
    """The type as C has it: a whole number is a double."""
    if isinstance(t, GenericAlias):
        return GenericAlias(tuple, tuple(map(plain, t.__args__)))
    return REAL if t == WHOLE else t


def in_words(t: Type) -> str:
    """A type in words."""
    name = f"tuple[{', '.join(map(in_words, parts(t)))}]"
    return name if isinstance(t, GenericAlias) else t.__name__


class Function(NamedTuple):
    """A function in C."""

    name: str
    returns: Type
    by_address: tuple[bool, ...] = ()
    """Which arguments are large NamedTuples, by their address."""


class Program:
    """The definitions of one block; `file` is the source of a user's block."""

    def __init__(self, params: type[Any], file: Path | None = None) -> None:
        self.params, self.file = params, file
        self._source = cache(Source)
        self.functions: dict[Any, Function | None] = {}
        """By code and the types of the arguments; None while it is being translated."""
        self.cached_properties: dict[str, Function] = {}
        """The cached properties of the parameters, which are worked out when those are read."""
        self.bodies: list[str] = []
        self.names: dict[str, Any] = {}
        self.constants: dict[str, str] = {}
        """The definitions of constants, by their names in C."""
        self._structs: dict[Type, str] = {}

    def source(self, file: str) -> Source:
        """The source in a file."""
        is_own = self.file is not None and Path(file).name == self.file.name
        return self._source(file, str(self.file) if is_own else Path(file).name)

    def unique(self, module: str, name: str, key: Any) -> str:
        """The name in C of what a module has, behind the module's own name."""
        short = module.rpartition(".")[2].removesuffix("_block")
        short = f"{short}_py" if short in ("block", "text", "slave") else short
        base_name = "_".join([short, *(part.lstrip("_") for part in name.split("."))])
        unused, count = base_name, 1
        while self.names.setdefault(unused, key) != key:
            count += 1
            unused = f"{base_name}_{count}"
        return unused

    def c(self, t: Type, near: dict[str, Any] | None = None) -> str:
        """A type in C; `near` are the names of the module that asks, one of which a tuple gets."""
        t = plain(t)
        if t in SCALARS:
            return "int" if t == BOOLEAN else "double"
        if t not in self._structs:
            self._structs[t] = self.unique(*self._name_of(t, near or {}), t)
        return self._structs[t]

    def _name_of(self, t: Type, near: dict[str, Any]) -> tuple[str, str]:
        if not isinstance(t, GenericAlias):
            return t.__module__, t.__name__
        for names in [near, *(vars(m) for m in near.values() if type(m) is type(sys))]:
            for name, hint in names.items():
                if name[0] != "_" and get_origin(hint) is tuple and of_hint(hint) == t:
                    return names["__name__"], name
        return "Tuple", str(len(parts(t)))

    def member(self, t: Type, i: int) -> str:
        """How an item of a tuple is reached: .at[0], .at_0 or .name."""
        if is_record(t):
            return f".{identifier(t._fields[i])}"
        return f".at[{i}]" if alike(t) else f".at_{i}"

    def braces(self, t: Type, items: list[str]) -> str:
        """The initialiser of a struct."""
        text = f"{{{', '.join(items)}}}"
        return f"{{{text}}}" if alike(t) else text

    def structs(self) -> str:
        """The definitions of all structs that were asked for, each after those in it."""
        done: dict[Type, str] = {}
        while waiting := [t for t in self._structs if t not in done]:
            for t in waiting:
                self._define(t, done)
        return "\n".join(done.values())

    def _define(self, t: Type, done: dict[Type, str]) -> None:
        t = plain(t)
        if t in SCALARS or t in done:
            return
        lines = [] if isinstance(t, GenericAlias) else [comment(t.__doc__ or t.__name__)]
        lines.append("typedef struct {")
        for name, kind, meaning in self._members(t):
            self._define(kind, done)
            lines += _member_lines(f"{self.c(kind)} {name};", meaning)
        done[t] = "\n".join([*lines, f"}} {self.c(t)};", ""])

    def _members(self, t: Type) -> Iterator[tuple[str, Type, str]]:
        if isinstance(t, type):
            for name, kind in fields(t).items():
                yield identifier(name), kind, self._meaning(t, name)
        elif alike(t):
            yield f"at[{len(parts(t))}]", parts(t)[0], ""
        else:
            yield from ((f"at_{i}", kind, "") for i, kind in enumerate(parts(t)))
        for name, prop in self.cached_properties.items() if t == self.params else ():
            yield identifier(name), prop.returns, "worked out from the others"

    def _meaning(self, cls: type[Any], name: str) -> str:
        hint = get_type_hints(cls, include_extras=True)[name]
        for declared in getattr(hint, "__metadata__", ())[:1]:
            unit = f", {declared.unit}" if declared.unit else ""
            return f"{declared.description}{unit}"
        spec: Any = sys.modules[cls.__module__].__spec__
        return re.sub(r"\s+", " ", self.source(spec.loader.path).member(cls.__name__, name))

    def constant(self, names: dict[str, Any], name: str, value: Any) -> str:
        """The name in C of a constant of a module."""
        key = names["__name__"], name
        c_name = self.unique(*key, key)
        if c_name not in self.constants:
            kind, text = self._literal(value)
            line = f"static const {self.c(kind, names)} {c_name} = {text};"
            self.constants[c_name] = f"{wrapped(line)}\n"
        return c_name

    def _literal(self, value: Any) -> tuple[Type, str]:
        """The type of a constant, which it has, and its initialiser."""
        kind = cast(Type, of_value(value))
        if isinstance(value, tuple):
            return kind, self.braces(kind, [self._literal(item)[1] for item in value])
        return kind, str(int(value)) if isinstance(value, bool) else number(value)


def alike(t: Type) -> bool:
    """Return True for a tuple whose items have one type in C: they are an array."""
    return isinstance(t, GenericAlias) and len({plain(item) for item in t.__args__}) == 1


def _member_lines(declaration: str, meaning: str) -> list[str]:
    """A member of a struct with its meaning behind it, or above it where that is too long."""
    if not meaning:
        return [f"    {declaration}"]
    line = f"    {declaration} {comment(meaning)}"
    return [line] if len(line) <= WIDTH else [f"    {comment(meaning)}", f"    {declaration}"]
