"""Expressions of a block in C: the same operations in the same order.

A block is pure functions of numbers: what C cannot say within an expression is worked out before
its statement. Where Python would raise, C has the value of IEEE 754.
"""

import ast
import builtins
import inspect
import math
import re
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from enum import IntEnum
from functools import cached_property
from types import FunctionType, GenericAlias, ModuleType
from typing import Any, NoReturn

from . import types
from .advice import ADVICE
from .text import Source, UntranslatableError, identifier, number
from .types import BOOLEAN, REAL, SCALARS, WHOLE, Function, Program, Type, Value, in_words

CHOICE, OR, AND, EQUAL, LESS, SUM, PRODUCT, SIGN, WORD = range(1, 10)
"""How tightly operators bind in C; WORD is what needs no parentheses."""

OPERATORS: dict[type[ast.operator], tuple[str, int]] = {
    ast.Add: ("+", SUM), ast.Sub: ("-", SUM), ast.Mult: ("*", PRODUCT), ast.Div: ("/", PRODUCT)
}  # fmt: skip
COMPARISONS = {ast.Lt: ("<", LESS), ast.LtE: ("<=", LESS), ast.Gt: (">", LESS)}
COMPARISONS |= {ast.GtE: (">=", LESS), ast.Eq: ("==", EQUAL), ast.NotEq: ("!=", EQUAL)}
_FUNCTIONS = """
acos acosh asin asinh atan atan2 atanh copysign cos cosh exp expm1 fabs fmod log log10 log1p log2
pow sin sinh sqrt tan tanh
"""
FUNCTIONS = {getattr(math, name): name for name in _FUNCTIONS.split()} | {math.ldexp: "scaled"}
OF_TWO = (math.atan2, math.copysign, math.fmod, math.pow, math.ldexp)
TO_WHOLE = {math.floor: "floored", math.ceil: "ceiled", math.trunc: "truncated", int: "truncated"}

VALID = "valid are numbers, tuples, if, for, functions of this module, and of math: "
VALID += ", ".join(sorted(f.__name__ for f in (*FUNCTIONS, *TO_WHOLE) if f is not int))

_UNKNOWN = object()
_PATH = re.compile(r"-?([*&]?[A-Za-z_]\w*(->|\.\w|\[\d+\]|\w)*|[\d.]+(e[-+]?\d+)?)")
"""A variable, a member of one or a number: it may stand in several places."""


class Expressions:
    """The expressions of one function, for the types that it is called with."""

    translate: Callable[[Any, Sequence[Type]], Function]
    """The function in C for arguments of these types."""

    def __init__(self, program: Program, source: Source, names: dict[str, Any]) -> None:
        self.program, self.source, self.names = program, source, names
        self.bound: dict[str, Value] = {}
        """The parameters and variables that have a value here."""
        self.locals: set[str] = set()
        self.lines: list[str] = []
        self._inside: list[Counter[str]] = []
        """How often names are in the statements of the blocks that are open."""
        self._used: set[str] = set()

    def refuse(self, node: Any, reason: str) -> NoReturn:
        """End with a reason, and the line of a node."""
        raise self.source.error(node, reason)

    def _say(self, line: str) -> None:
        self.lines.append(f"{'    ' * (1 + len(self._inside))}{line}")

    def fresh(self, name: str, is_own: bool = False) -> str:
        """A name for a variable of C: the block's own, or one for what C cannot say at once."""
        unused, count = identifier(name), 1
        while unused in {*self._used, *self.program.names} or (
            unused in self.locals and not is_own
        ):
            count += 1
            unused = f"{name}_{count}"
        self._used.add(unused)
        return unused

    def simple(self, value: Value, name: str = "value") -> Value:
        """The value where it may stand several times: what is more than a name gets a variable."""
        if value.items is not None and isinstance(value.type, GenericAlias):
            return self._display([self.simple(item, name) for item in value.items], value.type)
        if is_dataclass(value.type) or _PATH.fullmatch(value.text):
            return value
        return self._copied(value, name)

    def _copied(self, value: Value, name: str) -> Value:
        variable = self.fresh(name)
        self._say(f"{self.program.c(value.type, self.names)} {variable} = {value.text};")
        return Value(variable, value.type)

    def _at(self, value: Value, level: int) -> str:
        """The text of a value where an operator of this level takes it."""
        return value.text if value.level >= level else f"({value.text})"

    def named_object(self, node: ast.expr) -> Any:
        """The object of Python that an expression names, whatever the inputs are."""
        if isinstance(node, ast.Name) and node.id not in self.locals:
            named = self.names.get(node.id, getattr(builtins, node.id, _UNKNOWN))
            if named is _UNKNOWN:
                self.refuse(node, f"{node.id}: there is no such name")
            return named
        if isinstance(node, ast.Attribute):
            of = self.named_object(node.value)
            if isinstance(of, ModuleType | type):
                return getattr(of, node.attr, _UNKNOWN)
        return _UNKNOWN

    def constant(self, node: ast.expr, value: Any) -> Value:
        """A constant of a module; a number that has a name in capitals keeps it."""
        kind = types.of_value(value)
        if kind is None or is_dataclass(kind):
            self.refuse(node, f"{ast.unparse(node)}: {type(value).__name__} is not in the subset")
        names, name = self.names, getattr(node, "attr", getattr(node, "id", ""))
        if isinstance(node, ast.Attribute):
            names = vars(self.named_object(node.value))
        if kind in SCALARS and (isinstance(value, IntEnum) or not name.isupper()):
            return self._number_of(value)
        return Value(self.program.constant(dict(names), name, value), kind)

    def _number_of(self, value: Any) -> Value:
        if isinstance(value, bool):
            return Value(str(int(value)), BOOLEAN)
        text = number(value)
        kind = REAL if isinstance(value, float) else WHOLE
        return Value(text, kind, SIGN if text[0] == "-" else WORD)

    def _value(self, node: ast.expr) -> Value:
        named = self.named_object(node)
        if named is not _UNKNOWN:
            return self.constant(node, named)
        translate = getattr(self, f"_on_{type(node).__name__.lower()}", self._refuse_kind)
        try:
            value: Value = translate(node)
        except UntranslatableError:
            raise
        except (TypeError, ValueError, LookupError) as error:
            self.refuse(node, f"{ast.unparse(node)}: {error}")
        return value

    def _refuse_kind(self, node: ast.AST, kind: Any = None) -> NoReturn:
        text = ast.unparse(node).partition("\n")[0]
        otherwise = f"{text}: is not in the subset; {VALID}"
        self.refuse(node, ADVICE.get(kind or type(node).__name__, otherwise))

    def _number(self, node: ast.expr) -> Value:
        return self._as_number(self._value(node), node)

    def _as_number(self, value: Value, node: ast.AST) -> Value:
        if value.type not in SCALARS:
            self.refuse(node, f"{ast.unparse(node)} is {in_words(value.type)}: must be a number")
        return value._replace(type=WHOLE) if value.type == BOOLEAN else value

    def _condition(self, node: ast.expr) -> Value:
        value = self._value(node)
        if value.type in (REAL, WHOLE):
            return Value(f"{self._at(value, SUM)} != 0.0", BOOLEAN, EQUAL)
        if value.type != BOOLEAN:
            self.refuse(node, f"{ast.unparse(node)} is {in_words(value.type)}: must be a condition")
        return value

    def _on_constant(self, node: ast.Constant) -> Value:
        if node.value is None:
            self.refuse(
                node, "None: must be a number; math.nan is one that says that there is none"
            )
        if not isinstance(node.value, int | float):
            self.refuse(node, f"{ast.unparse(node)}: must be a number, or of an IntEnum of Params")
        if isinstance(node.value, int) and abs(node.value) > 2**53:
            self.refuse(node, f"{node.value}: an int must be at most 2**53; write {node.value}.0")
        return self._number_of(node.value)

    def _on_name(self, node: ast.Name) -> Value:
        if node.id not in self.bound:
            self.refuse(node, f"{node.id} may have no value here; give it one before")
        return self.bound[node.id]

    def _on_binop(self, node: ast.BinOp) -> Value:
        multiplicand, right = self._value(node.left), self._value(node.right)
        if isinstance(multiplicand.type, GenericAlias) and isinstance(node.op, ast.Mult):
            items = [self.simple(item) for item in self._items(multiplicand, node.left)]
            return self._display(items * self._index(node.right))
        a, b = self._as_number(multiplicand, node.left), self._as_number(right, node.right)
        if isinstance(node.op, ast.Pow):
            if a.type == b.type == WHOLE:
                self.refuse(node, f"{ast.unparse(node)}: of two ints; write float(...)")
            return Value(f"pow({a.text}, {b.text})", REAL)
        if type(node.op) not in OPERATORS:
            self._refuse_kind(node, type(node.op).__name__)
        symbol, level = OPERATORS[type(node.op)]
        text = f"{self._at(a, level)} {symbol} {self._at(b, level + 1)}"
        if a.type == b.type == WHOLE and symbol != "/":  # the zero of an int has no sign
            return Value(f"({text} + 0.0)" if symbol == "*" else text, WHOLE, level)
        return Value(text, REAL, level)

    def _on_unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            return Value(f"!{self._at(self._condition(node.operand), SIGN)}", BOOLEAN, SIGN)
        value = self._number(node.operand)
        if isinstance(node.op, ast.UAdd):
            return value
        if not isinstance(node.op, ast.USub):
            self.refuse(node, f"{ast.unparse(node)}: bits are not in the subset")
        if value.type == WHOLE and not value.text[0].isdigit():
            return Value(f"0.0 - {self._at(value, PRODUCT)}", WHOLE, SUM)
        inner = self._at(value, SIGN)
        return Value(f"-({inner})" if inner[0] == "-" else f"-{inner}", value.type, SIGN)

    def _on_boolop(self, node: ast.BoolOp) -> Value:
        symbol, level = ("&&", AND) if isinstance(node.op, ast.And) else ("||", OR)
        return self._all([self._condition(item) for item in node.values], symbol, level)

    def _all(self, values: Sequence[Value], symbol: str, level: int) -> Value:
        if len(values) == 1:
            return values[0]
        return Value(f" {symbol} ".join(self._at(v, EQUAL) for v in values), BOOLEAN, level)

    def _on_compare(self, node: ast.Compare) -> Value:
        for op in node.ops:
            if type(op) not in COMPARISONS:
                self._refuse_kind(node, type(op).__name__)
        values = [self._number(item) for item in (node.left, *node.comparators)]
        values[1:-1] = [self.simple(v) for v in values[1:-1]]
        comparisons = []
        for a, op, b in zip(values, node.ops, values[1:], strict=False):
            symbol, level = COMPARISONS[type(op)]
            comparisons.append(
                Value(f"{self._at(a, SUM)} {symbol} {self._at(b, SUM)}", BOOLEAN, level)
            )
        return self._all(comparisons, "&&", AND)

    def _on_ifexp(self, node: ast.IfExp) -> Value:
        test = self._at(self._condition(node.test), OR)
        a, b = self._value(node.body), self._value(node.orelse)
        kind = self._common(a.type, b.type, node)
        return Value(f"{test} ? {self._at(a, OR)} : {self._at(b, CHOICE)}", kind, CHOICE)

    def _common(self, a: Type, b: Type, node: ast.AST) -> Type:
        """The type of what may be of either; refused where there is none."""
        if a != b:
            self.refuse(
                node, f"{ast.unparse(node)} is {in_words(a)} or {in_words(b)}: must be one of them"
            )
        return a

    def _display(self, items: Sequence[Value], kind: Type | None = None) -> Value:
        t = kind or GenericAlias(tuple, tuple(item.type for item in items))
        if any(is_dataclass(item.type) for item in items):
            return Value("", t, WORD, tuple(items))
        braces = self.program.braces(t, [item.text for item in items])
        return Value(f"({self.program.c(t, self.names)}){braces}", t, WORD, tuple(items))

    def _on_tuple(self, node: ast.Tuple) -> Value:
        return self._display(self._starred(node.elts))

    def _starred(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Expressions, with all items of those that have a star."""
        items: list[Value] = []
        for node in nodes:
            star = isinstance(node, ast.Starred)
            items += self._items(self._value(node.value), node) if star else [self._value(node)]  # type: ignore[attr-defined]
        return items

    def _items(self, value: Value, node: ast.AST) -> list[Value]:
        if not isinstance(value.type, GenericAlias) and not types.is_record(value.type):
            self.refuse(node, f"{ast.unparse(node)} is {in_words(value.type)}: must be a tuple")
        if value.items is not None:
            return list(value.items)
        of = self.simple(value).text
        kinds = types.parts(value.type)
        members = [of + self.program.member(value.type, i) for i in range(len(kinds))]
        if of[0] == "*":
            members = [member[1:].replace(".", "->", 1) for member in members]
        return [*map(Value, members, kinds)]

    def _on_subscript(self, node: ast.Subscript) -> Value:
        items = self._items(self._value(node.value), node.value)
        if isinstance(node.slice, ast.Slice):
            ends = (node.slice.lower, node.slice.upper, node.slice.step)
            chosen = slice(*(None if end is None else self._index(end) for end in ends))
            return self._display(items[chosen])
        place = self._index(node.slice)
        if not -len(items) <= place < len(items):
            self.refuse(node, f"{ast.unparse(node)}: there are {len(items)} items")
        return items[place]

    def _index(self, node: ast.expr) -> int:
        try:
            place = ast.literal_eval(node)
        except ValueError:
            place = self.named_object(node)
        if not isinstance(place, int):
            loop = "to go through a tuple write for x in items, or for x, y in zip(a, b)"
            self.refuse(node, f"[{ast.unparse(node)}]: an index must be a constant; {loop}")
        return place

    def _on_attribute(self, node: ast.Attribute) -> Value:
        """Of a NamedTuple or of parameters: a field, or a property."""
        value, name = self._value(node.value), node.attr
        t = value.type
        if t in SCALARS or isinstance(t, GenericAlias):
            self.refuse(node, f"{ast.unparse(node)}: {in_words(t)} has no {name}")
        kinds = types.fields(t)
        if name in kinds:
            if types.is_record(t):
                return self._items(value, node)[[*kinds].index(name)]
            kind = kinds[name]
            address = "&" if is_dataclass(kind) else ""
            return Value(f"{address}{self._arrow(value)}{identifier(name)}", kind)
        member = inspect.getattr_static(t, name, None)
        if isinstance(member, cached_property) and t == self.program.params:
            if name not in self.program.cached_properties:
                self.program.cached_properties[name] = self.translate(member.func, [t])
            return Value(
                self._arrow(value) + identifier(name), self.program.cached_properties[name].returns
            )
        if isinstance(member, property | cached_property):
            getter = member.fget if isinstance(member, property) else member.func
            return self._call(getter, [value], {}, node)
        return self.refuse(node, f"{ast.unparse(node)}: {t.__name__} has no {name}")

    def _arrow(self, value: Value) -> str:
        return f"{value.text[1:]}." if value.text[0] == "&" else f"{value.text}->"

    def _on_call(self, node: ast.Call) -> Value:
        function = self.named_object(node.func)
        function = getattr(function, "__wrapped__", function)  # an lru_cache only saves time
        if isinstance(node.func, ast.Attribute) and function is _UNKNOWN:
            return self._method(node, node.func)
        if node.keywords and function in (min, max, *FUNCTIONS, *TO_WHOLE):
            self.refuse(node, f"{ast.unparse(node)}: keywords are not in the subset")
        if function in (any, all, tuple):
            return self._over_items(node, function)
        if function in (min, max, abs, float, len) or function in TO_WHOLE:
            return self._builtin(node, function)
        if function in FUNCTIONS:
            operands = [self._number(a).text for a in node.args]
            if len(operands) != (2 if function in OF_TWO else 1):
                self.refuse(node, f"{ast.unparse(node)}: has another number of arguments in C")
            return Value(f"{FUNCTIONS[function]}({', '.join(operands)})", REAL)
        if function in ADVICE:
            self._refuse_kind(node, function)
        arguments = self._starred(node.args)
        keywords = {k.arg: self._value(k.value) for k in node.keywords if k.arg}
        if types.is_record(function):
            items = self._matched(function, arguments, keywords, node)
            for value, kind in zip(items, types.parts(function), strict=True):
                self._common(value.type, kind, node)
            return self._display(items, function)
        if not isinstance(function, FunctionType):
            self._refuse_kind(node.func)
        return self._call(function, arguments, keywords, node)

    def _call(
        self,
        function: Any,
        positional: Sequence[Value],
        keywords: Mapping[str, Value],
        node: ast.AST,
    ) -> Value:
        arguments = self._matched(function, positional, keywords, node)
        translated = self.translate(function, [a.type for a in arguments])
        texts = [a.text for a in arguments]
        for i in (i for i, by_address in enumerate(translated.by_address) if by_address):
            text = self.simple(arguments[i]).text
            texts[i] = text[1:] if text[0] == "*" else f"&{text}"
        return Value(f"{translated.name}({', '.join(texts)})", translated.returns)

    def _matched(self, function: Any, positional: Any, keywords: Any, node: ast.AST) -> list[Value]:
        signature = inspect.signature(function)
        if any(p.kind != p.POSITIONAL_OR_KEYWORD for p in signature.parameters.values()):
            self.refuse(node, "*args, **kwargs and keywords only are not in the subset")
        bound = signature.bind(*positional, **keywords)
        bound.apply_defaults()
        return [v if isinstance(v, Value) else self._number_of(v) for v in bound.arguments.values()]

    def _method(self, node: ast.Call, of: ast.Attribute) -> Value:
        table = self.named_object(of.value)
        if isinstance(table, Mapping) and of.attr == "get":
            key, default = (self._number(a) for a in node.args)
            at = self.simple(key).text
            text = "".join(f"{at} == {number(k)} ? {number(v)} : " for k, v in table.items())
            return Value(text + self._at(default, CHOICE), default.type, CHOICE)
        value = self._value(of.value)
        if of.attr != "_replace" or not types.is_record(value.type):
            reason = f"{ast.unparse(of)}: is not in the subset"
            self.refuse(node, f"{reason}; use a function of the module")
        new = [(identifier(str(k.arg)), self._value(k.value).text) for k in node.keywords]
        copy = self._copied(value, "changed")
        for name, text in new:
            self._say(f"{copy.text}.{name} = {text};")
        return copy

    def _builtin(self, node: ast.Call, function: Any) -> Value:
        arguments = self._starred(node.args)
        if len(arguments) == 1 and isinstance(arguments[0].type, GenericAlias):
            arguments = self._items(arguments[0], node)
            if function is len:
                return self._number_of(len(arguments))
        value, *remaining = [self._as_number(a, node) for a in arguments]
        if function in (min, max):
            for operand in remaining:
                kind = self._common(value.type, operand.type, node)
                name = "smaller" if function is min else "larger"
                value = Value(f"{name}({value.text}, {operand.text})", kind)
            return value
        if function is float:
            return value._replace(type=REAL)
        if function is abs:
            return Value(f"fabs({value.text})", value.type)
        return value if value.type == WHOLE else Value(f"{TO_WHOLE[function]}({value.text})", WHOLE)

    def _over_items(self, node: ast.Call, function: Any) -> Value:
        over = node.args[0] if node.args else node
        if not isinstance(over, ast.GeneratorExp):
            return self._display(self._items(self._value(over), over))
        loop = over.generators[0]
        if len(over.generators) > 1 or loop.ifs:
            self.refuse(over, "a generator must have one for, and no if")
        bound, outer_locals, items = dict(self.bound), self.locals, []
        self.locals = outer_locals | {
            n.id for n in ast.walk(loop.target) if isinstance(n, ast.Name)
        }
        for row in self._rows(loop.iter):
            self._bind(loop.target, row)
            if function is tuple:
                items.append(self.simple(self._value(over.elt), "item"))
            else:
                items.append(self._condition(over.elt))
        self.bound, self.locals = bound, outer_locals
        if function is tuple:
            return self._display(items)
        return self._all(items, *(("||", OR) if function is any else ("&&", AND)))

    def _rows(self, node: ast.expr) -> list[Value]:
        if isinstance(node, ast.Call) and self.named_object(node.func) is zip:
            columns = [self._items(self._value(a), a) for a in node.args]
            return [self._display(row) for row in zip(*columns, strict=False)]
        return self._items(self._value(node), node)

    def _pairs(self, target: ast.expr, value: Value) -> list[tuple[str, Value]]:
        if isinstance(target, ast.Name):
            return [(target.id, value)]
        if not isinstance(target, ast.Tuple):
            self.refuse(target, f"{ast.unparse(target)}: must be a variable, or several")
        items = self._items(value, target)
        if len(items) != len(target.elts):
            self.refuse(target, f"{ast.unparse(target)}: there are {len(items)} items")
        return [pair for t, v in zip(target.elts, items, strict=True) for pair in self._pairs(t, v)]

    def _bind(self, target: ast.expr, value: Value) -> None:
        for name, item in self._pairs(target, value):
            self.bound[name] = self.simple(item, name)
