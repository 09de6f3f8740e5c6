"""How the C is laid out: comments, and lines that are not too long."""

import inspect
import textwrap

from .names import ascii_text

WIDTH = 100


def comment(text: str | None, indent: str = "") -> str:
    """A docstring as a comment of C; nothing where there is none."""
    if not text:
        return ""
    lines = [line.rstrip() for line in ascii_text(inspect.cleandoc(text)).splitlines()]
    if len(lines) == 1:
        one = f"{indent}/* {lines[0]} */"
        if len(one) <= WIDTH:
            return f"{one}\n"
        lines = textwrap.wrap(lines[0], WIDTH - len(indent) - 3)
        if len(lines[-1]) > WIDTH - len(indent) - 3:
            lines.append("")
    first, *rest = lines
    body = "".join(f"{indent}   {line}".rstrip() + "\n" for line in rest)
    return f"{indent}/* {first}\n{body.rstrip()} */\n" if rest else f"{indent}/* {first} */\n"


def wrapped(line: str) -> list[str]:
    """A statement in lines of at most WIDTH columns, broken where it is nested least."""
    indent = len(line) - len(line.lstrip())
    found = []
    while len(line) > WIDTH:
        place = _break(line)
        if place is None:
            break
        at, depth = place
        found.append(line[:at].rstrip())
        line = f"{' ' * (indent + 4 * (1 + depth))}{line[at:].lstrip()}"
        indent += 4 * depth
    return [*found, line]


def _break(line: str) -> tuple[int, int] | None:
    """The best place to break a line, the last of those nested least, and how deep it is."""
    start = len(line) - len(line.lstrip())
    depth, quoted, best = 0, False, None
    for i, c in enumerate(line[:WIDTH]):
        if c == '"' and line[i - 1] != "\\":
            quoted = not quoted
        if quoted or i < start:
            continue
        depth += (c in "([{") - (c in ")]}")
        after_comma = c == " " and line[i - 1] == ","
        before_word = c == " " and line[i + 1 : i + 3] in ("&&", "||", "? ", ": ", "+ ", "- ")
        if (after_comma or before_word) and i > start + 8 and (best is None or depth <= best[1]):
            best = i + 1, depth
    return best
