"""Requests of a paced run to the operating system. It does without what is not permitted."""

import gc
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from ..base.errors import InputError, choices
from ..base.system_calls import NotPossible, cpus, lock_memory, pin, put_first
from ..system.parts import Realtime

ONLINE = Path("/sys/devices/system/cpu/online")
"""The file in which Linux lists its CPUs, as in 0-3,6."""


SCHEDULING = (
    "needs CAP_SYS_NICE, or a limit of real-time priorities that is high enough "
    "(ulimit -r, rtprio in /etc/security/limits.conf)"
)
LOCKING = (
    "needs CAP_IPC_LOCK, or a limit of locked memory that is high enough "
    "(ulimit -l, memlock in /etc/security/limits.conf)"
)

THROTTLE = Path("/proc/sys/kernel")
"""The folder in which Linux limits the share of a period for threads of a real-time priority."""


@dataclass(frozen=True)
class Privileges:
    """A line for each that was asked for: those that were granted, and those that were not."""

    granted: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


def check_cpu(realtime: Realtime) -> None:
    """InputError where Linux runs no such CPU; other systems do not list theirs."""
    if realtime.cpu is None:
        return
    try:
        listed = ONLINE.read_text("ascii")
    except OSError:
        return
    ends = [tuple(map(int, part.split("-"))) for part in listed.split(",")]
    online = [number for span in ends for number in range(span[0], span[-1] + 1)]
    if realtime.cpu not in online:
        raise InputError(
            f"cpu = {realtime.cpu}: no such CPU here; must be one of {choices(online)}"
        )


@contextmanager
def privileges(realtime: Realtime, sleeps: bool = True) -> Iterator[Privileges]:
    """Asks for what is wanted, and keeps the garbage collector away; all is put back at the end.

    Priority and CPU are those of the calling thread. sleeps says whether it will sleep between two
    steps: if not, the kernel may break its priority off, which is then said.
    """
    found = Privileges()
    with ExitStack() as stack:
        gc.collect()  # now, and then not before the end: it would take too long on the way
        gc.freeze()
        stack.callback(gc.unfreeze)
        if gc.isenabled():
            stack.callback(gc.enable)
        gc.disable()
        thread, there = threading.get_native_id(), cpus()
        cpu, priority = realtime.cpu, realtime.priority
        wanted: list[tuple[str, Callable[[], Callable[[], object]], str]] = []
        if cpu is not None:
            remedy = f"must be one of {choices(there)}" if there else ""
            wanted.append((f"CPU {cpu}", partial(pin, thread, cpu), remedy))
        if realtime.lock_memory:
            wanted.append(("memory locked", lock_memory, LOCKING))
        if priority is not None:
            name = f"SCHED_FIFO, priority {priority}"
            wanted.append((name, partial(put_first, thread, priority), SCHEDULING))
        for name, ask, remedy in wanted:
            try:
                stack.callback(ask())
            except NotPossible:
                found.refused.append(f"{name}: not possible on this operating system")
            except OSError as error:
                found.refused.append(f"{name}: {error.strerror}; {remedy}")
            else:
                found.granted.append(name)
        if priority is not None and not sleeps:
            found.refused.extend(_throttled())
        yield found


def _throttled() -> list[str]:
    """A line, where the kernel stops a thread that runs all the time."""
    try:
        allowed, period = (
            int((THROTTLE / f"sched_rt_{name}_us").read_text()) for name in ("runtime", "period")
        )
    except OSError:  # not Linux, which has no such limit
        return []
    if not 0 <= allowed < period:
        return []
    return [
        "SCHED_FIFO all the time: the period leaves no time to sleep, and the kernel stops "
        f"such a thread for {(period - allowed) / 1e3:g} ms in every {period / 1e3:g} ms; "
        "sysctl kernel.sched_rt_runtime_us=-1 lifts that, or run without a priority"
    ]
