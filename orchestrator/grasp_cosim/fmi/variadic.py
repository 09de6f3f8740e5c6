"""The text of a message of FMI 2.0, whose logger is called like printf: a format, then arguments.

Python cannot define such a function. On Linux, with the processors below, the arguments lie where
those of a function would that has fixed ones: first in registers, of whole numbers and addresses
or of doubles, then on the stack. So the logger takes as many as these hold and some from the stack,
wanted or not, and puts them where C's vsnprintf looks for them: in a va_list.
"""

import ctypes
import platform
import re
import struct
import sys
from collections.abc import Callable, Mapping, Sequence
from ctypes import c_char_p, c_double, c_int, c_size_t, c_void_p
from functools import cache
from typing import Any, NamedTuple

from ..base.system_calls import c_library

_NAMED = c_void_p, c_char_p, c_int, c_char_p, c_char_p
"""Environment, instance, status, category and the format."""

_STACKED = 32
"""The most arguments on the stack."""

_LONG = re.compile(rb"%[^A-Za-z%]*L")
"""A long double, which has registers of its own kind, or none."""


class _Convention(NamedTuple):
    """How a processor passes arguments."""

    words: int
    """Registers for whole numbers and addresses; there are eight for doubles."""
    va_list: Callable[[int, int], bytes]
    """By the addresses of what was in registers and, behind it, of what was on the stack."""


_CONVENTIONS: Mapping[str, _Convention] = {
    "x86_64": _Convention(6, lambda words, stack: struct.pack("IIPP", 40, 48, stack, words)),
    "aarch64": _Convention(
        8, lambda words, stack: struct.pack("PPPii", stack, words + 64, stack, -24, -128)
    ),
}
"""Of the ABIs of System V and Arm for Linux."""

CONVENTION = _CONVENTIONS.get(platform.machine()) if sys.platform == "linux" else None


def logger_type(convention: _Convention | None = CONVENTION) -> Any:
    """The type of a logger: a function of the five named arguments, and of all that may follow."""
    if convention is None:
        return ctypes.CFUNCTYPE(None, *_NAMED)
    words = [c_size_t] * (convention.words - len(_NAMED))
    return ctypes.CFUNCTYPE(None, *_NAMED, *words, *[c_double] * 8, *[c_size_t] * _STACKED)


def formatted(
    form: bytes, passed: Sequence[float], convention: _Convention | None = CONVENTION
) -> bytes:
    """The format with the arguments that a logger was passed behind it.

    As it comes where this processor is none of those above, where one of them is a long double, or
    where there are too many.
    """
    if convention is None or not 0 < form.count(b"%") + form.count(b"*") <= _STACKED:
        return form
    if _LONG.search(form):
        return form
    named = len(_NAMED)
    layout = f"={8 * named}x{convention.words - named}Q{'d8x' * 8}{_STACKED}Q"
    area = ctypes.create_string_buffer(struct.pack(layout, *passed))
    words = ctypes.addressof(area)

    def printed(text: Any, size: int) -> int:
        read = convention.va_list(words, words + 8 * convention.words + 128)
        return int(_vsnprintf()(text, size, form, ctypes.create_string_buffer(read)))

    size = printed(None, 0)
    if size < 0:
        return form
    text = ctypes.create_string_buffer(size + 1)
    printed(text, size + 1)
    return text.value


@cache
def _vsnprintf() -> Any:
    found = c_library().vsnprintf
    found.argtypes = c_void_p, c_size_t, c_char_p, c_void_p
    return found
