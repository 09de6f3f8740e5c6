# ruff: noqa: E501, S101, SIM905, PT018, SIM102
# mypy: disable-error-code="union-attr, arg-type, attr-defined, str-bytes-safe"
"""Expressions of a block in C: the same operations in the same order.

A block is pure functions of numbers, so what C cannot say within an expression is worked out before
its statement.
"""

import ast
import builtins
import inspect
import math
import re
from collections.abc import Callable, Mapping, Sequence
from enum import IntEnum
from functools import cached_property
from itertools import product
from types import FunctionType, ModuleType
from typing import Any

from .structs import Function, Program, is_constant
from .text import Source, UntranslatableError, identifier, number
from .types import (
    BOOLEAN,
    NUMBER,
    NUMBERS,
    REAL,
    TEXT,
    WHOLE,
    Group,
    Member,
    Record,
    Tuple,
    Type,
    Value,
    fields,
    is_record,
    joined,
    of_items,
    said,
)

CHOICE, OR, AND, EQUAL, SUM, PRODUCT, SIGN, WORD = 1, 2, 3, 4, 6, 7, 8, 9
"""How tightly operators bind in C; WORD is what needs no parentheses."""

MATH: dict[Any, tuple[str, int]] = {
    getattr(math, name): (name, 1)
    for name in "acos acosh asin asinh atan atanh cos cosh exp expm1 fabs log10 log1p log2 sin sinh "
    "sqrt tan tanh".split()
}
MATH |= {getattr(math, name): (name, 2) for name in ("atan2", "copysign", "fmod", "pow")}
MATH |= {math.ldexp: ("scaled", 2), math.log: ("log", 1)}
TESTS = {math.isfinite: "isfinite", math.isnan: "isnan", math.isinf: "isinf"}
WHOLES = {math.floor: "floored", math.ceil: "ceiled", math.trunc: "truncated", int: "truncated"}

ADVICE: dict[Any, str] = {
    "Lambda": "lambda is not in the subset; use a function of the module",
    "List": "a list is not in the subset; use a tuple",
    "ListComp": "a list is not in the subset; use tuple(... for ...)",
    "Dict": "a dict is not in the subset; use a MappingProxyType of the module",
    "Set": "a set is not in the subset; use a tuple",
    "NamedExpr": ":= is not in the subset; assign before",
    "JoinedStr": "a text is only for the reason of a raise",
    "Starred": "a star is only for a tuple, or among arguments",
    "GeneratorExp": "a generator is only for any, all and tuple",
    sum: "sum: its rounding depends on the version of Python; write a + b, or a loop",
    math.fsum: "math.fsum is not in the subset; write a + b, or a loop",
    math.hypot: "math.hypot is CPython's own; write sqrt(x * x + y * y)",
    math.dist: "math.dist is CPython's own; write sqrt(x * x + y * y)",
    round: "round is not in the subset; write floor(x + 0.5)",
    print: "print is not in the subset: a block has no output",
    isinstance: "isinstance is not in the subset; leave it out: types are fixed",
}

_OPERATORS = {ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT)}
_OPERATORS[ast.Div] = "/", PRODUCT
_COMPARISONS = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_MISSING = object()


class Expressions:
    """The expressions of one function, for the types that it is called with."""

    def __init__(self, program: Program, source: Source) -> None:
        self.program, self.source = program, source
        self.locals: set[str] = set()
        self.bound: dict[str, Value] = {}
        """Parameters, and variables that have a value here."""
        self.lines: list[str] = []
        self.indent = 1
        self._used: set[str] = set()

    def called(self, function: FunctionType, arguments: Sequence[Value], node: ast.AST) -> Function:
        """The function in C for these arguments."""
        raise NotImplementedError

    def error(self, node: ast.AST, reason: str) -> UntranslatableError:
        """An error with a reason, and the line of a node."""
        return self.source.error(getattr(node, "lineno", 1), reason)

    # Lines and names

    def say(self, line: str) -> None:
        """Add a line."""
        self.lines.append(f"{'    ' * self.indent}{line}")

    def fresh(self, name: str) -> str:
        """A name for a variable of C that is not one of Python's."""
        count, plain = 1, identifier(name)
        while name in self._used or name in self.locals or name == plain + "_":
            count += 1
            name = f"{plain}_{count}"
        self._used.add(name)
        return name

    def simple(self, value: Value, name: str = "value") -> Value:
        """A value that may stand in several places: a variable, a member, a number."""
        if value.items is not None and not isinstance(value.type, Record):
            return value._replace(items=tuple(self.simple(item, name) for item in value.items))
        if isinstance(value.type, Group) or re.fullmatch(r"-?[\w.]+(->|[\w.\[\]])*", value.text):
            return value
        call = re.match(r"\w+_(\w+)\(", value.text)
        new = self.fresh(call[1] if call else name)
        self.say(f"{self.c(value.type)} {new} = {self.initial(value)};")
        return Value(new, value.type)

    def c(self, t: Type) -> str:
        """The name of a type in C."""
        return self.program.c(t, self.source)

    def text(self, value: Value, level: int = CHOICE) -> str:
        """An expression of C, in parentheses where its operator binds less than `level`."""
        if value.items is not None:
            return f"({self.c(value.type)}){self.initial(value)}"
        return value.text if value.level >= level else f"({value.text})"

    def initial(self, value: Value) -> str:
        """What initialises a variable, or a member."""
        if value.items is None:
            return value.text
        self.c(value.type)
        return self.program.braces(value.type, [self.initial(item) for item in value.items])

    # What a node is

    def known(self, node: ast.expr) -> Any:
        """The object of Python that a name stands for, or _MISSING: functions, classes, constants."""
        if isinstance(node, ast.Name) and node.id not in self.locals | self.bound.keys():
            there = self.source.names
            return there[node.id] if node.id in there else getattr(builtins, node.id, _MISSING)
        if isinstance(node, ast.Attribute):
            base = self.known(node.value)
            if isinstance(base, ModuleType | type):
                return getattr(base, node.attr, _MISSING)
        return _MISSING

    def value(self, node: ast.expr) -> Value:
        """The value of an expression."""
        found = self.known(node)
        if found is not _MISSING:
            return self._static(node, found)
        kind = type(node).__name__
        make: Callable[[Any], Value] | None = getattr(self, f"_{kind.lower()}", None)
        if make is None:
            raise self.error(node, ADVICE.get(kind, f"{kind} is not in the subset"))
        return make(node)

    def _static(self, node: ast.expr, found: Any) -> Value:
        if isinstance(found, IntEnum):
            return Value(self.program.member(found), Member(type(found)), is_int=True)
        if not is_constant(found):
            what = ast.unparse(node)
            raise self.error(
                node, ADVICE.get(type(found), f"{what} is no number: must be called, or be one")
            )
        source, name = self.source, ast.unparse(node).rpartition(".")[2]
        if isinstance(node, ast.Attribute):
            base = self.known(node.value)
            if base is math:
                return self._of_math(name, found)
            home = self.program.source(vars(base)) if isinstance(base, ModuleType) else None
            if home is None:
                return self.literal(found)
            source = home
        origin = self.source.imported.get(name)
        if isinstance(node, ast.Name) and origin and origin[0].module == "math":
            return self._of_math(origin[1], found)
        text, kind, is_int = self.program.constant(source, name, found)
        return Value(text, kind, is_int=is_int, span=(found, found + 1) if is_int else None)

    def _of_math(self, name: str, value: float) -> Value:
        names = {"pi": "PI", "tau": "TAU", "e": "E", "inf": "HUGE_VAL"}
        return Value(names.get(name) or number(value), REAL)

    def literal(self, value: Any) -> Value:
        """A number, or a tuple of them, as it is in Python."""
        if isinstance(value, tuple):
            items = tuple(self.literal(item) for item in value)
            kind: Type | None = of_items([item.type for item in items])
            kind = Record(type(value)) if is_record(type(value)) else kind
            assert kind
            return Value("", kind, items=items)
        if isinstance(value, IntEnum):
            return Value(self.program.member(value), Member(type(value)), is_int=True)
        if isinstance(value, bool):
            return Value(str(int(value)), BOOLEAN)
        level = SIGN if value < 0 else WORD
        if isinstance(value, int):
            return Value(number(value), WHOLE, level, span=(value, value + 1))
        return Value(number(value), REAL, level)

    def _constant(self, node: ast.Constant) -> Value:
        if isinstance(node.value, float):
            return Value(self.source.literal(node), REAL)
        if isinstance(node.value, int) and abs(node.value) <= 2**53:
            return self.literal(node.value)
        if isinstance(node.value, str):
            raise self.error(node, ADVICE["JoinedStr"])
        kind = type(node.value).__name__
        what = (
            f"{node.value}: must be up to 2^53"
            if kind == "int"
            else f"a {kind} is not in the subset"
        )
        raise self.error(node, what)

    def _name(self, node: ast.Name) -> Value:
        if node.id in self.bound:
            return self.bound[node.id]
        if node.id in self.locals:
            raise self.error(node, f"{node.id}: may have no value here; give it one before")
        raise self.error(node, f"{node.id}: is not defined")

    # Operators

    def number(self, node: ast.expr) -> Value:
        """An expression that must be a number; True and False are 1 and 0."""
        return self.as_number(self.value(node), node)

    def as_number(self, value: Value, node: ast.AST) -> Value:
        """A value that must be a number."""
        if value.type == BOOLEAN:
            return Value(f"(double){self.text(value, SIGN)}", WHOLE, SIGN)
        if isinstance(value.type, Member):
            return value._replace(type=WHOLE)
        if value.type not in NUMBERS:
            raise self.error(node, f"{ast.unparse(node)} is a {said(value.type)}, must be a number")
        return value

    def _binop(self, node: ast.BinOp) -> Value:
        left = self.value(node.left)
        if isinstance(left.type, Tuple):
            return self._tuple_operation(node, left)
        a, b = self.as_number(left, node.left), self.number(node.right)
        if isinstance(node.op, ast.Pow):
            if WHOLE == a.type == b.type:
                raise self.error(
                    node, "a power of ints is not in the subset; write float(n) ** ..."
                )
            return Value(f"pow({self.text(a)}, {self.text(b)})", REAL)
        if type(node.op) not in _OPERATORS:
            raise self.error(
                node, f"{ast.unparse(node)}: this operator is not in the subset; use + - * / **"
            )
        symbol, level = _OPERATORS[type(node.op)]
        if a.span and b.span and level == SUM:
            return self._sum_of_ints(a, symbol, b)
        plain = isinstance(node.op, ast.Div) or REAL in (a.type, b.type)
        if a.is_int and b.is_int:
            a = Value(f"(double){self.text(a, SIGN)}", WHOLE, SIGN)
        text = f"{self.text(a, level)} {symbol} {self.text(b, level + 1)}"
        if plain or not isinstance(node.op, ast.Mult):
            kind = REAL if plain else WHOLE if a.type == b.type == WHOLE else NUMBER
            return Value(text, kind, level)
        if NUMBER in (a.type, b.type):
            raise self.error(node, "a product of what may be an int or a float; write 0.0 for 0")
        return Value(f"{text} + 0.0", WHOLE, SUM)  # an int has no -0.0

    def _sum_of_ints(self, a: Value, symbol: str, b: Value) -> Value:
        """Of the numbers of loops, and constants: it is an int of C."""
        assert a.span and b.span
        low, high = b.span if symbol == "+" else (1 - b.span[1], 1 - b.span[0])
        span = a.span[0] + low, a.span[1] + high - 1
        return Value(f"{as_int(a)} {symbol} {as_int(b)}", WHOLE, SUM, is_int=True, span=span)

    def _tuple_operation(self, node: ast.BinOp, left: Value) -> Value:
        items = self.items(left, node)
        if isinstance(node.op, ast.Add):
            return self.display(items + self.items(self.value(node.right), node), node)
        if isinstance(node.op, ast.Mult):
            return self.display(items * self._place(node.right), node)
        raise self.error(node, "a tuple: must be added to another, or multiplied by a constant")

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!{self.text(self.condition(node.operand), SIGN)}", BOOLEAN, SIGN)
        value = self.number(node.operand)
        if isinstance(node.op, ast.UAdd):
            return value
        if not isinstance(node.op, ast.USub):
            raise self.error(node, "bits are not in the subset; use arithmetic")
        if value.type == NUMBER:
            raise self.error(node, "- of what may be an int or a float; write 0.0 for 0")
        if isinstance(node.operand, ast.Constant) and isinstance(node.operand.value, int):
            return self.literal(-node.operand.value)
        if value.type == WHOLE and not value.is_int:
            return Value(f"0.0 - {self.text(value, PRODUCT)}", WHOLE, SUM)
        span = (1 - value.span[1], 1 - value.span[0]) if value.span else None
        return value._replace(text=f"-{self.text(value, WORD)}", level=SIGN, span=span)

    def condition(self, node: ast.expr) -> Value:
        """An expression as a condition: of numbers, if they are not zero."""
        if isinstance(node, ast.BoolOp):
            return self._joined(node, [self.condition(v) for v in node.values])
        value = self.value(node)
        if value.type == BOOLEAN:
            return value
        value = self.as_number(value, node)
        return Value(f"{self.text(value, SUM)} != 0.0", BOOLEAN, EQUAL)

    def _boolop(self, node: ast.BoolOp) -> Value:
        values = [self.value(v) for v in node.values]
        if any(v.type != BOOLEAN for v in values):
            raise self.error(node, "and, or of numbers is not in the subset; write a if ... else b")
        return self._joined(node, values)

    def _joined(self, node: ast.BoolOp, values: list[Value]) -> Value:
        symbol, level = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        return self._all(values, symbol, level)

    def _all(self, values: Sequence[Value], symbol: str, level: int) -> Value:
        text = f" {symbol} ".join(self.text(v, EQUAL) for v in values)
        return Value(text, BOOLEAN, level if len(values) > 1 else values[0].level)

    def _compare(self, node: ast.Compare) -> Value:
        parts = [self.value(node.left)] if not self._is_look_up(node) else []
        if not parts:
            return self._look_up_in(node)
        nodes = [node.left, *node.comparators]
        parts += [self.value(n) for n in node.comparators]
        for i, part in enumerate(parts):
            if part.type != BOOLEAN or len(parts) > 2:
                parts[i] = self.as_number(part, nodes[i])
            if 0 < i < len(parts) - 1 and "(" in part.text:
                parts[i] = self.simple(parts[i])
        found = []
        for op, a, b in zip(node.ops, parts, parts[1:], strict=False):
            if type(op) not in _COMPARISONS:
                raise self.error(node, "is and in are not in the subset here; use ==")
            if (a.type == BOOLEAN) != (b.type == BOOLEAN):
                raise self.error(node, f"compares a {said(a.type)} with a {said(b.type)}")
            text = f"{self.text(a, SUM)} {_COMPARISONS[type(op)]} {self.text(b, SUM)}"
            found.append(Value(text, BOOLEAN, EQUAL))
        return self._all(found, "&&", AND)

    def _is_look_up(self, node: ast.Compare) -> bool:
        return isinstance(self.known(node.comparators[-1]), Mapping)

    def _look_up_in(self, node: ast.Compare) -> Value:
        """`key in TABLE`."""
        if not isinstance(node.ops[0], ast.In | ast.NotIn) or len(node.ops) > 1:
            raise self.error(
                node, "a dict: must be used as in key in TABLE, TABLE.get(key, default)"
            )
        key = self.simple(self.number(node.left))
        equal, symbol, level = (
            ("==", "||", OR) if isinstance(node.ops[0], ast.In) else ("!=", "&&", AND)
        )
        keys = [self.program.key(k) for k in self.known(node.comparators[0])]
        return self._all(
            [Value(f"{key.text} {equal} {k}", BOOLEAN, EQUAL) for k in keys], symbol, level
        )

    def _ifexp(self, node: ast.IfExp) -> Value:
        test, a, b = self.condition(node.test), self.value(node.body), self.value(node.orelse)
        kind = joined(a.type, b.type)
        if kind is None:
            raise self.error(node, f"is a {said(a.type)} or a {said(b.type)}; must be of one type")
        text = f"{self.text(test, OR)} ? {self.text(a, OR)} : {self.text(b)}"
        return Value(text, kind, CHOICE, is_int=a.is_int and b.is_int)

    # Tuples, fields, items

    def display(self, items: Sequence[Value], node: ast.AST) -> Value:
        """A tuple that stands item by item."""
        kind = of_items([item.type for item in items])
        if kind is None:
            raise self.error(node, "an empty tuple is not in the subset")
        return Value("", kind, items=tuple(items))

    def _tuple(self, node: ast.Tuple) -> Value:
        return self.display(self.starred(node.elts), node)

    def starred(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """The values of expressions, some of which may be `*items`."""
        found: list[Value] = []
        for node in nodes:
            star = isinstance(node, ast.Starred)
            found += self.items(self.value(node.value), node) if star else [self.value(node)]
        return found

    def items(self, value: Value, node: ast.AST) -> list[Value]:
        """The items of a tuple."""
        if value.items is not None:
            return [*value.items]
        if isinstance(value.type, Record):
            base = self.simple(value)
            return [self.field(base, name, node) for name in fields(value.type)]
        if not isinstance(value.type, Tuple):
            raise self.error(node, f"a {said(value.type)} has no items")
        base = self.simple(value)
        place = "at[{}]" if value.type.is_array else "at_{}"
        return [
            Value(f"{self.text(base, WORD)}.{place.format(i)}", kind)
            for i, kind in enumerate(value.type.items)
        ]

    def field(self, value: Value, name: str, node: ast.AST) -> Value:
        """A field of a NamedTuple or of parameters."""
        assert isinstance(value.type, Record | Group)
        kind = fields(value.type)[name]
        if kind is None:
            raise self.error(
                node, f"{value.type.cls.__name__}.{name}: is not of a type in the subset"
            )
        if value.items is not None:
            return value.items[list(fields(value.type)).index(name)]
        text = self._member(value, name)
        return Value(f"&{text}" if isinstance(kind, Group) else text, kind)

    def _member(self, value: Value, name: str) -> str:
        if isinstance(value.type, Group):
            plain = value.text.startswith("&")
            return (
                f"{value.text[1:]}.{identifier(name)}"
                if plain
                else f"{value.text}->{identifier(name)}"
            )
        return f"{self.text(value, WORD)}.{identifier(name)}"

    def _attribute(self, node: ast.Attribute) -> Value:
        value = self.value(node.value)
        if isinstance(value.type, Member) and node.attr == "name":
            return Value(f"{self.program.member_names(value.type.cls)}({value.text})", TEXT)
        if not isinstance(value.type, Record | Group):
            raise self.error(node, f"{node.attr}: a {said(value.type)} has no such field")
        if node.attr in fields(value.type):
            return self.field(value, node.attr, node)
        there = inspect.getattr_static(value.type.cls, node.attr, None)
        if isinstance(there, cached_property) and isinstance(value.type, Group):
            kept = self.program.kept.setdefault(value.type.cls, {})
            if node.attr not in kept:
                plain = Value("p", value.type)
                kept[node.attr] = self.called(there.func, [plain], node)
            return Value(self._member(value, node.attr), kept[node.attr].returns)
        if isinstance(there, property) and there.fget:
            return self.call(there.fget, [value], node)
        if there is not None and not callable(there):
            return self.literal(there)
        raise self.error(node, f"{said(value.type)} has no such field: {node.attr}")

    def _subscript(self, node: ast.Subscript) -> Value:
        value = self.value(node.value)
        items = self.items(value, node)
        if isinstance(node.slice, ast.Slice):
            bounds = (node.slice.lower, node.slice.upper, node.slice.step)
            return self.display(items[slice(*(b and self._place(b) for b in bounds))], node)
        index = self.value(node.slice)
        low, high = index.span or (-1, 0)
        if high - low > 1 and low >= 0 and high <= len(items) and isinstance(value.type, Tuple):
            if value.type.is_array and value.items is None:
                return Value(f"{self.simple(value).text}.at[{as_int(index)}]", value.type.items[0])
        place = self._place(node.slice)
        if not -len(items) <= place < len(items):
            raise self.error(node, f"{ast.unparse(node)}: there are {len(items)} items")
        return items[place]

    def _place(self, node: ast.expr) -> int:
        found = fixed(self.value(node))
        if found is None:
            raise self.error(
                node, "an index must be a constant int, or the number of a loop over the items"
            )
        return found

    # Calls

    def _call(self, node: ast.Call) -> Value:
        function = self.known(node.func)
        if function is _MISSING:
            if not isinstance(node.func, ast.Attribute):
                raise self.error(node, f"{ast.unparse(node.func)}: is no function")
            return self._method(node, node.func)
        function = inspect.unwrap(function) if callable(function) else function
        if is_record(function):
            return self._record(node, function)
        if isinstance(function, FunctionType) and self.program.source(function.__globals__):
            return self.call(function, self.starred(node.args), node, node.keywords)
        if isinstance(function, type) and issubclass(function, IntEnum):
            value = self.value(node.args[0])
            if value.type == Member(function):
                return value
        return self._builtin(node, function)

    def _builtin(self, node: ast.Call, function: Any) -> Value:
        if not callable(function) or not function.__hash__:
            raise self.error(node, f"{ast.unparse(node.func)}: is no function")
        advice = ADVICE.get(function)
        if advice or node.keywords:
            raise self.error(node, advice or f"{ast.unparse(node.func)}: must have no keywords")
        if function in (any, all):
            symbol, level = ("||", OR) if function is any else ("&&", AND)
            return self._all([self._truth(v, node) for v in self._each(node)], symbol, level)
        if function is tuple:
            return self.display(self._each(node), node)
        if function in (min, max):
            return self._extreme(node, "smaller" if function is min else "larger")
        arguments = self.starred(node.args)
        if function is len and len(arguments) == 1:
            return self.literal(len(self.items(arguments[0], node)))
        values = [self.as_number(v, node) for v in arguments]
        texts = [self.text(v) for v in values]
        kind = values[0].type if values else REAL
        if function is math.log and len(values) == 2:
            return Value(f"log({texts[0]}) / log({texts[1]})", REAL, PRODUCT)
        name, count = MATH.get(function, ("", 1))
        if function is pow:
            name, count = "pow", 2
        if len(values) != count:
            raise self.error(node, f"{ast.unparse(node.func)}: must have {count} argument(s)")
        if name:
            return Value(f"{name}({', '.join(texts)})", REAL)
        if function is abs:
            return Value(f"fabs({texts[0]})", kind)
        if function is float:
            return values[0]._replace(type=REAL)
        if function is bool:
            return Value(f"{self.text(values[0], SUM)} != 0.0", BOOLEAN, EQUAL)
        if function in TESTS:
            return Value(f"({TESTS[function]}({texts[0]}) != 0)", BOOLEAN)
        if function in WHOLES:
            return values[0] if kind == WHOLE else Value(f"{WHOLES[function]}({texts[0]})", WHOLE)
        raise self.error(node, f"{ast.unparse(node.func)}: is not in the subset")

    def _truth(self, value: Value, node: ast.AST) -> Value:
        if value.type != BOOLEAN:
            raise self.error(node, f"of a {said(value.type)}; must be of conditions")
        return value

    def _extreme(self, node: ast.Call, name: str) -> Value:
        values = self.starred(node.args)
        values = self.items(values[0], node) if len(values) == 1 else values
        found = self.as_number(values[0], node)
        for value in values[1:]:
            kind = joined(found.type, self.as_number(value, node).type)
            assert kind
            found = Value(f"{name}({self.text(found)}, {self.text(value)})", kind)
        return found

    def _each(self, node: ast.Call) -> list[Value]:
        """The items of the only argument: a tuple, or a generator over tuples of fixed lengths."""
        if len(node.args) != 1:
            raise self.error(node, f"{ast.unparse(node.func)}: must have 1 argument")
        made = node.args[0]
        if not isinstance(made, ast.GeneratorExp):
            return self.items(self.value(made), made)
        if any(g.ifs for g in made.generators):
            raise self.error(
                made, "if in a generator is not in the subset; write a if ... else b in it"
            )
        before, found = dict(self.bound), []
        for row in product(*(self.rows(g.iter) for g in made.generators)):
            for generator, item in zip(made.generators, row, strict=True):
                self.bind(generator.target, item)
            found.append(self.value(made.elt))
        self.bound = before
        return found

    def rows(self, node: ast.expr) -> list[Value]:
        """What a loop goes over: a tuple, zip() or enumerate() of tuples."""
        function = self.known(node.func) if isinstance(node, ast.Call) else None
        if isinstance(node, ast.Call) and function in (zip, enumerate):
            columns = [self.rows(argument) for argument in node.args]
            if function is enumerate:
                columns = [[self.literal(i) for i in range(len(columns[0]))], *columns]
            return [self.display(row, node) for row in zip(*columns, strict=False)]
        return self.items(self.simple(self.value(node)), node)

    def bind(self, target: ast.expr, value: Value) -> None:
        """Let the names of a target stand for a value, or its items, without a variable."""
        if isinstance(target, ast.Name):
            self.bound[target.id] = self.simple(value, target.id)
        elif isinstance(target, ast.Tuple):
            for name, item in zip(target.elts, self.unpacked(target, value), strict=True):
                self.bind(name, item)

    def unpacked(self, target: ast.Tuple, value: Value) -> list[Value]:
        """The items of a value, as many as the target has."""
        items = self.items(value, target)
        if len(items) != len(target.elts) or any(isinstance(t, ast.Starred) for t in target.elts):
            raise self.error(target, f"{ast.unparse(target)}: there are {len(items)} items")
        return items

    def call(
        self,
        function: FunctionType | Callable[..., Any],
        arguments: list[Value],
        node: ast.AST,
        keywords: Sequence[ast.keyword] = (),
    ) -> Value:
        """A call of a function of the block."""
        assert isinstance(function, FunctionType)
        given = self._matched(inspect.signature(function), arguments, keywords, node)
        made = self.called(function, given, node)
        return Value(f"{made.name}({', '.join(self.text(v) for v in given)})", made.returns)

    def _matched(
        self, signature: inspect.Signature, values: list[Value], keywords: Sequence[ast.keyword],
        node: ast.AST,
    ) -> list[Value]:  # fmt: skip
        """The arguments in the order of the parameters."""
        if any(k.arg is None for k in keywords):
            raise self.error(node, "** in a call is not in the subset")
        named = {str(k.arg): self.value(k.value) for k in keywords}
        try:
            found = signature.bind(*values, **named)
        except TypeError as error:
            raise self.error(node, f"{ast.unparse(node)}: {error}") from None
        given = found.arguments
        if any(p.kind in (p.VAR_POSITIONAL, p.VAR_KEYWORD) for p in signature.parameters.values()):
            raise self.error(node, "*args and **kwargs are not in the subset")
        return [
            given[name] if name in given else self.literal(p.default)
            for name, p in signature.parameters.items()
        ]

    def _record(self, node: ast.Call, cls: type[Any]) -> Value:
        """A NamedTuple that is made."""
        values = self._matched(inspect.signature(cls), self.starred(node.args), node.keywords, node)
        kinds = fields(Record(cls))
        for value, (name, kind) in zip(values, kinds.items(), strict=True):
            self.must_be(value, kind, f"{cls.__name__}.{name}", node)
        return Value("", Record(cls), items=tuple(values))

    def must_be(self, value: Value, kind: Type | None, name: str, node: ast.AST) -> None:
        """End where a field gets a value of another type than it is declared with."""
        if kind is None or value.type != kind:
            expected = f"{said(kind)}, as declared" if kind else "of a type in the subset"
            raise self.error(node, f"{name} is {said(value.type)}: must be {expected}")

    def _method(self, node: ast.Call, of: ast.Attribute) -> Value:
        table = self.known(of.value)
        if isinstance(table, Mapping):
            return self._got(node, of, table)
        value = self.value(of.value)
        if value.type == TEXT and of.attr == "lower":
            return value
        if isinstance(value.type, Record) and of.attr == "_replace":
            return self._replaced(node, value, value.type)
        if isinstance(value.type, Record | Group):
            method = inspect.getattr_static(value.type.cls, of.attr, None)
            if isinstance(method, FunctionType):
                return self.call(method, [value, *self.starred(node.args)], node, node.keywords)
        raise self.error(node, f"{of.attr}: a {said(value.type)} has no such method")

    def _got(self, node: ast.Call, of: ast.Attribute, table: Mapping[Any, Any]) -> Value:
        if of.attr != "get" or len(node.args) != 2:
            raise self.error(
                node, "a dict: must be used as in key in TABLE, TABLE.get(key, default)"
            )
        if not all(isinstance(k, int) and isinstance(v, float) for k, v in table.items()):
            raise self.error(node, f"{ast.unparse(of.value)}: must be of floats by ints or members")
        key, otherwise = (self.number(argument) for argument in node.args)
        if otherwise.type != REAL:
            raise self.error(node, f"the default is {said(otherwise.type)}; must be float")
        source = self.source
        if isinstance(of.value, ast.Attribute):
            home = self.program.source(vars(self.known(of.value.value)))
            source = home or source
        name = self.program.look_up(source, ast.unparse(of.value).rpartition(".")[2], table)
        return Value(f"{name}({self.text(key)}, {self.text(otherwise)})", REAL)

    def _replaced(self, node: ast.Call, value: Value, t: Record) -> Value:
        """A copy with other fields."""
        kinds = fields(t)
        new = {str(k.arg): self.value(k.value) for k in node.keywords}
        for name, item in new.items():
            if name not in kinds:
                raise self.error(node, f"{t.cls.__name__} has no field {name}")
            self.must_be(item, kinds[name], f"{t.cls.__name__}.{name}", node)
        copy = self.fresh(identifier(t.cls.__name__.lower()))
        self.say(f"{self.c(t)} {copy} = {self.initial(value)};")
        for name, item in new.items():
            self.say(f"{copy}.{identifier(name)} = {self.text(item)};")
        return Value(copy, t)


def fixed(value: Value) -> int | None:
    """A whole number that is known."""
    return value.span[0] if value.span and value.span[1] - value.span[0] == 1 else None


def as_int(value: Value) -> str:
    """A whole number within known bounds, as an int of C."""
    return value.text if value.is_int else str(fixed(value))
