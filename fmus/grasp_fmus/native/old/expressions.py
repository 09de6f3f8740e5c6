"""Expressions of Python as expressions of C, worked out in Python's order where that matters."""

import ast
import builtins
import dataclasses
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import IntEnum
from functools import cached_property
from types import FunctionType, ModuleType
from typing import Any

from . import names
from .program import Function, Program
from .python_source import Source, UntranslatableError
from .shapes import (
    BOOLEAN,
    NOTHING,
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
    fits,
    joined,
    said,
)

POSTFIX, UNARY, MUL, ADD, RELATION, EQUALITY, AND, OR, CONDITION, COMMA = range(10, 0, -1)
"""How tightly operators of C bind."""

MATH: dict[Any, tuple[str, tuple[str, ...]]] = {
    math.sqrt: ("py_sqrt", ("domain",)),
    math.sin: ("py_sin", ("domain",)),
    math.cos: ("py_cos", ("domain",)),
    math.tan: ("py_tan", ("domain",)),
    math.asin: ("py_asin", ("domain",)),
    math.acos: ("py_acos", ("domain",)),
    math.atan: ("py_atan", ()),
    math.sinh: ("py_sinh", ("range",)),
    math.cosh: ("py_cosh", ("range",)),
    math.tanh: ("py_tanh", ()),
    math.asinh: ("py_asinh", ()),
    math.acosh: ("py_acosh", ("domain",)),
    math.atanh: ("py_atanh", ("domain",)),
    math.exp: ("py_exp", ("range",)),
    math.expm1: ("py_expm1", ("range",)),
    math.log2: ("py_log2", ("domain",)),
    math.log10: ("py_log10", ("domain",)),
    math.log1p: ("py_log1p", ("domain",)),
    math.fabs: ("fabs", ()),
    math.pow: ("py_pow", ("domain", "range")),
    math.atan2: ("py_atan2", ()),
    math.fmod: ("py_fmod", ("domain",)),
    math.copysign: ("copysign", ()),
}
"""Functions of floats: that of C, and how it may fail."""

TWO = (math.pow, math.atan2, math.fmod, math.copysign)

TO_WHOLE: dict[Any, str] = {math.floor: "floor", math.ceil: "ceil", math.trunc: "int"}
TO_WHOLE |= {int: "int", round: "round"}
"""Functions that make an int of a float."""

IS = {
    math.isfinite: "!isnan({0}) && !isinf({0})",
    math.isnan: "isnan({0})",
    math.isinf: "isinf({0})",
}

UNKNOWN_SUM = "its rounding depends on the version of Python; add with +, or in a loop"
OWN_ALGORITHM = "CPython has its own algorithm for it; write sqrt(x * x + y * y)"
REFUSED: dict[Any, str] = {
    sum: f"sum: {UNKNOWN_SUM}",
    math.fsum: f"math.fsum: {UNKNOWN_SUM}",
    math.hypot: f"math.hypot: {OWN_ALGORITHM}",
    math.dist: f"math.dist: {OWN_ALGORITHM}",
    divmod: "divmod: write a // b and a % b",
    isinstance: "isinstance: C knows all types before; leave it out",
    print: "print: a block has no output but its outputs; leave it out",
}

CONSTANTS = {"pi": "PY_PI", "tau": "PY_TAU", "e": "PY_E", "inf": "PY_INF", "nan": "PY_NAN"}

COMPARISONS = {
    ast.Lt: ("<", RELATION),
    ast.LtE: ("<=", RELATION),
    ast.Gt: (">", RELATION),
    ast.GtE: (">=", RELATION),
    ast.Eq: ("==", EQUALITY),
    ast.NotEq: ("!=", EQUALITY),
}

WRITE_REAL = "may be an int or a float; write 0.0 for 0, or float(...)"


@dataclass(frozen=True)
class Temporary:
    """A value that is worked out before the rest of an expression."""

    name: str
    type: Type
    text: str


@dataclass(frozen=True)
class Value:
    """An expression in C.

    faults are those of evaluating `text`, past those of the temporaries before it. A path names
    something that is there already. A display has its items, and its text without a type.
    """

    text: str
    level: int
    type: Type
    faults: frozenset[str] = frozenset()
    before: tuple[Temporary, ...] = ()
    past: frozenset[str] = frozenset()
    number: float | None = None
    is_path: bool = False
    is_address: bool = False
    items: "tuple[Value, ...] | None" = None
    braces: str = ""


@dataclass(frozen=True)
class Static:
    """Something that is there before the block runs, and no value of C: a module, a function."""

    object: Any
    source: Source | None = None
    name: str = ""
    of: Value | None = None


class Expressions:
    """Translates the expressions of one function."""

    program: Program
    source: Source
    types: dict[str, Type]
    faults: set[str]

    def cname(self, name: str) -> str:
        """What a variable is called in C."""
        raise NotImplementedError

    def temporary(self, hint: str) -> str:
        """A name for a value in between."""
        raise NotImplementedError

    def read(self, node: ast.Name) -> Value | None:
        """A variable of the function; None where it has none of this name."""
        raise NotImplementedError

    def called(self, function: FunctionType, arguments: list[Type], node: ast.AST) -> Function:
        """A function for arguments of these types."""
        raise NotImplementedError

    def reserve(self, t: Temporary) -> None:
        """Declare a temporary of which the value is worked out within an expression."""
        raise NotImplementedError

    def error(self, node: ast.AST, reason: str) -> UntranslatableError:
        """An error at a node."""
        return self.source.error(node, reason)

    # In general

    def value(self, node: ast.expr) -> Value:
        """An expression that has a value in C."""
        found = self.found(node)
        if isinstance(found, Static):
            raise self.error(
                node,
                f"{ast.unparse(node)}: is no number; functions, classes and "
                "mappings are only called, or looked up in",
            )
        return found

    def found(self, node: ast.expr) -> Value | Static:
        """An expression, or what it names."""
        translate: Callable[[Any], Value | Static] | None = getattr(
            self, f"_{type(node).__name__.lower()}", None
        )
        if translate is None:
            raise self.error(
                node,
                UNTRANSLATED.get(
                    type(node),
                    f"{type(node).__name__}: is not in the subset; see What a block may contain",
                ),
            )
        return translate(node)

    def truth(self, node: ast.expr) -> Value:
        """An expression as a condition."""
        if isinstance(node, ast.BoolOp):
            return self._settled(node, self.truth)
        return self.as_truth(self.value(node), node)

    def as_truth(self, v: Value, node: ast.AST) -> Value:
        """A value as a condition."""
        if v.type == BOOLEAN:
            return v
        if v.type in NUMBERS or isinstance(v.type, Member):
            text = f"{at(v, EQUALITY + 1)} != 0.0"
            return replace(_plain(v), text=text, level=EQUALITY, type=BOOLEAN)
        raise self.error(node, f"a {said(v.type)} as a condition; compare it")

    def ordered(self, values: Sequence[Value]) -> tuple[list[Value], Value]:
        """The operands of one operation, and what is before and may fail in it all.

        C evaluates operands in any order: where that could show, by which of two faults is the
        first, the earlier ones are worked out before.
        """
        later, past = frozenset[str](), False
        must: list[bool] = []
        for v in reversed(values):
            differs = bool(v.faults and later) and not (v.faults == later and len(later) == 1)
            must.insert(0, bool(v.faults) and (past or differs))
            if not must[0]:
                later |= v.faults
            past = past or must[0] or bool(v.past)
        made = [self.apart(v) if apart else v for v, apart in zip(values, must, strict=True)]
        before = tuple(dict.fromkeys(t for v in made for t in v.before))
        joint = Value("", POSTFIX, NOTHING, later, before, _union(v.past for v in made))
        return [replace(v, before=(), past=frozenset()) for v in made], joint

    def apart(self, v: Value, hint: str = "part") -> Value:
        """A value that can be named more than once without being worked out again."""
        if v.is_path or v.number is not None:
            return v
        name = self.temporary(_hint(v.text, hint))
        before = (*v.before, Temporary(name, v.type, v.braces or v.text))
        is_address = isinstance(v.type, Group)
        past = v.past | v.faults
        return Value(
            name, POSTFIX, v.type, before=before, past=past, is_path=True, is_address=is_address
        )

    def folded(self, v: Value, done: Value) -> Value:
        """A value that is worked out only where a condition holds, temporaries included.

        Those of `done` are there already.
        """
        before = [t for t in v.before if t not in done.before]
        for t in before:
            self.reserve(t)
        parts = [f"{t.name} = {self._whole_text(t)}" for t in before]
        text = f"({', '.join([*parts, v.text])})" if before else v.text
        found = replace(v, text=text, faults=v.faults | v.past, before=(), past=frozenset())
        return replace(found, level=POSTFIX, is_path=False) if before else found

    def _whole_text(self, t: Temporary) -> str:
        """The value of a temporary outside its declaration, where braces need a type."""
        return f"({self.program.shape(t.type)}){t.text}" if t.text.startswith("{") else t.text

    def named(self, v: Value) -> Value:
        """A tuple of which items may be left out, or be taken more than once."""
        return v if v.items is not None and not v.faults else self.apart(v)

    def operation(
        self, values: Sequence[Value], make: Callable[..., str], level: int, t: Type, *faults: str
    ) -> Value:
        """An operation of operands in Python's order, which may fail by itself after them."""
        operands, joint = self.ordered(values)
        self.faults.update(faults)
        own = frozenset(faults)
        return replace(joint, text=make(*operands), level=level, type=t, faults=joint.faults | own)

    def call(self, name: str, values: Sequence[Value], t: Type, *faults: str) -> Value:
        """A call of a function of C; it gets the fault where it may fail."""

        def text(*operands: Value) -> str:
            arguments = [argument(v) for v in operands]
            return f"{name}({', '.join([*arguments, 'fault'] if faults else arguments)})"

        return self.operation(values, text, POSTFIX, t, *faults)

    # Leaves

    def _constant(self, node: ast.Constant) -> Value:
        v = node.value
        if isinstance(v, bool):
            return Value("1" if v else "0", POSTFIX, BOOLEAN)
        if isinstance(v, float):
            return Value(self.source.digits(node) or names.real(v), POSTFIX, REAL, number=v)
        if isinstance(v, int):
            if v > 2**53:
                raise self.error(node, f"{v}: must be up to 2^53, or a float")
            return Value(names.whole(v), POSTFIX, WHOLE, number=v)
        if isinstance(v, str):
            return Value(names.string(v), POSTFIX, TEXT, is_path=True)
        raise self.error(
            node, f"{v!r}: a {type(v).__name__} is not in the subset; must be a number"
        )

    def _name(self, node: ast.Name) -> Value | Static:
        v = self.read(node)
        if v is not None:
            return v
        if node.id in self.source.names:
            return self._global(node, self.source, node.id, self.source.names[node.id])
        if hasattr(builtins, node.id):
            return Static(getattr(builtins, node.id))
        raise self.error(node, f"{node.id}: is not defined")

    def _global(self, node: ast.expr, source: Source, name: str, v: Any) -> Value | Static:
        if isinstance(v, ModuleType | type) or callable(v):
            return Static(v)
        home, original = self.program.sources.origin(source, name)
        if home is None:
            return self._foreign(node, original, v)
        if isinstance(v, Mapping):
            return Static(v, home, original)
        cname, t = self.program.constant(home, original, v)
        number = v if isinstance(v, float | int) and t in NUMBERS else None
        return Value(cname, POSTFIX, t, number=number, is_path=True, is_address=False)

    def _foreign(self, node: ast.expr, name: str, v: Any) -> Value:
        if isinstance(v, float) and name in CONSTANTS:
            return Value(CONSTANTS[name], POSTFIX, REAL, number=v, is_path=True)
        raise self.error(
            node,
            f"{ast.unparse(node)}: is of no module of the block; must be a "
            "constant of its own, or of math",
        )

    def _attribute(self, node: ast.Attribute) -> Value | Static:
        base = self.found(node.value)
        if isinstance(base, Static):
            return self._static_attribute(node, base)
        if isinstance(base.type, Record | Group):
            return self._member(node, base, base.type)
        if isinstance(base.type, Member) and node.attr == "name":
            function = self.program.name_of_member(base.type.enum, lower=False)
            return self.call(function, [base], TEXT)
        if isinstance(base.type, Member) and node.attr == "value":
            return self._whole_of(base)
        if base.type == TEXT and node.attr in ("lower",):
            return Static(str.lower, of=base)
        raise self.error(node, f"{ast.unparse(node)}: a {said(base.type)} has no such field")

    def _static_attribute(self, node: ast.Attribute, base: Static) -> Value | Static:
        owner = base.object
        if isinstance(owner, Mapping):
            return Static(getattr(owner, node.attr, None), base.source, base.name)
        try:
            v = getattr(owner, node.attr)
        except AttributeError:
            raise self.error(node, f"{ast.unparse(node)}: is not defined") from None
        if isinstance(owner, ModuleType):
            source = self.program.sources.of(owner.__name__)
            if source is None and not (isinstance(v, ModuleType | type) or callable(v)):
                return self._foreign(node, node.attr, v)
            return self._global(node, source, node.attr, v) if source else Static(v)
        if isinstance(owner, type) and isinstance(v, IntEnum):
            text = f"{self.program.enum(type(v))}_{names.ascii_text(v.name)}"
            return Value(text, POSTFIX, Member(type(v)), is_path=True)
        if isinstance(v, FunctionType):
            return Static(v)
        if type(v) in (float, int, bool):
            return self.literal(v, node)
        raise self.error(node, f"{ast.unparse(node)}: must be a function, a member or a number")

    def _member(self, node: ast.Attribute, base: Value, t: Record | Group) -> Value | Static:
        members = self.program.members(t)
        if node.attr in members:
            dot = "->" if base.is_address else "."
            text = f"{at(base, POSTFIX)}{dot}{names.identifier(node.attr)}"
            return replace(
                base,
                text=text,
                level=POSTFIX,
                type=members[node.attr],
                is_address=False,
                items=None,
                number=None,
                braces="",
            )
        found = _in_class(t.cls, node.attr)
        if isinstance(found, property | cached_property):
            function: Any = found.fget if isinstance(found, property) else found.func
            return self.invoked(node, function, [base])
        if isinstance(t, Record) and node.attr == "_replace":
            return Static("_replace", of=base)
        if isinstance(found, FunctionType):
            return Static(found, of=base)
        if type(found) in (float, int, bool):
            return self.literal(found, node)
        raise self.error(node, f"{ast.unparse(node)}: {t.cls.__name__} has no such field")

    def _subscript(self, node: ast.Subscript) -> Value:
        base = self.found(node.value)
        if isinstance(base, Static):
            return self._looked_up(node, base)
        t = base.type
        if isinstance(t, Record):
            t = Tuple(tuple(self.program.members(t).values()))
        if not isinstance(t, Tuple):
            raise self.error(node, f"{ast.unparse(node)}: a {said(t)} has no items")
        index = node.slice
        if isinstance(index, ast.Slice):
            return self.display(self._slice(node, base), node)
        constant = _whole_constant(index)
        if constant is None:
            return self._indexed(node, base, t)
        if not -len(t.items) <= constant < len(t.items):
            raise self.error(node, f"{ast.unparse(node)}: there are {len(t.items)} items")
        return self.items(self.named(base))[constant]

    def _slice(self, node: ast.Subscript, base: Value) -> list[Value]:
        parts = [getattr(node.slice, name) for name in ("lower", "upper", "step")]
        numbers = [None if part is None else _whole_constant(part) for part in parts]
        if any(part is not None and n is None for part, n in zip(parts, numbers, strict=True)):
            raise self.error(node, f"{ast.unparse(node)}: must have constant bounds")
        if numbers[2] == 0:
            raise self.error(node, f"{ast.unparse(node)}: the step must not be 0")
        return self.items(self.named(base))[slice(*numbers)]

    def _indexed(self, node: ast.Subscript, base: Value, t: Tuple) -> Value:
        if not self.program.is_array(t) or isinstance(base.type, Record):
            raise self.error(
                node, f"{ast.unparse(node)}: must have a constant index, or items of one type"
            )
        kind: Type = t.items[0]
        for item in t.items[1:]:
            kind = joined(kind, item) or kind
        index = self.value(node.slice)
        if index.type != WHOLE:
            raise self.error(node, f"{ast.unparse(node)}: the index must be an int")
        count = len(t.items)
        return self.operation(
            [self.apart(base), index],
            lambda b, i: f"{at(b, POSTFIX)}.at[py_index({i.text}, {count}, fault)]",
            POSTFIX,
            kind,
            "IndexError",
        )

    def _looked_up(self, node: ast.Subscript, base: Static) -> Value:
        if not isinstance(base.object, Mapping) or base.source is None:
            raise self.error(node, f"{ast.unparse(node)}: has no items")
        name, _, t = self.program.mapping(base.source, base.name, base.object)
        key = self.apart(self.key(node.slice))
        zero = "0.0" if self.program.shape(t) == "double" else f"({self.program.shape(t)}){{0}}"

        def text(k: Value) -> str:
            missing = 'py_fault(fault, FAULT_OTHER, "KeyError", "")'
            if zero == "0.0":
                return f"{name}_has({k.text}) ? {name}_get({k.text}, 0.0) : {missing}"
            return f"({name}_has({k.text}) ? 0.0 : {missing}, {name}_get({k.text}, {zero}))"

        return self.operation([key], text, CONDITION if zero == "0.0" else POSTFIX, t, "KeyError")

    def key(self, node: ast.expr) -> Value:
        """What is looked up in a mapping."""
        v = self.value(node)
        if v.type not in (*NUMBERS, BOOLEAN) and not isinstance(v.type, Member):
            raise self.error(node, f"{ast.unparse(node)}: must be a number, or of an IntEnum")
        return v

    # Tuples

    def items(self, v: Value) -> list[Value]:
        """The items of a tuple that has a name, or is a display."""
        if v.items is not None:
            return list(v.items)
        if isinstance(v.type, Record):
            names_of = [names.identifier(n) for n in self.program.members(v.type)]
            kinds = list(self.program.members(v.type).values())
        else:
            kinds = list(v.type.items) if isinstance(v.type, Tuple) else []
            array = isinstance(v.type, Tuple) and self.program.is_array(v.type)
            names_of = [f"at[{i}]" if array else f"at_{i}" for i in range(len(kinds))]
        return [
            replace(
                v,
                text=f"{at(v, POSTFIX)}.{n}",
                level=POSTFIX,
                type=k,
                is_address=isinstance(k, Group),
                number=None,
            )
            for n, k in zip(names_of, kinds, strict=True)
        ]

    def display(self, values: Sequence[Value], node: ast.AST, t: Tuple | None = None) -> Value:
        """A tuple of values."""
        t = t or Tuple(tuple(v.type for v in values))
        for v in values:
            if v.type == NOTHING or v.type == TEXT:
                raise self.error(node, f"a tuple of {said(v.type)}; must be of numbers")
        if not values:
            raise self.error(node, "an empty tuple is not in the subset; must have an item")
        operands, joint = self.ordered(values)
        inner = ", ".join(initialiser(v) for v in operands)
        shape = self.program.shape(t)
        braces = f"{{{{{inner}}}}}" if self.program.is_array(t) else f"{{{inner}}}"
        return replace(
            joint,
            text=f"({shape}){braces}",
            level=POSTFIX,
            type=t,
            items=tuple(operands),
            braces=braces,
        )

    def spread(self, nodes: Sequence[ast.expr]) -> list[Value]:
        """Expressions, those with a star as their items."""
        found: list[Value] = []
        for node in nodes:
            if not isinstance(node, ast.Starred):
                found.append(self.value(node))
                continue
            v = self.value(node.value)
            if not isinstance(v.type, Tuple | Record):
                raise self.error(node, f"{ast.unparse(node)}: must be a tuple")
            found += self.items(self.named(v))
        return found

    def _tuple(self, node: ast.Tuple) -> Value:
        return self.display(self.spread(node.elts), node)

    def record(
        self, node: ast.AST, t: Record, given: dict[str, Value], order: Sequence[str]
    ) -> Value:
        """A NamedTuple of the values of its fields, in the order in which they are worked out."""
        members = self.program.members(t)
        for name, v in given.items():
            if not fits(v.type, members[name]) and not self._harmless(t, v, members[name]):
                fix = (
                    f"; {name} {WRITE_REAL}" if v.type in NUMBERS and members[name] == REAL else ""
                )
                raise self.error(
                    node,
                    f"{t.cls.__name__}.{name} is {said(v.type)}: must be "
                    f"{said(members[name])}, as declared{fix}",
                )
        operands, joint = self.ordered([given[name] for name in order])
        by_name = dict(zip(order, operands, strict=True))
        inner = ", ".join(f".{names.identifier(n)} = {initialiser(by_name[n])}" for n in members)
        braces = f"{{{inner}}}" if members else "{0}"
        shape = self.program.shape(t)
        return replace(
            joint,
            text=f"({shape}){braces}",
            level=POSTFIX,
            type=t,
            items=tuple(by_name[n] for n in members),
            braces=braces,
        )

    def _harmless(self, t: Record, v: Value, wanted: Type) -> bool:
        """True where an int goes out as a float: a host hears no difference."""
        return t.cls is self.program.outputs and joined(v.type, wanted) == _numbers(wanted)

    # Operators

    def _unaryop(self, node: ast.UnaryOp) -> Value:
        if isinstance(node.op, ast.Not):
            v = self.truth(node.operand)
            return replace(_plain(v), text=f"!{at(v, UNARY)}", level=UNARY)
        v = self.numeric(node.operand)
        if isinstance(node.op, ast.UAdd):
            return v
        if not isinstance(node.op, ast.USub):
            raise self.error(
                node, f"{ast.unparse(node)}: bits are not in the subset; use arithmetic"
            )
        if v.type == NUMBER:
            raise self.error(node, f"{ast.unparse(node.operand)}: {WRITE_REAL}")
        number = None if v.number is None else -v.number
        if v.type == WHOLE and number is None:
            return replace(_plain(v), text=f"0.0 - {at(v, MUL)}", level=ADD)
        if v.type == WHOLE and number == 0:
            return v
        operand = f"({v.text})" if v.text.startswith("-") else at(v, UNARY)
        return replace(_plain(v), text=f"-{operand}", level=UNARY, number=number)

    def numeric(self, node: ast.expr) -> Value:
        """A number; a truth value counts as an int."""
        return self.as_number(self.value(node), node)

    def as_number(self, v: Value, node: ast.AST) -> Value:
        """A value as a number."""
        if v.type == BOOLEAN or isinstance(v.type, Member):
            return self._whole_of(v)
        if v.type in NUMBERS:
            return v
        shown = ast.unparse(node) if isinstance(node, ast.expr) else "this"
        raise self.error(node, f"{shown}: a {said(v.type)}, must be a number")

    def _whole_of(self, v: Value) -> Value:
        return replace(_plain(v), text=f"(double){at(v, UNARY)}", level=UNARY, type=WHOLE)

    def _binop(self, node: ast.BinOp) -> Value:
        left, right = self.value(node.left), self.value(node.right)
        if isinstance(left.type, Tuple):
            if isinstance(node.op, ast.Add) and isinstance(right.type, Tuple):
                both = [self.named(v) for v in (left, right)]
                return self.display([i for v in both for i in self.items(v)], node)
            if isinstance(node.op, ast.Mult) and right.type == WHOLE:
                return self._repeated(node, left, right)
        left, right = self.as_number(left, node.left), self.as_number(right, node.right)
        return self.binary(node, node.op, left, right)

    def _repeated(self, node: ast.BinOp, left: Value, times: Value) -> Value:
        if times.number is None:
            raise self.error(node, f"{ast.unparse(node)}: the number of items must be a constant")
        items = self.items(self.named(left))
        own = [i if i.is_path or i.number is not None else self.apart(i) for i in items]
        bare = [replace(i, before=(), past=frozenset()) for i in own]
        return self.display([*own, *bare * (int(times.number) - 1)], node)

    def binary(self, node: ast.AST, op: ast.operator, a: Value, b: Value) -> Value:
        """An operation of two numbers."""
        t = _result(a.type, b.type)
        if t is None:
            shown = ast.unparse(node) if isinstance(node, ast.expr) else "this"
            raise self.error(node, f"{shown}: an operand {WRITE_REAL}")
        if isinstance(op, ast.Add | ast.Sub | ast.Mult):
            sign, level = {ast.Add: ("+", ADD), ast.Sub: ("-", ADD), ast.Mult: ("*", MUL)}[type(op)]
            return self._simple(sign, level, t, a, b)
        if isinstance(op, ast.Div):
            return self._quotient(t, a, b)
        if isinstance(op, ast.Pow):
            return self._power(node, t, a, b)
        both = {ast.Mod: ("modulo", "modulo"), ast.FloorDiv: ("floor_divide", "floor divide")}
        if type(op) not in both:
            raise self.error(node, "bits are not in the subset; use arithmetic, and, or, not")
        name, fault = both[type(op)]
        if t == WHOLE:
            return self.call(f"py_whole_{name}", [a, b], WHOLE, f"int {fault}", "beyond 2^53")
        return self.call(f"py_{name}", [a, b], REAL, f"float {fault}")

    def _simple(self, sign: str, level: int, t: Type, a: Value, b: Value) -> Value:
        def text(x: Value, y: Value) -> str:
            return f"{at(x, level)} {sign} {at(y, level + 1)}"

        if t != WHOLE:
            return self.operation([a, b], text, level, REAL)
        return self.operation(
            [a, b], lambda x, y: f"py_whole({text(x, y)}, fault)", POSTFIX, WHOLE, "beyond 2^53"
        )

    def _quotient(self, t: Type, a: Value, b: Value) -> Value:
        if b.number:
            return self.operation(
                [a, b], lambda x, y: f"{at(x, MUL)} / {at(y, MUL + 1)}", MUL, REAL
            )
        whole = "whole_" if t == WHOLE else ""
        return self.call(f"py_{whole}divide", [a, b], REAL, f"{whole}division by zero")

    def _power(self, node: ast.AST, t: Type, a: Value, b: Value) -> Value:
        if t != WHOLE:
            return self.call(
                "py_power", [a, b], REAL, "0.0 to a negative power", "errno range", "complex"
            )
        if b.number is None or not 0 <= b.number <= 1000:
            raise self.error(
                node, "an int to this power may be an int or a float; write float(...)"
            )
        exponent = f"{int(b.number)}"
        return self.operation(
            [a],
            lambda x: f"py_whole_power({x.text}, {exponent}, fault)",
            POSTFIX,
            WHOLE,
            "beyond 2^53",
        )

    def _boolop(self, node: ast.BoolOp) -> Value:
        return self._settled(node, self._condition)

    def _settled(self, node: ast.BoolOp, operand: Callable[[ast.expr], Value]) -> Value:
        first, *rest = node.values
        value = operand(first)
        others = [self.folded(operand(n), value) for n in rest]
        return self.either([value, *others], isinstance(node.op, ast.And))

    def _condition(self, node: ast.expr) -> Value:
        v = self.value(node)
        if v.type == BOOLEAN:
            return v
        shown = ast.unparse(node)
        raise self.error(
            node, f"{shown}: operands of and, or must be conditions; write a if ... else b"
        )

    def either(self, values: Sequence[Value], every: bool) -> Value:
        """All of some conditions, or any of them; one after the other, until it is settled."""
        level, sign = (AND, "&&") if every else (OR, "||")
        first, *rest = values
        parts = [first, *rest]
        texts = [f"({v.text})" if v.level == AND and level == OR else at(v, level) for v in parts]
        faults = _union(v.faults for v in parts)
        return replace(
            _plain(first),
            text=f" {sign} ".join(texts),
            level=level if rest else first.level,
            type=BOOLEAN,
            faults=faults,
        )

    def _compare(self, node: ast.Compare) -> Value:
        if isinstance(node.ops[0], ast.In | ast.NotIn) and len(node.ops) == 1:
            return self._contains(node)
        nodes = [node.left, *node.comparators]
        values = [self.value(n) for n in nodes]
        parts: list[Value] = []
        for i, op in enumerate(node.ops):
            a, b = values[i], values[i + 1]
            if i > 0:
                a = replace(a, before=(), past=frozenset(), faults=frozenset())
            if i + 1 < len(node.ops) and (b.faults or not _cheap(b)):
                b = self.apart(b)
                values[i + 1] = b
            part = self._compared(node, op, a, b)
            parts.append(self.folded(part, parts[0]) if parts else part)
        return parts[0] if len(parts) == 1 else self.either(parts, every=True)

    def _compared(self, node: ast.Compare, op: ast.cmpop, a: Value, b: Value) -> Value:
        same = isinstance(op, ast.Is | ast.IsNot) and isinstance(a.type, Member)
        if same:
            op = ast.Eq() if isinstance(op, ast.Is) else ast.NotEq()
        if type(op) not in COMPARISONS:
            raise self.error(
                node, f"{ast.unparse(node)}: is and in are only for members and mappings; use =="
            )
        for v in (a, b):
            if v.type not in (*NUMBERS, BOOLEAN) and not isinstance(v.type, Member):
                raise self.error(
                    node, f"{ast.unparse(node)}: compares a {said(v.type)}; must be numbers"
                )
        sign, level = COMPARISONS[type(op)]
        return self.operation(
            [a, b],
            lambda x, y: f"{_compared_text(x)} {sign} {_compared_text(y)}",
            level,
            BOOLEAN,
        )

    def _contains(self, node: ast.Compare) -> Value:
        where = self.found(node.comparators[0])
        negative = isinstance(node.ops[0], ast.NotIn)
        if isinstance(where, Static):
            if not isinstance(where.object, Mapping) or where.source is None:
                raise self.error(
                    node, f"{ast.unparse(node)}: must be a mapping, or a tuple of numbers"
                )
            name, _, _ = self.program.mapping(where.source, where.name, where.object)
            made = self.call(f"{name}_has", [self.key(node.left)], BOOLEAN)
            return replace(made, text=f"!{made.text}", level=UNARY) if negative else made
        if not isinstance(where.type, Tuple):
            raise self.error(node, f"{ast.unparse(node)}: must be a mapping, or a tuple of numbers")
        where = self.named(where)
        left, joint = self.ordered([self.apart(self.value(node.left)), where])
        sign = ast.NotEq() if negative else ast.Eq()
        items = [replace(i, before=()) for i in self.items(where if where.items else left[1])]
        parts = [self._compared(node, sign, left[0], i) for i in items]
        made = self.either(parts, every=negative)
        return replace(made, before=joint.before, past=joint.past)

    def _ifexp(self, node: ast.IfExp) -> Value:
        test = self.truth(node.test)
        a, b = (self.folded(self.value(n), test) for n in (node.body, node.orelse))
        t = joined(a.type, b.type)
        if t is None:
            raise self.error(
                node,
                f"{ast.unparse(node)}: is {said(a.type)} or {said(b.type)}; must be of one type",
            )
        text = f"{at(test, CONDITION + 1)} ? {_branch(a)} : {_branch(b)}"
        return replace(
            _plain(test),
            text=text,
            level=CONDITION,
            type=t,
            faults=test.faults | a.faults | b.faults,
            is_address=isinstance(t, Group),
        )

    # Calls

    def _call(self, node: ast.Call) -> Value | Static:
        target = self.found(node.func)
        if not isinstance(target, Static):
            raise self.error(node, f"{ast.unparse(node.func)}: is no function")
        if any(k.arg is None for k in node.keywords):
            raise self.error(node, "** in a call is not in the subset; name the arguments")
        f = target.object
        if f in (any, all):
            return self._any(node, every=f is all)
        if f is len:
            return self._len(node)
        if f is tuple:
            return self.display(self._generated(node), node)
        if isinstance(target.name, str) and target.source is not None:
            return self._mapping_get(node, target)
        if isinstance(f, type) and issubclass(f, tuple) and hasattr(f, "_fields"):
            return self._record_call(node, f)
        if isinstance(f, type) and issubclass(f, IntEnum):
            return self._as_member(node, f)
        if f == "_replace" or f is dataclasses.replace:
            return self._replaced(node, target)
        if f is str.lower and target.of is not None:
            return self._lower(node)
        function = getattr(f, "__wrapped__", f)
        if isinstance(function, FunctionType):
            return self._function_call(node, function, target.of)
        return self._builtin(node, f)

    def _function_call(self, node: ast.Call, function: FunctionType, of: Value | None) -> Value:
        own = [] if of is None else [of]
        given = own + self.spread(node.args)
        named = {k.arg: self.value(k.value) for k in node.keywords if k.arg}
        return self.invoked(node, function, given, named)

    def invoked(
        self,
        node: ast.AST,
        function: FunctionType,
        given: list[Value],
        named: Mapping[str, Value] | None = None,
    ) -> Value:
        """A call of one of the block's functions."""
        named = named or {}
        values = self._bound(node, function, given, named)
        made = self.called(function, [v.type for v in values.values()], node)
        in_order = [*list(values)[: len(given)], *named]
        in_order += [name for name in values if name not in in_order]
        operands, joint = self.ordered([values[name] for name in in_order])
        by_name = dict(zip(in_order, operands, strict=True))
        arguments = [argument(by_name[name]) for name in values] + (
            ["fault"] if made.faults else []
        )
        self.faults |= made.faults
        if made.returns == NOTHING and not made.faults:
            self.program.needed.discard(made.key)
        return replace(
            joint,
            text=f"{made.name}({', '.join(arguments)})",
            level=POSTFIX,
            type=made.returns,
            faults=joint.faults | made.faults,
        )

    def _bound(
        self, node: ast.AST, function: FunctionType, given: list[Value], named: Mapping[str, Value]
    ) -> dict[str, Value]:
        code = function.__code__
        if code.co_flags & 0x0C:
            raise self.error(
                node,
                f"{function.__name__}: *args and **kwargs are not in the subset; "
                "name the parameters",
            )
        positional = code.co_varnames[: code.co_argcount]
        all_names = code.co_varnames[: code.co_argcount + code.co_kwonlyargcount]
        if len(given) > len(positional) or any(
            name not in all_names or name in positional[: len(given)] for name in named
        ):
            raise self.error(node, f"{function.__name__}: does not take these arguments")
        defaults = dict(zip(positional[::-1], (function.__defaults__ or ())[::-1], strict=False))
        defaults |= function.__kwdefaults__ or {}
        found = dict(zip(positional, given, strict=False)) | dict(named)
        for name in all_names:
            if name not in found and name in defaults:
                found[name] = self.literal(defaults[name], node)
        missing = [name for name in all_names if name not in found]
        if missing:
            raise self.error(node, f"{function.__name__}: needs {', '.join(missing)}")
        return {name: found[name] for name in all_names}

    def literal(self, v: Any, node: ast.AST) -> Value:
        """A value that is known before, written where it is used."""
        t = self.program.type_of(
            v, f"{self.source.file}: line {getattr(node, 'lineno', 1)}: default"
        )
        if isinstance(t, Group):
            raise self.error(node, "a dataclass as a default; make it a constant of the module")
        if isinstance(t, Member):
            text = f"{self.program.enum(type(v))}_{names.ascii_text(v.name)}"
            return Value(text, POSTFIX, t, is_path=True)
        text = self.program.initialiser(v, t)
        if isinstance(t, Tuple | Record):
            return Value(f"({self.program.shape(t)}){text}", POSTFIX, t, braces=text)
        number = v if t in NUMBERS else None
        return Value(text, UNARY if text.startswith("-") else POSTFIX, t, number=number)

    def _record_call(self, node: ast.Call, cls: type[Any]) -> Value:
        t = Record(cls)
        members = list(self.program.members(t))
        given = self.spread(node.args)
        named = {k.arg: self.value(k.value) for k in node.keywords if k.arg}
        if len(given) > len(members) or any(n not in members[len(given) :] for n in named):
            raise self.error(node, f"{cls.__name__}: has the fields {', '.join(members)}")
        found = dict(zip(members, given, strict=False)) | named
        order = list(found)
        defaults = cls._field_defaults
        for name in members:
            if name not in found and name in defaults:
                found[name] = self.literal(defaults[name], node)
                order.append(name)
        missing = [n for n in members if n not in found]
        if missing:
            raise self.error(node, f"{cls.__name__}: needs {', '.join(missing)}")
        return self.record(node, t, found, order)

    def _replaced(self, node: ast.Call, target: Static) -> Value:
        of = target.of
        if of is None:
            raise self.error(
                node, "dataclasses.replace is not in the subset; use a NamedTuple and _replace"
            )
        if not isinstance(of.type, Record) or node.args:
            raise self.error(node, "_replace takes the fields of a NamedTuple by name")
        base = self.apart(of)
        members = list(self.program.members(of.type))
        named = {k.arg: self.value(k.value) for k in node.keywords if k.arg}
        unknown = [n for n in named if n not in members]
        if unknown:
            raise self.error(node, f"{of.type.cls.__name__} has no field {unknown[0]}")
        found = dict(zip(members, self.items(base), strict=True)) | named
        first = [n for n in members if n not in named]
        return self.record(node, of.type, found, [*first, *named])

    def _mapping_get(self, node: ast.Call, target: Static) -> Value:
        if target.source is None:
            raise self.error(node, f"{ast.unparse(node)}: is no mapping")
        if (
            not isinstance(node.func, ast.Attribute)
            or node.func.attr != "get"
            or len(node.args) != 2
        ):
            raise self.error(
                node, f"{ast.unparse(node)}: of a mapping there is in, [...] and .get(key, default)"
            )
        name, _, t = self.program.mapping(
            target.source, target.name, target.source.names[target.name]
        )
        key, otherwise = self.key(node.args[0]), self.value(node.args[1])
        if not fits(otherwise.type, t):
            raise self.error(
                node,
                f"{ast.unparse(node)}: the default is {said(otherwise.type)}; "
                f"must be {said(t)}, as the values",
            )
        return self.call(f"{name}_get", [key, otherwise], t)

    def _as_member(self, node: ast.Call, cls: type[IntEnum]) -> Value:
        if len(node.args) != 1:
            raise self.error(node, f"{cls.__name__}: takes one number")
        v = self.value(node.args[0])
        if v.type == Member(cls):
            return v
        raise self.error(node, f"{ast.unparse(node)}: must be a {cls.__name__} already")

    def _lower(self, node: ast.Call) -> Value:
        name = getattr(node.func, "value", None)
        member = self.value(name.value) if isinstance(name, ast.Attribute) else None
        if member is None or not isinstance(member.type, Member):
            raise self.error(
                node, f"{ast.unparse(node)}: .lower() is only for the name of a member"
            )
        return self.call(self.program.name_of_member(member.type.enum, lower=True), [member], TEXT)

    # Over tuples

    def _any(self, node: ast.Call, every: bool) -> Value:
        values = [self.as_truth(v, node) for v in self._generated(node)]
        first, *rest = values
        return self.either([first, *(self.folded(v, first) for v in rest)], every)

    def _generated(self, node: ast.Call) -> list[Value]:
        """The values that a generator over tuples gives, or the items of a tuple."""
        if len(node.args) != 1 or node.keywords:
            raise self.error(node, f"{ast.unparse(node)}: takes one tuple, or a generator over one")
        inner = node.args[0]
        if not isinstance(inner, ast.GeneratorExp):
            v = self.value(inner)
            if not isinstance(v.type, Tuple | Record):
                raise self.error(node, f"{ast.unparse(node)}: must be of a tuple")
            return self.items(self.named(v))
        if len(inner.generators) != 1 or inner.generators[0].ifs:
            raise self.error(node, f"{ast.unparse(node)}: must have one for, and no if")
        loop = inner.generators[0]
        found = []
        for bound in self.iterated(loop.iter):
            with self.binding(loop.target, bound):
                found.append(self.value(inner.elt))
        return found

    def iterated(self, node: ast.expr) -> list[Value]:
        """What a loop over a tuple gives, one after the other."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id == "zip":
                rows = zip(*(self.iterated(a) for a in node.args), strict=False)
                return [self.display(row, node) for row in rows]
            if node.func.id == "enumerate" and len(node.args) == 1:
                numbered = enumerate(self.iterated(node.args[0]))
                return [
                    self.display((Value(names.whole(i), POSTFIX, WHOLE, number=i), v), node)
                    for i, v in numbered
                ]
            if node.func.id == "range":
                numbers = [_whole_constant(a) for a in node.args]
                if numbers and None not in numbers:
                    return [
                        Value(names.whole(i), POSTFIX, WHOLE, number=i)
                        for i in range(*[n for n in numbers if n is not None])
                    ]
        v = self.value(node)
        if not isinstance(v.type, Tuple | Record):
            raise self.error(
                node,
                f"{ast.unparse(node)}: must be a tuple, zip or enumerate of tuples, or a range",
            )
        return self.items(self.named(v))

    def binding(self, target: ast.expr, v: Value) -> Any:
        """Give the variables of a generator their values."""
        raise NotImplementedError

    def _len(self, node: ast.Call) -> Value:
        if len(node.args) == 1:
            t = self.value(node.args[0]).type
            count = len(self.program.members(t)) if isinstance(t, Record) else None
            count = len(t.items) if isinstance(t, Tuple) else count
            if count is not None:
                return Value(names.whole(count), POSTFIX, WHOLE, number=count)
        raise self.error(node, f"{ast.unparse(node)}: must be of a tuple")

    # Builtins and math

    def _builtin(self, node: ast.Call, f: Any) -> Value:
        if f in REFUSED:
            raise self.error(node, REFUSED[f])
        if node.keywords:
            raise self.error(node, f"{ast.unparse(node)}: keywords are not in the subset here")
        if f in (min, max):
            return self._extreme(node, "min" if f is min else "max")
        count = 2 if f in TWO or f in (math.ldexp, pow) else 1
        if f is math.log and len(node.args) == 2:
            count = 2
        known = f in MATH or f in TO_WHOLE or f in IS
        known = known or f in (
            abs,
            float,
            bool,
            pow,
            math.log,
            math.ldexp,
            math.degrees,
            math.radians,
        )
        if not known:
            raise self.error(
                node,
                f"{ast.unparse(node.func)}: is not in the subset; of the standard "
                "library there are functions of math",
            )
        if len(node.args) != count:
            raise self.error(
                node, f"{ast.unparse(node)}: must have {count} argument{'s' if count > 1 else ''}"
            )
        if f is bool:
            return self.truth(node.args[0])
        given = [self.numeric(a) for a in node.args]
        return self._applied(node, f, given)

    def _applied(self, node: ast.Call, f: Any, given: list[Value]) -> Value:
        v = given[0]
        if f in MATH:
            name, faults = MATH[f]
            return self.call(name, given, REAL, *(f"math {fault} error" for fault in faults))
        if f in TO_WHOLE:
            if v.type == WHOLE:
                return v
            return self.call(f"py_{TO_WHOLE[f]}", given, WHOLE, "infinity to int", "NaN to int")
        if f in IS:
            v = self.apart(v)
            level = AND if f is math.isfinite else POSTFIX
            text = IS[f].format(v.text)
            return replace(
                _plain(v),
                text=text if level == AND else f"{text} != 0",
                level=level if level == AND else EQUALITY,
                type=BOOLEAN,
            )
        if f is abs:
            return self.call("fabs", given, v.type)
        if f is float:
            return replace(v, type=REAL)
        if f is pow:
            return self.binary(node, ast.Pow(), *given)
        if f is math.log:
            logs = [self.call("py_log", [g], REAL, "math domain error") for g in given]
            if len(logs) == 1:
                return logs[0]
            return self.call("py_divide", logs, REAL, "division by zero")
        if f is math.ldexp:
            if given[1].type != WHOLE:
                raise self.error(node, f"{ast.unparse(node)}: the second must be an int")
            return self.call("py_ldexp", given, REAL, "math range error")
        factor = "180.0 / PY_PI" if f is math.degrees else "PY_PI / 180.0"
        return replace(_plain(v), text=f"{at(v, MUL)} * ({factor})", level=MUL, type=REAL)

    def _extreme(self, node: ast.Call, name: str) -> Value:
        values = self.spread(node.args)
        if len(values) == 1 and len(node.args) == 1:
            v = values[0]
            if not isinstance(v.type, Tuple | Record):
                raise self.error(
                    node, f"{ast.unparse(node)}: must be of two numbers, or of a tuple"
                )
            values = self.items(self.named(v))
        values = [self.as_number(v, node) for v in values]
        t: Type = values[0].type
        for v in values[1:]:
            t = joined(t, v.type) or t

        def text(*operands: Value) -> str:
            made = operands[0].text
            for v in operands[1:]:
                made = f"py_{name}({made}, {v.text})"
            return made

        return self.operation(values, text, POSTFIX, t)


def at(v: Value, level: int) -> str:
    """The text of a value as an operand of what binds this tightly."""
    return v.text if v.level >= level else f"({v.text})"


def argument(v: Value) -> str:
    """The text of a value as an argument."""
    if isinstance(v.type, Group) and not v.is_address:
        return f"&{at(v, POSTFIX)}"
    return v.text if v.level > COMMA else f"({v.text})"


def initialiser(v: Value) -> str:
    """The text of a value as an item of another."""
    return v.braces or argument(v)


def _branch(v: Value) -> str:
    return argument(v) if v.level >= CONDITION else f"({v.text})"


def _compared_text(v: Value) -> str:
    """An operand of a comparison, in which compilers suspect a bare !x."""
    return f"({v.text})" if v.text.startswith("!") else at(v, RELATION + 1)


def _union(sets: Iterable[frozenset[str]]) -> frozenset[str]:
    return frozenset[str]().union(*sets)


def _plain(v: Value) -> Value:
    """A value of which something else is made."""
    return replace(v, number=None, is_path=False, is_address=False, items=None, braces="")


def _result(a: Type, b: Type) -> Type | None:
    if REAL in (a, b):
        return REAL
    return WHOLE if a == b == WHOLE else None


def _numbers(t: Type) -> Type:
    if isinstance(t, Tuple):
        return Tuple(tuple(_numbers(item) for item in t.items))
    return NUMBER if t == REAL else t


def _whole_constant(node: ast.expr) -> int | None:
    sign = 1
    if isinstance(node, ast.UnaryOp) and isinstance(node.op, ast.USub):
        sign, node = -1, node.operand
    if isinstance(node, ast.Constant) and type(node.value) is int:
        return sign * node.value
    return None


def _cheap(v: Value) -> bool:
    return "(" not in v.text


def _hint(text: str, otherwise: str) -> str:
    """What a value in between is called after: the function that gives it."""
    name, paren, _ = text.partition("(")
    return name.removeprefix("py_") if paren and name.isidentifier() else otherwise


def _in_class(cls: type[Any], name: str) -> Any:
    for base in cls.__mro__:
        if name in vars(base):
            return vars(base)[name]
    return None


UNTRANSLATED: dict[type[ast.AST], str] = {
    ast.Lambda: "lambda is not in the subset; define a function of the module",
    ast.ListComp: "a list is not in the subset; use a tuple",
    ast.List: "a list is not in the subset; use a tuple",
    ast.Dict: "a dict is not in the subset but as a constant of the module",
    ast.DictComp: "a dict is not in the subset but as a constant of the module",
    ast.Set: "a set is not in the subset; use a tuple",
    ast.SetComp: "a set is not in the subset; use a tuple",
    ast.GeneratorExp: "a generator is only for any, all and tuple over a tuple",
    ast.NamedExpr: "the walrus := is not in the subset; assign before",
    ast.JoinedStr: "an f-string is only for the text of a raise",
    ast.Starred: "a star is only for the items of a tuple",
    ast.Await: "await is not in the subset",
    ast.Yield: "yield is not in the subset; return a tuple",
    ast.YieldFrom: "yield is not in the subset; return a tuple",
}
