"""Text in C, and the text of the Python that it comes from."""

import ast
import io
import tokenize
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any

from ...base.c_compilers import LIBM

WIDTH = 100


class UntranslatableError(ValueError):
    """A block has what cannot be C: where, what, and what to write instead, in one line."""


_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline
int long register restrict return short signed sizeof static struct switch typedef union
unsigned void volatile while

alignas alignof and and_eq asm bitand bitor bool catch char8_t char16_t char32_t class co_await
co_return co_yield compl concept const_cast consteval constexpr constinit decltype delete
dynamic_cast explicit export false friend mutable namespace new noexcept not not_eq nullptr
operator or or_eq private protected public reinterpret_cast requires static_assert static_cast
template this thread_local throw true try typeid typename typeof typeof_unqual using virtual
wchar_t xor xor_eq

NULL I errno linux unix stdin stdout stderr assert offsetof
"""
WORDS = frozenset(_WORDS.split())
"""Words of C and C++, and macros, that no member may be called."""

_MORE = """
far near CLOCKS_PER_SEC EOF HUGE_VAL INFINITY NAN
abs ceil copysign div fabs fdim floor fma fmax fmin free gamma index j0 j1 jn logb malloc nan
remainder rint round scalb signal signgam sqrt trunc y0 y1 yn
larger smaller scaled floored ceiled truncated values numbers why
"""
RESERVED = WORDS.union(_MORE.split(), LIBM)
"""Those, words of old compilers, functions of the library, more macros, names of arithmetic.h."""


def identifier(name: str) -> str:
    """A name that C does not use for something else, of ASCII."""
    plain = "".join(c if c.isascii() else f"u{ord(c):x}" for c in name)
    return f"{plain}_" if plain in RESERVED else plain


def number(value: float) -> str:
    """A number of Python as C reads it: the same double."""
    return repr(float(value)).replace("inf", "INFINITY").replace("nan", "NAN")


def string(text: str) -> str:
    """A string of C, in UTF-8."""
    plain = text.replace("\\", "\\\\").replace('"', '\\"').replace("?", "\\?")
    octets = (chr(o) if 32 <= o < 127 else f"\\{o:03o}" for o in plain.encode())
    return f'"{"".join(octets)}"'


def comment(text: str) -> str:
    """A comment of C, of one or several lines."""
    lines = "\n".join(f"   {comment_text(line)}".rstrip() for line in text.strip().split("\n"))
    return f"/* {lines.strip()} */"


def comment_text(line: str) -> str:
    """A line of text for a comment in C, which it neither ends nor continues on another line."""
    plain = line.replace("·", "*").encode("ascii", "backslashreplace").decode()
    plain = "".join(c if c.isprintable() else "?" for c in plain)
    return plain.replace("*/", "* /").replace("/*", "/ *").replace("\\", "/").replace("??", "? ?")


def wrapped(line: str, begin: str = "") -> str:
    """A line of C in several, where it is too long; a string stays in one piece."""
    begin = begin or " " * (len(line) - len(line.lstrip(" ")) + 8)
    at = line.rfind(" ", len(begin) + 1, WIDTH)
    if len(line) <= WIDTH or at < 0 or '"' in line or "/*" in line:
        return line
    return f"{line[:at]}\n{wrapped(begin + line[at + 1 :], begin)}"


class Source:
    """A Python file: its functions by their first line, its comments, the notes on members."""

    def __init__(self, file: str, label: str) -> None:
        self.shown, self.text = label, Path(file).read_text("utf-8")
        self.tree = ast.parse(self.text, file)

    @cached_property
    def functions(self) -> dict[int, ast.FunctionDef]:
        """Each function by the line that its code object begins at."""
        nodes = (n for n in ast.walk(self.tree) if isinstance(n, ast.FunctionDef))
        return {min([n.lineno, *(d.lineno for d in n.decorator_list)]): n for n in nodes}

    @cached_property
    def comments(self) -> dict[int, tuple[str, bool]]:
        """Comments by line, each with whether it has the line for itself."""
        tokens = tokenize.generate_tokens(io.StringIO(self.text).readline)
        return {
            t.start[0]: (t.string.lstrip("# "), not t.line[: t.start[1]].strip())
            for t in tokens
            if t.type == tokenize.COMMENT and "noqa" not in t.string and "type:" not in t.string
        }

    def member(self, cls: str, name: str) -> str:
        """What the docstring below a member of a class says of it, or ""."""
        for node in self.tree.body:
            if isinstance(node, ast.ClassDef) and node.name == cls:
                for pair in pairwise(node.body):
                    match pair:
                        case ast.AnnAssign(ast.Name(n)), ast.Expr(ast.Constant(said)) if n == name:
                            return str(said).strip()
        return ""

    def error(self, at: Any, reason: str) -> UntranslatableError:
        """Say what is wrong at a node, or at a line."""
        line = at if isinstance(at, int) else getattr(at, "lineno", 1)
        return UntranslatableError(f"{self.shown}: line {line}: {reason}")
