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


PLAIN_FIELDS = ("factor", "period", "overrun", "steps", "real_time_factor")
"""The fields of a Timing that run.json has as they are."""

SPREAD_KEYS = ("median", "p99", "p99.9", "worst", "worst_at")
"""The fields of a Spread as run.json names them."""


@dataclass(frozen=True)
class Timing:
    """The timing of a run: how well it kept to the clock.

    factor is what was asked for, real_time_factor what came of it. overruns and culprits, by name,
    count all of them; listed are the first ones. parts and histograms are by name: step (the time
    it computes), start (how late it begins), each component, exchange (the rest of the step) and
    recording (handing rows on). The last one is between, the rest between two steps: the loop, the
    progress, the caller of Session.step. A part that never happened is in neither.
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
        overruns = {
            "count": self.overruns,
            "culprits": dict(self.culprits),
            "listed": [overrun._asdict() for overrun in self.listed],
        }
        parts = {
            name: dict(zip(SPREAD_KEYS, spread, strict=True)) for name, spread in self.parts.items()
        }
        histograms = {
            name: {"edges": list(histogram.edges), "counts": list(histogram.counts)}
            for name, histogram in self.histograms.items()
        }
        return {
            **{field: getattr(self, field) for field in PLAIN_FIELDS},
            "granted": list(self.granted),
            "refused": list(self.refused),
            "overruns": overruns,
            "parts": parts,
            "histograms": histograms,
        }

    @classmethod
    def from_dict(cls, place: str, entry: Mapping[str, Any]) -> Self:
        """The timing that as_dict() gave, as an entry of run.json that has the types it must have.

        InputError, which names the `place`, where its parts do not fit each other.
        """
        overruns = entry["overruns"]
        spreads = {
            name: Spread(*(spread[key] for key in SPREAD_KEYS))
            for name, spread in entry["parts"].items()
        }
        histograms = {
            name: Histogram(tuple(histogram["edges"]), tuple(histogram["counts"]))
            for name, histogram in entry["histograms"].items()
        }
        timing = cls(
            **{field: entry[field] for field in PLAIN_FIELDS},
            granted=tuple(entry["granted"]),
            refused=tuple(entry["refused"]),
            overruns=overruns["count"],
            listed=tuple(Overrun(**overrun) for overrun in overruns["listed"]),
            culprits=overruns["culprits"],
            parts=spreads,
            histograms=histograms,
        )
        timing._check(place)
        return timing

    def _check(self, place: str) -> None:
        """InputError where what it has of its parts does not fit each other."""
        if self.overruns and not (self.listed and STEP in self.parts and self.steps):
            raise _damaged(place, "it has overruns, and does not say of which step")
        if any(len(h.edges) != len(h.counts) + 1 for h in self.histograms.values()):
            raise _damaged(place, "a histogram has not one edge more than counts")
        if not self.histograms.keys() <= self.parts.keys():
            raise _damaged(place, "there are histograms of other parts")


def _damaged(place: str, reason: str) -> InputError:
    return InputError(
        f"{place}: is damaged ({reason}); must be a file of `grasp-cosim run --realtime --out`"
    )


HEAD = 4
ARRIVED, LATE, SCHEDULED, BEGIN = range(HEAD)
"""Places of times in ns that the pacer writes: when the step before had ended, by how much that was
after its deadline, when the step should begin, when it did. The ends of its segments follow.
"""

MAX_LISTED = 1000
"""The most overruns that are listed one by one."""

STEP, START = "step", "start"
EXCHANGE, RECORDING, BETWEEN, BACKLOG = "exchange", "recording", "between", "backlog"
RESERVED = (STEP, START, EXCHANGE, RECORDING, BETWEEN, BACKLOG)
"""The names of parts of a step which no component can have."""

EXCHANGE_OWNER = -1
"""The owner of a segment of a step that is no component's."""

QUANTILES = (0.5, 0.99, 0.999)
"""Those of a Spread."""

BARS_PER_OCTAVE = 16
"""Of a histogram of durations."""

Steps = npt.NDArray[np.int64]
Table = npt.NDArray[np.float64]
"""Times in ns: whole numbers, exact below 2**53."""


class _Judged(NamedTuple):
    """The steps of which it is known whether they ended late; times in ns."""

    steps: Steps
    rows: Table
    late: Table
    """By how much each ended after its deadline."""
    parts: dict[str, Table]
    """What each part took in each step."""


class SoFar(NamedTuple):
    """Steps that ended after their deadline; the longest, and the latest begin of one, in s."""

    overruns: int
    longest: float
    latest: float


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
        self.segments = _owners_of_segments(len(components), system.scheme)
        """The owner of each segment of a step: a component by index, or EXCHANGE_OWNER."""
        self._system, self._realtime, self._period = system, realtime, float(period)
        self._names = (*components, EXCHANGE)
        self._culprits = {c.name: f"{c.name}'s peer" for c in system.components if c.is_proxy}
        self._periods = {name: system.period(name) for name in components}
        self._file = TemporaryFile(prefix="grasp_times_")  # noqa: SIM115 - open as long as this
        finalize(self, self._file.close)
        self._first = self._rows = self._overruns = self._worst = self._latest = 0
        self._arrival_after: tuple[int, int] | None = None
        """When the step after the last one would have begun, and how late."""
        self._recordings = array("q"), array("q")
        """Numbers of steps, and what recording took after each."""

    def add(self, steps: Steps, rows: Table) -> None:
        """Take the rows of these steps; one counts when it is known what comes after it."""
        if not self._rows:
            self._first = int(steps[0])
        self._file.write(rows.tobytes())
        self._rows += len(rows)
        self._overruns += int(np.count_nonzero(rows[:, LATE] > 0.0))
        self._worst = max(self._worst, int((rows[:, -1] - rows[:, BEGIN]).max()))
        self._latest = max(self._latest, int((rows[:, BEGIN] - rows[:, SCHEDULED]).max()))

    def end(self, arrived: int, late: int) -> None:
        """No step follows the last one; the next one would have begun then, and so late."""
        self._arrival_after = arrived, late
        self._overruns += late > 0

    def recorded(self, step: int, took: int) -> None:
        """After that step, recording took so many ns."""
        self._recordings[0].append(step)
        self._recordings[1].append(took)

    def verdict(self) -> str:
        """The last overrun, in words."""
        last = self._blame(self._judged())[-1]
        return (
            f"{self._system.name}: the step at t = {last.time:.9g} s ended {1e3 * last.late:.3g} ms"
            f" late: {last.culprit} took {1e3 * last.took:.3g} ms; "
            f"must end within {self._period / 1e6:.6g} ms"
        )

    def live(self) -> str:
        """Return the state of the run in a few words."""
        factor, worst = self._real_time_factor(), self._worst / 1e6
        return f"{factor:.3g}x, worst step {worst:.3g} ms, {self._overruns} overruns"

    def so_far(self) -> SoFar:
        """Return the figures that any thread may ask for while the run goes on."""
        return SoFar(self._overruns, self._worst / NANOSECONDS, self._latest / NANOSECONDS)

    def timing(self, granted: Sequence[str], refused: Sequence[str]) -> Timing:
        """Return the timing so far, with the answers of the operating system."""
        judged = self._judged()
        overruns = self._blame(judged)
        culprits = Counter(overrun.culprit for overrun in overruns)
        parts: dict[str, Spread] = {}
        histograms: dict[str, Histogram] = {}
        for name, durations in judged.parts.items():
            happened = self._happened(name, judged.steps, durations)
            if len(happened):
                parts[name] = self._spread(durations[happened], judged.steps[happened])
                histograms[name] = _histogram(durations[happened])
        return Timing(
            factor=float(self._realtime.factor),
            period=self._period / NANOSECONDS,
            overrun=self._realtime.overrun,
            granted=tuple(granted),
            refused=tuple(refused),
            steps=self._count,
            real_time_factor=self._real_time_factor(),
            overruns=len(overruns),
            listed=tuple(overruns[:MAX_LISTED]),
            culprits=dict(culprits.most_common()),
            parts=parts,
            histograms=histograms,
        )

    @property
    def _count(self) -> int:
        """The number of steps of which it is known what came after them."""
        return max(self._rows - (self._arrival_after is None), 0)

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
        end = max(last[SCHEDULED] + self._period, last[-1])
        return float(count * self._system.step_ns) / float(end - first[SCHEDULED])

    def _judged(self) -> _Judged:
        """The steps that count: it is known when the next one arrived."""
        table, count = self._table(), self._count
        next_arrivals = table[1:, :SCHEDULED]
        if self._arrival_after is not None:
            next_arrivals = np.vstack((next_arrivals, self._arrival_after))
        arrived, late = next_arrivals[:count].T
        rows = table[:count]
        recording = self._recording_after(count)
        begin, end = rows[:, BEGIN], rows[:, -1]
        parts: dict[str, Table] = {STEP: end - begin, START: begin - rows[:, SCHEDULED]}
        segments, owners = np.diff(rows[:, BEGIN:]), np.array(self.segments)
        for owner, name in enumerate(self._names[:-1]):
            parts[name] = segments[:, owners == owner].sum(axis=1)
        parts[EXCHANGE] = segments[:, owners == EXCHANGE_OWNER].sum(axis=1)
        parts[BETWEEN] = arrived - end - recording
        parts[RECORDING] = recording
        return _Judged(self._first + np.arange(count), rows, late, parts)

    def _recording_after(self, count: int) -> Table:
        """The time in ns that recording took after each of the first so many steps."""
        steps, durations = (np.frombuffer(values, np.int64) for values in self._recordings)
        counts = steps < self._first + count
        places = steps[counts] - self._first
        return np.bincount(places, durations[counts], count).astype(float)

    def _blame(self, judged: _Judged) -> list[Overrun]:
        """The steps that ended late, each with the part that took longest beyond what is usual."""
        overdue = np.flatnonzero(judged.late > 0.0)
        if not len(overdue):
            return []
        suspects = self._suspects(judged)
        names = list(suspects)
        usual = self._usual(judged.parts)
        durations = np.array([suspects[name][overdue] for name in names])
        excess = durations - np.array([[usual.get(name, 0.0)] for name in names])
        culprits = excess.argmax(axis=0)
        took = durations[culprits, np.arange(len(overdue))]
        columns = (judged.steps[overdue], judged.late[overdue], culprits, took)
        overruns: list[Overrun] = []
        for step, late_ns, culprit, took_ns in zip(*(c.tolist() for c in columns), strict=True):
            name = self._culprits.get(names[culprit], names[culprit])
            late, duration = late_ns / NANOSECONDS, took_ns / NANOSECONDS
            overruns.append(Overrun(step, self._time(step), late, name, duration))
        return overruns

    def _suspects(self, judged: _Judged) -> dict[str, Table]:
        """What each part took that may be to blame for a late step, in ns."""
        rows, parts = judged.rows, judged.parts
        # A step is ready to begin when it is due, or later, when the step before has ended.
        ready = np.maximum(rows[:, SCHEDULED], rows[:, ARRIVED])
        return {
            START: rows[:, BEGIN] - ready,
            BACKLOG: ready - rows[:, SCHEDULED],
            **{name: parts[name] for name in (*self._names, BETWEEN, RECORDING)},
        }

    def _usual(self, parts: Mapping[str, Table]) -> dict[str, float]:
        """What parts usually take, in ns, which is no reason for a step to be late.

        It is no excuse where a step takes longer than its period anyhow, and then a backlog is no
        reason. A slow component takes no time in most steps.
        """
        if np.median(parts[STEP]) > self._period:
            return {BACKLOG: np.inf}
        in_each_step = [name for name in self._names if self._periods.get(name, 1) == 1]
        usual = {name: float(np.median(parts[name])) for name in (START, *in_each_step, BETWEEN)}
        return {BACKLOG: 0.0, **usual}

    def _happened(self, name: str, steps: Steps, durations: Table) -> Steps:
        """The places of the steps in which a part happened: a slow component runs in some only."""
        if name == RECORDING:
            return np.flatnonzero(durations)
        period = self._periods.get(name, 1)
        phase, last = steps % period, period - 1
        first = 0 if self._system.scheme == "jacobi" else last
        return np.flatnonzero((phase == last) | (phase == first))

    def _spread(self, durations: Table, steps: Steps) -> Spread:
        worst = durations.argmax()
        quantiles = np.quantile(durations, QUANTILES, method="inverted_cdf")
        in_ns = (*quantiles.tolist(), float(durations[worst]))
        median, p99, p999, longest = (duration / NANOSECONDS for duration in in_ns)
        return Spread(median, p99, p999, longest, self._time(int(steps[worst])))

    def _time(self, step: int) -> float:
        return in_seconds(self._system.time_ns(step))


def _owners_of_segments(components: int, scheme: str) -> list[int]:
    """The owner of each segment of a step: a component by index, or the exchange.

    In the Jacobi scheme all components take their inputs before the first one steps.
    """
    if scheme == "jacobi":
        return [EXCHANGE_OWNER, *range(components), *range(components)]
    owners: list[int] = []
    for component in range(components):
        owners += [EXCHANGE_OWNER, component]
    return owners


def _histogram(durations: Table) -> Histogram:
    """A histogram by octaves; empty bars side by side are one, and there are none at the ends."""
    octaves = np.log2(np.maximum(durations, 1.0))
    bars, counts = np.unique(np.floor(BARS_PER_OCTAVE * octaves), return_counts=True)
    edges = np.union1d(bars, bars + 1.0)
    heights = np.zeros(len(edges) - 1, int)
    heights[np.searchsorted(edges, bars)] = counts
    edges_in_s = 2.0 ** (edges / BARS_PER_OCTAVE) / NANOSECONDS
    return Histogram(tuple(edges_in_s.tolist()), tuple(heights.tolist()))
