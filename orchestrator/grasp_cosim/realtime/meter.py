"""Takes the wall times of a paced run, chunk by chunk, and keeps what they come to.

A step is judged when the next one arrives: it is late where that is after its deadline. The time
between two arrivals is divided without a gap: waiting for the start, the segments of the step, then
recording and what else there is between two steps.
"""

from collections import Counter
from collections.abc import Sequence
from fractions import Fraction

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..system.description import System
from ..system.parts import NANOSECONDS
from ..system.realtime import Realtime
from .histogram import Histograms
from .timing import Histogram, Overrun, Spread, Timing

HEAD = 4
ARRIVED, LATE, DUE, BEGIN = range(HEAD)
"""Places of times in ns that the pacer writes: when the step before had ended, by how much that was
after its deadline, when the step should begin, when it did. The ends of its segments follow.
"""

LISTED = 1000
"""The most overruns that are listed one by one."""

STEP, START = "step", "start"
EXCHANGE, RECORDING, BETWEEN, BACKLOG = "exchange", "recording", "between", "backlog"
RESERVED = (STEP, START, EXCHANGE, RECORDING, BETWEEN, BACKLOG)

Steps = npt.NDArray[np.int64]
Table = npt.NDArray[np.float64]
"""Times in ns: whole numbers, exact below 2**53."""


def segments_of(system: System) -> tuple[int, ...]:
    """Return the owner of each segment of a step: a component by index, or the exchange, -1.

    The components are called one after the other; in the Jacobi scheme all take their inputs
    before the first one steps.
    """
    components = range(len(system.components))
    if system.scheme == "sequential":
        return tuple(i for c in components for i in (-1, c))
    return (-1, *components, *components)


class Meter:
    """The statistics of one run."""

    def __init__(self, system: System, realtime: Realtime, period: Fraction) -> None:
        """InputError where a component has the name of another part."""
        names = [component.name for component in system.components]
        for name in names:
            if name in RESERVED:
                raise InputError(
                    f"{system.name}: component {name!r}: in real time must not be called "
                    f"{', '.join(RESERVED)}, which are other parts of a step"
                )
        self.segments = segments_of(system)
        self.overruns = 0
        """The number of steps that ended late."""
        self._system, self._realtime, self._period = system, realtime, period
        self._names = (*names, EXCHANGE)
        self._periods = np.array([1, 1, *map(system.period, names), 1, 1])
        self._phase = 0 if system.scheme == "jacobi" else -1
        owners = np.array(self.segments) % len(self._names)  # the exchange is the last one
        self._order = owners.argsort(kind="stable")
        self._firsts = owners[self._order].searchsorted(np.arange(len(self._names)))
        self._inside = Histograms(len(self._names) + 3)
        self._recording = Histograms(1)
        self._recordings: list[tuple[int, int]] = []
        self._culprits: Counter[str] = Counter()
        self._listed: list[Overrun] = []
        self._rows = np.empty((0, HEAD + len(self.segments)))
        self._next = 0
        self._judged = 0
        self._first_due = self._last_end = 0.0
        self._usual, self._usual_of = np.zeros(0), 0

    def add(self, steps: Steps, rows: Table) -> None:
        """Take the rows (HEAD, then the ends of the segments) of the steps of these numbers.

        Judges the steps up to the last one, which waits for what comes after it.
        """
        if not len(self._rows):
            self._first_due = rows[0, DUE]
        rows = np.concatenate((self._rows, rows))
        self._rows, self._next = rows[-1:].copy(), int(steps[-1])
        if len(rows) > 1:
            self._judge(np.arange(self._next + 1 - len(rows), self._next), rows[:-1], rows[1:])

    def end(self, arrived: int, late: int) -> None:
        """No step follows the last one; the next one would have begun now."""
        row = np.zeros_like(self._rows)
        row[0, ARRIVED], row[0, LATE] = arrived, late
        self._judge(np.array([self._next]), self._rows, row)
        self._rows = self._rows[:0]

    def recorded(self, step: int, took: int) -> None:
        """After that step, recording took so many ns. Comes before the next step is judged."""
        self._recordings.append((step, took))

    def verdict(self) -> str:
        """The overrun that was listed last, in words."""
        last = self._listed[-1]
        return (
            f"{self._system.name}: the step at t = {last.time:.9g} s ended {1e3 * last.late:.3g} ms"
            f" late: {last.culprit} took {1e3 * last.took:.3g} ms; "
            f"must end within {float(self._period) / 1e6:.6g} ms"
        )

    def live(self) -> str:
        """Return the state of the run in a few words."""
        worst = self._inside.worst(0) / 1e6
        factor = self._real_time_factor()
        return f"{factor:.3g}x, worst step {worst:.3g} ms, {self.overruns} overruns"

    def timing(self, granted: Sequence[str], refused: Sequence[str]) -> Timing:
        """Return the timing so far, with the answers of the operating system."""
        spreads, histograms = {}, {}
        inside = (STEP, START, *self._names, BETWEEN)
        for name in (*inside, RECORDING):
            recording = name == RECORDING
            found, i = (self._recording, 0) if recording else (self._inside, inside.index(name))
            if spread := found.spread(i):
                times = (t / NANOSECONDS for t in spread[:4])
                spreads[name] = Spread._make((*times, self._time(int(spread.worst_at))))
                edges, counts = found.bars(i)
                histograms[name] = Histogram(tuple(e / NANOSECONDS for e in edges), tuple(counts))
        return Timing(
            factor=float(self._realtime.factor),
            period=float(self._period) / NANOSECONDS,
            overrun=self._realtime.overrun,
            granted=tuple(granted),
            refused=tuple(refused),
            steps=self._judged,
            real_time_factor=self._real_time_factor(),
            overruns=self.overruns,
            listed=tuple(self._listed),
            culprits=dict(self._culprits.most_common()),
            parts=spreads,
            histograms=histograms,
        )

    def _time(self, step: int) -> float:
        return self._system.time_ns(step) / NANOSECONDS

    def _real_time_factor(self) -> float:
        """Simulated by wall time, from the first deadline to the last one, or the end after it."""
        if not self._judged:
            return 0.0
        return self._judged * self._system.step_ns / (self._last_end - self._first_due)

    def _judge(self, steps: Steps, rows: Table, after: Table) -> None:
        """Take steps, given what came after each of them."""
        recorded = self._recorded(steps)
        segments = np.diff(rows[:, BEGIN:], axis=1)
        parts = np.add.reduceat(segments[:, self._order], self._firsts, axis=1)
        start, whole = rows[:, BEGIN] - rows[:, DUE], rows[:, -1] - rows[:, BEGIN]
        between = after[:, ARRIVED] - rows[:, -1] - recorded
        times = np.column_stack((whole, start, parts, between))
        self._inside.add(times, steps, self._happened(steps))
        self._judged += len(steps)
        self._last_end = max(rows[-1, DUE] + float(self._period), rows[-1, -1])
        late = np.flatnonzero(after[:, LATE] > 0.0)
        if len(late):
            ready = np.maximum(rows[:, DUE], rows[:, ARRIVED])
            suspects = np.column_stack(
                (rows[:, BEGIN] - ready, ready - rows[:, DUE], parts, between, recorded)
            )
            self._blame(steps[late], after[late, LATE], suspects[late])

    def _recorded(self, steps: Steps) -> Table:
        """Return the time in ns that recording took after each of these consecutive steps."""
        spent = np.zeros(len(steps))
        first, last = int(steps[0]), int(steps[-1])
        taken = [entry for entry in self._recordings if entry[0] <= last]
        if taken:
            self._recordings = self._recordings[len(taken) :]
            after, took = np.array([s for s, _ in taken]), np.array([float(t) for _, t in taken])
            np.add.at(spent, after - first, took)
            self._recording.add(took[:, np.newaxis], after)
        return spent

    def _happened(self, steps: Steps) -> npt.NDArray[np.bool_] | None:
        """Return the parts that ran, a row per step; None if all did, as slow components do not."""
        periods = self._periods
        if (periods == 1).all():
            return None
        phase = steps[:, np.newaxis] % periods
        happened: npt.NDArray[np.bool_] = (phase == periods - 1) | (phase == self._phase)
        return happened

    def _blame(self, steps: Steps, late: Table, suspects: Table) -> None:
        """Take steps that ended late, and what may have made each of them late."""
        names = (START, BACKLOG, *self._names, BETWEEN, RECORDING)
        if 4 * self._judged > 5 * self._usual_of:  # medians are slow to change, and to find
            self._usual, self._usual_of = self._find_usual(), self._judged
        worst = (suspects - self._usual).argmax(axis=1)
        self.overruns += len(steps)
        self._culprits.update(names[i] for i in worst.tolist())
        for i in range(min(len(steps), LISTED - len(self._listed))):
            step, culprit = int(steps[i]), int(worst[i])
            late_by, took = (float(t) / NANOSECONDS for t in (late[i], suspects[i, culprit]))
            overrun = Overrun(step, self._time(step), late_by, names[culprit], took)
            self._listed.append(overrun)

    def _find_usual(self) -> Table:
        """Return the usual times of the suspects in ns: the medians over all steps.

        Where a step takes longer than its period anyhow, nothing that it usually takes is an
        excuse, and no backlog a reason.
        """
        step, start, *parts = self._inside.medians()
        if step > self._period:
            return np.array([0.0, np.inf, *np.zeros(len(parts) + 1)])
        slow = self._periods[2:] > 1  # such a one takes no time in most steps
        return np.array([start, 0.0, *np.where(slow, 0.0, parts), 0.0])
