"""Text of others, such as names in an FMU, made harmless: for a terminal, for a cell of a CSV."""

import re
from typing import Any

_UNSEEN = (
    "\x00-\x08\x0b-\x1f\x7f-\x9f"  # control characters but tab and line feed: escape sequences
    "\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069"  # which turn the direction, or end a line
    "\ud800-\udfff\U000e0000-\U000e007f"  # halves of letters; tags, which nothing shows
)
_RAW = re.compile(f"[{_UNSEEN}]")
_IN_A_CELL = re.compile(f"[\\\\\t\n{_UNSEEN}]|\\A[=+\\-@\uff1d\uff0b\uff0d\uff20]")
_WRITTEN = re.compile(r"\\(x[0-9a-f]{2}|u[0-9a-f]{4}|U[0-9a-f]{8}|.)", re.DOTALL)
_SHORT = {"\n": "\\n", "\r": "\\r", "\t": "\\t"}
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
    letter, number = match[0], ord(match[0])
    if letter in _SHORT:
        return _SHORT[letter]
    if letter.isprintable():
        return f"\\{letter}"
    return (
        f"\\x{number:02x}"
        if number < 0x100
        else f"\\{f'u{number:04x}' if number < 0x10000 else f'U{number:08x}'}"
    )


def _character(match: re.Match[str]) -> str:
    said = match[1]
    return chr(int(said[1:], 16)) if len(said) > 1 else _MEANT.get(said, said)
