"""A signal before a command begins ends the process at once, in one line: there is nothing to keep.

Imports next to nothing, as it comes before all else.
"""

import os
import signal

_is_command = False


def leave_at_once() -> None:
    """Have Ctrl-C and SIGTERM end the process, which is a command, unless it ignores them."""
    global _is_command
    _is_command = True
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)
    if signal.getsignal(signal.SIGTERM) is signal.SIG_DFL:
        signal.signal(signal.SIGTERM, _leave)


def begin() -> bool:
    """From here on Ctrl-C is a KeyboardInterrupt again; True if this process is a command."""
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    return _is_command


def _leave(number: int, _: object) -> None:
    try:
        os.write(2, b"grasp-cosim: interrupted\n")
    finally:
        os._exit(128 + number)
