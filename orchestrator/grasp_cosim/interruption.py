"""Ctrl-C and SIGTERM: the first ends in good order what goes on, the second ends it at once.

SIGTERM, with which systemd and Docker stop a command, does there what Ctrl-C does. A handler of
Python's does not run while an FMU hangs in C code; so the kernel is told to take each of these
signals once for us, and after that by its default action, which is to end the process.
"""

import ctypes
import fcntl
import os
import signal
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType

SIGNALS = (signal.SIGINT, signal.SIGTERM)

_came: list[int] = []
"""The signal that came since command() or worker(), if any."""

_afterwards: signal.Handlers | None = None
"""What becomes of further signals in a process that is there for one end; None in any other."""

_raised = 0
"""How often Ctrl-C was raised as KeyboardInterrupt by us."""

_noticing = 0
"""How many contexts of noticing() there are."""

Handler = Callable[[int, FrameType | None], None]


def command() -> None:
    """Have SIGTERM do what Ctrl-C does from now on, in a process that is there for one command."""
    global _afterwards
    _afterwards = signal.SIG_DFL
    if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not ignored, as after `&`
        _handle(signal.SIGINT, _interrupt)
    _handle(signal.SIGTERM, _terminate)


def worker() -> None:
    """Have Ctrl-C end this process once, and nothing else: whoever started it will kill it.

    Where it comes while an object is cleared away, Python tells of it and goes on; it is not told.
    """
    global _afterwards
    _afterwards = signal.SIG_IGN
    signal.signal(signal.SIGTERM, signal.SIG_IGN)
    _handle(signal.SIGINT, _interrupt)
    sys.unraisablehook = _told


def _told(unraisable: "sys.UnraisableHookArgs") -> None:
    """Tell of an error that cannot be raised, but not of Ctrl-C."""
    if not isinstance(unraisable.exc_value, KeyboardInterrupt):
        sys.__unraisablehook__(unraisable)


def end_with(lifeline: int) -> None:
    """End this process, whatever its FMU is doing, once another has ended that keeps a pipe open.

    `lifeline` is the end of that pipe to read from, through which nothing comes.
    """

    def wait() -> None:
        os.read(lifeline, 1)
        os._exit(1)

    fcntl.fcntl(lifeline, fcntl.F_SETOWN, os.getpid())
    fcntl.fcntl(lifeline, fcntl.F_SETFL, os.O_ASYNC)  # SIGIO ends it while an FMU keeps the GIL
    threading.Thread(target=wait, daemon=True).start()


def came() -> int | None:
    """The first signal that this command got; None before that."""
    return _came[0] if _came else None


def leave_to_system(number: int, action: signal.Handlers) -> None:
    """Have the kernel ignore a signal, or end the process by it.

    Not by signal.signal(), by which Python complains of a signal that came right before.
    """
    set_action = ctypes.CDLL(None).signal
    set_action.argtypes, set_action.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_void_p
    set_action(number, int(action))


def _handle(number: int, handler: Handler) -> None:
    """Have a handler take a signal; in a command once, a second one ends it at once."""
    if _afterwards is not signal.SIG_DFL:
        signal.signal(number, handler)
        return
    blocked = signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    try:
        signal.signal(number, handler)
        libc = ctypes.CDLL(None)
        if hasattr(libc, "sysv_signal"):  # glibc; it leaves Python's own handler, but for one time
            set_once = libc.sysv_signal
            set_once.argtypes, set_once.restype = (ctypes.c_int, ctypes.c_void_p), ctypes.c_void_p
            set_once(number, set_once(number, None))
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, blocked)


def _is_first(number: int) -> bool:
    """True for the first signal, and in a process that is there for more than one end."""
    if _afterwards is None:
        return True
    if _came:  # both came at once
        return False
    _came.append(number)
    for each in SIGNALS:
        leave_to_system(each, _afterwards)
    return True


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _raised
    if _is_first(number):
        _raised += 1
        signal.default_int_handler(number, frame)


def _terminate(number: int, frame: FrameType | None) -> None:
    handler = signal.getsignal(signal.SIGINT)
    (handler if callable(handler) else _interrupt)(number, frame)


@contextmanager
def handled(handler: Handler, *numbers: int) -> Iterator[None]:
    """A handler of these signals in this context; in a command it gets one of them, once."""

    def take(number: int, frame: FrameType | None) -> None:
        if _is_first(number):
            handler(number, frame)

    previous = {} if _came else {number: signal.getsignal(number) for number in numbers}
    for number in previous:
        _handle(number, take)
    try:
        yield
    finally:
        for number, before in previous.items():
            if before in (_interrupt, _terminate) and not _came:
                _handle(number, before)
            elif not _came:
                signal.signal(number, before)


@contextmanager
def noticing() -> Iterator[None]:
    """interruptible() works in this context, also outside of a command."""
    global _noticing
    here = threading.current_thread() is threading.main_thread()
    if here and signal.getsignal(signal.SIGINT) is signal.default_int_handler:
        signal.signal(signal.SIGINT, _interrupt)
    _noticing += 1
    try:
        yield
    finally:
        _noticing -= 1
        last = here and not _noticing and _afterwards is None
        if last and signal.getsignal(signal.SIGINT) is _interrupt:
            signal.signal(signal.SIGINT, signal.default_int_handler)


@contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C is a KeyboardInterrupt here even where an FMU makes an error of its own of it.

    A Python FMU does, or one that is a proxy and waits for its peer.
    """
    before = _raised
    try:
        yield
    except Exception as error:
        if _raised != before and threading.current_thread() is threading.main_thread():
            raise KeyboardInterrupt from error
        raise
    if _raised != before and threading.current_thread() is threading.main_thread():
        raise KeyboardInterrupt  # an FMU has swallowed it


@contextmanager
def interrupts(interrupted: threading.Event) -> Iterator[None]:
    """Collects Ctrl-C instead of raising it, which could happen inside a Python FMU."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.getsignal(signal.SIGINT)

    def remember(*_: object) -> None:
        interrupted.set()
        if _afterwards is None:
            signal.signal(signal.SIGINT, previous)  # a second Ctrl-C does not wait

    with handled(remember, signal.SIGINT):
        yield
