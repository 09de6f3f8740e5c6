"""Functions of a block in C, statement by statement, with their docstrings and comments."""

import ast
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import is_dataclass
from functools import partial
from typing import Any, cast

from .expressions import SIGN, WORD, Expressions
from .text import comment, string, wrapped
from .types import REAL, WHOLE, Function, Program, Type, Value, in_words, is_record, size

LARGE = 30
"""A NamedTuple of more numbers goes by its address, unless the function changes it."""


class Body(Expressions):
    """The body of one function, for the types that it is called with."""

    def __init__(self, program: Program, function: Any) -> None:
        source = program.source(function.__code__.co_filename)
        super().__init__(program, source, function.__globals__)
        self.translate = partial(translated_function, program)
        self.node = source.functions[function.__code__.co_firstlineno]
        self.returns: Type | None = None
        self.by_address: tuple[bool, ...] = ()
        self.locals = {*_names(self.node, ast.Store), *(a.arg for a in self.node.args.args)}
        self._uses = Counter(_names(self.node))
        self._late: dict[str, list[str]] = {}
        """Variables that are declared at the top, as more than one block uses them, by type."""
        self._variables: dict[str, Value] = {}
        """Those of C, whether they have a value here or not."""
        self._exits: list[list[set[str]]] = []
        """What has a value where each open loop is left, or goes on."""

    def definition(self, name: str, types: Sequence[Type]) -> str:
        """The text of the function in C."""
        heads = self._heads(types, [a.arg for a in self.node.args.args])
        self.block(self.node.body)
        if not _leaves(self.node.body, ast.Return):
            self.refuse(self.node, f"{self.node.name}: must return a value on every way")
        return self._text(name, heads, self.program.c(cast(Type, self.returns), self.names))

    def _heads(self, types: Sequence[Type], names: Sequence[str]) -> list[str]:
        """The declarations in C of the arguments, which have these names there."""
        heads, arguments = [], self.node.args.args
        changed = {*_names(self.node, ast.Store)}
        for argument, kind, name in zip(arguments, types, names, strict=True):
            c_name, is_copy = self.fresh(name, is_own=True), argument.arg in changed
            large = is_record(kind) and size(kind) > LARGE and not is_copy
            self.by_address += (large,)
            text, level = (f"*{c_name}", SIGN) if large else (c_name, WORD)
            self.bound[argument.arg] = Value(text, kind, level)
            star = "const {} *{}" if is_dataclass(kind) or large else "{} {}"
            heads.append(star.format(self.program.c(kind, self.names), c_name))
        return heads

    def _text(self, name: str, heads: Sequence[str], returns: str) -> str:
        text = "\n".join(self.lines)
        late = [f"    {kind} {', '.join(names)};" for kind, names in self._late.items()]
        names = [head.split()[-1].lstrip("*") for head in heads]
        unused = [f"    (void){n};" for n in names if not re.search(rf"\b{n}\b", text)]
        docstring = ast.get_docstring(self.node)
        head = wrapped(f"static {returns} {name}({', '.join(heads) or 'void'})")
        lines = [head, "{", *map(wrapped, [*late, *unused, *self.lines]), "}", ""]
        return "\n".join([comment(docstring), *lines] if docstring else lines)

    def block(self, body: Sequence[ast.stmt], inner: bool = False) -> None:
        """The statements of a block, with the comments before and behind them."""
        if inner:
            self._inside.append(Counter(n for s in body for n in _names(s)))
        end = body[0].lineno if body else 0
        for statement in body:
            for line in range(end, statement.lineno):
                self._remark(line, alone=True)
            getattr(self, f"_on_{type(statement).__name__.lower()}", self._refuse_kind)(statement)
            self._remark(statement.lineno, alone=False)
            end = statement.lineno + 1
        if inner:
            self._inside.pop()

    def _remark(self, line: int, alone: bool) -> None:
        text, own_line = self.source.comments.get(line, ("", alone))
        if text and alone and own_line:
            self._say(comment(text))
        elif text and self.lines and not (alone or own_line):
            self.lines[-1] += f"  {comment(text)}"

    def _on_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self._value(node.value)  # what is not in the subset at all says so
            self.refuse(node, f"{ast.unparse(node)}: has no effect; leave it out")

    def _on_pass(self, node: ast.Pass) -> None:
        pass

    def _on_break(self, node: ast.Break | ast.Continue) -> None:
        self._exits[-1].append({*self.bound})
        self._say(f"{type(node).__name__.lower()};")

    _on_continue = _on_break

    def _on_return(self, node: ast.Return) -> None:
        if node.value is None:
            self.refuse(node, f"{self.node.name}: must return a value")
        value = self._value(node.value)
        self.returns = self._common(self.returns or value.type, value.type, node)
        self._say(f"return {value.text};")

    def _on_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self._assign(node.target, self._value(node.value), node)

    def _on_assign(self, node: ast.Assign) -> None:
        value = self._value(node.value)
        if len(node.targets) > 1:
            value = self.simple(value)
        for target in node.targets:
            self._assign(target, value, node)

    def _on_augassign(self, node: ast.AugAssign) -> None:
        target = node.target
        if not isinstance(target, ast.Name):
            self.refuse(node, f"{ast.unparse(target)}: must be a variable")
        read = ast.copy_location(ast.Name(target.id, ast.Load()), node)
        operation = ast.copy_location(ast.BinOp(read, node.op, node.value), node)
        self._assign(target, self._value(operation), node)

    def _assign(self, target: ast.expr, value: Value, node: ast.AST) -> None:
        pairs = [(name, v) for name, v in self._pairs(target, value) if name != "_"]
        for i, (name, _) in enumerate(pairs):
            old = self.bound.get(name)
            for j in range(i + 1, len(pairs)):
                later, v = pairs[j]
                if old and re.search(rf"(?<![\w.]){old.text}\b", v.text.replace("->", ".")):
                    pairs[j] = later, self._copied(v, f"new_{later}")
        for name, v in pairs:
            self._store(name, v, node)

    def _store(self, name: str, value: Value, node: ast.AST) -> None:
        if value.text == "" or is_dataclass(value.type):  # parameters stay where they are
            self.bound[name] = value
            return
        old = self._variables.get(name) or self.bound.get(name)
        if old and value.type not in (old.type, WHOLE if old.type == REAL else old.type):
            kinds = f"{in_words(old.type)}, then {in_words(value.type)}"
            self.refuse(node, f"{name} is {kinds}; use another name, or write 0.0 for 0")
        stored = old or Value(self.fresh(name, is_own=True), value.type)
        self.bound[name] = self._variables[name] = stored
        begin, kind = "", self.program.c(value.type, self.names)
        if not old and self._inside and self._inside[-1][name] < self._uses[name]:
            # Other blocks use it, too. A compiler does not see that a loop runs: see _go_on()
            start = {"double": " = 0.0", "int": " = 0"}.get(kind, " = {0}")
            self._late.setdefault(kind, []).append(
                f"{stored.text}{start}" if self._exits else stored.text
            )
        elif not old:
            begin = f"{kind} "
        self._say(f"{begin}{stored.text} = {value.text};")

    def _on_if(self, node: ast.If) -> None:
        branches, otherwise = [(self._condition(node.test).text, node.body)], node.orelse
        while len(otherwise) == 1 and isinstance(otherwise[0], ast.If):
            branches.append((self._condition(otherwise[0].test).text, otherwise[0].body))
            otherwise = otherwise[0].orelse
        bound, exits = dict(self.bound), [] if otherwise else [{*self.bound}]
        for i, (test, body) in enumerate([*branches, *([("", otherwise)] if otherwise else [])]):
            head = f"if ({test}) {{" if test else "{"
            self._say(f"}} else {head}" if i else head)
            self.bound = dict(bound)
            self.block(body, inner=True)
            if not _leaves(body):
                exits.append({*self.bound})
        self._say("}")
        self._go_on(bound, exits)

    def _go_on(self, bound: dict[str, Value], exits: list[set[str]]) -> None:
        """Go on with what has a value on all ways."""
        everywhere = set[str].intersection(*exits) if exits else set()
        self.bound = {n: self._variables[n] for n in everywhere if n in self._variables} | bound

    def _on_for(self, node: ast.For) -> None:
        call, name = node.iter, ast.unparse(node.target)
        changed = {n for s in node.body for n in _names(s, ast.Store)}
        is_range = isinstance(call, ast.Call) and self.named_object(call.func) is range
        if node.orelse or {*_names(node.target)} & changed - {"_"}:
            self.refuse(node, f"{name}: must not be changed in its loop, which has no else")
        if not isinstance(call, ast.Call) or not is_range:
            self._on_each(node, changed)
            return
        if not isinstance(node.target, ast.Name) or not 1 <= len(call.args) <= 2:
            must = "must be range(n) or range(first, n); for a step of 2 write 2 * k in the loop"
            self.refuse(node, f"{ast.unparse(call)}: {must}")
        if name in self.bound and name != "_":
            self.refuse(node, f"{name}: is a variable already; use another name")
        first, last = (["0"] + [self._number(a).text for a in call.args])[-2:]
        if changed & {*_names(call)} or not re.fullmatch(r"[\w.>-]+", last):
            last = self._copied(Value(last, WHOLE), "count").text
        counter = self.fresh("i" if name == "_" else name)
        constant = isinstance(call.args[-1], ast.Constant) and name == "_"
        self._late.setdefault("int" if constant else "double", []).append(counter)
        bound = dict(self.bound)
        if name != "_":
            self.bound[name] = Value(counter, WHOLE)
        last = last.removesuffix(".0") if constant else last
        self._say(f"for ({counter} = {first}; {counter} < {last}; {counter}++) {{")
        self._exits.append([])
        self.block(node.body, inner=True)
        self._say("}")
        exits = self._exits.pop() + ([] if _leaves(node.body) else [{*self.bound} - {name}])
        count = call.args[0]
        fixed = count.value if isinstance(count, ast.Constant) else self.named_object(count)
        runs = len(call.args) == 1 and isinstance(fixed, int) and fixed > 0
        self._go_on(bound, exits if runs and exits else [{*bound}])

    def _on_each(self, node: ast.For, changed: set[str]) -> None:
        """A loop over a tuple, or zip() of tuples, item by item."""
        inner = [n for s in node.body for n in ast.walk(s)]
        if any(isinstance(n, ast.Break | ast.Continue) for n in inner):
            self.refuse(node, "break and continue are only for a loop over range(n)")
        if changed & {*_names(node.iter)}:
            self.refuse(node, f"{ast.unparse(node.iter)}: must not be changed in its loop")
        for row in self._rows(node.iter):
            self._bind(node.target, row)
            self.block(node.body)


class Check(Body):
    """A function that raises ValueError, of parameters and inputs, as one that says why."""

    def definition(self, name: str, types: Sequence[Type]) -> str:
        """The text of the function in C; "" where it checks nothing but ranges."""
        heads = self._heads(types, "pu"[: len(types)])
        self.block(self.node.body)
        if not any("text_put(" in line for line in self.lines):
            return ""
        self._say("return 1;")
        return self._text(name, [*heads, "Text *why"], "int")

    def _on_expr(self, node: ast.Expr) -> None:
        """Ranges are checked from the declaration; those of a base class are there already."""
        call = node.value
        if isinstance(call, ast.Constant):
            return
        function = self.named_object(call.func) if isinstance(call, ast.Call) else None
        if getattr(function, "__name__", "") not in ("check", "__post_init__"):
            self.refuse(node, f"{ast.unparse(node)}: has no effect; leave it out")

    def _on_return(self, node: ast.Return) -> None:
        self._say("return 1;")

    def _on_raise(self, node: ast.Raise) -> None:
        reason = node.exc.args[0] if isinstance(node.exc, ast.Call) and node.exc.args else None
        parts = reason.values if isinstance(reason, ast.JoinedStr) else [reason]
        for part in parts:
            if isinstance(part, ast.Constant):
                self._say(f"text_put(why, {string(str(part.value))});")
            elif isinstance(part, ast.FormattedValue):
                self._put(part)
            else:
                self.refuse(node, 'raise: must be ValueError("..."), or of an f-string')
        self._say("return 0;")

    def _put(self, part: ast.FormattedValue) -> None:
        value, spec = self._number(part.value).text, part.format_spec
        text = ast.literal_eval(spec.values[0]) if isinstance(spec, ast.JoinedStr) else ""
        digits = re.fullmatch(r"(?:\.(\d+))?g", text)
        if text and not digits:
            self.refuse(part, f"{{...:{text}}}: must be {{x}}, {{x!r}}, {{x:g}} or {{x:.3g}}")
        call = f"general(why, {value}, {digits[1] or 6})" if digits else f"number(why, {value})"
        self._say(f"text_{call};")


def translated_function(program: Program, function: Any, types: Sequence[Type]) -> Function:
    """The function in C for arguments of these types, translated when it is first asked for."""
    key = function.__code__, tuple(types)
    if key not in program.functions:
        program.functions[key] = None
        body = Body(program, function)
        name = program.unique(function.__module__, function.__qualname__, key)
        text = body.definition(name, types)
        program.functions[key] = Function(name, cast(Type, body.returns), body.by_address)
        program.bodies.append(text)
    if translated := program.functions[key]:
        return translated
    source = program.source(key[0].co_filename)
    reason = f"{function.__name__}: calls itself; use a loop"
    raise source.error(key[0].co_firstlineno, reason)


def _leaves(body: Sequence[ast.stmt], *by: type[ast.stmt]) -> bool:
    """Return True if nothing comes after a block; `by` says what may leave it, if not anything."""
    last = body[-1] if body else None
    if isinstance(last, ast.If):
        return _leaves(last.body, *by) and _leaves(last.orelse, *by)
    return isinstance(last, by or (ast.Return, ast.Break, ast.Continue, ast.Raise))


def _names(node: ast.AST, context: type[ast.expr_context] = ast.expr_context) -> list[str]:
    nodes = (n for n in ast.walk(node) if isinstance(n, ast.Name))
    return [n.id for n in nodes if isinstance(n.ctx, context)]
