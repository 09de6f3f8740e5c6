"""What only some operating systems have, with what the others get in its place.

No other module asks for it. On Windows there is no priority, no pinning, no locked memory, and no
group of processes: the children of a process of ours live on. macOS lacks the first three.
"""

import ctypes
import mmap
import os
import select
import signal
import sys
import threading
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

NotPossible = AttributeError
"""What is raised for what the system does not have: Python offers what there is."""

_os: Any = os
_signal: Any = signal
_mmap: Any = mmap
_select: Any = select

CURRENT, FUTURE, ON_FAULT = 1, 2, 4
"""Flags of mlockall on Linux: pages that are there, that will be, each from its first use on."""


# ------------------------------------------------------------------ threads and memory


def cpus() -> list[int]:
    """Return the CPUs that this thread may run on; none where the system does not say."""
    try:
        return sorted(_os.sched_getaffinity(0))
    except NotPossible:
        return []


def be_ordinary(cpus: Collection[int]) -> None:
    """Have this thread run on these CPUs at no special priority; without, it does so anyway."""
    with suppress(NotPossible, OSError):
        _os.sched_setscheduler(0, _os.SCHED_OTHER, _os.sched_param(0))
        _os.sched_setaffinity(0, cpus)


def pin(thread: int, cpu: int) -> Callable[[], object]:
    """Have a thread run on one CPU; return what puts that back. OSError, NotPossible."""
    previous_cpus = _os.sched_getaffinity(thread)
    _os.sched_setaffinity(thread, {cpu})
    return lambda: _os.sched_setaffinity(thread, previous_cpus)


def put_first(thread: int, priority: int) -> Callable[[], object]:
    """Give a thread a priority of SCHED_FIFO; return what puts that back. OSError, NotPossible."""
    policy, parameter = _os.sched_getscheduler(thread), _os.sched_getparam(thread)
    _os.sched_setscheduler(thread, _os.SCHED_FIFO, _os.sched_param(priority))
    return lambda: _os.sched_setscheduler(thread, policy, parameter)


def lock_memory() -> Callable[[], object]:
    """Keep our memory from being paged out; return what permits it. OSError, NotPossible."""
    if sys.platform != "linux":  # whose flags these are
        raise NotPossible("mlockall")
    library = ctypes.CDLL(None, use_errno=True)
    if library.mlockall(CURRENT | FUTURE | ON_FAULT):
        code = ctypes.get_errno()
        raise OSError(code, os.strerror(code))
    return library.munlockall


def memory(size: int) -> mmap.mmap:
    """Return so many bytes, as far as can be chosen without a huge page.

    Of which each column of a table would make the system clear one, in the middle of a run.
    """
    with suppress(NotPossible):
        private = _mmap.MAP_PRIVATE | _mmap.MAP_ANONYMOUS
        return mmap.mmap(-1, size, private)
    return mmap.mmap(-1, size)


# ------------------------------------------------------------------ processes


@contextmanager
def deferred(signals: Iterable[int]) -> Iterator[None]:
    """What Python does about signals that come meanwhile, it does at the end.

    For what must not be cut in two by a KeyboardInterrupt, such as starting a process and noting
    that it is to be ended.
    """
    came: list[int] = []
    handlers: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        handlers = {number: signal.getsignal(number) for number in signals}
    python_handlers = {n: handler for n, handler in handlers.items() if callable(handler)}
    for number in python_handlers:
        signal.signal(number, lambda number, _: came.append(number))
    try:
        yield
    finally:
        for number, handler in python_handlers.items():
            signal.signal(number, handler)
        for number in came:
            python_handlers[number](number, None)


@contextmanager
def held_back(signals: Iterable[int]) -> Iterator[None]:
    """Signals that come meanwhile come at the end, and not at all to processes started here.

    The mask of this thread is for those processes; another thread may take a signal all the same,
    so what Python does then waits, too. Where there is no such mask, a process that is about to
    start gets them.
    """
    with deferred(signals), _masked(signals):
        yield


@contextmanager
def _masked(signals: Iterable[int]) -> Iterator[None]:
    """Nothing here, nor a process that is started here, is told of signals, if the system can."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    from multiprocessing.resource_tracker import ensure_running

    ensure_running()  # else the first process that is started has it run, which lifts the mask
    mask = _signal.pthread_sigmask(_signal.SIG_BLOCK, signals)
    try:
        yield
    finally:
        _signal.pthread_sigmask(_signal.SIG_SETMASK, mask)


def end_when_closed(lifeline: int) -> None:
    """Have the system end this process when the other end of a pipe is closed, if it can.

    By SIGIO, which does so while an FMU keeps Python's lock: a thread could not.
    """
    with suppress(ImportError):
        import fcntl

        control: Any = fcntl
        control.fcntl(lifeline, control.F_SETOWN, os.getpid())
        control.fcntl(lifeline, control.F_SETFL, _os.O_ASYNC)


def listener(pipe: Any) -> Callable[[float], object]:
    """Return what waits at most so many s, and says whether something comes out of a connection.

    By poll(), which takes a tenth of the time, where there is one.
    """
    if not hasattr(select, "poll"):
        return pipe.poll  # type: ignore[no-any-return]
    poll = _select.poll()
    poll.register(pipe.fileno(), _select.POLLIN)
    return lambda seconds: poll.poll(1000.0 * seconds)


def end_group(leader: int) -> None:
    """End what a process, which began its own session, has started and left behind."""
    with suppress(NotPossible, OSError):  # there are none, as a rule
        _os.killpg(leader, _signal.SIGKILL)


def is_mine(place: Path) -> bool:
    """Return True if a file or folder, not a link to it, belongs to the user of this process."""
    return not hasattr(os, "getuid") or place.lstat().st_uid == _os.getuid()


def end_fork(owner: int) -> None:
    """End this process at once if it is a fork of its `owner`, a process ID.

    An FMU may fork and forget to end its child, which then comes back to us: files, output and
    other processes are its parent's.
    """
    if os.getpid() != owner:
        os._exit(0)


# ------------------------------------------------------------------ the C library


def c_library() -> Any:
    """Return the C library that Python uses; None where the system has not got it by a name."""
    with suppress(OSError):
        try:
            return ctypes.CDLL(None)
        except TypeError:  # Windows
            return ctypes.CDLL("ucrtbase")
    return None


def flush_c() -> None:
    """Write what C code has printed and is still in memory."""
    if library := c_library():
        library.fflush(None)


def when_c_exits(call: Any) -> None:
    """Have a C function called where exit() ends this process; on Windows it is not."""
    with suppress(NotPossible):
        c_library().__cxa_atexit(call, None, None)
