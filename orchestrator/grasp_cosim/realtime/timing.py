"""The timing of a paced run: its wall times, kept in a temporary file, and what they come to.

A step is judged when the next one arrives: it is late where that is after its deadline. The time
between two arrivals is divided without a gap: waiting for the start, the segments of the step, then
recording and what else there is between two steps. A Timing is plain data, in s.
"""

from array import array
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from tempfile import TemporaryFile
from typing import Any, NamedTuple, Self
from weakref import finalize

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..system.description import System
from ..system.parts import Realtime
from ..system.times import NANOSECONDS, in_seconds


class Overrun(NamedTuple):
    """A step that ended late: its number, when it began, by how much, what caused it and took."""

    step: int
    time: float
    late: float
    culprit: str
    took: float


class Spread(NamedTuple):
    """Durations of a part; `worst_at` is the simulated time at which the worst step began."""

    median: float
    p99: float
    p999: float
    worst: float
    worst_at: float


class Histogram(NamedTuple):
    """counts[i] values are from edges[i] up to, and without, edges[i + 1]."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]


def _texts(found: Any) -> tuple[str, ...]:
    return tuple(map(str, found))


PLAIN: Mapping[str, Any] = {
    "factor": float, "period": float, "overrun": str, "granted": _texts, "refused": _texts,
    "steps": int, "real_time_factor": float,
}  # fmt: skip
"""The fields of a Timing that run.json has as they are."""

SPREAD_KEYS = ("median", "p99", "p99.9", "worst", "worst_at")
"""The fields of a Spread as run.json names them."""


@dataclass(frozen=True)
class Timing:
    """The timing of a run: how well it kept to the clock.

    factor is what was asked for, real_time_factor what came of it. overruns and culprits, by
    name, count all of them; listed are the first ones. parts and histograms are by name: step (the
    time it computes), start (how late it begins), each component, exchange (the rest of the step),
    recording (handing rows on), between (what else is between two steps: the loop, the progress,
    the caller of Session.step). A part that never happened is in neither.
    """

    factor: float
    period: float
    overrun: str
    granted: tuple[str, ...]
    refused: tuple[str, ...]
    steps: int
    real_time_factor: float
    overruns: int
    listed: tuple[Overrun, ...]
    culprits: Mapping[str, int]
    parts: Mapping[str, Spread]
    histograms: Mapping[str, Histogram]

    def as_dict(self) -> dict[str, Any]:
        """Return the timing as run.json has it."""
        return {
            **{key: getattr(self, key) for key in PLAIN},
            "granted": list(self.granted),
            "refused": list(self.refused),
            "overruns": {
                "count": self.overruns,
                "culprits": dict(self.culprits),
                "listed": [o._asdict() for o in self.listed],
            },
            "parts": {n: dict(zip(SPREAD_KEYS, p, strict=True)) for n, p in self.parts.items()},
            "histograms": {
                name: {"edges": list(h.edges), "counts": list(h.counts)}
                for name, h in self.histograms.items()
            },
        }

    @classmethod
    def from_dict(cls, place: str, found: Any) -> Self:
        """Read what as_dict() gave; InputError, naming the `place`, if it is something else."""
        try:
            overruns, parts, bars = (found[key] for key in ("overruns", "parts", "histograms"))
            read = cls(
                **{key: kind(found[key]) for key, kind in PLAIN.items()},
                overruns=int(overruns["count"]),
                listed=tuple(
                    Overrun(*(kind(o[key]) for key, kind in Overrun.__annotations__.items()))
                    for o in overruns["listed"]
                ),
                culprits={str(name): int(n) for name, n in overruns["culprits"].items()},
                parts={
                    n: Spread(*(float(p[key]) for key in SPREAD_KEYS)) for n, p in parts.items()
                },
                histograms={
                    n: Histogram(tuple(map(float, h["edges"])), tuple(map(int, h["counts"])))
                    for n, h in bars.items()
                },
            )
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise _damaged(place, f"{type(error).__name__}: {error}") from error
        if read.overruns and not (read.listed and STEP in read.parts and read.steps):
            raise _damaged(place, "it has overruns, and does not say of which step")
        if any(len(h.edges) != len(h.counts) + 1 for h in read.histograms.values()):
            raise _damaged(place, "a histogram has not one edge more than counts")
        if not read.histograms.keys() <= read.parts.keys():
            raise _damaged(place, "there are histograms of other parts")
        return read


def _damaged(place: str, why: str) -> InputError:
    return InputError(
        f"{place}: is damaged ({why}); must be what `grasp-cosim run --realtime --out` wrote"
    )


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

QUANTILES = (0.5, 0.99, 0.999)
"""Those of a Spread."""

FINE = 16
"""Bars of a histogram to an octave."""

Steps = npt.NDArray[np.int64]
Table = npt.NDArray[np.float64]
"""Times in ns: whole numbers, exact below 2**53."""


class Meter:
    """The statistics of one run."""

    def __init__(self, system: System, realtime: Realtime, period: Fraction) -> None:
        """InputError where a component has the name of another part."""
        components = [component.name for component in system.components]
        for name in components:
            if name in RESERVED:
                raise InputError(
                    f"{system.name}: component {name!r}: in real time must not be called "
                    f"{', '.join(RESERVED)}, which are other parts of a step"
                )
        own = range(len(components))
        each = [owner for i in own for owner in (-1, i)]
        self.segments = each if system.scheme == "sequential" else [-1, *own, *own]
        """The owner of each segment of a step: a component by index, or the exchange, -1. In the
        Jacobi scheme all components take their inputs before the first one steps."""
        self._system, self._realtime, self._period = system, realtime, float(period)
        self._names = (*components, EXCHANGE)
        self._culprits = {c.name: f"{c.name}'s peer" for c in system.components if c.is_proxy}
        self._every = {name: system.period(name) for name in components}
        self._file = TemporaryFile(prefix="grasp_times_")  # noqa: SIM115 - open as long as this
        finalize(self, self._file.close)
        self._first = self._rows = self._overruns = self._worst = 0
        self._after: tuple[int, int] | None = None
        self._recordings = array("q"), array("q")

    def add(self, steps: Steps, rows: Table) -> None:
        """Take the rows of these steps; one counts when it is known what comes after it."""
        if not self._rows:
            self._first = int(steps[0])
        self._file.write(rows.tobytes())
        self._rows += len(rows)
        self._overruns += int(np.count_nonzero(rows[:, LATE] > 0.0))
        self._worst = max(self._worst, int((rows[:, -1] - rows[:, BEGIN]).max()))

    def end(self, arrived: int, late: int) -> None:
        """No step follows the last one; the next one would have begun then, and so late."""
        self._after = arrived, late
        self._overruns += late > 0

    def recorded(self, step: int, took: int) -> None:
        """After that step, recording took so many ns."""
        self._recordings[0].append(step)
        self._recordings[1].append(took)

    def verdict(self) -> str:
        """The last overrun, in words."""
        last = self._blame(*self._judged())[-1]
        return (
            f"{self._system.name}: the step at t = {last.time:.9g} s ended {1e3 * last.late:.3g} ms"
            f" late: {last.culprit} took {1e3 * last.took:.3g} ms; "
            f"must end within {self._period / 1e6:.6g} ms"
        )

    def live(self) -> str:
        """Return the state of the run in a few words."""
        factor, worst = self._real_time_factor(), self._worst / 1e6
        return f"{factor:.3g}x, worst step {worst:.3g} ms, {self._overruns} overruns"

    def timing(self, granted: Sequence[str], refused: Sequence[str]) -> Timing:
        """Return the timing so far, with the answers of the operating system."""
        steps, _, _, parts = judged = self._judged()
        overruns = self._blame(*judged)
        ran = {name: self._ran(name, steps, part) for name, part in parts.items()}
        times = {n: (part[ran[n]], steps[ran[n]]) for n, part in parts.items() if len(ran[n])}
        return Timing(
            factor=float(self._realtime.factor),
            period=self._period / NANOSECONDS,
            overrun=self._realtime.overrun,
            granted=tuple(granted),
            refused=tuple(refused),
            steps=self._count,
            real_time_factor=self._real_time_factor(),
            overruns=len(overruns),
            listed=tuple(overruns[:LISTED]),
            culprits=dict(Counter(o.culprit for o in overruns).most_common()),
            parts={name: self._spread(*both) for name, both in times.items()},
            histograms={name: _bars(part) for name, (part, _) in times.items()},
        )

    @property
    def _count(self) -> int:
        """The number of steps of which it is known what came after them."""
        return max(self._rows - (self._after is None), 0)

    def _table(self) -> Table:
        """All rows so far, mapped from the file."""
        self._file.flush()
        shape = self._rows, HEAD + len(self.segments)
        if not self._rows:
            return np.empty(shape)
        return np.asarray(np.memmap(self._file, np.float64, "r", shape=shape))

    def _real_time_factor(self) -> float:
        """Simulated by wall time, from the first deadline to the last one, or the end after it."""
        if not (count := self._count):
            return 0.0
        first, last = self._table()[[0, count - 1]]
        end = max(last[DUE] + self._period, last[-1])
        return float(count * self._system.step_ns) / float(end - first[DUE])

    def _judged(self) -> tuple[Steps, Table, Table, dict[str, Table]]:
        """The steps that count, their rows, by how much each was late, and what the parts took."""
        table, count, owners = self._table(), self._count, np.array(self.segments)
        after, rows = table[1:, :DUE], table[:count]
        if self._after is not None:
            after = np.vstack((after, self._after))
        arrived, late = after[:count].T
        at, took = (np.frombuffer(values, np.int64) for values in self._recordings)
        known = at < self._first + count
        recorded = np.bincount(at[known] - self._first, took[known], count).astype(float)
        begin, end, spans = rows[:, BEGIN], rows[:, -1], np.diff(rows[:, BEGIN:])
        parts: dict[str, Table] = {STEP: end - begin, START: begin - rows[:, DUE]}
        for i, name in enumerate(self._names):
            parts[name] = spans[:, owners % len(self._names) == i].sum(axis=1)
        parts |= {BETWEEN: arrived - end - recorded, RECORDING: recorded}
        return self._first + np.arange(count), rows, late, parts

    def _blame(
        self, steps: Steps, rows: Table, late: Table, parts: dict[str, Table]
    ) -> list[Overrun]:
        """The steps that ended late, each with the part that took longest beyond what is usual."""
        overdue = np.flatnonzero(late > 0.0)
        if not len(overdue):
            return []
        # What a part usually takes is no excuse where a step takes longer than its period anyhow,
        # and then a backlog is no reason. A slow component takes no time in most steps.
        usual = {BACKLOG: np.inf}
        if np.median(parts[STEP]) <= self._period:
            always = (name for name in self._names if self._every.get(name, 1) == 1)
            usual = {name: np.median(parts[name]) for name in (START, *always, BETWEEN)}
        ready = np.maximum(rows[:, DUE], rows[:, ARRIVED])
        names = (START, BACKLOG, *self._names, BETWEEN, RECORDING)
        suspects = parts | {START: rows[:, BEGIN] - ready, BACKLOG: ready - rows[:, DUE]}
        spent = np.array([suspects[name][overdue] for name in names])
        worst = (spent - [[usual.get(name, 0.0)] for name in names]).argmax(axis=0)
        spent = spent[worst, np.arange(len(overdue))]
        columns = (v.tolist() for v in (steps[overdue], late[overdue], worst, spent))
        return [
            Overrun(
                step,
                self._time(step),
                by / NANOSECONDS,
                self._culprits.get(names[i], names[i]),
                took / NANOSECONDS,
            )
            for step, by, i, took in zip(*columns, strict=True)
        ]

    def _ran(self, name: str, steps: Steps, times: Table) -> Steps:
        """The places of the steps in which a part happened: a slow component runs in some only."""
        if name == RECORDING:
            return np.flatnonzero(times)
        every = self._every.get(name, 1)
        turn, last = steps % every, every - 1
        first = 0 if self._system.scheme == "jacobi" else last
        return np.flatnonzero((turn == last) | (turn == first))

    def _spread(self, times: Table, steps: Steps) -> Spread:
        worst = times.argmax()
        found = [*np.quantile(times, QUANTILES, method="inverted_cdf"), times[worst]]
        at = self._time(int(steps[worst]))
        return Spread._make((*(float(t) / NANOSECONDS for t in found), at))

    def _time(self, step: int) -> float:
        return in_seconds(self._system.time_ns(step))


def _bars(times: Table) -> Histogram:
    """A histogram by octaves; empty bars side by side are one, and there are none at the ends."""
    bars, counts = np.unique(np.floor(FINE * np.log2(np.maximum(times, 1.0))), return_counts=True)
    edges = np.union1d(bars, bars + 1.0)
    heights = np.zeros(len(edges) - 1, int)
    heights[np.searchsorted(edges, bars)] = counts
    return Histogram(tuple((2.0 ** (edges / FINE) / NANOSECONDS).tolist()), tuple(heights.tolist()))
