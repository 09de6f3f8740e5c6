# ruff: noqa: SIM905
# mypy: disable-error-code="arg-type"
"""Text of the block, and text of C: sources with their comments, names, numbers, long lines."""

import ast
import inspect
import io
import re
import tokenize
import unicodedata
from math import isinf, isnan
from pathlib import Path
from typing import Any

WIDTH = 100

_RESERVED = frozenset(
    """
    auto break case char const continue default do double else enum extern float for goto if inline
    int long register restrict return short signed sizeof static struct switch typedef union
    unsigned void volatile while asm fortran bool true false nullptr alignas alignof constexpr
    static_assert thread_local typeof complex imaginary I unix linux near far huge small min max
    interface errno assert stdin stdout stderr signbit isnormal fpclassify isnan isinf isfinite
    NULL EOF PI TAU E NAN INFINITY HUGE_VAL IN OUT TRUE FALSE BOOL VOID ERROR CONST
    acos acosh asin asinh atan atan2 atanh ceil copysign cos cosh exp expm1 fabs floor fmod ldexp
    log log10 log1p log2 pow sin sinh sqrt tan tanh trunc larger smaller floored ceiled truncated
    scaled variables Variable Text text_put text_number text_general INPUT OUTPUT PARAMETER why
    """.split()
)
"""Words that mean something else in C, in the headers of hosts, or in what a block includes."""

_BEGINNINGS = ("__", "FP_", "M_", "N_", "KIND_", "BLOCK_", "FMI", "fmi", "DBL_", "FLT_", "INT")

_TAKEN = {"block", "text", "variable", "arithmetic", "slave", "fmi2", "fmi3", "py"}
"""Modules whose names would be those of something else."""

_LETTERS = {"·": "*", "×": "x", "−": "-", "–": "-", "—": "-", "≤": "<=", "≥": ">=", "≠": "!="}
_LETTERS |= {"°": "deg", "µ": "u", "√": "sqrt", "∞": "inf", "→": "->", "±": "+-", "²": "^2"}


class UntranslatableError(ValueError):
    """What a block may not contain: FILE: line N: reason; what to write instead."""


class Source:
    """A module of the block: its names in memory, its text as a tree, its comments by line."""

    def __init__(self, names: dict[str, Any], file: Path) -> None:
        text = file.read_text("utf-8-sig")
        self.names, self.file = names, file
        self.tree, self.lines = ast.parse(text), text.splitlines()
        self.comments = _comments(text)
        self.stem = identifier(file.stem if file.stem != "__init__" else file.parent.name)
        self.assigned = {t.id: node for node in self.tree.body for t in _targets(node)}
        self.imported = {
            alias.asname or alias.name: (node, alias.name)
            for node in self.tree.body
            if isinstance(node, ast.ImportFrom)
            for alias in node.names
        }
        self.functions = {
            min([node.lineno, *(d.lineno for d in node.decorator_list)]): node
            for node in ast.walk(self.tree)
            if isinstance(node, ast.FunctionDef)
        }
        self.classes = {n.name: n for n in self.tree.body if isinstance(n, ast.ClassDef)}
        if self.stem in _TAKEN:
            self.stem += "_py"

    def error(self, line: int, reason: str) -> UntranslatableError:
        """An error at a line."""
        return UntranslatableError(f"{self.file}: line {line}: {reason}")

    def doc_after(self, body: list[ast.stmt], node: ast.stmt) -> str:
        """The docstring of a constant or a field, which follows it; empty without one."""
        after = body[body.index(node) + 1 :][:1]
        text = after[0].value if after and isinstance(after[0], ast.Expr) else None
        return str(text.value) if isinstance(text, ast.Constant) else ""

    def literal(self, node: ast.Constant) -> str:
        """A float as it stands in the source, where C reads it alike."""
        line = self.lines[node.lineno - 1].encode()
        text = line[node.col_offset : node.end_col_offset].decode().replace("_", "")
        plain = re.fullmatch(r"\d+\.\d+([eE][+-]?\d+)?|\d+[eE][+-]?\d+", text)
        usual = node.value == 0.0 or 1e-300 < abs(node.value) < 1e300
        return text if plain and usual and float(text) == node.value else number(node.value)


def _targets(node: ast.stmt) -> list[ast.Name]:
    found: list[ast.expr] = []
    if isinstance(node, ast.AnnAssign):
        found = [node.target]
    elif isinstance(node, ast.Assign):
        found = [n for t in node.targets for n in (t.elts if isinstance(t, ast.Tuple) else [t])]
    return [n for n in found if isinstance(n, ast.Name)]


def _comments(text: str) -> dict[int, str]:
    """The comments by line, but for those that speak to tools."""
    found = {}
    for token in tokenize.generate_tokens(io.StringIO(text).readline):
        said = token.string.lstrip("#").strip()
        told = said.startswith(("noqa", "type:", "pragma", "fmt:", "mypy:", "ruff:"))
        if token.type == tokenize.COMMENT and not told:
            found[token.start[0]] = said.partition("  # ")[0]
    return found


def identifier(name: str) -> str:
    """A name of Python as one of C."""
    plain = "".join(c if c.isascii() else _word(c) for c in name)
    return f"{plain}_" if plain in _RESERVED or plain.startswith(_BEGINNINGS) else plain


def _word(c: str) -> str:
    return unicodedata.name(c, f"u{ord(c):x}").rpartition(" ")[2].lower()


def number(value: float) -> str:
    """A number as C writes it, to the bit."""
    if isnan(value):
        return "(double)NAN"
    if isinf(value):
        return "HUGE_VAL" if value > 0 else "-HUGE_VAL"
    return repr(float(value))


def string(text: str) -> str:
    """A text as a C string of its bytes in UTF-8."""
    plain = "".join(
        f"\\{c}" if c in '"\\?' else c if " " <= c <= "~" else f"\\{ord(c):03o}"
        for c in map(chr, text.encode())
    )
    return f'"{plain}"'


def comment(text: str | None, indent: str = "") -> str:
    """A docstring as a comment of C, with the end of its last line; nothing where there is none."""
    lines = [line.rstrip() for line in ascii_text(inspect.cleandoc(text or "")).splitlines()]
    if not lines:
        return ""
    body = "\n".join([f"/* {lines[0]}", *(f"   {line}".rstrip() for line in lines[1:])])
    body += "\n*/" if len(lines) > 1 else " */"
    return "".join(f"{indent}{line}\n" if line else "\n" for line in body.split("\n"))


def ascii_text(text: str) -> str:
    """A text for a comment: ASCII, and nothing that ends the comment."""
    plain = "".join(c if c.isascii() else _letter(c) for c in text)
    plain = "".join(c if c >= " " or c == "\n" else " " for c in plain)
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("??", "? ?").replace("\\", "/")


def _letter(c: str) -> str:
    base = unicodedata.normalize("NFKD", c).encode("ascii", "ignore").decode()
    return _LETTERS.get(c) or base or (_word(c) if c.isalpha() else "?")


def wrapped(line: str) -> str:
    """A statement in lines of at most WIDTH columns, broken where it is nested least."""
    start = len(line) - len(line.lstrip())
    indent, found = start, []
    while len(line) > WIDTH and (place := _break(line, indent)):
        at, depth = place
        found.append(line[:at].rstrip())
        indent = start + 4 * (1 + min(depth, 4))
        line = f"{' ' * indent}{line[at:].lstrip()}"
    return "\n".join([*found, line])


def _break(line: str, start: int) -> tuple[int, int] | None:
    """The last place of those nested least where a line may be broken, and how deep it is."""
    depth, quoted, best = 0, False, None
    for i, c in enumerate(line[:WIDTH]):
        quoted ^= c == '"' and line[i - 1] != "\\"
        depth += (c in "([{") - (c in ")]}") if not quoted else 0
        after_comma = c == " " and line[i - 1] == ","
        before = c == " " and line[i + 1 : i + 3] in ("&&", "||", "? ", ": ", "+ ", "- ", "/*")
        fits = i > start + 8 and not quoted
        if fits and (after_comma or before) and (best is None or depth <= best[1]):
            best = i + 1, depth
    return best
