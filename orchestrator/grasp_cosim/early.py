"""Ctrl-C before a command begins ends the process at once, in one line: there is nothing to keep.

Imports next to nothing, as it comes before all else.
"""

import os
import signal


def leave_at_once() -> None:
    """Have Ctrl-C end the process, unless the process ignores it."""
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _leave)


def begin() -> None:
    """From here on Ctrl-C is a KeyboardInterrupt again."""
    if signal.getsignal(signal.SIGINT) is _leave:
        signal.signal(signal.SIGINT, signal.default_int_handler)


def _leave(*_: object) -> None:
    try:
        os.write(2, b"grasp-cosim: interrupted\n")
    finally:
        os._exit(130)
