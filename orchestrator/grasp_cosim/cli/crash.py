"""Last words of the command, where the binary of an FMU crashes it: one line, and exit code 3.

The handlers are C functions to the system, as those of the signal module are not: these wait for
the interpreter to go on, to which a crash does not return. One that overflows the stack leaves no
room for them.
"""

import ctypes
import faulthandler
import os
import signal
from pathlib import Path
from typing import Any

from ..plain import on_one_line
from ..scratch import PREFIX
from .frame import FAILED

SIGNALS = {s.value: s.name for s in signal.Signals} if os.name == "posix" else {}
CRASHES = ("SIGABRT", "SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL")
LONGEST = 5
"""s for the last words: a crash may leave locks behind that they would wait for."""

DEEPEST = 256
"""Frames of the stack that are searched for the FMU."""

ADVICE = (
    "run has --isolation process, and a system file isolation = 'process': a crash is then that of "
    "a component, and what was recorded is kept"
)
_keep: list[Any] = []


class _Symbol(ctypes.Structure):
    """Dl_info of dladdr()."""

    _fields_ = (
        ("file", ctypes.c_char_p),
        ("base", ctypes.c_void_p),
        ("name", ctypes.c_char_p),
        ("address", ctypes.c_void_p),
    )


def explain_crashes(debug: bool) -> None:
    """Have a crash of this process end it with one line; `debug` shows where Python was instead."""
    if debug:
        faulthandler.enable()
    libc: Any = ctypes.CDLL(None) if SIGNALS else None
    if faulthandler.is_enabled() or not hasattr(libc, "backtrace"):
        return
    _binary(libc)  # the first call loads what it needs
    type_ = ctypes.CFUNCTYPE(None, ctypes.c_int)

    def end(number: int) -> None:
        signal.alarm(LONGEST)
        try:
            binary = on_one_line(_binary(libc))
            line = f"grasp-cosim: {binary} crashed with {SIGNALS[number]}; {ADVICE}\n"
            os.write(2, line.encode(errors="replace"))
        finally:
            os._exit(FAILED)

    handler = type_(end)
    _keep.append(handler)
    libc.signal.argtypes, libc.signal.restype = (ctypes.c_int, type_), ctypes.c_void_p
    for name in CRASHES:
        libc.signal(signal.Signals[name], handler)


def _binary(libc: Any) -> str:
    """The innermost binary of an FMU on the stack."""
    frames = (ctypes.c_void_p * DEEPEST)()
    symbol = _Symbol()
    for frame in frames[: libc.backtrace(frames, DEEPEST)]:
        if libc.dladdr(ctypes.c_void_p(frame), ctypes.byref(symbol)) and symbol.file:
            path = Path(os.fsdecode(symbol.file))
            if any(part.startswith(PREFIX) for part in path.parts):
                return f"{path.name}, the binary of an FMU,"
    return "the process"
