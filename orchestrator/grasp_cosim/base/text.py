"""Numbers and tables for the eye, and text of others, such as names in an FMU, made harmless."""

import re
from collections.abc import Collection, Sequence
from math import degrees
from typing import Any

MOST = 1e9
"""The size from which a number in a table is written with a power of ten."""

NOISE = 1e-10
"""What is smaller is 0 but for rounding errors, in any unit in which a table shows it."""

MILLI = {"m": (1e3, "mm"), "m/s": (1e3, "mm/s"), "N.s": (1e3, "mN.s"), "rad": (degrees(1), "deg")}
"""How values are shown in tables and pictures, by unit: times a factor, in another."""


def in_milli(unit: str | None) -> tuple[float, str]:
    """Return the factor and the unit in which values of `unit` are shown; "" for a mere number."""
    return MILLI.get(unit or "", (1.0, "" if unit in (None, "1") else str(unit)))


def counted(count: int, noun: str) -> str:
    """Return a count with its noun, which takes an s unless it is 1: `1 fault`, `2 faults`."""
    return f"{count} {noun}{'' if count == 1 else 's'}"


def fixed(
    value: float,
    decimals: int,
    *,
    width: int = 0,
    sign: str = "",
    most: float = MOST,
    digits: int = 4,
    rounded: bool = False,
) -> str:
    """Return `value` with so many decimals; where it has no place there, like 4.04e+41 or 6.3e-5.

    That is from `most` on and, unless it is `rounded` to 0, where all its decimals would be 0; it
    then has up to so many digits. `width` and `sign` ("+" for both) are those of a format.
    """
    least = 0.0 if rounded else 0.5 * 10.0**-decimals
    value = 0.0 if abs(value) < NOISE else value
    if not value or least <= abs(value) < most:
        return f"{value:{sign}{width}.{decimals}f}"
    return f"{value:{sign}{width}.{digits}g}"


def significant(value: float | None, digits: int = 6, none: str = "none") -> str:
    """Return a number with so many significant digits; `none` where there is none."""
    return none if value is None else f"{value:.{digits}g}"


def grouped(value: float, decimals: int = 0) -> str:
    """Return a number in groups of three digits."""
    return f"{value:,.{decimals}f}".replace(",", "\N{NARROW NO-BREAK SPACE}")


MAX_WIDTH, MAX_LINES = 120, 24
"""Characters and lines of a repr() at most, which is less than a screen."""


def on_a_screen(lines: Sequence[str]) -> str:
    """The lines as a repr() has them: of many the first, each of them cut where it is long."""
    hidden = len(lines) - MAX_LINES
    remaining = [f"... ({counted(hidden, 'line')} more)"] if hidden > 0 else []
    harmless = [on_one_line(line) for line in [*lines[:MAX_LINES], *remaining]]
    return "\n".join(x if len(x) <= MAX_WIDTH else f"{x[: MAX_WIDTH - 3]}..." for x in harmless)


def columns(rows: Sequence[Sequence[str]], left: Collection[int] = (0,)) -> list[str]:
    """Return a line for each row, two spaces between its cells.

    Cells are to the right, but those of the columns `left` to the left.
    """
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if i in left else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


# ------------------------------------------------------------------ text of others

_UNSEEN = (
    "\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters but tab and line feed: escape sequences
    "\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"  # which turn the direction, or end a line
    "\ud800-\udfff\U000e0000-\U000e007f"  # halves of letters; tags, which nothing shows
)
_RAW = re.compile(f"[{_UNSEEN}]")
_IN_A_CELL = re.compile(f"[\\\\\t\n{_UNSEEN}]|\\A[=+\\-@\uff1d\uff0b\uff0d\uff20]")
_WRITTEN = re.compile(r"\\(x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8}|.)", re.DOTALL)
_MEANT = {"n": "\n", "r": "\r", "t": "\t"}


def printable(text: str) -> str:
    r"""The text for a terminal: what steers it, or hides text, becomes its code, like \x1b."""
    return _RAW.sub(_code, text)


def on_one_line(text: str) -> str:
    r"""The same, line feeds written as \n."""
    return printable(text.replace("\n", "\\n"))


def to_cell(value: Any) -> Any:
    r"""A value for a CSV, where a text is no formula and has no line break; others stay.

    A backslash escapes what a spreadsheet takes for a formula at the beginning (= + - @), line
    breaks (\n, \r), tabs, other control characters (\x1b, \u2028) and itself.
    """
    return _IN_A_CELL.sub(_code, value) if isinstance(value, str) else value


def from_cell(text: str) -> str:
    """The text that to_cell() has written."""
    return _WRITTEN.sub(_character, text)


def _code(match: re.Match[str]) -> str:
    letter = match[0]
    return f"\\{letter}" if letter.isprintable() else letter.encode("unicode_escape").decode()


def _character(match: re.Match[str]) -> str:
    escaped = match[1]
    return chr(int(escaped[1:], 16)) if len(escaped) > 1 else _MEANT.get(escaped, escaped)
