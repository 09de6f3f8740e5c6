"""Functions of Python as functions of C, statement by statement."""

import ast
import builtins
import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count
from types import FunctionType
from typing import Any

from . import names
from .expressions import (
    POSTFIX,
    UNTRANSLATED,
    Expressions,
    Static,
    Temporary,
    Value,
    argument,
    at,
)
from .layout import comment, wrapped
from .program import Function, Program
from .python_source import Source, UntranslatableError
from .shapes import (
    BOOLEAN,
    NOTHING,
    NUMBERS,
    REAL,
    TEXT,
    WHOLE,
    Group,
    Record,
    Tuple,
    Type,
    joined,
    said,
)

DECORATORS = ("property", "cached_property", "lru_cache", "cache", "staticmethod", "override")


@dataclass
class Loop:
    """What is known where a loop is left: the variables that have a value there."""

    exits: list[set[str]]
    rounds: list[set[str]]


def function(
    program: Program, of: FunctionType, arguments: list[Type], caller: UntranslatableError
) -> Function:
    """A function for arguments of these types, translated once.

    `caller` is the beginning of the error of a call that has none.
    """
    source = program.sources.of(of.__globals__["__name__"])
    definition = source.function(of) if source else None
    if source is None or definition is None:
        raise UntranslatableError(
            f"{caller}{of.__module__}.{of.__qualname__}: must be a function of the block's "
            "modules, defined at the top level or in a class"
        )
    key = ("function", source.name, of.__qualname__, definition.lineno, tuple(arguments))
    if key in program.functions:
        made = program.functions[key]
        if made is None:
            raise source.error(definition, f"{of.__name__}: calls itself; use a loop")
    else:
        made = _translated(program, source, of, definition, arguments, key)
    program.need(key)
    return made


def _translated(
    program: Program,
    source: Source,
    of: FunctionType,
    definition: ast.FunctionDef,
    arguments: list[Type],
    key: tuple[Any, ...],
) -> Function:
    program.functions[key] = None
    outer, types = program.needed, dict[str, Type]()
    returned: Type | None = None
    try:
        while True:
            program.needed = set()
            body = Body(program, source, of, definition, arguments, types, returned)
            text = body.text()
            if body.types == types and body.returned == returned:
                break
            types, returned = body.types, body.returned
        for needed in [k for k in program.needed if program.functions.get(k)]:
            if not _uses(text, getattr(program.functions[needed], "name", "")):
                program.needed.discard(needed)  # its value is not used, and it cannot fail
        made = Function(_name(program, source, of, key), body.returned, frozenset(body.faults), key)
        program.plain[made.name] = of.__name__.lstrip("_")
        program.define(key, source.name, body.whole(made, text), program.needed)
    except BaseException:
        del program.functions[key]
        raise
    finally:
        program.needed = outer
    program.functions[key] = made
    return made


def _name(program: Program, source: Source, of: FunctionType, key: tuple[Any, ...]) -> str:
    name = of.__qualname__.replace(".__post_init__", ".post_init").replace(".", "_")
    return program.unique(f"{source.prefix}_{names.identifier(name.lstrip('_')).strip('_')}", key)


class Body(Expressions):
    """One pass over a function, with what the last one found about its variables."""

    def __init__(
        self,
        program: Program,
        source: Source,
        of: FunctionType,
        definition: ast.FunctionDef,
        arguments: list[Type],
        known: dict[str, Type],
        returned: Type | None,
    ) -> None:
        self.program, self.source, self.function, self.definition = program, source, of, definition
        self.known, self.types = known, dict[str, Type]()
        self.returns: Type | None = None
        self.returned = returned or REAL
        self.faults: set[str] = set()
        self._check_definition()
        spec = definition.args
        self.parameters = [a.arg for a in (*spec.posonlyargs, *spec.args, *spec.kwonlyargs)]
        self.arguments = arguments
        self._hints = program.hints(source, of)
        self._locals = _stored(definition) | set(self.parameters)
        self._paths = _paths(definition)
        self._owner = _owners(definition, self._paths)
        self._reads = {
            n.id
            for n in ast.walk(definition)
            if isinstance(n, ast.Name) and isinstance(n.ctx, ast.Load)
        } | {
            n.target.id
            for n in ast.walk(definition)
            if isinstance(n, ast.AugAssign) and isinstance(n.target, ast.Name)
        }
        self._cnames: dict[str, str] = {}
        for name in sorted(self._locals):
            plain = names.identifier(name)
            while plain in program.sources.global_names or plain in self._cnames.values():
                plain += "_"
            self._cnames[name] = plain
        self._environment: dict[str, Value] = {}
        self._used = set(self._cnames.values())
        self._scopes: list[set[str]] = [set()]
        self._has: set[str] = set(self.parameters)
        self._live = True
        self._loops: list[Loop] = []
        self._counting: list[str] = []
        self._lines: list[str] = []
        self._indent = 1
        self._reserved: list[Temporary] = []
        self._next_line = definition.body[0].lineno
        for name, t in zip(self.parameters, arguments, strict=True):
            hint = self._hints.get(name)
            self._join(name, hint if hint == t and isinstance(t, Tuple) else t, definition)

    def _check_definition(self) -> None:
        d = self.definition
        for decorator in d.decorator_list:
            inner = decorator.func if isinstance(decorator, ast.Call) else decorator
            name = inner.attr if isinstance(inner, ast.Attribute) else getattr(inner, "id", "")
            if name not in DECORATORS:
                raise self.error(
                    decorator, f"@{ast.unparse(decorator)}: must be one of {', '.join(DECORATORS)}"
                )
        if d.args.vararg or d.args.kwarg:
            raise self.error(
                d, f"{d.name}: *args and **kwargs are not in the subset; name the parameters"
            )

    # The whole

    def text(self) -> str:
        """The statements."""
        body = self.definition.body
        if ast.get_docstring(self.definition) is not None:
            self._next_line = (body[0].end_lineno or body[0].lineno) + 1
            body = body[1:]
        self._block(body, top=True)
        self._trailing_comments(self.definition.end_lineno or 0)
        if self._live and self.returns is not None and self.returned != NOTHING:
            raise self.error(
                self.definition, f"{self.definition.name}: must return a value on every way"
            )
        if self.returns is None:
            self.returned = NOTHING
        self._note_unused()
        return "".join(f"{line}\n" for line in self._lines)

    def _note_unused(self) -> None:
        """Say so of variables that are read in Python only: len(t) needs no t in C."""
        text = "\n".join(self._lines)
        for name in sorted(self._locals - set(self.parameters)):
            cname = self.cname(name)
            if len(re.findall(rf"(?<![.\w>]){cname}\b", text)) == 1:
                at_ = next(i for i, line in enumerate(self._lines) if _uses(line, cname))
                while not self._lines[at_].partition(" /*")[0].endswith(";"):
                    at_ += 1
                indent = self._lines[at_][: len(self._lines[at_]) - len(self._lines[at_].lstrip())]
                self._lines.insert(at_ + 1, f"{indent}(void){cname};")

    def whole(self, made: Function, text: str) -> str:
        """The definition in C."""
        declared = []
        unused = []
        for name in self.parameters:
            t = self.types[name]
            declared.append(self.program.held(t, self.cname(name)))
            if not _uses(text, self.cname(name)):
                unused.append(f"    (void){self.cname(name)};\n")
        if made.faults:
            declared.append("Fault *fault")
        about = comment(ast.get_docstring(self.definition, clean=True))
        result = self.returned
        hint = self._hints.get("return")
        if isinstance(result, Tuple) and hint == result:
            result = hint
        head = f"static {self.program.held(result, made.name)}({', '.join(declared) or 'void'})"
        if result == NOTHING:
            head = f"static void {made.name}({', '.join(declared) or 'void'})"
        lines = "\n".join(wrapped(head))
        return f"{about}{lines}\n{{\n{''.join(unused)}{text}}}\n"

    # What expressions ask for

    def cname(self, name: str) -> str:
        """What a variable is called in C."""
        return self._cnames[name]

    def temporary(self, hint: str) -> str:
        """A name that is free."""
        hint = names.identifier(hint)
        hint = names.identifier(self.program.plain.get(hint, hint))
        if hint in names.RESERVED or hint.endswith("_"):
            hint = f"{hint.rstrip('_')}_1"
        count, name = 1, hint
        while name in self._used or name.startswith("py_"):
            count += 1
            name = f"{hint.removesuffix('_1')}_{count}"
        self._used.add(name)
        return name

    def read(self, node: ast.Name) -> Value | None:
        """A variable with what is known of it."""
        if node.id in self._environment:
            return self._environment[node.id]
        if node.id not in self._locals:
            return None
        if node.id not in self._has:
            raise self.error(node, f"{node.id}: may have no value here; give it one before")
        t = self.known.get(node.id) or self.types.get(node.id)
        if t is None:
            raise self.error(node, f"{node.id}: may have no value here; give it one before")
        return Value(self.cname(node.id), POSTFIX, t, is_path=True, is_address=isinstance(t, Group))

    def called(self, function_: FunctionType, arguments: list[Type], node: ast.AST) -> Function:
        """Translate a function that is called."""
        return function(self.program, function_, arguments, self.error(node, ""))

    def reserve(self, t: Temporary) -> None:
        """Declare a temporary before the next statement."""
        self._reserved.append(t)

    @contextmanager
    def binding(self, target: ast.expr, v: Value) -> Iterator[None]:
        """Let the variables of a generator stand for values."""
        before = self._environment
        self._environment = {**before, **self._matched(target, v)}
        yield
        self._environment = before

    def _matched(self, target: ast.expr, v: Value) -> dict[str, Value]:
        if isinstance(target, ast.Name):
            return {target.id: v}
        if not isinstance(target, ast.Tuple):
            raise self.error(target, f"{ast.unparse(target)}: must be a variable, or some")
        parts = self.items(v)
        if len(parts) != len(target.elts):
            raise self.error(target, f"{ast.unparse(target)}: there are {len(parts)} items")
        found: dict[str, Value] = {}
        for inner, part in zip(target.elts, parts, strict=True):
            found |= self._matched(inner, part)
        return found

    # Lines

    def _emit(self, line: str) -> None:
        self._lines += wrapped(f"{'    ' * self._indent}{line}")

    def _comments_before(self, line: int) -> None:
        for number in range(self._next_line, line):
            if number in self.source.own_line:
                said_ = names.ascii_text(self.source.comments[number])
                self._emit(f"/* {said_} */")
        self._next_line = max(self._next_line, line)

    def _trailing_comments(self, last: int) -> None:
        self._comments_before(last + 1)

    def _comment_at(self, line: int) -> str:
        if line in self.source.comments and line not in self.source.own_line:
            return f" /* {names.ascii_text(self.source.comments[line])} */"
        return ""

    # Blocks

    def _block(self, body: Sequence[ast.stmt], top: bool = False) -> None:
        if not top:
            self._scopes.append(set())
            self._indent += 1
        for node in body:
            if not self._live:
                break
            self._statement(node)
        if not top:
            self._scopes.pop()
            self._indent -= 1

    def _statement(self, node: ast.stmt) -> None:
        self._comments_before(node.lineno)
        translate = getattr(self, f"_{type(node).__name__.lower()}_statement", None)
        if translate is None:
            raise self.error(
                node,
                _STATEMENTS.get(
                    type(node),
                    f"{type(node).__name__}: is not in the subset; see What a block may contain",
                ),
            )
        first = len(self._lines)
        if isinstance(node, ast.If | ast.For):
            self._declare_before(node)
        translate(node)
        own = len(self._lines)
        end = node.end_lineno or node.lineno
        if not isinstance(node, ast.If | ast.For):
            for line in range(node.lineno, end + 1):
                about = self._comment_at(line)
                if about and own > first:
                    self._lines[-1] += about
            self._next_line = max(self._next_line, end + 1)

    def _declare_before(self, node: ast.If | ast.For) -> None:
        """Declare what is used after a statement with blocks, and gets its value in one of them."""
        for name in self._to_declare(node):
            t = self.known.get(name)
            if t is not None:
                zero = "" if isinstance(node, ast.If) else f" = {self._zero(t)}"
                self._emit(f"{self.program.held(t, self.cname(name))}{zero};")
                self._scopes[-1].add(name)

    def _to_declare(self, node: ast.If | ast.For) -> list[str]:
        direct = self._direct(node) if isinstance(node, ast.For) else ""
        return [
            name
            for name in _in_order(node)
            if name != direct
            and name in self._reads
            and not self._declared(name)
            and self._owner.get(name) == self._paths[node]
        ]

    def _direct(self, node: ast.For) -> str:
        """The variable of a loop over a range that C can count with itself."""
        name = node.target.id if isinstance(node.target, ast.Name) else ""
        if not _is_range(node.iter) or name not in self._reads or self._declared(name):
            return ""
        reads = [_reads(part, name) for part in node.body]
        is_changed = name in set().union(*(_stored(part) for part in node.body))
        return "" if is_changed or sum(reads) < _reads(self.definition, name) else name

    def _declared(self, name: str) -> bool:
        return name in self.parameters or any(name in scope for scope in self._scopes)

    def _is_read(self, name: str) -> bool:
        return name in self._reads

    def _zero(self, t: Type) -> str:
        if isinstance(t, Tuple | Record):
            return "{0}"
        return (
            {"int": "0", "const char *": '""'}.get(self.program.shape(t), "0.0")
            if not isinstance(t, Group)
            else "0"
        )

    def _flushed(self, v: Value) -> Value:
        """A value with its temporaries declared before the statement."""
        for t in self._reserved:
            self._emit(f"{self.program.held(t.type, t.name)};")
        self._reserved = []
        for t in v.before:
            self._emit(f"{self.program.held(t.type, t.name)} = {t.text};")
        return replace(v, before=(), past=frozenset())

    # Assignments

    def _join(self, name: str, t: Type, node: ast.AST) -> None:
        if t == NOTHING:
            raise self.error(node, f"{name}: is given the value of a function that returns none")
        before = self.types.get(name)
        both = t if before is None else joined(before, t)
        if both is None:
            raise self.error(
                node,
                f"{name} is {said(t)}, was {said(before or t)}; must stay of one type: "
                "take another name",
            )
        known = self.known.get(name)
        if known is not None and joined(known, both) is not None:
            both = joined(known, both) or both
        self.types[name] = both

    def _store(self, name: str, v: Value, node: ast.AST, hint: Type | None = None) -> None:
        """Give a variable a value."""
        if not self._is_read(name):
            self._effect(v)
            return
        t = v.type
        if hint is not None and hint == t:
            t = hint
        self._join(name, t, node)
        t = self.known.get(name) or self.types[name]
        text = argument(v) if isinstance(t, Group) else v.text
        if self._declared(name):
            self._emit(f"{self.cname(name)} = {text};")
        else:
            self._emit(f"{self.program.held(t, self.cname(name))} = {v.braces or text};")
            self._scopes[-1].add(name)
        self._has.add(name)

    def _assign_statement(self, node: ast.Assign) -> None:
        first, *rest = node.targets
        pairs = self._pairs(first, node.value) if not rest else None
        if pairs is not None:
            self._parallel(pairs, node)
            return
        v = self.value(node.value)
        if rest and not (v.is_path or v.number is not None):
            names_ = [t for t in node.targets if isinstance(t, ast.Name)]
            if not names_:
                v = self._flushed(self.apart(v))
        self._give(first, v, node)
        for target in rest:
            known = first if isinstance(first, ast.Name) and self._is_read(first.id) else None
            if known is not None:
                v = self.value(ast.copy_location(ast.Name(known.id, ast.Load()), known))
            self._give(target, v, node)

    def _annassign_statement(self, node: ast.AnnAssign) -> None:
        if node.value is None:
            return
        hint = None
        if isinstance(node.annotation, ast.Name | ast.Attribute):
            try:
                found = self.found(node.annotation)
                if isinstance(found, Static):
                    hint = self.program.of_hint(found.object, "")
            except UntranslatableError:
                hint = None
        self._give(node.target, self.value(node.value), node, hint)

    def _give(self, target: ast.expr, v: Value, node: ast.stmt, hint: Type | None = None) -> None:
        """Give a target, or several, a value."""
        if isinstance(target, ast.Name):
            self._store(target.id, self._flushed(v), node, hint)
            return
        if not isinstance(target, ast.Tuple):
            raise self.error(
                target,
                f"{ast.unparse(target)}: only variables are assigned to; use "
                "_replace, or a new tuple",
            )
        pairs: list[tuple[str, Value]] = []
        self._pair(target, v, pairs)
        self._parallel(pairs, node)

    def _pairs(self, target: ast.expr, value: ast.expr) -> list[tuple[str, Value]] | None:
        """The assignments of one tuple to another, item by item; None where they do not match."""
        if not isinstance(target, ast.Tuple) or not isinstance(value, ast.Tuple):
            return None
        both = [*target.elts, *value.elts]
        if len(target.elts) != len(value.elts) or any(isinstance(n, ast.Starred) for n in both):
            return None
        pairs: list[tuple[str, Value]] = []
        for inner, item in zip(target.elts, value.elts, strict=True):
            nested = self._pairs(inner, item)
            if nested is not None:
                pairs += nested
            elif isinstance(inner, ast.Name):
                pairs.append((inner.id, self.value(item)))
            elif isinstance(inner, ast.Tuple):
                self._pair(inner, self.value(item), pairs)
            else:
                raise self.error(inner, f"{ast.unparse(inner)}: only variables are assigned to")
        return pairs

    def _pair(self, target: ast.Tuple, v: Value, pairs: list[tuple[str, Value]]) -> None:
        if not isinstance(v.type, Tuple | Record):
            raise self.error(target, f"{ast.unparse(target)}: a {said(v.type)} has no items")
        v = self._flushed(v if v.items is not None else self.apart(v))
        parts = self.items(v)
        if any(isinstance(inner, ast.Starred) for inner in target.elts):
            raise self.error(
                target,
                f"{ast.unparse(target)}: a star among the targets is not in the subset; use slices",
            )
        if len(parts) != len(target.elts):
            raise self.error(
                target, f"{ast.unparse(target)}: there are {len(parts)} items, must be as many"
            )
        for inner, part in zip(target.elts, parts, strict=True):
            if isinstance(inner, ast.Tuple):
                self._pair(inner, part, pairs)
            elif isinstance(inner, ast.Name):
                pairs.append((inner.id, part))
            else:
                raise self.error(inner, f"{ast.unparse(inner)}: only variables are assigned to")

    def _parallel(self, pairs: list[tuple[str, Value]], node: ast.stmt) -> None:
        """Several assignments at once: a variable that a later one reads keeps its old value."""
        for i, (name, v) in enumerate(pairs):
            cname = self.cname(name)
            later = pairs[i + 1 :]
            is_old = self._declared(name) and self._is_read(name) and v.text != cname
            if is_old and any(_uses(text, cname) for _, w in later for text in _texts(w)):
                old = self.temporary(f"old_{cname}")
                self._emit(f"{self.program.held(self.types[name], old)} = {cname};")
                pairs[i + 1 :] = [(n, _with(w, cname, old)) for n, w in later]
            if v.text != cname:
                self._store(name, self._flushed(v), node)

    def _augassign_statement(self, node: ast.AugAssign) -> None:
        if not isinstance(node.target, ast.Name):
            raise self.error(node, f"{ast.unparse(node.target)}: only variables are assigned to")
        target = ast.copy_location(ast.Name(node.target.id, ast.Load()), node.target)
        before = self.numeric(target)
        v = self._flushed(self.numeric(node.value))
        made = self._flushed(self.binary(node, node.op, before, v))
        signs = {ast.Add: "+", ast.Sub: "-", ast.Mult: "*", ast.Div: "/"}
        name = self.cname(node.target.id)
        sign = signs.get(type(node.op))
        if sign and made.text.startswith(f"{name} {sign} ") and before.type == REAL:
            self._join(node.target.id, made.type, node)
            self._emit(f"{name} {sign}= {v.text};")
        else:
            self._store(node.target.id, made, node)

    # Control

    def _pass_statement(self, node: ast.Pass) -> None:
        pass

    def _expr_statement(self, node: ast.Expr) -> None:
        if isinstance(node.value, ast.Constant):
            return
        if isinstance(node.value, ast.Call):
            if self._is_check(node.value):
                return
            found = self.found(node.value)
            if isinstance(found, Value):
                self._effect(self._flushed(found))
                return
        no_effect = f"{ast.unparse(node)}: has no effect; leave it out"
        raise self.error(node, UNTRANSLATED.get(type(node.value), no_effect))

    def _is_check(self, node: ast.Call) -> bool:
        """True for check(self) and Group.__post_init__(self): ranges are checked in each set."""
        if isinstance(node.func, ast.Attribute) and node.func.attr == "__post_init__":
            return self._is_base_check(node, node.func)
        found = self.found(node.func)
        return (
            isinstance(found, Static)
            and getattr(found.object, "__module__", "") == "block_variables"
        )

    def _is_base_check(self, node: ast.Call, func: ast.Attribute) -> bool:
        me = Value(
            self.cname(self.parameters[0]),
            POSTFIX,
            self.arguments[0],
            is_path=True,
            is_address=True,
        )
        cls = getattr(self.arguments[0], "cls", None)
        is_super = isinstance(func.value, ast.Call) and ast.unparse(func.value.func) == "super"
        if is_super and cls is not None:
            owner = self.function.__qualname__.partition(".")[0]
            line = [c.__name__ for c in cls.__mro__]
            after = cls.__mro__[line.index(owner) + 1 :] if owner in line else ()
            found = next(
                (vars(c)["__post_init__"] for c in after if "__post_init__" in vars(c)), None
            )
        else:
            base = self.found(func.value)
            found = (
                getattr(base.object, "__post_init__", None) if isinstance(base, Static) else None
            )
        if not isinstance(found, FunctionType):
            raise self.error(node, f"{ast.unparse(node)}: must be of a base class")
        if found.__module__ != "block_variables":
            v = self.invoked(node, found, [me])
            self._effect(v)
        return True

    def _effect(self, v: Value) -> None:
        """A call for what it raises; nothing where it cannot."""
        if v.faults and v.type == NOTHING:
            self._emit(f"{v.text};")
        elif v.faults:
            self._emit(f"(void){at(v, POSTFIX)};")

    def _return_statement(self, node: ast.Return) -> None:
        if node.value is None or (
            isinstance(node.value, ast.Constant) and node.value.value is None
        ):
            self._returns(NOTHING, node)
            self._emit("return;")
        else:
            v = self._flushed(self.value(node.value))
            hint = self._hints.get("return")
            self._returns(v.type, node)
            if isinstance(v.type, Tuple) and v.braces and hint == v.type:
                v = replace(v, text=f"({self.program.shape(hint)}){v.braces}")
            self._emit(f"return {argument(v)};")
        self._live = False

    def _returns(self, t: Type, node: ast.AST) -> None:
        both = t if self.returns is None else joined(self.returns, t)
        if both is None:
            raise self.error(
                node,
                f"{self.definition.name}: returns {said(t)} here, "
                f"{said(self.returns or t)} before; must be one type",
            )
        self.returns = both
        self.returned = both

    def _if_statement(self, node: ast.If, word: str = "if") -> None:
        test = self._flushed(self.truth(node.test))
        about = self._comment_at(node.test.end_lineno or node.lineno)
        self._next_line = max(self._next_line, (node.test.end_lineno or node.lineno) + 1)
        self._emit(f"{word} ({test.text}) {{{about}")
        before = set(self._has)
        self._block(node.body)
        ends = [self._has] if self._live else []
        self._has, self._live = set(before), True
        if not node.orelse:
            self._emit("}")
            ends.append(self._has)
        else:
            self._else(node)
            if self._live:
                ends.append(self._has)
        self._live = bool(ends)
        self._has = set.intersection(*ends) if ends else set(before)

    def _else(self, node: ast.If) -> None:
        inner = node.orelse[0]
        if len(node.orelse) == 1 and isinstance(inner, ast.If) and self._is_elif(node, inner):
            self._comments_before(inner.lineno)
            self._if_statement(inner, "} else if")
            return
        self._emit("} else {")
        self._block(node.orelse)
        self._emit("}")

    def _is_elif(self, node: ast.If, inner: ast.If) -> bool:
        """True where nothing stands between the else and the if, also in C."""
        if inner.col_offset != node.col_offset or self._to_declare(inner):
            return False
        used, reserved = set(self._used), self._reserved
        self._reserved = []
        test = self.truth(inner.test)
        is_bare = not test.before and not self._reserved
        self._used, self._reserved = used, reserved
        return is_bare

    def _for_statement(self, node: ast.For) -> None:
        if node.orelse:
            raise self.error(node.orelse[0], "else of a for is not in the subset; use a flag")
        call = node.iter
        if _is_range(call) and "range" not in self._locals:
            self._range(node, call)  # type: ignore[arg-type]
        else:
            self._over(node)

    def _range(self, node: ast.For, call: ast.Call) -> None:
        if not isinstance(node.target, ast.Name) or call.keywords or not 1 <= len(call.args) <= 3:
            raise self.error(
                node,
                f"for ... in {ast.unparse(call)}: must be one variable in range(n), "
                "range(a, b) or range(a, b, step)",
            )
        bounds = [self.value(a) for a in call.args]
        for bound, part in zip(bounds, call.args, strict=True):
            if bound.type != WHOLE:
                raise self.error(
                    part, f"{ast.unparse(part)}: is {said(bound.type)}, must be an int"
                )
        bounds = self._held(bounds, node)
        zero, one = Value("0.0", POSTFIX, WHOLE, number=0), Value("1.0", POSTFIX, WHOLE, number=1)
        start, stop, step = {1: [zero, *bounds, one], 2: [*bounds, one], 3: bounds}[len(bounds)]
        if not step.number:
            raise self.error(node, f"{ast.unparse(call)}: the step must be a constant, and not 0")
        direct = self._direct(node)
        is_small = all(b.number is not None and abs(b.number) < 2**30 for b in (start, stop, step))
        shape = "int" if is_small and not direct else "double"
        counter = self._counter(shape, direct)
        name = node.target.id
        given = [] if direct or name not in self._reads else [(node.target, _counted(counter))]
        if direct:
            self._join(name, WHOLE, node)
            self._has.add(name)
            self._scopes[-1].add(name)
        up = step.number > 0
        size = _plain_whole(abs(int(step.number)), shape)
        by = f"{counter} {'+' if up else '-'}= {size}"
        if shape == "int" and abs(step.number) == 1:
            by = f"{'++' if up else '--'}{counter}"
        sign = "<" if up else ">"
        times = None
        if start.number is not None and stop.number is not None:
            times = len(range(int(start.number), int(stop.number), int(step.number)))
        head = f"for ({counter} = {_bound(start, shape)}; {counter} {sign} {_bound(stop, shape)}"
        self._loop(node, head, by, times, given, counter)

    def _held(self, values: list[Value], node: ast.For) -> list[Value]:
        """Values that stay what they are, whatever the body of a loop does."""
        changed = [self.cname(n) for n in _stored(node)]
        found = []
        for v in values:
            is_changed = any(_uses(v.text, n) for n in changed)
            is_kept = v.number is not None or (v.is_path and not is_changed and v.items is None)
            if not is_kept:
                v = self.apart(replace(v, is_path=False, items=None), "count")
            found.append(self._flushed(v))
        return found

    def _loop(
        self,
        node: ast.For,
        head: str,
        by: str,
        times: int | None,
        given: Sequence[tuple[ast.expr, Value]],
        counter: str,
    ) -> None:
        """A loop; times is how often, None where that is not known before."""
        before, faults = set(self._has), self.faults
        self.faults = set()
        self._loops.append(Loop([], []))
        self._counting.append(counter)
        about = self._comment_at(node.iter.end_lineno or node.lineno)
        self._next_line = max(self._next_line, (node.iter.end_lineno or node.lineno) + 1)
        line = len(self._lines)
        self._scopes.append(set())
        self._indent += 1
        for target, v in given:
            self._give(target, v, node)
        for inner in node.body:
            if self._live:
                self._statement(inner)
        self._indent -= 1
        self._scopes.pop()
        self._counting.pop()
        guard = ""
        if times is None:  # a count that a fault left without meaning may be huge
            guard = " && fault->kind == FAULT_NONE"
            self.faults.add("a fault before the loop")
        self._lines[line:line] = wrapped(f"{'    ' * self._indent}{head}{guard}; {by}) {{{about}")
        self._emit("}")
        self.faults |= faults
        loop = self._loops.pop()
        ends = [*loop.exits, *loop.rounds, *([self._has] if self._live else [])]
        ends += [] if times else [before]
        self._live = bool(ends)
        self._has = set.intersection(*ends) if ends else before

    def _counter(self, shape: str, direct: str) -> str:
        """What a loop counts with, declared where it is not yet."""
        if direct:
            self._emit(f"{shape} {self.cname(direct)};")
            return self.cname(direct)
        for name in ("i", "j", "k", "n", *(f"i_{number}" for number in range(100))):
            other = f"{name} {'double' if shape == 'int' else 'int'}"
            is_free = name not in self._used and name not in self._counting
            if is_free and not any(other in scope for scope in self._scopes):
                break
        if not any(f"{name} {shape}" in scope for scope in self._scopes):
            self._emit(f"{shape} {name};")
            self._scopes[-1].add(f"{name} {shape}")
        return name

    def _over(self, node: ast.For) -> None:
        """A loop over the items of one tuple or more, which are of one type."""
        columns = self._columns(node.iter)
        values = self._held([v for v in columns if v is not None], node)
        for v in values:
            if not isinstance(v.type, Tuple) or not self.program.is_array(v.type):
                raise self.error(
                    node,
                    f"for ... in {ast.unparse(node.iter)}: items must be of one type; "
                    "write the statements for each",
                )
        times = min(len(v.type.items) for v in values if isinstance(v.type, Tuple))
        counter = self._counter("int", "")
        rest = iter(values)
        row = [_counted(counter) if v is None else self._item(next(rest), counter) for v in columns]
        one = row[0] if len(row) == 1 and not _is_zip(node.iter) else self.display(row, node.iter)
        head = f"for ({counter} = 0; {counter} < {times}"
        self._loop(node, head, f"++{counter}", times, [(node.target, one)], counter)

    def _columns(self, node: ast.expr) -> list[Value | None]:
        """The tuples that a loop goes over; None for the number of enumerate."""
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name):
            if node.func.id == "zip" and node.args:
                named = {k.arg for k in node.keywords}
                if named <= {"strict"}:
                    return [self.value(a) for a in node.args]
            if node.func.id == "enumerate" and len(node.args) == 1 and not node.keywords:
                return [None, self.value(node.args[0])]
        return [self.value(node)]

    def _item(self, v: Value, counter: str) -> Value:
        items = v.type.items if isinstance(v.type, Tuple) else ()
        kind: Type = items[0]
        for item in items:
            kind = joined(kind, item) or kind
        return replace(
            v,
            text=f"{at(v, POSTFIX)}.at[{counter}]",
            type=kind,
            items=None,
            is_address=isinstance(kind, Group),
        )

    def _break_statement(self, node: ast.Break) -> None:
        self._loops[-1].exits.append(set(self._has))
        self._emit("break;")
        self._live = False

    def _continue_statement(self, node: ast.Continue) -> None:
        self._loops[-1].rounds.append(set(self._has))
        self._emit("continue;")
        self._live = False

    # Exceptions

    def _raise_statement(self, node: ast.Raise) -> None:
        call = node.exc
        if node.cause is not None or call is None:
            raise self.error(
                node, "raise ... from and raise alone are not in the subset; raise a new one"
            )
        inner = call.func if isinstance(call, ast.Call) else call
        found = self.found(inner)
        cls: Any = found.object if isinstance(found, Static) else None
        if not (
            isinstance(cls, type)
            and issubclass(cls, Exception)
            and cls is getattr(builtins, cls.__name__, 0)
        ):
            raise self.error(
                node,
                f"{ast.unparse(inner)}: must be an exception of Python's own, as "
                "ArithmeticError or ValueError",
            )
        if cls is KeyError:
            raise self.error(
                node, "KeyError shows its text in quotes; raise another, as ValueError"
            )
        arguments = call.args if isinstance(call, ast.Call) else []
        if len(arguments) > 1 or (isinstance(call, ast.Call) and call.keywords):
            raise self.error(node, f"{ast.unparse(call)}: must have one text")
        pieces = self._pieces(arguments[0]) if arguments else []
        said_values = [v for v, _ in pieces if isinstance(v, Value)]
        operands, joint = self.ordered([self.apart(v) if v.faults else v for v in said_values])
        self._flushed(joint)
        values = iter(operands)
        raised: Any = cls
        kind, name = _kind(raised), names.string(raised.__name__)
        self.faults.add(f"raise at line {node.lineno} of {self.source.name}")
        if all(isinstance(v, str) for v, _ in pieces):
            text = names.string("".join(v for v, _ in pieces if isinstance(v, str)))
            self._emit(f"py_fault(fault, {kind}, {name}, {text});")
        else:
            self._emit(f"if (py_raise(fault, {kind}, {name})) {{")
            self._indent += 1
            for v, how in pieces:
                self._emit(
                    f"py_say(fault, {names.string(v)});"
                    if isinstance(v, str)
                    else how.format(next(values).text)
                )
            self._indent -= 1
            self._emit("}")
        if self.returned == NOTHING:
            self._emit("return;")
        else:
            zero = self._zero(self.returned)
            shape = self.program.shape(self.returned)
            self._emit(f"return {f'({shape}){zero}' if zero.startswith('{') else zero};")
        self._live = False

    def _pieces(self, node: ast.expr) -> list[tuple[str | Value, str]]:
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            return [(node.value, "")]
        if not isinstance(node, ast.JoinedStr):
            raise self.error(node, f"{ast.unparse(node)}: must be a text, or an f-string")
        found: list[tuple[str | Value, str]] = []
        for part in node.values:
            if isinstance(part, ast.Constant):
                found.append((str(part.value), ""))
            elif isinstance(part, ast.FormattedValue):
                found.append(self._formatted(part))
        return found

    def _formatted(self, node: ast.FormattedValue) -> tuple[Value, str]:
        v = self.value(node.value)
        spec = "".join(
            str(getattr(p, "value", "?")) for p in getattr(node.format_spec, "values", [])
        )
        how = {-1: "", 114: "r", 115: "s"}.get(node.conversion, "?")
        if (
            spec
            and spec.endswith("g")
            and (spec == "g" or (spec[0] == "." and spec[1:-1].isdigit()))
        ):
            digits = 6 if spec == "g" else max(1, int(spec[1:-1]))
            if v.type in NUMBERS and not how and digits <= 17:
                return v, f"py_say_general(fault, {{0}}, {digits});"
        elif not spec and how != "?":
            if v.type == REAL:
                return v, "py_say_repr(fault, {0});"
            if v.type == WHOLE:
                return v, "py_say_whole(fault, {0});"
            if v.type == BOOLEAN:
                return replace(
                    v, text=f"{at(v, POSTFIX)}"
                ), 'py_say(fault, {0} ? "True" : "False");'
            if v.type == TEXT and how != "r":
                return v, "py_say(fault, {0});"
        elif spec == "d" and v.type == WHOLE and not how:
            return v, "py_say_whole(fault, {0});"
        shown = ast.unparse(node.value)
        raise self.error(
            node,
            f"{{{shown}}} of a {said(v.type)} in this format; must be {{{shown}}}, "
            f"{{{shown}!r}}, {{{shown}:g}} or {{{shown}:.3g}} of a number, or a .name",
        )


def _kind(cls: type[Exception]) -> str:
    if cls is ArithmeticError:
        return "FAULT_OWN"
    if issubclass(cls, ArithmeticError):
        return "FAULT_ARITHMETIC"
    return "FAULT_VALUE" if issubclass(cls, ValueError) else "FAULT_OTHER"


def _stored(node: ast.AST) -> set[str]:
    """The variables that a statement gives a value, without those of generators."""
    found: set[str] = set()
    for child in ast.iter_child_nodes(node):
        if isinstance(child, ast.comprehension | ast.GeneratorExp | ast.Lambda):
            continue
        if isinstance(child, ast.Name) and isinstance(child.ctx, ast.Store):
            found.add(child.id)
        found |= _stored(child)
    return found


def _in_order(node: ast.AST) -> list[str]:
    """The variables that a statement gives a value, in the order of the text."""
    return sorted(
        _stored(node),
        key=lambda name: min(
            (n.lineno, n.col_offset)
            for n in ast.walk(node)
            if isinstance(n, ast.Name) and n.id == name
        ),
    )


def _reads(node: ast.AST, name: str) -> int:
    return sum(
        isinstance(n, ast.Name) and n.id == name and isinstance(n.ctx, ast.Load)
        for n in ast.walk(node)
    )


def _is_range(node: ast.expr) -> bool:
    return (
        isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "range"
    )


def _is_zip(node: ast.expr) -> bool:
    return isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "zip"


def _counted(counter: str) -> Value:
    return Value(counter, POSTFIX, WHOLE, is_path=True)


def _plain_whole(n: int, shape: str) -> str:
    return str(n) if shape == "int" else names.whole(n)


def _bound(v: Value, shape: str) -> str:
    """A bound of a loop; a literal as the counter is held."""
    is_literal = v.number is not None and v.text.replace("-", "")[:1].isdigit()
    return _plain_whole(int(v.number or 0), shape) if is_literal else v.text


def _paths(definition: ast.FunctionDef) -> dict[ast.stmt, tuple[int, ...]]:
    """The blocks that each statement is in, from the outermost."""
    found: dict[ast.stmt, tuple[int, ...]] = {}
    numbers = count()

    def walk(body: Sequence[ast.stmt], at_: tuple[int, ...]) -> None:
        for node in body:
            found[node] = at_
            for part in ("body", "orelse"):
                walk(getattr(node, part, []), (*at_, next(numbers)))

    walk(definition.body, ())
    return found


def _owners(
    definition: ast.FunctionDef, paths: dict[ast.stmt, tuple[int, ...]]
) -> dict[str, tuple[int, ...]]:
    """The innermost block that has all uses of a variable."""
    found: dict[str, tuple[int, ...]] = {}

    def note(name: str, path: tuple[int, ...]) -> None:
        if name in found:
            common = [a for a, b in zip(found[name], path, strict=False) if a == b]
            path = path[: len(common)]
        found[name] = path

    def expressions(node: ast.AST, path: tuple[int, ...]) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.stmt):
                expressions(child, paths.get(child, path))
            else:
                if isinstance(child, ast.Name):
                    note(child.id, path)
                expressions(child, path)

    expressions(definition, ())
    return found


def _uses(text: str, name: str) -> bool:
    return _renamed(text, name, "") != text


def _texts(v: Value) -> list[str]:
    return [v.text, *(t.text for t in v.before)]


def _with(v: Value, name: str, to: str) -> Value:
    """A value with a variable called otherwise."""
    before = tuple(replace(t, text=_renamed(t.text, name, to)) for t in v.before)
    text, braces = _renamed(v.text, name, to), _renamed(v.braces, name, to)
    return replace(v, text=text, braces=braces, before=before)


def _renamed(text: str, name: str, to: str) -> str:
    """A text of C with a variable called otherwise; not a field of the same name."""
    if name not in text:
        return text
    return _TOKEN.sub(lambda found: to if found[0] == name else found[0], text)


_TOKEN = re.compile(r'/\*.*?\*/|"(?:\\.|[^"\\])*"|\d[\w.]*|(?:\.|->)?[^\W\d]\w*', re.DOTALL)
"""A comment, a text, a number, or a name with what makes it a field."""

_STATEMENTS: dict[type[ast.stmt], str] = {
    ast.While: "while is not in the subset, as a step must end; use for ... in range(n) with break",
    ast.FunctionDef: "a function in a function is not in the subset; define it in the module",
    ast.ClassDef: "a class in a function is not in the subset; define it in the module",
    ast.With: "with is not in the subset; a block uses nothing that is to be closed",
    ast.Try: "try is not in the subset; ask before, as with if x > 0.0",
    ast.Assert: "assert is not in the subset; write if not ...: raise ValueError(...)",
    ast.Global: "global is not in the subset; what changes belongs in the State",
    ast.Nonlocal: "nonlocal is not in the subset; what changes belongs in the State",
    ast.Delete: "del is not in the subset; leave it out",
    ast.Match: "match is not in the subset; use if and elif",
    ast.Import: "import is only for the top level of the module",
    ast.ImportFrom: "import is only for the top level of the module",
}
