"""Last words of the command, where the binary of an FMU ends it: one line, and exit code 3.

It crashes, or calls exit(), after which a run in its midst would look like one that is done. The
handlers are C functions to the system, as those of the signal module are not: these wait for the
interpreter to go on, to which a crash does not return. One that overflows the stack leaves no room
for them.
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
    """Have a crash of this process end it with one line; `debug` shows where Python was instead.

    The process must end by streams.leave(): an exit() is taken for that of an FMU.
    """
    libc: Any = ctypes.CDLL(None) if SIGNALS else None
    if not hasattr(libc, "backtrace") or not hasattr(libc, "on_exit"):  # not glibc
        return
    _binary(libc)  # the first call loads what it needs

    def end(how: str) -> None:
        signal.alarm(LONGEST)
        try:
            line = f"grasp-cosim: {on_one_line(_binary(libc))} {how}; {ADVICE}\n"
            os.write(2, line.encode(errors="replace"))
        finally:
            os._exit(FAILED)

    owner = os.getpid()

    def leave(code: int, _: object) -> None:
        if os.getpid() == owner:  # and not a fork
            end(f"ended the process with exit code {code}")

    leaves = ctypes.CFUNCTYPE(None, ctypes.c_int, ctypes.c_void_p)(leave)
    _keep.append(leaves)
    libc.on_exit(leaves, None)
    if debug:
        faulthandler.enable()
    if faulthandler.is_enabled():
        return
    type_ = ctypes.CFUNCTYPE(None, ctypes.c_int)
    crashes = type_(lambda number: end(f"crashed with {SIGNALS[number]}"))
    _keep.append(crashes)
    libc.signal.argtypes, libc.signal.restype = (ctypes.c_int, type_), ctypes.c_void_p
    for name in CRASHES:
        libc.signal(signal.Signals[name], crashes)


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
