"""Ctrl-C and SIGTERM: the first ends in good order what goes on, the second ends it at once.

SIGTERM, with which systemd and Docker stop a command, does there what Ctrl-C does.

Nothing can take a KeyboardInterrupt in the callback of a weak reference, a `__del__` or a callback
from C: Python only prints it. The command then raises it once more.
"""

import ctypes
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from types import FrameType
from typing import NoReturn

from .system_calls import end_when_closed

SIGNALS = (signal.SIGINT, signal.SIGTERM)

AT_ONCE = 0.1
"""s in which several signals are one, such as the two that `timeout` sends."""

_came: list[int] = []
"""The signals that came since command(); 0 where none came before over()."""

_lost = threading.Event()
"""Set once the KeyboardInterrupt of a signal was lost."""

LOST = 0
"""What stands for a KeyboardInterrupt that was lost, where signals stand by their numbers."""


def command() -> None:
    """Have SIGTERM do what Ctrl-C does from now on, and a second signal end the process at once.

    A thread ends it, as Python's handlers do not run while an FMU hangs in C code.
    """
    for number in SIGNALS:
        if signal.getsignal(number) is not signal.SIG_IGN:  # as after `&`
            signal.signal(number, _raise)
    reader, writer = socket.socketpair()
    writer.setblocking(False)
    signal.set_wakeup_fd(writer.fileno())
    sys.unraisablehook = _noting_what_is_lost(writer, sys.unraisablehook)
    threading.Thread(target=_follow_signals, args=(reader,), daemon=True).start()


def over() -> int:
    """The first signal that this command got, else 0; from here on a signal changes nothing."""
    _came.append(0)
    return _came[0]


def lost() -> bool:
    """True if the KeyboardInterrupt of a signal was lost, and perhaps never taken."""
    return _lost.is_set()


def came() -> bool:
    """True once this command got a signal."""
    return bool(_came)


def worker(lifeline: int) -> None:
    """Leave signals to the process that started this one, and end with it, whatever an FMU does.

    `lifeline` is the end to read from of a pipe that it keeps open, through which nothing comes, or
    what multiprocessing has for that.
    """
    from multiprocessing.connection import wait

    def end() -> None:
        wait([lifeline])
        os._exit(1)

    for number in SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    end_when_closed(lifeline)
    threading.Thread(target=end, daemon=True).start()


@contextmanager
def interrupts(end: Callable[[], object]) -> Iterator[threading.Event]:
    """Here the first signal calls `end`, instead of raising KeyboardInterrupt, and sets the event.

    Nothing changes within another such context, nor in another thread than the main one.
    """
    interrupted = threading.Event()
    in_main_thread = threading.current_thread() is threading.main_thread()
    signals: list[int] = [
        n for n in SIGNALS if signal.getsignal(n) in (_raise, signal.default_int_handler)
    ]

    def take(number: int, _: FrameType | None) -> None:
        if handlers[number] is not _raise or _is_first(number):
            restore()
            interrupted.set()
            end()

    def restore() -> None:
        for number, handler in handlers.items():
            signal.signal(number, handler)

    handlers = {number: signal.signal(number, take) for number in signals if in_main_thread}
    try:
        yield interrupted
    finally:
        restore()


class _RaisedAgainError(KeyboardInterrupt):
    """One that may be lost, as another follows it at the end of its context."""


@contextmanager
def raised(end: Callable[[], object]) -> Iterator[None]:
    """Here the first signal calls `end`; at the end it is a KeyboardInterrupt, whatever came."""
    with interrupts(end) as came:
        try:
            yield
        finally:
            if came.is_set():
                raise KeyboardInterrupt


@contextmanager
def interruptible() -> Iterator[None]:
    """Ctrl-C is a KeyboardInterrupt here, even where a Python FMU makes an error of it."""

    def end() -> NoReturn:
        raise _RaisedAgainError

    with raised(end):
        yield


def _raise(number: int, _: FrameType | None) -> None:
    if _is_first(number):
        raise KeyboardInterrupt


def _is_first(number: int) -> bool:
    _came.append(number)
    return len(_came) == 1  # after that _follow_signals() ends the process


def _noting_what_is_lost(
    writer: socket.socket, previous_hook: Callable[["sys.UnraisableHookArgs"], object]
) -> Callable[["sys.UnraisableHookArgs"], None]:
    """What Python calls for an exception that nothing can take; others go to the hook before."""

    def note(unraisable: "sys.UnraisableHookArgs") -> None:
        if not issubclass(unraisable.exc_type, KeyboardInterrupt):
            previous_hook(unraisable)
        elif unraisable.exc_type is not _RaisedAgainError:
            _lost.set()
            writer.send(bytes([LOST]))

    return note


def _follow_signals(reader: socket.socket) -> None:
    """End the process by a signal that does not come at once with the first.

    Where the KeyboardInterrupt was lost, raise it again in the main thread: later, as it would be
    lost again where that is still about the first. No signal tells of it, which would be a second.
    """
    reader.recv(1, socket.MSG_PEEK)
    time.sleep(AT_ONCE)
    news = bytes([LOST]) if LOST in reader.recv(64) else b""
    while True:
        for number in news:
            if number != LOST:
                os._exit(128 + number)
            time.sleep(AT_ONCE)
            _raise_in_main_thread()
        news = reader.recv(64)


def _raise_in_main_thread() -> None:
    main = threading.main_thread().ident
    if main is not None and 0 not in _came:
        ctypes.pythonapi.PyThreadState_SetAsyncExc(
            ctypes.c_ulong(main), ctypes.py_object(KeyboardInterrupt)
        )
