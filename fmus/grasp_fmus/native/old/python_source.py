"""The source of the modules that a block is made of, beside the modules as they are in memory."""

import ast
import io
import re
import sys
import tokenize
from math import isinf
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from .names import TAKEN_MODULES, identifier


class UntranslatableError(ValueError):
    """What a block may not contain: FILE: line N: reason; what is valid."""


class Source:
    """One module: its names in memory, its text as a tree, its comments by line."""

    def __init__(self, name: str, module: ModuleType, file: Path, text: str) -> None:
        self.name, self.module, self.file = name, module, file
        self.names = vars(module)
        self.tree = ast.parse(text)
        self.comments, self.own_line = _comments(text)
        self._lines = re.split("\r\n?|\n", text)
        self._imports: set[str] | None = None
        self._functions = dict(_functions(self.tree.body, ""))
        self.assigned = {target.id: node for node in self.tree.body for target in _targets(node)}
        self.imported = {
            alias.asname or alias.name: (node, alias.name)
            for node in self.tree.body
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        stem = identifier(file.stem if file.stem != "__init__" else file.parent.name)
        self.prefix = f"{stem}_py" if stem.lower() in TAKEN_MODULES else stem

    def error(self, node: ast.AST | int, reason: str) -> UntranslatableError:
        """An error at a node, or at a line."""
        line = node if isinstance(node, int) else getattr(node, "lineno", 1)
        return UntranslatableError(f"{self.file}: line {line}: {reason}")

    def function(self, function: FunctionType) -> ast.FunctionDef | None:
        """The definition of a function of this module."""
        return self._functions.get((function.__qualname__, function.__code__.co_firstlineno))

    def imports(self, sources: "Sources") -> set[str]:
        """The modules of the block that this one imports, by their names."""
        if self._imports is None:
            found = set()
            for node in self.tree.body:
                if isinstance(node, ast.Import):
                    found |= {alias.name for alias in node.names}
                elif isinstance(node, ast.ImportFrom):
                    base = _absolute(self, node)
                    found |= {base, *(f"{base}.{alias.name}" for alias in node.names)}
            self._imports = {name for name in sorted(found) if sources.of(name)}
        return self._imports

    def global_names(self) -> set[str]:
        """What C may call the functions, classes and constants of this module."""
        found = set(self.assigned)
        for node in self.tree.body:
            if isinstance(node, ast.FunctionDef | ast.ClassDef):
                inner = [getattr(n, "name", "") for n in getattr(node, "body", [])]
                found |= {node.name, *(f"{node.name}_{name}" for name in inner)}
        return {f"{self.prefix}_{name.lstrip('_')}" for name in found}

    def line_of(self, name: str) -> int:
        """The line of the assignment of a global."""
        return self.assigned[name].lineno if name in self.assigned else 1

    def about(self, name: str) -> str | None:
        """The docstring that follows the assignment of a global."""
        node = self.assigned.get(name)
        if node is None:
            return None
        after = self.tree.body[self.tree.body.index(node) + 1 :][:1]
        for text in after:
            if isinstance(text, ast.Expr) and isinstance(text.value, ast.Constant):
                return str(text.value.value)
        return None

    def literal(self, node: ast.stmt | None) -> str | None:
        """The number that is assigned, as it is written."""
        value = getattr(node, "value", None)
        return self.digits(value) if isinstance(value, ast.Constant) else None

    def digits(self, node: ast.Constant) -> str | None:
        """A float as it is written, where C reads the same."""
        if not isinstance(node.value, float):
            return None
        line = self._lines[node.lineno - 1].encode()
        plain = line[node.col_offset : node.end_col_offset].decode().replace("_", "")
        is_decimal = bool(plain) and set(plain) <= set("0123456789.eE+-") and plain[0] != "-"
        if not is_decimal or float(plain) != node.value:
            return None
        digits = plain.lower().partition("e")[0]
        if isinf(node.value) or (node.value == 0.0 and set(digits) - set("0.")):
            return None  # beyond the range of a double, of which compilers warn
        return plain if set(plain) & set(".eE") else f"{plain}.0"

    def class_doc(self, cls: type[Any]) -> bool:
        """True if a class has a docstring of its own."""
        node = self.class_node(cls)
        return node is not None and ast.get_docstring(node) is not None

    def class_node(self, cls: type[Any]) -> ast.ClassDef | None:
        """The definition of a class of this module."""
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef) and node.name == cls.__name__:
                return node
        return None


class Sources:
    """The modules of a block, read once."""

    def __init__(self, block: Any, file: Path | None) -> None:
        self._block, self._file = block, file
        self.block_file = file or getattr(block, "__file__", block.__name__)
        self._read: dict[str, Source] = {}
        todo, seen = [block.__name__], {block.__name__}
        while todo:
            source = self.of(todo.pop(0))
            if source:
                todo += [name for name in sorted(source.imports(self)) if name not in seen]
                seen |= set(todo)
        self.global_names = {name for source in self.read() for name in source.global_names()}

    def read(self) -> list[Source]:
        """Those that have been read so far."""
        return list(self._read.values())

    def of(self, name: str) -> Source | None:
        """The source of a module; None where it is none of the block's."""
        if name.partition(".")[0] in sys.stdlib_module_names:
            return None
        if name not in self._read:
            is_block = name == self._block.__name__
            module = self._block if is_block else sys.modules.get(name)
            if module is None:
                return None
            path = self._file if is_block and self._file else getattr(module, "__file__", None)
            if path is None or Path(path).suffix != ".py":
                return None
            text = Path(path).read_text("utf-8-sig")
            source = Source(name, module, Path(path), text)
            taken = [other.prefix.lower() for other in self._read.values()]
            if source.prefix.lower() in taken:
                source.prefix = f"{identifier(name.replace('.', '_'))}"
            self._read[name] = source
        return self._read[name]

    def origin(self, source: Source, name: str) -> tuple[Source | None, str]:
        """Where a global name comes from: its module, and what it is called there."""
        while name in source.imported and name not in source.assigned:
            node, original = source.imported[name]
            module = _absolute(source, node)
            if isinstance(sys.modules.get(f"{module}.{original}"), ModuleType):
                break
            found = self.of(module)
            if found is None:
                return None, original
            source, name = found, original
        return source, name


def _absolute(source: Source, node: ast.ImportFrom) -> str:
    if not node.level:
        return node.module or ""
    package = source.names.get("__package__") or source.name.rpartition(".")[0]
    parts = package.split(".")
    base = ".".join(parts[: len(parts) - node.level + 1])
    return f"{base}.{node.module}" if node.module else base


def _targets(node: ast.stmt) -> list[ast.Name]:
    found: list[ast.expr] = []
    if isinstance(node, ast.AnnAssign):
        found = [node.target]
    elif isinstance(node, ast.Assign):
        found = [
            item
            for target in node.targets
            for item in (target.elts if isinstance(target, ast.Tuple) else [target])
        ]
    return [target for target in found if isinstance(target, ast.Name)]


def _functions(body: list[ast.stmt], at: str) -> list[tuple[tuple[str, int], ast.FunctionDef]]:
    found = []
    for node in body:
        if isinstance(node, ast.FunctionDef):
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)])
            found.append(((f"{at}{node.name}", first), node))
        elif isinstance(node, ast.ClassDef):
            found += _functions(node.body, f"{at}{node.name}.")
        elif isinstance(node, ast.If):
            found += _functions([*node.body, *node.orelse], at)
    return found


def _comments(text: str) -> tuple[dict[int, str], set[int]]:
    """Return the comments by line, and the lines that hold nothing else."""
    found, alone = {}, set()
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        if token.type == tokenize.COMMENT:
            said = token.string.lstrip("#").strip()
            if said.startswith(("noqa", "type:", "pragma", "fmt:", "mypy:", "ruff:")):
                continue
            found[token.start[0]] = said.partition("  # ")[0]
            if not token.line[: token.start[1]].strip():
                alone.add(token.start[0])
    return found, alone
