# ruff: noqa: E501, S101
# mypy: disable-error-code="union-attr, arg-type, attr-defined, str-bytes-safe"
"""Statements and functions of a block in C, one for one."""

import ast
import inspect
import re
from collections.abc import Iterator, Sequence
from types import FunctionType

from .expressions import OR, SUM, Expressions, as_int, fixed
from .structs import Function, Program
from .text import Source, ascii_text, comment, identifier, string, wrapped
from .types import BOOLEAN, NUMBERS, REAL, TEXT, WHOLE, Group, Tuple, Type, Value, joined, said

ADVICE = {
    "While": "while is not in the subset, as a step must end; use for ... in range(n) with break",
    "Try": "try is not in the subset; ask before",
    "With": "with is not in the subset",
    "Assert": "assert is not in the subset; a check belongs in __post_init__, with raise ValueError",
    "Global": "global is not in the subset; what changes belongs in the State",
    "FunctionDef": "a function in a function is not in the subset; use one of the module",
    "ClassDef": "a class in a function is not in the subset; use one of the module",
    "Import": "import is only for the top level of the module",
    "ImportFrom": "import is only for the top level of the module",
    "Match": "match is not in the subset; use if and elif",
    "Delete": "del is not in the subset; leave it out",
    "Raise": "raise is only for __post_init__; a step returns numbers, nan where there is none",
}
_SYMBOLS = {ast.Add: "+=", ast.Sub: "-=", ast.Mult: "*=", ast.Div: "/="}


def function(program: Program, made_from: FunctionType, arguments: Sequence[Value]) -> Function:
    """The function in C for arguments of these types; made where it is not there yet."""
    types = tuple(v.type for v in arguments)
    key = made_from, types
    source = program.source(made_from.__globals__)
    assert source
    node = source.functions.get(made_from.__code__.co_firstlineno)
    if node is None:
        raise source.error(
            made_from.__code__.co_firstlineno, f"{made_from.__name__}: must be a def"
        )
    if program.functions.get(key, made_from) is None:
        raise source.error(node.lineno, f"{node.name}: calls itself; use a loop")
    if key not in program.functions:
        program.functions[key] = None
        name = program.function_name(source, made_from, key)
        program.functions[key] = _Body(program, source, node, types).function(name)
    made = program.functions[key]
    assert made
    return made


class _Body(Expressions):
    """A function of the block, for arguments of certain types."""

    def __init__(
        self, program: Program, source: Source, node: ast.FunctionDef, types: Sequence[Type]
    ) -> None:
        super().__init__(program, source)
        self.node = node
        a = node.args
        self.parameters = [arg.arg for arg in [*a.posonlyargs, *a.args, *a.kwonlyargs]]
        names = [n for n in ast.walk(node) if isinstance(n, ast.Name)]
        self.loaded = {n.id for n in names if isinstance(n.ctx, ast.Load)}
        stored = {n.id for n in names if isinstance(n.ctx, ast.Store)}
        in_generators = {
            n.id
            for made in ast.walk(node)
            if isinstance(made, ast.comprehension)
            for n in ast.walk(made.target)
            if isinstance(n, ast.Name)
        }
        plain = {n for s in ast.walk(node) for n in _assigned(s)}
        self.locals = {*self.parameters, *(stored - in_generators), *plain}
        self.types: dict[str, Type] = dict(zip(self.parameters, types, strict=True))
        self.c_names: dict[str, str] = {}
        for name, kind in self.types.items():
            self.bound[name] = Value(self.c_name(name), kind)
        self.returns: Type | None = None
        self.declared: dict[ast.stmt, list[str]] = {}
        self.of_loops: dict[ast.stmt, set[str]] = {}
        self._declarations(node.body, set(self.parameters))
        self.open: set[str] = set()
        """Variables to declare with their first value."""
        self.exits: list[list[set[str]]] = []
        """Variables with a value where each loop is left, or goes on."""
        self.said: set[int] = set()

    def called(self, made: FunctionType, arguments: Sequence[Value], node: ast.AST) -> Function:
        """The function in C for these arguments."""
        return function(self.program, made, arguments)

    def c_name(self, name: str) -> str:
        """What C calls a variable."""
        if name not in self.c_names:
            self.c_names[name] = (
                self.fresh(identifier(name))
                if identifier(name) not in (self.c_names.values())
                else self.fresh(f"{identifier(name)}_")
            )
        return self.c_names[name]

    def fresh(self, name: str) -> str:
        """A name that no variable of the function has."""
        if name in self.locals and name not in self._used:
            self._used.add(name)
            return name
        return super().fresh(name)

    # Where variables are declared: in the innermost block that has all that is said of them

    def _declarations(self, body: list[ast.stmt], known: set[str]) -> None:
        mentioned = {s: _names(s) for s in body}
        for name in sorted(set().union(*mentioned.values()) & self.locals - known):
            users = [s for s in body if name in mentioned[s]]
            if all(name in _targets(s) and name not in _names(*_heads(s)) for s in users):
                for loop in users:
                    self.of_loops.setdefault(loop, set()).add(name)
                continue
            inside = [b for b in _blocks(users[0]) if name in _names(*b)]
            if (
                len(users) > 1
                or len(inside) != 1
                or name in _targets(users[0]) | _names(*_heads(users[0]))
            ):
                self.declared.setdefault(users[0], []).append(name)
                known = known | {name}
        for statement in body:
            for block in _blocks(statement):
                self._declarations(block, known | self.of_loops.get(statement, set()))

    # Functions

    def function(self, name: str) -> Function:
        """Make the function, and what it calls before it."""
        ended = self.block(self.node.body)
        if self.returns is None or not ended:
            raise self.error(self.node, f"{self.node.name}: must return a value on every way")
        self.finish(f"{self.c(self.returns)}", name)
        return Function(name, self.returns)

    def finish(self, returns: str, name: str, more: str = "") -> None:
        """Put the function together."""
        parameters = [self.parameter(p) for p in self.parameters]
        body = "\n".join(wrapped(line) if "/*" not in line[:12] else line for line in self.lines)
        unused = [p for p in self.parameters if not re.search(rf"\b{self.c_names[p]}\b", body)]
        quiet = "".join(f"    (void){self.c_names[p]};\n" for p in unused)
        head = wrapped(
            f"static {returns} {name}({', '.join(parameters)}{more})".replace("()", "(void)")
        )
        doc = comment(ast.get_docstring(self.node))
        self.program.bodies.append(f"{doc}{head}\n{{\n{quiet}{body}\n}}\n")

    def parameter(self, name: str) -> str:
        """A parameter in the head of the function."""
        return self.declaration(self.types[name], self.c_names[name])

    def declaration(self, kind: Type, name: str) -> str:
        """The declaration of a variable; parameters of the block are passed by address."""
        plain = self.c(kind)
        return f"const {plain} *{name}" if isinstance(kind, Group) else f"{plain} {name}"

    # Statements

    def block(self, body: list[ast.stmt]) -> bool:
        """Statements in their order; True if none can follow."""
        for i, statement in enumerate(body):
            if isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant):
                continue
            if isinstance(statement, ast.Pass):
                continue
            self.remarks(statement, body[i - 1] if i else None)
            for name in self.declared.get(statement, []):
                self.open.add(name)
            at = len(self.lines)
            kind = type(statement).__name__
            make = getattr(self, f"_{kind.lower()}_statement", None)
            if make is None:
                raise self.error(
                    statement, ADVICE.get(kind, f"{kind.lower()} is not in the subset")
                )
            ended = make(statement)
            self.remark(statement, at)
            if ended:
                return True
        return False

    def remarks(self, statement: ast.stmt, before: ast.stmt | None) -> None:
        """The comments between two statements."""
        start = (before.end_lineno if before else None) or self._head_line(statement)
        for line in range(start + 1, statement.lineno):
            if line in self.source.comments and line not in self.said:
                self.said.add(line)
                self.say(f"/* {ascii_text(self.source.comments[line])} */")

    def _head_line(self, statement: ast.stmt) -> int:
        line = statement.lineno - 1
        while line in self.source.comments and self.source.lines[line - 1].lstrip().startswith("#"):
            line -= 1
        return line

    def remark(self, statement: ast.stmt, at: int) -> None:
        """The comment at the end of a statement, or of its head."""
        inner = _blocks(statement)
        end = inner[0][0].lineno if inner else (statement.end_lineno or 0) + 1
        for line in range(statement.lineno, end):
            if line in self.source.comments and line not in self.said and at < len(self.lines):
                self.said.add(line)
                self.lines[at] += f" /* {ascii_text(self.source.comments[line])} */"

    def _return_statement(self, node: ast.Return) -> bool:
        if node.value is None:
            raise self.error(node, "return: must be with a value")
        value = self.value(node.value)
        kind = joined(self.returns or value.type, value.type)
        if kind is None:
            raise self.error(
                node, f"returns {said(value.type)} here, {said(self.returns or kind)} before"
            )
        self.returns = kind
        self.say(f"return {self.text(value)};")
        return True

    def _break_statement(self, node: ast.Break) -> bool:
        self.exits[-1].append({*self.bound})
        self.say("break;")
        return True

    def _continue_statement(self, node: ast.Continue) -> bool:
        self.exits[-1].append({*self.bound})
        self.say("continue;")
        return True

    def _expr_statement(self, node: ast.Expr) -> bool:
        self.value(node.value)
        raise self.error(node, "has no effect; leave it out")

    def _annassign_statement(self, node: ast.AnnAssign) -> bool:
        if node.value:
            value = self.value(node.value)
            if ast.unparse(node.annotation) == "float" and value.type != REAL:
                raise self.error(
                    node, f"is {said(value.type)}: must be float, as declared; write 0.0 for 0"
                )
            self.assign(node.target, value, node)
        return False

    def _assign_statement(self, node: ast.Assign) -> bool:
        if len(node.targets) == 1:
            self.assign(node.targets[0], self.value(node.value), node)
            return False
        value = self.simple(self.value(node.value))
        for target in node.targets:
            self.assign(target, value, node)
        return False

    def _augassign_statement(self, node: ast.AugAssign) -> bool:
        if not isinstance(node.target, ast.Name):
            raise self.error(node, "only variables are assigned to")
        load = ast.copy_location(ast.Name(node.target.id, ast.Load()), node)
        old, symbol = self.value(load), _SYMBOLS.get(type(node.op))
        if symbol and old.type in NUMBERS and old.type != WHOLE:
            self.say(f"{old.text} {symbol} {self.text(self.number(node.value))};")
        else:
            whole = ast.copy_location(ast.BinOp(load, node.op, node.value), node)
            self.assign(node.target, self.value(whole), node)
        return False

    # Assignment

    def assign(self, target: ast.expr, value: Value, node: ast.AST) -> None:
        """Give a variable its value, or several the items of a tuple, all at once."""
        if isinstance(target, ast.Name):
            self.store([(target.id, value)], node)
            return
        if not isinstance(target, ast.Tuple):
            raise self.error(node, "only variables are assigned to")
        pairs = list(self._pairs(target, value))
        stored = {self.c_name(name) for name, _ in pairs}
        for i, (name, item) in enumerate(pairs):
            words = set(re.findall(r"(?<![.>])\b[A-Za-z_]\w*", self.initial(item)))
            if words & {self.c_name(n) for n, _ in pairs[:i]} and words & stored:
                pairs[i] = name, self._copied(item, name)
        self.store(pairs, node)

    def _copied(self, value: Value, name: str) -> Value:
        new = self.fresh(f"new_{identifier(name)}")
        self.say(f"{self.declaration(value.type, new)} = {self.initial(value)};")
        return Value(new, value.type)

    def _pairs(self, target: ast.expr, value: Value) -> Iterator[tuple[str, Value]]:
        if isinstance(target, ast.Name):
            if target.id in self.loaded:
                yield target.id, value
        elif isinstance(target, ast.Tuple):
            for part, item in zip(target.elts, self.unpacked(target, value), strict=True):
                yield from self._pairs(part, item)
        else:
            raise self.error(target, "only variables are assigned to")

    def store(self, pairs: Sequence[tuple[str, Value]], node: ast.AST) -> None:
        """Assign to variables; those that are new are declared, together where they are alike."""
        run: list[str] = []
        for name, value in pairs:
            if name not in self.loaded:
                continue
            if isinstance(value.type, Tuple) and any(
                isinstance(i, Group) for i in value.type.items
            ):
                self.bound[name] = value  # addresses: only as what they stand for
                continue
            kind = self.types.setdefault(name, value.type)
            if kind != value.type and not (kind == REAL and value.type in NUMBERS):
                was, now = said(kind), said(value.type)
                raise self.error(
                    node, f"{name}: is {was}, here {now}; must stay of one type: use another name"
                )
            new, c_name = name in self.open, self.c_name(name)
            self.bound[name] = Value(c_name, kind)
            text = self.initial(value) if new else self.text(value)
            if not new:
                self.say(f"{c_name} = {text};")
                run = []
                continue
            self.open.discard(name)
            declaration = self.declaration(kind, c_name)
            alike = run and run[0] == self.c(kind) and not isinstance(kind, Group)
            line = f"{self.lines[-1][:-1]}, {c_name} = {text};" if alike else ""
            if line and len(line) <= 100:
                self.lines[-1] = line
            else:
                self.say(f"{declaration} = {text};")
                run = [self.c(kind)]

    # Branches and loops

    def _if_statement(self, node: ast.If) -> bool:
        tests, blocks, otherwise = [node.test], [node.body], node.orelse
        while len(otherwise) == 1 and isinstance(otherwise[0], ast.If):
            tests.append(otherwise[0].test)
            blocks.append(otherwise[0].body)
            otherwise = otherwise[0].orelse
        conditions = [self.text(self.condition(test)) for test in tests]
        at, waiting = len(self.lines), self._waiting()
        before, after = dict(self.bound), []
        for i, block in enumerate([*blocks, *([otherwise] if otherwise else [])]):
            head = f"if ({conditions[i]}) {{" if i < len(conditions) else "{"
            self.say(f"}} else {head}" if i else head)
            self.bound = dict(before)
            after.append(self._inner(block))
        self.say("}")
        self._declare(waiting, at)
        if not otherwise:
            after.append(set(before))
        return self._merge(before, [names for names in after if names is not None])

    def _waiting(self) -> set[str]:
        """Variables that are declared before a statement that may give them a value."""
        waiting = set(self.open)
        self.open = set()
        return waiting

    def _declare(self, waiting: set[str], at: int) -> None:
        """Declare them, at a place in the lines."""
        kinds: dict[str, list[str]] = {}
        for name in sorted(waiting & self.types.keys() & self.loaded):
            kinds.setdefault(self.c(self.types[name]), []).append(self.c_name(name))
        lines = [
            f"{'    ' * self.indent}{kind} {', '.join(names)};" for kind, names in kinds.items()
        ]
        self.lines[at:at] = lines

    def _inner(self, block: list[ast.stmt]) -> set[str] | None:
        """A block, a level deeper; the variables that have a value after it, if it has an end."""
        self.indent += 1
        ended = self.block(block)
        self.indent -= 1
        return None if ended else {*self.bound}

    def _merge(self, before: dict[str, Value], after: list[set[str]]) -> bool:
        """Go on with what has a value on all ways; True if there is no way on."""
        names = set.intersection(*after) if after else set()
        self.bound = {
            **before, **{n: Value(self.c_name(n), self.types[n]) for n in names - before.keys()}
        }  # fmt: skip
        return not after

    def _for_statement(self, node: ast.For) -> bool:
        if node.orelse:
            raise self.error(node.orelse[0], "else of a loop is not in the subset; use a flag")
        changed = {name for s in node.body for inner in ast.walk(s) for name in _assigned(inner)}
        at, waiting = len(self.lines), self._waiting()
        before = dict(self.bound)
        is_range = isinstance(node.iter, ast.Call) and self.known(node.iter.func) is range
        head, item, runs = (self._counted if is_range else self._over)(node, changed)
        self.say(head)
        self.exits.append([])
        self.indent += 1
        self.open = set(self.of_loops.get(node, ()))
        if not (isinstance(node.target, ast.Name) and self._is_counter(node, changed)):
            self.assign(node.target, item, node)
        elif node.target.id in self.loaded:
            self.types[node.target.id] = WHOLE
            self.bound[node.target.id] = item
        self.indent -= 1
        self.open = set()
        ends = self._inner(node.body)
        self.say("}")
        self._declare(waiting, at)
        ways = [*self.exits.pop(), *([ends] if ends is not None else [])]
        if runs and ways:
            self._merge(before, ways)
        else:
            self._merge(before, [set(before)])
        return False

    def _is_counter(self, node: ast.For, changed: set[str]) -> bool:
        """True if the number of a loop is its variable itself: nothing else changes or needs it."""
        assert isinstance(node.target, ast.Name)
        name, call = node.target.id, node.iter
        is_range = isinstance(call, ast.Call) and self.known(call.func) is range
        return is_range and name not in changed and name in self.of_loops.get(node, {name})

    def _counted(self, node: ast.For, changed: set[str]) -> tuple[str, Value, bool]:
        """The head of a loop over range(), its number, and if it is certain to run."""
        assert isinstance(node.iter, ast.Call)
        given = [self.value(argument) for argument in node.iter.args]
        if any(v.type != WHOLE for v in given) or not isinstance(node.target, ast.Name):
            raise self.error(node, f"{ast.unparse(node.iter)}: must be of ints, for one variable")
        first, last, *more = given if len(given) > 1 else [self.literal(0), *given]
        step = fixed(more[0]) if more else 1
        if not step:
            raise self.error(
                node, f"the step {ast.unparse(node.iter.args[2])} must be constant, and not 0"
            )
        is_int = bool(first.span and last.span)
        if set(re.findall(r"[A-Za-z_]\w*", last.text)) & {
            self.c_name(n) for n in changed & self.locals
        }:
            last = self._copied(last, "last")
        own = self._is_counter(node, changed) and node.target.id in self.loaded
        k = self.c_name(node.target.id) if own else self.fresh("k")
        start, end = (as_int(v) if is_int else self.text(v, SUM) for v in (first, last))
        forward = f"{k}{'++' if step > 0 else '--'}" if step in (1, -1) else f"{k} += {step}"
        sign = "<" if step > 0 else ">"
        head = (
            f"for ({'int' if is_int else 'double'} {k} = {start}; {k} {sign} {end}; {forward}) {{"
        )
        if not (first.span and last.span):
            return head, Value(k, WHOLE), False
        span = (first.span[0], last.span[1] - 1) if step > 0 else (last.span[0] + 1, first.span[1])
        runs = first.span[1] <= last.span[0] if step > 0 else first.span[0] >= last.span[1]
        return head, Value(k, WHOLE, is_int=True, span=span), runs

    def _over(self, node: ast.For, changed: set[str]) -> tuple[str, Value, bool]:
        """The same of a loop over tuples."""
        k = self.fresh("k")
        call = self.known(node.iter.func) if isinstance(node.iter, ast.Call) else None
        nodes = (
            node.iter.args
            if isinstance(node.iter, ast.Call) and call in (zip, enumerate)
            else [node.iter]
        )
        columns, length = [], 2**31
        for made in nodes:
            value = self.value(made)
            if not isinstance(value.type, Tuple) or not value.type.is_array:
                raise self.error(
                    node, f"{ast.unparse(made)}: must be a tuple, its items must be of one type"
                )
            plain = re.fullmatch(r"(\w+)[\w.>\[\]-]*", value.text)
            fixed = plain and plain[1] not in {self.c_name(n) for n in changed & self.locals}
            value = value if fixed else self._copied(value, "items")
            columns.append(Value(f"{value.text}.at[{k}]", value.type.items[0]))
            length = min(length, len(value.type.items))
        if call is enumerate:
            columns.insert(0, Value(k, WHOLE, is_int=True, span=(0, length)))
        head = f"for (int {k} = 0; {k} < {length}; {k}++) {{"
        return head, self.display(columns, node) if call in (zip, enumerate) else columns[0], True


def check(program: Program, made_from: FunctionType, cls: Group) -> Function | None:
    """The function that says why parameters do not go together; None where it says nothing."""
    source = program.source(made_from.__globals__)
    if source is None:  # of block_variables: the ranges, which are in the table
        return None
    key = made_from, (cls,)
    if key not in program.functions:
        node = source.functions[made_from.__code__.co_firstlineno]
        program.functions[key] = _Check(program, source, node, [cls]).checked(made_from, key)
    return program.functions[key]


class _Check(_Body):
    """A __post_init__: raise puts its reason into `why`, and ends."""

    def checked(self, made_from: FunctionType, key: object) -> Function | None:
        """Make the function; None where there is nothing in it."""
        ended = self.block(self.node.body)
        if not self.lines:
            return None
        if not ended:
            self.say("return 1;")
        name = self.program.function_name(self.source, made_from, key)
        self.finish("int", name, ", Text *why")
        return Function(name, BOOLEAN)

    def _expr_statement(self, node: ast.Expr) -> bool:
        call = node.value
        made = inspect.unwrap(self.known(call.func)) if isinstance(call, ast.Call) else None
        if not isinstance(made, FunctionType) or not isinstance(call, ast.Call):
            raise self.error(node, "has no effect; leave it out")
        kind = self.types[self.parameters[0]]
        assert isinstance(kind, Group)
        found = check(self.program, made, kind)
        if found:
            self.say(f"if (!{found.name}({self.c_names[self.parameters[0]]}, why)) {{")
            self.say("    return 0;")
            self.say("}")
        return False

    def _raise_statement(self, node: ast.Raise) -> bool:
        made = node.exc
        if not (isinstance(made, ast.Call) and self.known(made.func) is ValueError and made.args):
            raise self.error(node, "raise: must be of a ValueError with a text")
        text = made.args[0]
        for part in text.values if isinstance(text, ast.JoinedStr) else [text]:
            if isinstance(part, ast.FormattedValue):
                self._put(part)
            elif isinstance(part, ast.Constant) and isinstance(part.value, str):
                self.say(f"text_put(why, {string(part.value)});")
            else:
                raise self.error(node, "the reason must be a text, or an f-string")
        self.say("return 0;")
        return True

    def _put(self, part: ast.FormattedValue) -> None:
        value = self.value(part.value)
        spec = ast.unparse(part.format_spec)[2:-1] if part.format_spec else ""
        form = re.fullmatch(r"(?:\.(\d+))?g", spec)
        if value.type == TEXT and not spec:
            self.say(f"text_put(why, {value.text});")
        elif value.type == BOOLEAN and not spec:
            self.say(f'text_put(why, {self.text(value, OR)} ? "True" : "False");')
        elif form:
            number = self.as_number(value, part)
            self.say(f"text_general(why, {self.text(number)}, {form[1] or 6});")
        elif not spec:
            self.say(f"text_number(why, {self.text(self.as_number(value, part))});")
        else:
            raise self.error(
                part,
                f"a number in the format {spec!r}; must be {{x}}, {{x!r}}, {{x:g}} or {{x:.3g}}",
            )


# What a statement of Python has


def _names(*nodes: ast.AST) -> set[str]:
    """All names in it."""
    return {n.id for node in nodes for n in ast.walk(node) if isinstance(n, ast.Name)}


def _assigned(node: ast.AST) -> set[str]:
    """The variables that it gives a value, but for those of what is in it."""
    if isinstance(node, ast.Assign):
        return {n for target in node.targets for n in _names(target)}
    return (
        _names(node.target) if isinstance(node, ast.AugAssign | ast.AnnAssign | ast.For) else set()
    )


def _targets(node: ast.stmt) -> set[str]:
    """The variables of a loop."""
    return _names(node.target) if isinstance(node, ast.For) else set()


def _heads(node: ast.stmt) -> list[ast.AST]:
    """What it evaluates before its blocks: the conditions of if and elif, what a loop goes over."""
    if isinstance(node, ast.If):
        is_elif = len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If)
        return [node.test, *(_heads(node.orelse[0]) if is_elif else [])]
    return [node.iter] if isinstance(node, ast.For) else [node]


def _blocks(node: ast.stmt) -> list[list[ast.stmt]]:
    """Its blocks: those of if, elif and else, that of a loop."""
    if isinstance(node, ast.If):
        is_elif = len(node.orelse) == 1 and isinstance(node.orelse[0], ast.If)
        rest = _blocks(node.orelse[0]) if is_elif else [node.orelse] if node.orelse else []
        return [node.body, *rest]
    return [node.body] if isinstance(node, ast.For) else []
