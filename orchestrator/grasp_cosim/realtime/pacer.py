"""Waits for the clock, at the beginning of each step, and what it asks of the system for that.

The pacer and the stamps between the components write wall times into the vector of values, behind
the slots of the ports. So they are in the rows of the loop, and cost nothing where there are none.
"""

import ctypes
import gc
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.calls import CLOCK, PACE, Call, Native
from ..base.errors import InputError, choices
from ..base.system_calls import NotPossible, cpus, lock_memory, pin, put_first
from ..system.description import System
from ..system.parts import Realtime
from .timing import ARRIVED, BEGIN, DUE, HEAD, LATE, Meter, Steps, Table

SPIN_NS = 200_000
"""Before the deadline the pacer does not sleep any more: it may be woken too late."""

MOST_SPIN = 0.85
"""The most of a period that it spins: a real-time priority is broken off where it never sleeps."""

SLICE_NS = 50_000_000
"""The longest sleep between two looks at Ctrl-C."""

BREATH_NS = 500_000_000
"""At a real-time priority the longest time without a sleep, as nothing else may get to run."""

SOME = 64
"""The rows that are handed on together while it waits, if there is time for it."""

NAP = 1e-4
"""s of a sleep that is there for others only."""


class OverrunError(Exception):
    """A step ended after its deadline, and the run is to stop there."""


class HaltError(Exception):
    """The run was interrupted while it waited for the beginning of a step."""


class _State(ctypes.Structure):
    """What compiled code knows of a pacer: see master/loop.c."""

    _fields_ = [
        (name, ctypes.c_int64)
        for name in (
            *("origin", "base", "base_step", "numerator", "denominator", "spin", "slept"),
            *("breath", "shifts", "stops", "arrived", "late"),
        )
    ]


class Clock(NamedTuple):
    """A monotonic clock in ns, and a sleep of a time in s by it."""

    now: Callable[[], int] = time.monotonic_ns
    sleep: Callable[[float], None] = time.sleep


class Pacer:
    """Begins each step at its time, and hands the wall times on to the meter."""

    def __init__(
        self,
        system: System,
        realtime: Realtime,
        halted: Callable[[], bool] = lambda: False,
        clock: Clock | None = None,
    ) -> None:
        """Ask halted while it waits; it says whether the run was interrupted.

        InputError as of Realtime.period() and Meter, and where the CPU is not there.
        """
        check_cpu(realtime)
        period = realtime.period(system.step_ns)
        self.meter = Meter(system, realtime, period)
        self._period = period.as_integer_ratio()
        self._spin = min(SPIN_NS, int(MOST_SPIN * period))
        self.breathes = False
        """True if it has to sleep from time to time for the sake of other processes."""
        self._policy = realtime.overrun
        self.halted = halted
        self._clock = clock or Clock()
        self._now = self._clock.now
        self._origin = self._now()
        self._slept = 0
        self._base = 0
        self._base_step: int | None = None
        self._end: tuple[int, int] | None = None
        self._taken = 0
        self._hand_on: Callable[[int], None] = lambda _: None
        self.spare: Callable[[float], bool] | None = None
        """Does something that may wait within so many ns; False if there is nothing to do."""
        self._recording = 0
        self._state = _State()
        self._head: Any = memoryview(bytearray(8 * HEAD)).cast("d")

    @property
    def sleeps(self) -> bool:
        """True if there is time to sleep between two steps."""
        numerator, denominator = self._period
        return numerator > SPIN_NS * denominator

    @property
    def width(self) -> int:
        """The number of values it needs in a row."""
        return HEAD + len(self.meter.segments)

    def bind(self, values: npt.NDArray[np.float64], hand_on: Callable[[int], None]) -> None:
        """Have it write into these values, width of them.

        hand_on hands on the rows of the steps before one. It is called while there is time to wait.
        """
        self._hand_on = hand_on
        self._head = memoryview(values[:HEAD])  # type: ignore[arg-type]  # numpy's 3.11 stubs
        self._stamped = values[HEAD:]

    def stamp(self, i: int) -> Call:
        """The call that says when segment i of a step has ended."""
        data, now, origin = self._stamped[i : i + 1], self._now, self._origin
        view: Any = memoryview(data)  # type: ignore[arg-type]  # numpy's 3.11 stubs

        def python() -> int:
            view[0] = now() - origin
            return 0

        if now is not time.monotonic_ns or not HAS_CLOCK:
            return Call(python)
        return Call(python, Native(CLOCK, 0, 0, size=origin, data=data.ctypes.data))

    def native(self, steps: int) -> Native | None:
        """The same as calling it, in compiled code that nobody else has to wait for; None where
        that is not possible in a run of so many steps. The state is handed over meanwhile.
        """
        if self._now is not time.monotonic_ns or not HAS_CLOCK:
            return None
        if self._period[0] * steps >= 2**62 or self._period[1] >= 2**62:
            return None
        head = np.frombuffer(self._head)
        return Native(PACE, 0, ctypes.addressof(self._state), data=head.ctypes.data)

    def hand_over(self) -> None:
        """Have compiled code go on from here: see native()."""
        state = self._state
        state.origin, state.base, state.slept = self._origin, self._base, self._slept
        state.base_step = -1 if self._base_step is None else self._base_step
        state.numerator, state.denominator = self._period
        state.spin, state.breath = self._spin, BREATH_NS if self.breathes else 0
        state.shifts, state.stops = self._policy == "continue", self._policy == "stop"

    def take_over(self, overrun: bool) -> None:
        """Go on from where compiled code came to; `overrun` if it was to stop at one."""
        state = self._state
        self._base, self._slept = state.base, state.slept
        self._base_step = None if state.base_step < 0 else state.base_step
        if overrun:
            self._end = state.arrived, state.late

    def __call__(self, step: int) -> None:
        """Wait for the beginning of a step.

        HaltError where the run is interrupted meanwhile, OverrunError where it stops at an overrun.
        """
        self._use_the_wait(step)
        arrived, late = self._arrive(step)
        if late > 0 and self._policy == "continue":
            self._base, self._base_step = arrived, step
        due = self._due(step)
        begin = self._wait(due, arrived)
        head = self._head
        head[ARRIVED], head[LATE], head[DUE], head[BEGIN] = arrived, late, due, begin

    def finish(self, step: int, now: int | None = None) -> None:
        """The last step has just ended, or at `now`, where another step would begin.

        OverrunError as above.
        """
        self._end = self._arrive(step, now)

    def record(self, steps: Steps, rows: Table, hand_on: Callable[[], None]) -> None:
        """Take steps that were done: the numbers they lead to, and what was written of each.

        Hands their rows on, which counts as recording.
        """
        self._taken = int(steps[-1])
        start = self._now()
        try:
            self.meter.add(steps - 1, rows)
            hand_on()
        finally:
            self._recording = self._now() - start
            self.meter.recorded(self._taken - 1, self._recording)

    def settled(self) -> Meter:
        """Return the meter with the end of the last step, once the steps until then are recorded.

        After an OverrunError it tells the cause.
        """
        if self._end is not None:
            self.meter.end(*self._end)
            self._end = None
        return self.meter

    def _use_the_wait(self, step: int) -> None:
        """Do what has to be done some time, where it is not likely to make the step late.

        It is expected to take half as long again as it did the last time.
        """
        waiting = step - self._taken
        if self._base_step is None or (waiting < SOME and self.spare is None):
            return
        spare = self._due(step) - (self._now() - self._origin)
        if waiting >= SOME and 2 * spare > 3 * self._recording:
            self._hand_on(step)
        elif self.spare is not None:
            start = self._now()
            if self.spare(2 * spare / 3):
                self.meter.recorded(step - 1, self._now() - start)

    def _arrive(self, step: int, now: int | None = None) -> tuple[int, int]:
        """The time now, and by how much the step before ended late; negative where it did not."""
        arrived = (self._now() if now is None else now) - self._origin
        if self._base_step is None:
            self._base, self._base_step, self._slept = arrived, step, arrived
        late = arrived - self._due(step)
        if late > 0 and self._policy == "stop":
            self._end = arrived, late
            raise OverrunError
        return arrived, late

    def _due(self, step: int) -> int:
        numerator, denominator = self._period
        return self._base + (step - (self._base_step or 0)) * numerator // denominator

    def _wait(self, due: int, now: int) -> int:
        """Sleep, then spin, until it is due; the time then."""
        if now + self._spin < due:
            while (left := due - self._spin - now) > 0:
                if self.halted():
                    raise HaltError
                self._clock.sleep(min(left, SLICE_NS) / 1e9)
                now = self._now() - self._origin
            self._slept = now
        elif self.breathes and now - self._slept > BREATH_NS:
            self._clock.sleep(NAP)
            self._slept = now = self._now() - self._origin
        while now < due:
            now = self._now() - self._origin
        return now


HAS_CLOCK = sys.platform == "linux"
"""True if time.monotonic_ns() is the clock that compiled code reads, CLOCK_MONOTONIC."""


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
