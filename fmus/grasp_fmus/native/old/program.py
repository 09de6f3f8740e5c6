"""Everything of a block that C has: types, constants and functions, each with what it needs."""

import ast
import inspect
import typing
from collections.abc import Mapping
from dataclasses import dataclass, fields, is_dataclass
from enum import IntEnum
from itertools import pairwise
from types import FunctionType, GenericAlias
from typing import Any

from . import names
from .layout import comment, wrapped
from .python_source import Source, Sources, UntranslatableError
from .shapes import (
    BOOLEAN,
    NOTHING,
    REAL,
    TEXT,
    WHOLE,
    Group,
    Member,
    Record,
    Scalar,
    Tuple,
    Type,
    fits,
    said,
)

SHARED = "tuples"
"""The file of what belongs to no module: the shapes of plain tuples."""

Key = tuple[Any, ...]


@dataclass
class Item:
    """A definition in C: its text, the file it is in, and the definitions that it needs."""

    home: str
    text: str
    needs: set[Key]


@dataclass(frozen=True)
class Function:
    """A translated function, for one tuple of types of its arguments."""

    name: str
    returns: Type
    faults: frozenset[str]
    key: "Key"


class Program:
    """What has been translated so far."""

    def __init__(self, sources: Sources, outputs: type[Any]) -> None:
        self.sources, self.outputs = sources, outputs
        self.items: dict[Key, Item] = {}
        self.needed: set[Key] = set()
        self.functions: dict[Key, Function | None] = {}
        self.plain: dict[str, str] = {}
        self._names: dict[str, Key] = {}

    # Names and files

    def unique(self, name: str, key: Key) -> str:
        """The name in C, with a number where something else has it."""
        count = 1
        found = name
        while self._names.setdefault(found, key) != key:
            count += 1
            found = f"{name}_{count}"
        return found

    def define(self, key: Key, home: str, text: str, needs: set[Key]) -> None:
        """Add a definition. It is where the last of the modules is that it needs."""
        homes = [home] + [self.items[k].home for k in sorted(needs, key=repr) if k in self.items]
        for other in homes:
            if home == SHARED or self._uses(other, home):
                home = other
        self.items[key] = Item(home, text, needs)

    def _uses(self, module: str, other: str) -> bool:
        """True if a module imports another, or imports one that does."""
        seen, todo = {module}, [module]
        while todo:
            source = self.sources.of(todo.pop())
            for found in source.imports(self.sources) if source else ():
                if found == other:
                    return True
                if found not in seen:
                    seen.add(found)
                    todo.append(found)
        return False

    def need(self, key: Key) -> None:
        """Note that what is being translated needs a definition."""
        self.needed.add(key)

    # Types

    def of_hint(self, hint: Any, where: str) -> Type:
        """The type that an annotation stands for."""
        if typing.get_origin(hint) is typing.Annotated:
            return self.of_hint(typing.get_args(hint)[0], where)
        simple = {float: REAL, int: WHOLE, bool: BOOLEAN, str: TEXT, None: NOTHING}
        if hint is type(None):
            return NOTHING
        if isinstance(hint, type) and not isinstance(hint, GenericAlias):
            if hint in simple:
                return simple[hint]
            if issubclass(hint, IntEnum):
                return Member(hint)
            if issubclass(hint, tuple) and hasattr(hint, "_fields"):
                return Record(hint)
            if is_dataclass(hint):
                return Group(hint)
        if typing.get_origin(hint) is tuple and Ellipsis not in typing.get_args(hint):
            items = tuple(self.of_hint(arg, where) for arg in typing.get_args(hint))
            return Tuple(items, self._alias(hint, items))
        shown = getattr(hint, "__name__", hint)
        if typing.get_origin(hint) is tuple:
            shown = hint
        raise UntranslatableError(
            f"{where} is {shown}; must be float, int, bool, an IntEnum, a tuple of a fixed length, "
            "a NamedTuple or a frozen dataclass"
        )

    def _alias(self, hint: Any, items: tuple[Type, ...]) -> str:
        for source in self.sources.read():
            for name in source.assigned:
                if source.names.get(name) is hint:
                    key = ("alias", source.name, name)
                    if key not in self.items:
                        before, self.needed = self.needed, set()
                        cname = self.unique(f"{source.prefix}_{names.identifier(name)}", key)
                        shape = self.shape(Tuple(items))
                        about = comment(source.about(name))
                        self.define(
                            key, source.name, f"{about}typedef {shape} {cname};\n", self.needed
                        )
                        self.needed = before
                    return next(n for n, k in self._names.items() if k == key)
        return ""

    def hints(self, source: Source, function: FunctionType) -> dict[str, Type]:
        """The types that the annotations of a function name; what is none of ours is left out."""
        found = {}
        for name, hint in _hints(function).items():
            try:
                found[name] = self.of_hint(hint, "")
            except UntranslatableError:
                continue
        return found

    def members(self, t: Record | Group) -> dict[str, Type]:
        """The fields of a class with their types."""
        cls = t.cls
        hints = _hints(cls)
        of_class = cls._fields if isinstance(t, Record) else [f.name for f in fields(cls)]
        source = self.home(cls)
        line = getattr(source.class_node(cls), "lineno", 1)
        in_c: dict[str, str] = {}
        for name in of_class:
            other = in_c.setdefault(names.identifier(name), name)
            if other != name:
                raise source.error(
                    line, f"{cls.__name__}: {other} and {name} are one name in C; rename one"
                )
        return {
            name: self.of_hint(
                hints.get(name, Any), f"{source.file}: line {line}: {cls.__name__}.{name}"
            )
            for name in of_class
        }

    def home(self, cls: type[Any]) -> Source:
        """The module of a class."""
        source = self.sources.of(cls.__module__)
        if source is None:
            raise UntranslatableError(
                f"{self.sources.block_file}: line 1: {cls.__module__}.{cls.__qualname__} is in no "
                "module of the block; must be one of its own classes"
            )
        return source

    def shape(self, t: Type) -> str:
        """The C type of a value that is held, not pointed to."""
        if isinstance(t, Scalar):
            return {BOOLEAN: "int", TEXT: "const char *", NOTHING: "void"}.get(t, "double")
        if isinstance(t, Member):
            return "double"
        if isinstance(t, Tuple):
            if t.alias:
                self.need(self._names[t.alias])
                return t.alias
            return self._tuple(t)
        return self._class(t)  # type: ignore[arg-type]  # what is left

    def held(self, t: Type, name: str) -> str:
        """The declaration of a variable, or a parameter, of a type."""
        if isinstance(t, Group):
            return f"const {self.shape(t)} *{name}"
        shape = self.shape(t)
        return f"{shape}{name}" if shape.endswith("*") else f"{shape} {name}"

    def is_array(self, t: Tuple) -> bool:
        """True if the items of a tuple are all held alike."""
        return len({self._code(item) for item in t.items}) == 1

    def _code(self, t: Type) -> str:
        if isinstance(t, Tuple):
            return f"t{self._codes(t)}e"
        if isinstance(t, Record | Group):
            return self._class(t)
        return {"int": "b", "const char *": "s"}.get(self.shape(t), "d")

    def _codes(self, t: Tuple) -> str:
        runs: list[tuple[str, int]] = []
        for item in t.items:
            code = self._code(item)
            if runs and runs[-1][0] == code:
                runs[-1] = (code, runs[-1][1] + 1)
            else:
                runs.append((code, 1))
        return "_".join(f"{n}{c}" if n > 1 else c for c, n in runs)

    def _spoken(self, t: Tuple) -> str:
        """A short name of a tuple: 4d for four numbers, 2x4d for two of those."""
        runs: list[tuple[str, int]] = []
        for item in t.items:
            code = self._spoken(item) if isinstance(item, Tuple) else self._code(item)
            code = f"x{code}" if isinstance(item, Tuple) else code
            if runs and runs[-1][0] == code:
                runs[-1] = (code, runs[-1][1] + 1)
            else:
                runs.append((code, 1))
        return "_".join(f"{n}{code}" if n > 1 else code.removeprefix("x") for code, n in runs)

    def _tuple(self, t: Tuple) -> str:
        codes = self._codes(t)
        key = ("tuple", codes)
        spoken = self._spoken(t)
        name = self.unique(f"Tuple_{spoken if len(spoken) < 30 else 'mixed'}", key)
        if key not in self.items:
            before, self.needed = self.needed, set()
            items = t.items or (REAL,)
            if self.is_array(Tuple(items)):
                held = [self.held(items[0], f"at[{len(items)}]")]
            else:
                held = [self.held(item, f"at_{i}") for i, item in enumerate(items)]
            inner = "".join(f"    {h};\n" for h in held)
            self.define(key, SHARED, f"typedef struct {{\n{inner}}} {name};\n", self.needed)
            self.needed = before
        self.need(key)
        return name

    def _class(self, t: Record | Group) -> str:
        key = ("class", t.cls.__module__, t.cls.__qualname__)
        if key not in self.items:
            source = self.home(t.cls)
            before, self.needed = self.needed, set()
            lines = []
            about = _about_members(source, t.cls)
            for name, kind in self.members(t).items():
                inner = self.shape(kind)
                space = "" if inner.endswith("*") else " "
                lines.append((f"{inner}{space}{names.identifier(name)};", about.get(name, "")))
            lines = lines or [("char none;", "")]
            inner = "".join(_member(text, said) for text, said in lines)
            doc = comment(t.cls.__dict__.get("__doc__") if source.class_doc(t.cls) else None)
            name = self.unique(f"{source.prefix}_{names.identifier(t.cls.__name__)}", key)
            self.define(
                key, source.name, f"{doc}typedef struct {{\n{inner}}} {name};\n", self.needed
            )
            self.needed = before
        self.need(key)
        return next(n for n, k in self._names.items() if k == key)

    def enum(self, cls: type[IntEnum]) -> str:
        """What the constants of an enumeration begin with."""
        source = self.home(cls)
        key = ("enum", cls.__module__, cls.__qualname__)
        prefix = f"{source.prefix}_{names.identifier(cls.__name__)}"
        if key not in self.items:
            doc = comment(cls.__doc__ if source.class_doc(cls) else None)
            inner = ",\n".join(f"    {prefix}_{names.ascii_text(m.name)} = {int(m)}" for m in cls)
            if any(not -(2**31) < int(m) < 2**31 for m in cls):
                raise source.error(
                    source.class_node(cls) or 1, f"{cls.__name__}: members must be below 2^31"
                )
            self.define(key, source.name, f"{doc}enum {{\n{inner}\n}};\n", set())
        self.need(key)
        return prefix

    # Constants

    def type_of(self, value: Any, where: str) -> Type:
        """The type of a value that is there before the block runs."""
        if isinstance(value, bool):
            return BOOLEAN
        if isinstance(value, IntEnum):
            return Member(type(value))
        simple = {float: REAL, int: WHOLE, str: TEXT}
        if type(value) in simple:
            if type(value) is int and abs(value) > 2**53:
                raise UntranslatableError(f"{where} = {value}: must be up to 2^53, or a float")
            return simple[type(value)]
        if isinstance(value, tuple):
            items = tuple(self.type_of(item, where) for item in value)
            if not hasattr(value, "_fields"):
                return Tuple(items)
            record = Record(type(value))
            for (name, kind), item in zip(self.members(record).items(), items, strict=True):
                if not fits(item, kind):
                    raise UntranslatableError(
                        f"{where}.{name} is {said(item)}; must be {said(kind)}, as declared"
                    )
            return record
        if is_dataclass(value) and not isinstance(value, type):
            return Group(type(value))
        raise UntranslatableError(
            f"{where} is of type {type(value).__name__}; must be a number, a bool, an IntEnum, "
            "a tuple, a NamedTuple or a frozen dataclass"
        )

    def initialiser(self, value: Any, t: Type) -> str:
        """A value as an initialiser of C."""
        if isinstance(value, bool):
            return "1" if value else "0"
        if isinstance(value, float):
            return names.real(value)
        if isinstance(value, int):
            return names.whole(value)
        if isinstance(value, str):
            return names.string(value)
        if isinstance(t, Tuple):
            inner = ", ".join(self.initialiser(v, k) for v, k in zip(value, t.items, strict=True))
            return f"{{{{{inner}}}}}" if self.is_array(t) else f"{{{inner}}}"
        members = self.members(t)  # type: ignore[arg-type]  # what is left
        inner = ", ".join(self.initialiser(getattr(value, n), k) for n, k in members.items())
        return f"{{{inner}}}"

    def constant(self, source: Source, name: str, value: Any) -> tuple[str, Type]:
        """The name of a constant of a module, and its type."""
        key = ("constant", source.name, name)
        where = f"{source.file}: line {source.line_of(name)}: {name}"
        t = self.type_of(value, where)
        cname = self.unique(f"{source.prefix}_{names.identifier(name)}", key)
        if key not in self.items:
            before, self.needed = self.needed, set()
            node = source.assigned.get(name)
            text = source.literal(node) if isinstance(value, float) else None
            initial = text or self.initialiser(value, t)
            if isinstance(node, ast.AnnAssign):
                try:
                    hint = self.of_hint(typing.get_type_hints(source.module)[name], "")
                    t = hint if fits(t, hint) else t
                except (NameError, TypeError, KeyError, UntranslatableError):
                    pass
            held = f"{self.shape(t)} {cname}"
            about = comment(source.about(name))
            self.define(
                key, source.name, about + _lines(f"static const {held} = {initial};"), self.needed
            )
            self.needed = before
        self.need(key)
        return cname, t

    def mapping(
        self, source: Source, name: str, value: Mapping[Any, Any]
    ) -> tuple[str, Type, Type]:
        """The beginning of the names of the functions that look up in a mapping; its types."""
        key = ("mapping", source.name, name)
        where = f"{source.file}: line {source.line_of(name)}: {name}"
        kinds = (
            {self.type_of(k, where) for k in value},
            {self.type_of(v, where) for v in value.values()},
        )
        if any(len(k) != 1 for k in kinds):
            raise UntranslatableError(
                f"{where}: must have keys of one type, and values of one type"
            )
        key_type, value_type = (k.pop() for k in kinds)
        if not isinstance(key_type, Member) and key_type not in (REAL, WHOLE, BOOLEAN):
            raise UntranslatableError(
                f"{where}: has keys of type {said(key_type)}; must be numbers, or of an IntEnum"
            )
        cname = self.unique(f"{source.prefix}_{names.identifier(name)}", key)
        if key not in self.items:
            before, self.needed = self.needed, set()
            shape, keys = self.shape(value_type), [(self._key(k), v) for k, v in value.items()]
            about = comment(source.about(name))
            found = "".join(
                f"    if (key == {k}) {{\n        return {self._returned(v, value_type)};\n    }}\n"
                for k, v in keys
            )
            text = (
                f"{about}static inline int {cname}_has(double key)\n{{\n"
                + _lines(f"    return {' || '.join(f'key == {k}' for k, _ in keys)};")
                + f"}}\n\nstatic inline {shape} {cname}_get(double key, {shape} otherwise)\n"
                f"{{\n{found}    return otherwise;\n}}\n"
            )
            self.define(key, source.name, text, self.needed)
            self.needed = before
        self.need(key)
        return cname, key_type, value_type

    def _key(self, value: Any) -> str:
        if isinstance(value, IntEnum):
            return f"{self.enum(type(value))}_{names.ascii_text(value.name)}"
        return names.real(float(value))

    def _returned(self, value: Any, t: Type) -> str:
        text = self.initialiser(value, t)
        return f"({self.shape(t)}){text}" if text.startswith("{") else text

    def name_of_member(self, cls: type[IntEnum], lower: bool) -> str:
        """The function that gives the name of a member."""
        source = self.home(cls)
        prefix = self.enum(cls)
        key = ("name", cls.__module__, cls.__qualname__, lower)
        cname = self.unique(f"{prefix}_name{'_lower' if lower else ''}", key)
        if key not in self.items:
            lines = "".join(
                f"    if (member == {prefix}_{names.ascii_text(m.name)}) {{\n"
                f"        return {names.string(m.name.lower() if lower else m.name)};\n    }}\n"
                for m in cls
            )
            text = (
                f'static inline const char *{cname}(double member)\n{{\n{lines}    return "";\n}}\n'
            )
            self.define(key, source.name, text, {("enum", cls.__module__, cls.__qualname__)})
        self.need(key)
        return cname

    # The files

    def files(self, roots: set[Key]) -> tuple[dict[str, str], dict[str, str]]:
        """The text of each file, and the name of the file of each module, of what roots need."""
        wanted: set[Key] = set()
        todo = sorted(roots, key=repr)
        while todo:
            key = todo.pop()
            if key not in wanted:
                wanted.add(key)
                todo += sorted(self.items[key].needs, key=repr)
        texts: dict[str, list[str]] = {}
        uses: dict[str, set[str]] = {}
        for key, item in self.items.items():
            if key in wanted:
                texts.setdefault(item.home, []).append(item.text)
                homes = uses.setdefault(item.home, set())
                homes |= {self.items[k].home for k in item.needs} - {item.home}
        self._check_order(uses)
        stems = {home: self._stem(home) for home in texts}
        return {
            f"{stems[home]}.h": self._file(home, stems, uses[home], texts[home]) for home in texts
        }, stems

    def _stem(self, home: str) -> str:
        source = self.sources.of(home) if home != SHARED else None
        return source.prefix if source else SHARED

    def _file(self, home: str, stems: dict[str, str], uses: set[str], texts: list[str]) -> str:
        guard = f"{stems[home].upper()}_H"
        included = sorted(stems[other] for other in uses)
        lines = ['#include "python_arithmetic.h"', *(f'#include "{name}.h"' for name in included)]
        source = self.sources.of(home) if home != SHARED else None
        doc = ast.get_docstring(source.tree) if source else "The shapes of plain tuples."
        return (
            f"{comment(doc)}#ifndef {guard}\n#define {guard}\n\n"
            + "\n".join(lines)
            + "\n\n"
            + "\n".join(texts)
            + "\n#endif\n"
        )

    def _check_order(self, uses: dict[str, set[str]]) -> None:
        done: set[str] = set()
        while len(done) < len(uses):
            ready = [h for h in uses if h not in done and uses[h] <= done]
            if not ready:
                left = sorted(h for h in uses if h not in done)
                source = self.sources.of(left[0]) or self.sources.of(left[-1])
                where = source.file if source else left[0]
                raise UntranslatableError(
                    f"{where}: line 1: {', '.join(left)} need one another; "
                    "must be modules of which none needs itself over another"
                )
            done |= set(ready)


def _hints(of: Any) -> dict[str, Any]:
    """The annotations of a class or a function, as they are where they are no texts.

    typing makes new ones, by which an alias could not be told from another.
    """
    found: dict[str, Any] = {}
    try:
        for each in reversed(of.__mro__) if isinstance(of, type) else (of,):
            found |= inspect.get_annotations(each)
        if any(isinstance(hint, str | typing.ForwardRef) for hint in found.values()):
            return typing.get_type_hints(of)
    except (NameError, TypeError, AttributeError):
        return {}
    return found


def _lines(text: str) -> str:
    return "".join(f"{line}\n" for line in wrapped(text))


def _about_members(source: Source, cls: type[Any]) -> dict[str, str]:
    """What is said of the fields of a class: by their declarations, or in docstrings after them."""
    found = {}
    for base in reversed(cls.__mro__):
        of_base = source if base is cls else None
        node = of_base.class_node(base) if of_base else None
        body = node.body if node else []
        for before, after in pairwise(body):
            is_text = isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant)
            if (
                is_text
                and isinstance(before, ast.AnnAssign)
                and isinstance(before.target, ast.Name)
            ):
                found[before.target.id] = inspect.cleandoc(str(after.value.value))  # type: ignore[attr-defined]
    for name, hint in typing.get_type_hints(cls, include_extras=True).items():
        declared = getattr(hint, "__metadata__", (None,))[0]
        description = getattr(declared, "description", None)
        if isinstance(description, str):
            unit = getattr(declared, "unit", "")
            found[name] = f"{description}, {unit}" if unit else description
    return found


def _member(text: str, about: str) -> str:
    said = " ".join(names.ascii_text(about).split())
    line = f"    {text} /* {said} */" if said else f"    {text}"
    if len(line) > 100 and said:
        return f"{comment(said, '    ')}    {text}\n"
    return f"{line}\n"
