"""The logger that an FMU of FMI 2.0 calls, and the other functions that it may call.

The logger is called like printf: a format, then arguments. Python cannot define such a function. On
Linux, with the processors below, the arguments lie where those of a function would that has fixed
ones: first in registers, of whole numbers and addresses or of doubles, then on the stack. So the
logger takes as many as these hold and some from the stack, wanted or not. It puts them into the
places that C's vsnprintf reads: in a va_list.
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

import fmpy
from fmpy.fmi2 import (
    fmi2CallbackAllocateMemoryTYPE,
    fmi2CallbackFreeMemoryTYPE,
    fmi2CallbackFunctions,
    fmi2CallbackLoggerTYPE,
)

from ..base.system_calls import c_library
from .messages import Messages

FIXED_ARGUMENTS = c_void_p, c_char_p, c_int, c_char_p, c_char_p
"""Those that each call of a logger has: environment, instance, status, category and the format."""

MAX_ON_STACK = 32
"""The most arguments on the stack that are passed on."""

DOUBLE_REGISTERS = 8
"""Registers for doubles, of both conventions below."""

WORD, DOUBLE_REGISTER = 8, 16
"""Bytes of a register for whole numbers and addresses, and of one for doubles."""

LONG_DOUBLE = re.compile(rb"%[^A-Za-z%]*L")
"""In a format, a long double, which has registers of a separate kind, or none."""


class Convention(NamedTuple):
    """How a processor passes the arguments of a function."""

    word_registers: int
    """For whole numbers and addresses."""
    va_list: Callable[[int, int], bytes]
    """The va_list, by the addresses of what was in registers and of what was on the stack."""


def _va_list_of_x86_64(registers: int, stack: int) -> bytes:
    """That of the ABI of System V: two offsets, then two addresses.

    The offsets say where the next argument is among the registers: behind the fixed ones.
    """
    next_word = len(FIXED_ARGUMENTS) * WORD
    next_double = CONVENTIONS["x86_64"].word_registers * WORD
    return struct.pack("IIPP", next_word, next_double, stack, registers)


def _va_list_of_aarch64(registers: int, stack: int) -> bytes:
    """That of the ABI of Arm: three addresses, then two offsets.

    The addresses are those of the stack and of the ends of the registers of each kind; the offsets
    say how far before these the next argument is.
    """
    words = CONVENTIONS["aarch64"].word_registers
    end_of_words = registers + words * WORD
    end_of_doubles = end_of_words + DOUBLE_REGISTERS * DOUBLE_REGISTER
    next_word = -(words - len(FIXED_ARGUMENTS)) * WORD
    next_double = -DOUBLE_REGISTERS * DOUBLE_REGISTER
    return struct.pack("PPPii", stack, end_of_words, end_of_doubles, next_word, next_double)


CONVENTIONS: Mapping[str, Convention] = {
    "x86_64": Convention(6, _va_list_of_x86_64),
    "aarch64": Convention(8, _va_list_of_aarch64),
}
"""For Linux, by processor."""

CONVENTION = CONVENTIONS.get(platform.machine()) if sys.platform == "linux" else None
"""That of this machine; None where it is none of these."""


@cache
def logger_type() -> Any:
    """The type of a logger: a function of the five named arguments, and of all that may follow."""
    if CONVENTION is None:
        return ctypes.CFUNCTYPE(None, *FIXED_ARGUMENTS)
    words = [c_size_t] * (CONVENTION.word_registers - len(FIXED_ARGUMENTS))
    doubles, stack = [c_double] * DOUBLE_REGISTERS, [c_size_t] * MAX_ON_STACK
    return ctypes.CFUNCTYPE(None, *FIXED_ARGUMENTS, *words, *doubles, *stack)


def formatted(form: bytes, passed: Sequence[float]) -> bytes:
    """The format with the arguments that a logger was passed behind it.

    As it comes where this processor is none of those above, where one of them is a long double, or
    where there are too many.
    """
    places = form.count(b"%") + form.count(b"*")
    if CONVENTION is None or not 0 < places <= MAX_ON_STACK or LONG_DOUBLE.search(form):
        return form
    area = ctypes.create_string_buffer(struct.pack(_layout(CONVENTION), *passed))
    registers = ctypes.addressof(area)
    size_of_words = CONVENTION.word_registers * WORD
    stack = registers + size_of_words + DOUBLE_REGISTERS * DOUBLE_REGISTER
    va_list = CONVENTION.va_list(registers, stack)

    def printed(text: Any, size: int) -> int:
        return int(_vsnprintf()(text, size, form, ctypes.create_string_buffer(va_list)))

    size = printed(None, 0)
    if size < 0:
        return form
    text = ctypes.create_string_buffer(size + 1)
    printed(text, size + 1)
    return text.value


def _layout(convention: Convention) -> str:
    """The format for struct of what was in registers, without the fixed ones, and on the stack."""
    fixed = len(FIXED_ARGUMENTS)
    words = f"{WORD * fixed}x{convention.word_registers - fixed}Q"
    doubles = "d8x" * DOUBLE_REGISTERS
    return f"={words}{doubles}{MAX_ON_STACK}Q"


@cache
def _vsnprintf() -> Any:
    """C's vsnprintf(text, size, format, va_list)."""
    vsnprintf = c_library().vsnprintf
    vsnprintf.argtypes = c_void_p, c_size_t, c_char_p, c_void_p
    return vsnprintf


def callbacks_for(messages: Messages) -> fmi2CallbackFunctions:
    """The functions that an FMU may call: its logger, which is its own, and memory."""

    def log(
        _: Any,
        instance: Any,
        status: int,
        category: bytes | None,
        message: bytes | None,
        *arguments: float,
    ) -> None:
        if messages.wants(status, category):
            messages.take(status, formatted(message or b"", arguments))

    callbacks = fmi2CallbackFunctions()
    callbacks.logger = ctypes.cast(logger_type()(log), fmi2CallbackLoggerTYPE)
    callbacks.allocateMemory = fmi2CallbackAllocateMemoryTYPE(fmpy.calloc)
    callbacks.freeMemory = fmi2CallbackFreeMemoryTYPE(fmpy.free)
    return callbacks
