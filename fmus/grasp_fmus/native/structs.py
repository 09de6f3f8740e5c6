# ruff: noqa: S101, PT018
# mypy: disable-error-code="union-attr, arg-type, attr-defined, str-bytes-safe"
"""What a block in C defines beside its functions: structs, constants, names that are unique."""

import ast
import sys
from collections.abc import Iterator, Mapping
from dataclasses import is_dataclass
from enum import IntEnum
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple, get_origin, get_type_hints

from .text import WIDTH, Source, ascii_text, comment, identifier, number, string, wrapped
from .types import (
    BOOLEAN,
    TEXT,
    Group,
    Member,
    Record,
    Scalar,
    Tuple,
    Type,
    fields,
    is_record,
    of_hint,
    of_value,
)

MOST = 2**31 - 1
"""Of a whole number that C has as an int."""


class Function(NamedTuple):
    """A function in C, and what it returns."""

    name: str
    returns: Type


class Program:
    """The block in C as it grows: each definition is made when it is first needed."""

    def __init__(self, block: Any, file: Path | None) -> None:
        self.block = block
        self._file = file
        self._sources: dict[int, Source | None] = {}
        self._names: dict[Any, str] = {}
        self._types: dict[Type, None] = {}
        self._aliases: dict[Type, dict[str, str]] = {}
        self._constants: dict[str, str] = {}
        self.functions: dict[Any, Function | None] = {}
        """By what they are made from; None while one is being made."""
        self.bodies: list[str] = []
        self.kept: dict[type[Any], dict[str, Function]] = {}
        """The properties that are worked out when parameters are read, by class."""
        self.own = self.source(vars(block))

    # Sources

    def source(self, names: dict[str, Any]) -> Source | None:
        """The source of the module with these names; None where it is none of a block's."""
        if id(names) not in self._sources:
            self._sources[id(names)] = self._read(names)
        return self._sources[id(names)]

    def _read(self, names: dict[str, Any]) -> Source | None:
        root = str(names["__name__"]).partition(".")[0]
        file = self._file if names is vars(self.block) and self._file else names.get("__file__")
        if root in sys.stdlib_module_names or root == "block_variables" or file is None:
            return None
        found = Source(names, Path(file))
        stems = {source.stem for source in self._sources.values() if source}
        if found.stem in stems:
            found.stem = identifier(str(names["__name__"]).replace(".", "_"))
        return found

    def module(self, name: str) -> Source | None:
        """The source of a module by its name."""
        if name == self.block.__name__:
            return self.own
        module = sys.modules.get(name)
        return self.source(vars(module)) if module else None

    def origin(self, source: Source, name: str) -> tuple[Source, str]:
        """Where a name of a module comes from: its module, and what it is called there."""
        while name in source.imported and name not in source.assigned:
            node, original = source.imported[name]
            package = str(source.names.get("__package__") or "").split(".")
            parts = package[: len(package) - node.level + 1] if node.level else []
            found = self.module(".".join([*parts, *([node.module] if node.module else [])]))
            if found is None:
                break
            source, name = found, original
        return source, name

    # Names

    def unique(self, key: Any, name: str) -> str:
        """The name of C for a key, told from all others."""
        if key not in self._names:
            taken, plain, count = set(self._names.values()), name, 1
            while name in taken:
                count += 1
                name = f"{plain}_{count}"
            self._names[key] = name
        return self._names[key]

    def function_name(self, source: Source, function: FunctionType, key: Any) -> str:
        """advance() of contact.py is contact_advance, Params.rates is contact_Params_rates."""
        parts = [part.strip("_") for part in function.__qualname__.split(".")]
        return self.unique(key, identifier("_".join([source.stem, *parts])))

    # Types

    def c(self, t: Type, source: Source | None = None) -> str:
        """The name of a type in C, as a module calls it."""
        if isinstance(t, Scalar | Member):
            return {BOOLEAN: "int", TEXT: "const char *"}.get(t, "double")
        self._types[t] = None
        if not isinstance(t, Tuple):
            home = self.module(t.cls.__module__)
            stem = f"{home.stem}_" if home else ""
            return self.unique(t, identifier(f"{stem}{t.cls.__name__}"))
        known = self._aliases.setdefault(t, {})
        for alias, doc in self._called(t, source):
            known.setdefault(alias, doc)
            return alias
        if not known:
            letters = "".join(self._letter(item) for item in t.items)
            known[self.unique(t, f"Tuple_{letters}")] = ""
        return next(iter(known))

    def _letter(self, t: Type) -> str:
        if isinstance(t, Scalar | Member):
            return "b" if t == BOOLEAN else "d"
        return f"_{self.c(t)}_"

    def _called(self, t: Tuple, source: Source | None) -> Iterator[tuple[str, str]]:
        """What modules call a tuple, this one first."""
        if t.is_array or source:
            others = [s for s in self._sources.values() if s] if not self._aliases[t] else []
            for module in [*([source] if source else []), *others]:
                for name in [*module.assigned, *module.imported]:
                    value = module.names.get(name)
                    if get_origin(value) is tuple and of_hint(value) == t:
                        home, called = self.origin(module, name)
                        doc = home.doc_after(home.tree.body, home.assigned[called])
                        key = home.file, called
                        yield self.unique(key, identifier(f"{home.stem}_{called}")), doc

    def braces(self, t: Type, items: list[str]) -> str:
        """The initialiser of a struct."""
        text = ", ".join(items) or "0"
        return f"{{{{{text}}}}}" if isinstance(t, Tuple) and t.is_array else f"{{{text}}}"

    def structs(self) -> str:
        """The definitions of all types that are used, each after those of its members."""
        done: dict[Type, str] = {}
        for t in list(self._types):
            self._define(t, done)
        return "\n".join(done.values())

    def _define(self, t: Type, done: dict[Type, str]) -> None:
        if t in done or isinstance(t, Scalar | Member):
            return
        members = self._members(t)
        for _, kind, _ in members:
            self._define(kind, done)
        if isinstance(t, Tuple):
            (name, doc), *others = [*self._aliases.get(t, {}).items()] or [(self.c(t), "")]
        else:
            name, doc, others = self.c(t), t.cls.__dict__.get("__doc__") or "", []
        lines = []
        for member, kind, about in members or [("none", BOOLEAN, "")]:
            line = f"    {self.c(kind)} {member};"
            said = f" /* {ascii_text(about)} */" if about else ""
            above = len(line + said) > WIDTH or "\n" in said
            lines.append(comment(about, "    ") + line if above else line + said)
        body = "\n".join(lines)
        done[t] = f"{comment(doc)}typedef struct {{\n{body}\n}} {name};\n"
        for alias, meaning in others:
            done[t] += f"\n{comment(meaning)}typedef {name} {alias};\n"

    def _members(self, t: Type) -> list[tuple[str, Type, str]]:
        """Name, type and meaning of the members of a struct."""
        if isinstance(t, Tuple):
            if t.is_array:
                return [(f"at[{len(t.items)}]", t.items[0], "")]
            return [(f"at_{i}", kind, "") for i, kind in enumerate(t.items)]
        assert isinstance(t, Record | Group)
        found = [
            (identifier(name), kind, self._meaning(t.cls, name))
            for name, kind in fields(t).items()
            if kind
        ]
        for name, made in self.kept.get(t.cls, {}).items():
            found.append((identifier(name), made.returns, "worked out once from the others"))
        return found

    def _meaning(self, cls: type[Any], name: str) -> str:
        """What a field is declared to mean, with its unit, or its docstring."""
        declared = getattr(get_type_hints(cls, include_extras=True)[name], "__metadata__", None)
        if declared:
            unit = declared[0].unit
            return f"{declared[0].description}{f', {unit}' if unit not in ('', '1') else ''}"
        for owner in cls.__mro__:
            home = self.module(owner.__module__)
            node = home.classes.get(owner.__name__) if home else None
            for item in node.body if node else []:
                if isinstance(item, ast.AnnAssign) and ast.unparse(item.target) == name:
                    assert home and node
                    return home.doc_after(node.body, item)
        return ""

    # Constants

    def constant(self, source: Source, name: str, value: Any) -> tuple[str, Type, bool]:
        """The name in C of a constant of a module, its type, and if it is an int of C."""
        kind = of_value(value)
        assert kind
        home, called = self.origin(source, name)
        c_name = self.unique((home.file, called), identifier(f"{home.stem}_{called.strip('_')}"))
        is_int = type(value) is int and abs(value) <= MOST
        if c_name not in self._constants:
            node = home.assigned.get(called)
            doc = comment(home.doc_after(home.tree.body, node) if node else "")
            text = f"static const {self.c(kind, home)} {c_name} = {self.literal(value)};"
            text = f"enum {{ {c_name} = {value} }};" if is_int else text
            self._constants[c_name] = f"{doc}{wrapped(text)}\n"
        return c_name, kind, is_int

    def literal(self, value: Any) -> str:
        """A constant as an initialiser, or as an expression where it is a number."""
        if isinstance(value, tuple):
            kind = of_value(value)
            assert kind
            return self.braces(kind, [self.literal(item) for item in value])
        return str(int(value)) if isinstance(value, bool) else number(value)

    def member(self, value: IntEnum) -> str:
        """The name in C of a member of an IntEnum."""
        cls = type(value)
        name = self.c(Record(cls)).removesuffix("_")
        self._types.pop(Record(cls), None)
        if name not in self._constants:
            rows = [f"    {name}_{m.name} = {int(m)}" for m in cls]
            body = ",\n".join(rows)
            self._constants[name] = f"{comment(cls.__doc__)}enum {{\n{body}\n}};\n"
        return f"{name}_{value.name}"

    def look_up(self, source: Source, name: str, table: Mapping[Any, float]) -> str:
        """The function that looks a key up in a table of a module."""
        home, called = self.origin(source, name)
        c_name = self.unique((home.file, called), identifier(f"{home.stem}_{called.strip('_')}"))
        if c_name not in self._constants:
            rows = "".join(
                f"    if (key == {self.key(key)}) {{\n        return {number(value)};\n    }}\n"
                for key, value in table.items()
            )
            node = home.assigned.get(called)
            self._constants[c_name] = (
                f"{comment(home.doc_after(home.tree.body, node) if node else '')}"
                f"static double {c_name}(double key, double otherwise)\n{{\n{rows}"
                "    return otherwise;\n}\n"
            )
        return c_name

    def key(self, key: Any) -> str:
        """A key of a table."""
        return self.member(key) if isinstance(key, IntEnum) else number(key)

    def member_names(self, cls: type[IntEnum]) -> str:
        """The function that names the members of an IntEnum, in lower case."""
        c_name = self.unique((cls, "name"), identifier(f"{cls.__name__}_name"))
        if c_name not in self._constants:
            rows = "".join(
                f"    if (member == {self.member(m)}) {{\n"
                f"        return {string(m.name.lower())};\n    }}\n"
                for m in cls
            )
            self._constants[c_name] = (
                f'static const char *{c_name}(double member)\n{{\n{rows}    return "";\n}}\n'
            )
        return c_name

    def constants(self) -> str:
        """The definitions of all constants that are used."""
        return "\n".join(self._constants.values())


def is_constant(value: Any) -> bool:
    """True for a value that a constant of C can have."""
    if isinstance(value, FunctionType | ModuleType | type) or is_dataclass(type(value)):
        return False
    return of_value(value) is not None and (isinstance(value, int | float) or is_tuple(value))


def is_tuple(value: Any) -> bool:
    """True for a tuple or a NamedTuple."""
    return type(value) is tuple or is_record(type(value))
