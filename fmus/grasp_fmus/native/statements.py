"""Functions of a block in C, statement by statement, with their docstrings and comments."""

import ast
import re
from collections import Counter
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, cast

from .expressions import SIGN, WORD, Expressions
from .text import comment, string, wrapped
from .types import REAL, WHOLE, Function, Group, Program, Record, Type, Value, said, size

ADVICE = {
    "While": "while is not in the subset, as a step must end; use for ... in range(n) with break",
    "FunctionDef": "a function in a function is not in the subset; put it into the module",
    "Try": "try is not in the subset; ask before",
    "Global": "global is not in the subset; what is to be kept belongs into State",
    "Match": "match is not in the subset; use if and elif",
    "Raise": "raise is only for __post_init__; a step whose outputs are not finite is refused",
    "ImportFrom": "import in a function is not in the subset; put it at the top of the module",
}

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
        self._inside: list[Counter[str]] = []
        """How often names are in the statements of the blocks that are open."""
        self._late: dict[str, list[str]] = {}
        """Variables that are declared at the top, as more than one block uses them, by type."""
        self._variables: dict[str, Value] = {}
        """Those of C, whether they have a value here or not."""
        self._exits: list[list[set[str]]] = []
        """What has a value where each open loop is left, or goes on."""

    def definition(self, name: str, types: Sequence[Type]) -> str:
        """The text of the function in C."""
        heads, given = [], self.node.args
        changed = {*_names(self.node, ast.Store)}
        for argument, kind in zip(given.args, types, strict=True):
            c_name, is_copy = self.fresh(argument.arg, own=True), argument.arg in changed
            large = isinstance(kind, Record) and size(kind) > LARGE and not is_copy
            self.by_address += (large,)
            text, level = (f"*{c_name}", SIGN) if large else (c_name, WORD)
            self.bound[argument.arg] = Value(text, kind, level)
            star = "const {} *{}" if isinstance(kind, Group) or large else "{} {}"
            heads.append(star.format(self.program.c(kind, self.names), c_name))
        self.block(self.node.body)
        if not _leaves(self.node.body, ast.Return):
            self.refuse(self.node, f"{self.node.name}: must return a value on every way")
        return self._text(name, heads, self.program.c(cast(Type, self.returns), self.names))

    def _text(self, name: str, heads: Sequence[str], returns: str) -> str:
        text = "\n".join(self.lines)
        late = [f"    {kind} {', '.join(names)};" for kind, names in self._late.items()]
        names = [head.split()[-1].lstrip("*") for head in heads]
        unused = [f"    (void){n};" for n in names if not re.search(rf"\b{n}\b", text)]
        said = ast.get_docstring(self.node)
        head = wrapped(f"static {returns} {name}({', '.join(heads) or 'void'})")
        lines = [head, "{", *map(wrapped, [*late, *unused, *self.lines]), "}", ""]
        return "\n".join([comment(said), *lines] if said else lines)

    def block(self, body: Sequence[ast.stmt], inner: bool = False) -> None:
        """The statements of a block, with the comments before and behind them."""
        if inner:
            self.indent += 1
            self._inside.append(Counter(n for s in body for n in _names(s)))
        end = body[0].lineno if body else 0
        for statement in body:
            for line in range(end, statement.lineno):
                self._remark(line, alone=True)
            self.statement(statement)
            self._remark(statement.lineno, alone=False)
            end = statement.lineno + 1
        if inner:
            self.indent -= 1
            self._inside.pop()

    def _remark(self, line: int, alone: bool) -> None:
        text, own_line = self.source.comments.get(line, ("", alone))
        if text and alone and own_line:
            self.say(comment(text))
        elif text and self.lines and not (alone or own_line):
            self.lines[-1] += f"  {comment(text)}"

    def statement(self, node: ast.stmt) -> None:
        """One statement."""
        kind = type(node).__name__
        translate: Callable[[Any], None] | None = getattr(self, f"_on_{kind.lower()}", None)
        if translate is None:
            self.refuse(node, ADVICE.get(kind, f"{kind.lower()} is not in the subset"))
        translate(node)

    def _on_expr(self, node: ast.Expr) -> None:
        if not isinstance(node.value, ast.Constant):
            self.refuse(node, f"{ast.unparse(node)}: has no effect; leave it out")

    def _on_pass(self, node: ast.Pass) -> None:
        pass

    def _on_break(self, node: ast.Break | ast.Continue) -> None:
        self._exits[-1].append({*self.bound})
        self.say(f"{type(node).__name__.lower()};")

    _on_continue = _on_break

    def _on_return(self, node: ast.Return) -> None:
        if node.value is None:
            self.refuse(node, f"{self.node.name}: must return a value")
        value = self.value(node.value)
        self.returns = self.common(self.returns or value.type, value.type, node)
        self.say(f"return {value.text};")

    def _on_annassign(self, node: ast.AnnAssign) -> None:
        if node.value is not None:
            self.assign(node.target, self.value(node.value), node)

    def _on_assign(self, node: ast.Assign) -> None:
        value = self.value(node.value)
        if len(node.targets) > 1:
            value = self.simple(value)
        for target in node.targets:
            self.assign(target, value, node)

    def _on_augassign(self, node: ast.AugAssign) -> None:
        target = node.target
        if not isinstance(target, ast.Name):
            self.refuse(node, f"{ast.unparse(target)}: must be a variable")
        read = ast.copy_location(ast.Name(target.id, ast.Load()), node)
        operation = ast.copy_location(ast.BinOp(read, node.op, node.value), node)
        self.assign(target, self.value(operation), node)

    def assign(self, target: ast.expr, value: Value, node: ast.AST) -> None:
        """Give a value to a variable, or its items to several."""
        pairs = [(name, v) for name, v in self._pairs(target, value) if name != "_"]
        for i, (name, _) in enumerate(pairs):
            old = self.bound.get(name)
            for j in range(i + 1, len(pairs)):
                later, v = pairs[j]
                if old and re.search(rf"(?<![\w.]){old.text}\b", v.text.replace("->", ".")):
                    pairs[j] = later, self.copied(v, f"new_{later}")
        for name, v in pairs:
            self._store(name, v, node)

    def _pairs(self, target: ast.expr, value: Value) -> list[tuple[str, Value]]:
        if isinstance(target, ast.Name):
            return [(target.id, value)]
        if not isinstance(target, ast.Tuple):
            self.refuse(target, f"{ast.unparse(target)}: must be a variable, or several")
        items = self.items(value, target)
        if len(items) != len(target.elts):
            self.refuse(target, f"{ast.unparse(target)}: there are {len(items)} items")
        return [pair for t, v in zip(target.elts, items, strict=True) for pair in self._pairs(t, v)]

    def _store(self, name: str, value: Value, node: ast.AST) -> None:
        if value.text == "" or isinstance(value.type, Group):  # parameters stay where they are
            self.bound[name] = value
            return
        old = self._variables.get(name) or self.bound.get(name)
        if old is None:
            self._declare(name, value)
            return
        if value.type not in (old.type, WHOLE if old.type == REAL else old.type):
            kinds = f"{said(old.type)}, then {said(value.type)}"
            self.refuse(node, f"{name} is {kinds}; use another name, or write 0.0 for 0")
        self.bound[name] = self._variables[name] = old
        self.say(f"{old.text} = {value.text};")

    def _declare(self, name: str, value: Value) -> None:
        """Declare a variable where it is first used, or at the top, where other blocks use it."""
        c_name, kind = self.fresh(name, own=True), self.program.c(value.type, self.names)
        self.bound[name] = self._variables[name] = Value(c_name, value.type)
        if self._inside and self._inside[-1][name] < self._uses[name]:
            # A compiler does not see that a loop runs, which _go_on() has made sure of
            start = {"double": " = 0.0", "int": " = 0"}.get(kind, " = {0}")
            self._late.setdefault(kind, []).append(c_name + start * bool(self._exits))
            self.say(f"{c_name} = {value.text};")
        else:
            self.say(f"{kind} {c_name} = {value.text};")

    def _on_if(self, node: ast.If) -> None:
        branches, rest = [(self.condition(node.test).text, node.body)], node.orelse
        while len(rest) == 1 and isinstance(rest[0], ast.If):
            branches.append((self.condition(rest[0].test).text, rest[0].body))
            rest = rest[0].orelse
        before, after = dict(self.bound), [] if rest else [{*self.bound}]
        for i, (test, body) in enumerate([*branches, *([("", rest)] if rest else [])]):
            head = f"if ({test}) {{" if test else "{"
            self.say(f"}} else {head}" if i else head)
            self.bound = dict(before)
            self.block(body, inner=True)
            after += [] if _leaves(body) else [{*self.bound}]
        self.say("}")
        self._go_on(before, after)

    def _go_on(self, before: dict[str, Value], ways: list[set[str]]) -> None:
        """Go on with what has a value on all ways."""
        everywhere = set[str].intersection(*ways) if ways else set()
        self.bound = {n: self._variables[n] for n in everywhere if n in self._variables} | before

    def _on_for(self, node: ast.For) -> None:
        call, name = node.iter, ast.unparse(node.target)
        changed = {n for s in node.body for n in _names(s, ast.Store)}
        is_range = isinstance(call, ast.Call) and self.known(call.func) is range
        if node.orelse or {*_names(node.target)} & changed - {"_"}:
            self.refuse(node, f"{name}: must not be changed in its loop, which has no else")
        if not isinstance(call, ast.Call) or not is_range:
            self._on_each(node, changed)
            return
        if not isinstance(node.target, ast.Name) or not 1 <= len(call.args) <= 2:
            self.refuse(node, f"{ast.unparse(call)}: must be range(n) or range(first, n)")
        if name in self.bound and name != "_":
            self.refuse(node, f"{name}: is a variable already; use another name")
        first, last = (["0"] + [self.number(a).text for a in call.args])[-2:]
        if changed & {*_names(call)} or not re.fullmatch(r"[\w.>-]+", last):
            last = self.copied(Value(last, WHOLE), "count").text
        counter = self.fresh("i" if name == "_" else name)
        constant = isinstance(call.args[-1], ast.Constant) and name == "_"
        self._late.setdefault("int" if constant else "double", []).append(counter)
        before = dict(self.bound)
        if name != "_":
            self.bound[name] = Value(counter, WHOLE)
        last = last.removesuffix(".0") if constant else last
        self.say(f"for ({counter} = {first}; {counter} < {last}; {counter}++) {{")
        self._exits.append([])
        self.block(node.body, inner=True)
        self.say("}")
        ways = self._exits.pop() + ([] if _leaves(node.body) else [{*self.bound} - {name}])
        runs = len(call.args) == 1 and self._fixed(call.args[0]) > 0
        self._go_on(before, ways if runs and ways else [{*before}])

    def _fixed(self, node: ast.expr) -> int:
        found = node.value if isinstance(node, ast.Constant) else self.known(node)
        return found if isinstance(found, int) else 0

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
    """A __post_init__ as a function that says why parameters do not go together."""

    def definition(self, name: str, types: Sequence[Type]) -> str:
        """The text of the function in C; "" where it checks nothing but ranges."""
        self.bound[self.node.args.args[0].arg] = Value("p", types[0])
        self.block(self.node.body)
        if not any("text_put(" in line for line in self.lines):
            return ""
        self.say("return 1;")
        heads = [f"const {self.program.c(types[0], self.names)} *p", "Text *why"]
        return self._text(name, heads, "int")

    def _on_expr(self, node: ast.Expr) -> None:
        """Ranges are checked from the declaration; those of a base class are there already."""
        call = node.value
        if isinstance(call, ast.Constant):
            return
        function = self.known(call.func) if isinstance(call, ast.Call) else None
        if getattr(function, "__name__", "") not in ("check", "__post_init__"):
            self.refuse(node, f"{ast.unparse(node)}: has no effect; leave it out")

    def _on_return(self, node: ast.Return) -> None:
        self.say("return 1;")

    def _on_raise(self, node: ast.Raise) -> None:
        reason = node.exc.args[0] if isinstance(node.exc, ast.Call) and node.exc.args else None
        parts = reason.values if isinstance(reason, ast.JoinedStr) else [reason]
        for part in parts:
            if isinstance(part, ast.Constant):
                self.say(f"text_put(why, {string(str(part.value))});")
            elif isinstance(part, ast.FormattedValue):
                self._put(part)
            else:
                self.refuse(node, 'raise: must be ValueError("..."), or of an f-string')
        self.say("return 0;")

    def _put(self, part: ast.FormattedValue) -> None:
        value, spec = self.number(part.value).text, ""
        if isinstance(part.format_spec, ast.JoinedStr):
            spec = ast.literal_eval(part.format_spec.values[0])
        digits = re.fullmatch(r"(?:\.(\d+))?g", spec)
        if digits:
            self.say(f"text_general(why, {value}, {digits[1] or 6});")
        elif not spec:
            self.say(f"text_number(why, {value});")
        else:
            self.refuse(part, f"{{...:{spec}}}: must be {{x}}, {{x!r}}, {{x:g}} or {{x:.3g}}")


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
    if made := program.functions[key]:
        return made
    where = program.source(key[0].co_filename)
    reason = f"{function.__name__}: calls itself; use a loop"
    raise where.error(key[0].co_firstlineno, reason)


def _leaves(body: Sequence[ast.stmt], *by: type[ast.stmt]) -> bool:
    """Return True if nothing comes after a block; `by` says what may leave it, if not anything."""
    last = body[-1] if body else None
    if isinstance(last, ast.If):
        return _leaves(last.body, *by) and _leaves(last.orelse, *by)
    return isinstance(last, by or (ast.Return, ast.Break, ast.Continue, ast.Raise))


def _names(node: ast.AST, context: type[ast.expr_context] = ast.expr_context) -> list[str]:
    found = (n for n in ast.walk(node) if isinstance(n, ast.Name))
    return [n.id for n in found if isinstance(n.ctx, context)]
