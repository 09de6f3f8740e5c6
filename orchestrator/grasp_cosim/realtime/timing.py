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
from ..system.parts import NANOSECONDS, Realtime


class Overrun(NamedTuple):
    """A step that ended late: its number, the time it began at, by how much, what caused it.

    took is the wall time of what caused it.
    """

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


PLAIN = {"factor": float, "period": float, "overrun": str, "steps": int, "real_time_factor": float}
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
                name: {key: list(values) for key, values in h._asdict().items()}
                for name, h in self.histograms.items()
            },
        }

    @classmethod
    def from_dict(cls, place: str, found: Any) -> Self:
        """Read what as_dict() gave; InputError, naming the `place`, if it is something else."""
        try:
            overruns, parts, bars = (found[key] for key in ("overruns", "parts", "histograms"))
            return cls(
                **{key: kind(found[key]) for key, kind in PLAIN.items()},
                granted=tuple(map(str, found["granted"])),
                refused=tuple(map(str, found["refused"])),
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
            raise InputError(
                f"{place}: is damaged ({type(error).__name__}: {error}); "
                "must be what `grasp-cosim run --realtime --out` wrote"
            ) from error


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

PER_MILLE = (500, 990, 999)
"""The ranks of a Spread."""

FINE = 16
"""Bars of a histogram to an octave."""

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
        self.system, self.realtime, self.period = system, realtime, period
        self.names = (*names, EXCHANGE)
        self._file = TemporaryFile(prefix="grasp_times_")  # noqa: SIM115 - open as long as this
        finalize(self, self._file.close)
        self.first = self._rows = self._worst = 0
        self._first_due = self._last_end = self._before_last = 0.0
        self.after: tuple[int, int] | None = None
        """When the step after the last one would have begun, and how late that was."""
        self.recordings = array("q"), array("q")
        """After which steps rows were handed on, and the ns that it took."""

    def add(self, steps: Steps, rows: Table) -> None:
        """Take the rows (HEAD, then the ends of the segments) of the steps of these numbers.

        A step counts from when it is known what comes after it.
        """
        if not self._rows:
            self.first, self._first_due = int(steps[0]), float(rows[0, DUE])
        ends = np.maximum(rows[-2:, DUE] + float(self.period), rows[-2:, -1]).tolist()
        self._before_last, self._last_end = [self._last_end, *ends][-2:]
        self._file.write(rows.tobytes())
        self._rows += len(rows)
        self.overruns += int(np.count_nonzero(rows[:, LATE] > 0.0))
        self._worst = max(self._worst, int((rows[:, -1] - rows[:, BEGIN]).max()))

    def end(self, arrived: int, late: int) -> None:
        """No step follows the last one; the next one would have begun now."""
        self.after = arrived, late
        self.overruns += late > 0

    def recorded(self, step: int, took: int) -> None:
        """After that step, recording took so many ns."""
        self.recordings[0].append(step)
        self.recordings[1].append(took)

    def verdict(self) -> str:
        """The last overrun, in words."""
        last = _Judged(self).overruns(slice(-1, None))[0]
        return (
            f"{self.system.name}: the step at t = {last.time:.9g} s ended {1e3 * last.late:.3g} ms"
            f" late: {last.culprit} took {1e3 * last.took:.3g} ms; "
            f"must end within {float(self.period) / 1e6:.6g} ms"
        )

    def live(self) -> str:
        """Return the state of the run in a few words."""
        factor = self.real_time_factor()
        return f"{factor:.3g}x, worst step {self._worst / 1e6:.3g} ms, {self.overruns} overruns"

    def real_time_factor(self) -> float:
        """Simulated by wall time, from the first deadline to the last one, or the end after it."""
        if not self.judged:
            return 0.0
        end = self._last_end if self.after else self._before_last
        return self.judged * self.system.step_ns / (end - self._first_due)

    @property
    def judged(self) -> int:
        """The number of steps of which it is known what came after them."""
        return max(self._rows - (self.after is None), 0)

    def rows(self) -> Table:
        """All rows so far, mapped from the file."""
        self._file.flush()
        shape = self._rows, HEAD + len(self.segments)
        return (
            np.memmap(self._file, np.float64, "r", shape=shape) if self._rows else np.empty(shape)
        )

    def timing(self, granted: Sequence[str], refused: Sequence[str]) -> Timing:
        """Return the timing so far, with the answers of the operating system."""
        found = _Judged(self)
        listed = found.overruns(slice(None))
        times = found.times()
        return Timing(
            factor=float(self.realtime.factor),
            period=float(self.period) / NANOSECONDS,
            overrun=self.realtime.overrun,
            granted=tuple(granted),
            refused=tuple(refused),
            steps=self.judged,
            real_time_factor=self.real_time_factor(),
            overruns=len(listed),
            listed=tuple(listed[:LISTED]),
            culprits=dict(Counter(o.culprit for o in listed).most_common()),
            parts={name: found.spread(*both) for name, both in times.items()},
            histograms={name: _bars(part) for name, (part, _) in times.items()},
        )


class _Judged:
    """The times of the steps that a meter has judged, by part, in ns."""

    def __init__(self, meter: Meter) -> None:
        self._meter, self._system = meter, meter.system
        rows, count = meter.rows(), meter.judged
        after = rows[1:, :DUE] if meter.after is None else np.vstack((rows[1:, :DUE], meter.after))
        self._rows, self._arrived, self._late = rows[:count], after[:, ARRIVED], after[:, LATE]
        self._steps = meter.first + np.arange(count)
        at, took = (np.frombuffer(values, np.int64) for values in meter.recordings)
        known = at < meter.first + count
        self._recordings = took[known].astype(float), at[known]
        self._recorded = np.bincount(at[known] - meter.first, took[known], count)

    def times(self) -> dict[str, tuple[Table, Steps]]:
        """The times of all parts that happened, and the steps in which they did."""
        found = {}
        for name in (STEP, START, *self._meter.names, BETWEEN):
            # a slow component runs in some steps only
            period, phase = self._period(name), 0 if self._system.scheme == "jacobi" else -1
            turn = self._steps % period
            ran = (turn == period - 1) | (turn == phase)
            found[name] = self._part(name)[ran], self._steps[ran]
        found[RECORDING] = self._recordings
        return {name: both for name, both in found.items() if len(both[0])}

    def overruns(self, which: slice) -> list[Overrun]:
        """The steps that ended late, and what may have made each of them so."""
        late = np.flatnonzero(self._late > 0.0)
        if not len(late):
            return []
        names = (START, BACKLOG, *self._meter.names, BETWEEN, RECORDING)
        usual, late = self._usual(), late[which]
        rows = self._rows[late]
        ready = np.maximum(rows[:, DUE], rows[:, ARRIVED])
        own = [self._part(name)[late] for name in names[2:-1]]
        suspects = np.column_stack(
            (rows[:, BEGIN] - ready, ready - rows[:, DUE], *own, self._recorded[late])
        )
        worst = (suspects - usual).argmax(axis=1)
        took = suspects[np.arange(len(late)), worst]
        return [
            Overrun(step, self._time(step), by / NANOSECONDS, names[i], spent / NANOSECONDS)
            for step, by, i, spent in zip(
                *(v.tolist() for v in (self._steps[late], self._late[late], worst, took)),
                strict=True,
            )
        ]

    def spread(self, times: Table, steps: Steps) -> Spread:
        """The spread of the times of a part, and in which step the worst one was."""
        ranks = [-(-len(times) * rank // 1000) - 1 for rank in PER_MILLE]
        found = [*np.partition(times, ranks)[ranks].tolist(), float(times.max())]
        at = self._time(int(steps[times.argmax()]))
        return Spread._make((*(t / NANOSECONDS for t in found), at))

    def _usual(self) -> Table:
        """Return the usual times of the suspects in ns: the medians over all steps.

        Where a step takes longer than its period anyhow, nothing that it usually takes is an
        excuse, and no backlog a reason. A slow component takes no time in most steps.
        """
        names = (*self._meter.names, BETWEEN)
        if np.median(self._part(STEP)) > self._meter.period:
            return np.array([0.0, np.inf, *np.zeros(len(names) + 1)])
        usual = [0.0 if self._period(n) > 1 else np.median(self._part(n)) for n in names]
        return np.array([np.median(self._part(START)), 0.0, *usual, 0.0])

    def _part(self, name: str) -> Table:
        """The time that a part took in each step."""
        rows = self._rows
        if name == STEP:
            return np.asarray(rows[:, -1] - rows[:, BEGIN])
        if name == START:
            return np.asarray(rows[:, BEGIN] - rows[:, DUE])
        if name == BETWEEN:
            return np.asarray(self._arrived - rows[:, -1] - self._recorded)
        owner, own = self._meter.names.index(name), np.zeros(len(rows))
        for i, segment in enumerate(self._meter.segments, BEGIN):
            if segment % len(self._meter.names) == owner:
                own += rows[:, i + 1] - rows[:, i]
        return own

    def _period(self, name: str) -> int:
        return self._system.period(name) if name in self._meter.names[:-1] else 1

    def _time(self, step: int) -> float:
        return self._system.time_ns(step) / NANOSECONDS


def _bars(times: Table) -> Histogram:
    """A histogram by octaves; empty bars side by side are one, and there are none at the ends."""
    bars, counts = np.unique(np.floor(FINE * np.log2(np.maximum(times, 1.0))), return_counts=True)
    edges: list[float] = []
    heights: list[int] = []
    for bar, count in zip(bars.tolist(), counts.tolist(), strict=True):
        if edges and edges[-1] != bar:
            heights.append(0)
        if not edges or edges[-1] != bar:
            edges.append(bar)
        edges.append(bar + 1)
        heights.append(count)
    return Histogram(tuple(2.0 ** (e / FINE) / NANOSECONDS for e in edges), tuple(heights))
