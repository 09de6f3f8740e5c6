"""Waits for the clock, at the beginning of each step, and what it asks of the system for that.

The pacer and the stamps between the components write wall times into the vector of values, behind
the slots of the ports. So they are in the rows of the loop, and cost nothing where there are none.
"""

import ctypes
import gc
import os
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
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
from ..system.times import NANOSECONDS
from .timing import ARRIVED, BEGIN, HEAD, LATE, SCHEDULED, Meter, Steps, Table

SPIN_NS = 200_000
"""Before the deadline the pacer does not sleep any more: it may be woken too late."""

MAX_SPIN = 0.4
"""The most of a period that it spins: Linux breaks a real-time priority off where there is hardly
any sleep, for 40 to 50 ms in a second. At this share it never was, at 10 kHz.
"""

SLICE_NS = 50_000_000
"""The longest sleep between two looks at Ctrl-C."""

BREATH_NS = 500_000_000
"""At a real-time priority the longest time without a sleep, as nothing else may get to run."""

MIN_ROWS = 64
"""The rows that are handed on together while it waits, if there is time for it."""

NAP = 1e-4
"""s of a sleep that is there for others only."""

HAS_CLOCK = sys.platform == "linux"
"""True if time.monotonic_ns() is the clock that compiled code reads, CLOCK_MONOTONIC."""


class OverrunError(Exception):
    """A step ended after its deadline, and the run is to stop there."""


class HaltError(Exception):
    """The run was interrupted while it waited for the beginning of a step."""


class StallError(Exception):
    """A step would begin so late that the peers would get commands from what was measured before.

    late is by how much, in s.
    """

    def __init__(self, late: float) -> None:
        super().__init__(late)
        self.late = late


class _State(ctypes.Structure):
    """The state of a pacer, which compiled code goes on with: see master/loop.c.

    Times are in ns since the origin. Step k is due at base + (k - base_step) numerator/denominator;
    base_step is -1 before the first one. It spins for the last `spin` before that. `slept` is when
    it slept last, `breath` after how long without a sleep it needs one, 0 for never. An overrun
    shifts the schedule, or stops the run beyond the tolerance. `arrived` is when the last step had
    ended, `late` by how much after its deadline; more than `stall`, if that is not 0, is a stall.
    """

    _fields_ = [
        (name, ctypes.c_int64)
        for name in (
            *("origin", "base", "base_step", "numerator", "denominator", "spin", "slept"),
            *("breath", "shifts", "stops", "arrived", "late", "tolerance", "stall"),
        )
    ]


CLOCK_OF_THE_SYSTEM = time.monotonic_ns, time.sleep
"""A monotonic clock in ns, and a sleep of a time in s by it."""


class Pacer:
    """Begins each step at its time, and hands the wall times on to the meter."""

    def __init__(
        self,
        system: System,
        realtime: Realtime,
        halted: Callable[[], bool] = lambda: False,
        clock: tuple[Callable[[], int], Callable[[float], None]] | None = None,
    ) -> None:
        """InputError as of Realtime.period() and Meter, or if there is no such CPU. Another is that
        steps would be caught up with although a component is a proxy.
        """
        processors = os.cpu_count() or 1  # None where that is not known
        last_cpu = max(processors - 1, *cpus(), 0)
        if realtime.cpu is not None and realtime.cpu > last_cpu:
            message = f"no such CPU here; must be from 0 to {last_cpu}"
            raise InputError(f"cpu = {realtime.cpu}: {message}")
        proxies = [component.name for component in system.components if component.is_proxy]
        if proxies and realtime.overrun == "catch-up":
            raise InputError(
                f"realtime: overrun = 'catch-up': a burst of steps would go to the hardware behind "
                f"{choices(proxies)}; must be 'continue' or 'stop' with a proxy"
            )
        realtime = resolved(realtime, bool(proxies))
        period = realtime.period(system.step_ns)
        self.meter = Meter(system, realtime, period)
        self.realtime = realtime
        self.width = HEAD + len(self.meter.segments)
        """The number of values it needs in a row."""
        self.halted = halted
        self.spare: Callable[[float], bool] | None = None
        """Does something that may wait within so many ns; False if there is nothing to do."""
        self._clock, self._sleep = clock or CLOCK_OF_THE_SYSTEM
        self._period = period.as_integer_ratio()
        numerator, denominator = self._period
        self._state = _State(
            origin=self._clock(),
            base_step=-1,
            numerator=numerator,
            denominator=denominator,
            spin=min(SPIN_NS, int(MAX_SPIN * period)),
            shifts=realtime.overrun == "continue",
            stops=realtime.overrun == "stop",
            tolerance=round(realtime.tolerance * NANOSECONDS),
        )
        if realtime.priority is not None:
            self._state.breath = BREATH_NS
        if proxies:
            self._state.stall = round(realtime.stall * NANOSECONDS)
        self._taken = self._recording = 0
        self.bind(np.zeros(self.width), lambda _: None)

    def bind(self, values: npt.NDArray[np.float64], hand_on: Callable[[int], None]) -> None:
        """Have it write into these values, and hand on the rows before a step while it waits."""
        self._values, self._hand_on = values, hand_on
        self._head: Any = memoryview(values[:HEAD])  # type: ignore[arg-type]  # numpy's 3.11 stubs

    def stamp(self, i: int) -> Call:
        """The call that says when segment i of a step has ended."""
        data, clock, origin = self._values[HEAD + i :][:1], self._clock, self._state.origin
        view: Any = memoryview(data)  # type: ignore[arg-type]  # numpy's 3.11 stubs

        def python() -> int:
            view[0] = clock() - origin
            return 0

        if clock is not time.monotonic_ns or not HAS_CLOCK:
            return Call(python)
        return Call(python, Native(CLOCK, 0, 0, size=origin, data=data.ctypes.data))

    def native(self, steps: int) -> Native | None:
        """The same as calling it, in compiled code; None where so many steps do not allow that."""
        fits = max(self._period[0] * steps, self._period[1]) < 2**62
        if not fits or not HAS_CLOCK or self._clock is not time.monotonic_ns:
            return None
        state = ctypes.addressof(self._state)
        return Native(PACE, 0, state, data=self._values.ctypes.data)

    def __call__(self, step: int) -> None:
        """Wait for the beginning of a step; HaltError, OverrunError where the run ends there."""
        self._use_the_wait(step)
        state, head, origin = self._state, self._head, self._state.origin
        now_ns = self._arrive(step)
        due = self._due(step)
        head[ARRIVED], head[LATE] = now_ns, state.late
        if 0 < state.stall < state.late:
            raise self.stall()
        if state.late > 0 and state.shifts:
            state.base, state.base_step, due = now_ns, step, now_ns
        if now_ns + state.spin < due:
            while (remaining := due - state.spin - now_ns) > 0:
                if self.halted():
                    raise HaltError
                self._sleep(min(remaining, SLICE_NS) / NANOSECONDS)
                now_ns = self._clock() - origin
            state.slept = now_ns
        elif state.breath and now_ns - state.slept > state.breath:
            self._sleep(NAP)
            state.slept = now_ns = self._clock() - origin
        while now_ns < due:
            now_ns = self._clock() - origin
        head[SCHEDULED], head[BEGIN] = due, now_ns

    def finish(self, step: int, now_ns: int | None = None) -> None:
        """The last step has just ended, or did at now_ns; OverrunError where it stops at that."""
        self.meter.end(self._arrive(step, now_ns), self._state.late)

    def overrun(self) -> OverrunError:
        """The error where it is to stop, also of compiled code."""
        self.meter.end(self._state.arrived, self._state.late)
        return OverrunError()

    def stall(self) -> StallError:
        """The error where a step would begin too late, also of compiled code."""
        return StallError(self._state.late / NANOSECONDS)

    def begin_anew(self) -> None:
        """Have the schedule begin with the next step."""
        self._state.base_step = -1

    def record(self, steps: Steps, rows: Table, hand_on: Callable[[], None]) -> None:
        """Take the rows of steps, by the numbers they lead to; handing them on is recording."""
        self._taken = int(steps[-1])
        start = self._clock()
        try:
            self.meter.add(steps - 1, rows)
            hand_on()
        finally:
            self._recording = self._clock() - start
            self.meter.recorded(self._taken - 1, self._recording)

    def _use_the_wait(self, step: int) -> None:
        """Do what has to be done some time, if half as long again as last time is left for it."""
        waiting = step - self._taken
        if self._state.base_step < 0 or (waiting < MIN_ROWS and self.spare is None):
            return
        spare = self._due(step) - (self._clock() - self._state.origin)
        if waiting >= MIN_ROWS and 2 * spare > 3 * self._recording:
            self._hand_on(step)
        elif self.spare is not None:
            start = self._clock()
            if self.spare(2 * spare / 3):
                self.meter.recorded(step - 1, self._clock() - start)

    def _arrive(self, step: int, now_ns: int | None = None) -> int:
        """The time now; late is by how much the step before ended late, negative if it did not."""
        state = self._state
        arrived: int = (self._clock() if now_ns is None else now_ns) - state.origin
        if state.base_step < 0:
            state.base, state.base_step, state.slept = arrived, step, arrived
        state.arrived, state.late = arrived, arrived - self._due(step)
        if state.late > state.tolerance and state.stops:
            raise self.overrun()
        return arrived

    def _due(self, step: int) -> int:
        since: int = step - self._state.base_step
        return int(self._state.base) + since * self._period[0] // self._period[1]


def resolved(realtime: Realtime, has_proxies: bool) -> Realtime:
    """The same with what follows on an overrun, where that is left to us."""
    if realtime.overrun != "auto":
        return realtime
    return replace(realtime, overrun="continue" if has_proxies else "catch-up")


LIMIT = "needs {}, or a limit that is high enough (ulimit {} in /etc/security/limits.conf)"

KERNEL = Path("/proc/sys/kernel")
"""Where Linux says what threads of a real-time priority may take of each period: two files, in us;
no more than that, -1 for no limit.
"""


@dataclass(frozen=True)
class Privileges:
    """A line for each privilege that was requested, of those granted and of those refused."""

    granted: list[str] = field(default_factory=list)
    refused: list[str] = field(default_factory=list)


@contextmanager
def privileges(realtime: Realtime) -> Iterator[Privileges]:
    """Ask for the privileges of a run in real time, and keep the garbage collector away.

    All is put back at the end. Priority and CPU are those of the calling thread. Of a priority the
    line names the part of the time the kernel permits it.
    """
    answers = Privileges()
    with ExitStack() as stack:
        gc.collect()  # now, and then not before the end: it would take too long on the way
        gc.freeze()
        stack.callback(gc.unfreeze)
        if gc.isenabled():
            stack.callback(gc.enable)
        gc.disable()
        for request in _requests(realtime):
            try:
                stack.callback(request.ask())
            except NotPossible:
                answers.refused.append(f"{request.name}: not possible on this operating system")
            except OSError as error:
                answers.refused.append(f"{request.name}: {error.strerror}; {request.remedy}")
            else:
                share = permitted_share() if request.is_priority else ""
                answers.granted.append(request.name + share)
        yield answers


class _Request(NamedTuple):
    """A privilege that is asked of the operating system."""

    name: str
    ask: Callable[[], Callable[[], object]]
    """Asks for it, and returns what puts it back; OSError or NotPossible where it is refused."""
    remedy: str
    """What helps where it is refused."""
    is_priority: bool = False


def _requests(realtime: Realtime) -> Iterator[_Request]:
    """The privileges that a run in real time wants."""
    thread, cpu, priority = threading.get_native_id(), realtime.cpu, realtime.priority
    if cpu is not None:
        yield _Request(f"CPU {cpu}", partial(pin, thread, cpu), f"must be one of {choices(cpus())}")
    if realtime.lock_memory:
        yield _Request("memory locked", lock_memory, LIMIT.format("CAP_IPC_LOCK", "-l, memlock"))
    if priority is not None:
        yield _Request(
            f"SCHED_FIFO, priority {priority}",
            partial(put_first, thread, priority),
            LIMIT.format("CAP_SYS_NICE", "-r, rtprio"),
            is_priority=True,
        )


def permitted_share() -> str:
    """What part of the time the kernel permits a thread of a real-time priority, in words."""
    with suppress(OSError, ValueError):  # not Linux, which has no such limit
        runtime, period = (
            int((KERNEL / f"sched_rt_{name}_us").read_text()) for name in ("runtime", "period")
        )
        if 0 <= runtime < period:
            return (
                f" (the kernel permits it {100 * runtime / period:g} % of each {period / 1e6:g} s)"
            )
    return ""


def long_waits(system: System, realtime: Realtime) -> list[str]:
    """A line for each proxy that may wait for its peer for longer than a period."""
    period = float(realtime.period(system.step_ns)) / NANOSECONDS
    return [
        f"{component.name}: proxy.timeout = {timeout:g} s is longer than the period of {period:g} "
        "s: one answer that is lost makes the steps after it late"
        for component in system.components
        if component.is_proxy and (timeout := float(component.of_proxy("timeout"))) > period
    ]
