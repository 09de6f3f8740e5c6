"""Which rows of a triggered run are recorded: windows around where a condition becomes true.

A window begins at the earliest where the one before it ended, so that no row is in two of them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Protocol

import numpy as np

from ..base.errors import InputError
from ..interface.units import IDENTITY
from ..system.conditions import COMPARE, compared
from ..system.description import System
from ..system.parts import Port
from ..system.record import Trigger
from ..system.times import in_seconds, seconds
from .listener import Floats, Steps, Window


def check_every(system: System, every: int) -> None:
    """InputError where a window may have no row, as only so many steps have one."""
    trigger = system.record.trigger
    points = 1 + int(trigger.after_ns // system.step_ns) if trigger else every
    if trigger and every > points:
        raise InputError(
            f"every = {every}: a window of the recording may have no row; must be at most "
            f"{points}, the points from its trigger to record.after = {seconds(trigger.after_ns)}"
        )


class Receiver(Protocol):
    """Gets the rows of the windows."""

    def begin_window(self, window: Window) -> None:
        """A window begins."""

    def hand_on(self, steps: Steps, rows: Floats) -> None:
        """Rows of it, of which there are some; they are no longer as they are after the call."""

    def end_window(self, window: Window) -> None:
        """It ends."""


class TriggeredRows:
    """Hands on the rows that are in a window, and keeps those that may come into the next one.

    So it holds no more rows than a window has before its trigger. `log` has a line for each window.
    """

    def __init__(self, system: System, trigger: Trigger, slots: Mapping[Port, int]) -> None:
        """Of a system that runs; slots are the columns of all values."""
        self._system, self._condition = system, trigger.when
        self._before = int(trigger.before_ns // system.step_ns)
        self._after = int(trigger.after_ns // system.step_ns)
        port, self._change, self._constant = compared(system, trigger.when)
        self._place, self._compare = slots[port], COMPARE[trigger.when.relation]
        self._held = False
        self._kept: deque[tuple[Steps, Floats]] = deque()
        """Rows that come into the next window, if that is near."""
        self._window: Window | None = None
        """The one that is open; its last step is _end."""
        self._end = -1
        self._number_of_windows = 0
        self._lines: tuple[str, ...] = ()

    @property
    def is_open(self) -> bool:
        """True if the last row was in a window."""
        return self._window is not None

    @property
    def log(self) -> tuple[str, ...]:
        """A line for each window until now."""
        return self._lines

    @property
    def absence(self) -> tuple[str, ...]:
        """A line where the condition has never become true."""
        if self._number_of_windows:
            return ()
        return (f"record.trigger: {self._condition} never came true: nothing is recorded",)

    def saved(self) -> tuple[Any, ...]:
        """What it came to until now, for restore()."""
        window = self._window, self._end, self._number_of_windows
        return self._held, tuple(self._kept), window, self._lines

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved."""
        self._held, kept, window, self._lines = saved
        self._window, self._end, self._number_of_windows = window
        self._kept = deque(kept)

    def __call__(
        self, receiver: Receiver, steps: Steps, values: Floats, nth: Steps, rows: Floats
    ) -> None:
        """Take rows of all values of these steps, and the rows to be recorded of the n-th ones."""

        def part(first: int, last: int) -> tuple[Steps, Floats]:
            """The rows to be recorded from one step to another."""
            places = slice(*np.searchsorted(nth, (first, last + 1)))
            return nth[places], rows[places]

        first, last = int(steps[0]), int(steps[-1])
        for edge in self._edges(steps, values):
            if self._window and edge <= self._end:
                self._window = replace(self._window, times=self._window.times + 1)
            else:
                if self._window:
                    first = self._close(receiver, first, part)
                self._keep(*part(first, edge - 1), next_step=edge)
                self._open(receiver, edge)
                first = edge
            self._end = edge + self._after
        if self._window and self._end < last:
            first = self._close(receiver, first, part)
        if self._window:
            _hand_on(receiver, *part(first, last))
        else:
            self._keep(*part(first, last), next_step=last + 1)

    def end(self, receiver: Receiver, complete: bool) -> None:
        """End the window that is open, as the run ends."""
        if self._window:
            window, self._window = self._window, None
            receiver.end_window(replace(window, complete=complete))

    def _edges(self, steps: Steps, values: Floats) -> list[int]:
        """The steps at which the condition becomes true."""
        signal = values[:, self._place]
        if self._change != IDENTITY:
            with np.errstate(over="ignore", invalid="ignore"):
                signal = self._change(signal)
        holds = self._compare(signal, self._constant)
        held = np.append(self._held, holds[:-1])
        self._held = bool(holds[-1])
        edges: list[int] = steps[holds & ~held].tolist()
        return edges

    def _keep(self, steps: Steps, rows: Floats, next_step: int) -> None:
        """Keep copies of rows, but for those that are too early for a window of the next step."""
        kept = self._kept
        if len(steps):
            kept.append((steps.copy(), rows.copy()))
        begin = next_step - self._before
        while kept and kept[0][0][-1] < begin:
            kept.popleft()
        if kept and kept[0][0][0] < begin:
            steps, rows = kept[0]
            late = int(np.searchsorted(steps, begin))
            kept[0] = steps[late:], rows[late:]

    def _open(self, receiver: Receiver, step: int) -> None:
        """Begin a window at whose step the trigger came true, with the rows that are kept."""
        self._number_of_windows += 1
        time = self._system.time_ns(step)
        self._window = Window(self._number_of_windows, in_seconds(time))
        line = f"t = {seconds(time)}: recording {self._number_of_windows}: {self._condition}"
        self._lines = (*self._lines, line)
        receiver.begin_window(self._window)
        while self._kept:
            receiver.hand_on(*self._kept.popleft())

    def _close(
        self, receiver: Receiver, first: int, part: Callable[[int, int], tuple[Steps, Floats]]
    ) -> int:
        """Hand on the rest of the window that is open, and end it; the step behind it."""
        _hand_on(receiver, *part(first, self._end))
        self.end(receiver, complete=True)
        return max(first, self._end + 1)


def _hand_on(receiver: Receiver, steps: Steps, rows: Floats) -> None:
    """Hand rows on, if there are any."""
    if len(steps):
        receiver.hand_on(steps, rows)
