"""Each signal and metric of two runs in its band, given in a file or derived from the reference.

How they are derived: docs/studies.md. A file overrides that where it names a signal or metric, in
the unit of the original:

    [signals]
    "plant.gap[1]" = { absolute = 1e-5, relative = 1e-3, time = 2e-3 }
    "controller.*" = { relative = 0.01 }      # * stands for anything; an exact name goes first
    "plant.contact*" = { absolute = inf }     # not judged

    [metrics]
    time_to_contact = { absolute = 0.002 }    # of both fingers; or "time_to_contact[1]"
"""

import json
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import inf
from pathlib import Path
from typing import Any, Literal

import numpy as np

from ..base.checks import known, number, toml_table
from ..base.errors import InputError, choices, nearest
from ..metrics.metric import Metric, Signals, measure
from .side import Side
from .tube import Curve, deviation

SHARE = 1e-3
"""The smallest derived width as a share of the range, and time as a share of the duration."""

SMALL = 1e-6
"""The smallest derived width as a share of the size of a signal."""

BOTH = 2.0
"""The numerical errors of two runs, of that of one."""

FEWEST_STEPS = 2
"""The least shift in time a derived band allows, in steps: one for the step, one for the scheme."""

Curves = Mapping[str, Curve]
Values = Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class Band:
    """A deviation up to width is allowed, in the unit of what is judged, and a shift in s."""

    width: float
    time: float
    source: Literal["given", "derived"]


@dataclass(frozen=True, slots=True)
class Given:
    """An entry of a file; relative is a share of the signal's range, or of the metric's value."""

    absolute: float | None = None
    relative: float | None = None
    time: float | None = None

    @property
    def wide(self) -> bool:
        """True if it gives a width; else that is derived."""
        return self.absolute is not None or self.relative is not None

    def band(self, scale: float, derived: Band) -> Band:
        """The band it makes where relative is of scale; what it does not give stays derived."""
        given = (self.absolute or 0.0) + (self.relative * scale if self.relative else 0.0)
        time = derived.time if self.time is None else self.time
        return Band(given if self.wide else derived.width, time, "given")


@dataclass(frozen=True, slots=True)
class Bands:
    """The entries of a file by the pattern of names they are for."""

    place: str = ""
    signals: Mapping[str, Given] = field(default_factory=dict)
    metrics: Mapping[str, Given] = field(default_factory=dict)


def read_bands(path: Path) -> Bands:
    """The bands of a TOML file, or those that a qualification used, of what its --json printed.

    InputError names the entry that is wrong.
    """
    table = _used(path) if path.suffix == ".json" else toml_table(path, "file of bands")
    valid = {"signals": ("absolute", "relative", "time"), "metrics": ("absolute", "relative")}
    for key in table:
        known(f"{path}: unknown entry", key, valid)
    found = (_entries(f"{path}: [{key}]", table.get(key, {}), of) for key, of in valid.items())
    return Bands(str(path), *found)


def _used(path: Path) -> dict[str, Any]:
    """The bands in the JSON of a qualification; JSON has null for those that are infinite."""

    def given(entry: dict[str, Any]) -> dict[str, Any]:
        return {key: inf if value is None else value for key, value in entry.items()}

    try:
        bands = json.loads(path.read_text("utf-8"))["bands"]
        return {kind: {n: given(e) for n, e in of.items()} for kind, of in bands.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise InputError(f"{path}: {error!r}; must be what `qualify --json` printed") from error


def entry_for(entries: Mapping[str, Given], *names: str) -> Given | None:
    """The entry of the first of the names that has one; else the first pattern that fits one."""
    exact = [entries[name] for name in names if name in entries]
    fitting = (e for pattern, e in entries.items() if any(_fits(pattern, n) for n in names))
    return exact[0] if exact else next(fitting, None)


def check_patterns(place: str, entries: Mapping[str, Given], names: Sequence[str]) -> None:
    """InputError for a pattern that no name fits: most likely it is misspelt."""
    for pattern in entries:
        if not any(_fits(pattern, name) for name in names):
            raise InputError(f"{place}: nothing is called {pattern!r}; {nearest(pattern, names)}")


def signal_band(
    reference: Curve,
    again: Iterable[Curve],
    nominal: float | None,
    time: float,
    given: Given | None = None,
) -> Band:
    """The band of a signal from its reference and from the same run with other numerics.

    time in s is the shift allowed unless given says otherwise, nominal the declared nominal value;
    None stands for 1, as in FMI. A held curve (Booleans, integers) has the derived width 0.
    """
    apart = [float(deviation(reference, other, time).values.max()) for other in again]
    width, span = BOTH * max(apart, default=0.0), float(np.ptp(reference.values))
    if not reference.held:
        size = max(float(np.abs(reference.values).max()), 1.0 if nominal is None else abs(nominal))
        width = max(SHARE * span, SMALL * size, width)
    derived = Band(width, time, "derived")
    return given.band(span, derived) if given else derived


def metric_band(
    value: float | None,
    again: Iterable[float | None],
    least: float,
    given: Given | None = None,
) -> Band:
    """The band of a metric from its value and those of the same run with other numerics.

    least is the smallest derived width where that is not a share of the value: of a time the shift
    allowed for signals, of a share of something else SHARE. None is the value of a moment that
    never comes.
    """
    size = abs(value or 0.0)
    apart = [abs(other - value) for other in again if other is not None and value is not None]
    width = max(least, SHARE * size, SMALL, BOTH * max(apart, default=0.0))
    derived = Band(width, 0.0, "derived")
    return given.band(size, derived) if given else derived


def _fits(pattern: str, name: str) -> bool:
    """True if a name fits a pattern, in which only * is special: names have brackets."""
    return re.fullmatch(".*".join(map(re.escape, pattern.split("*"))), name) is not None


def _entries(place: str, table: Any, valid: Sequence[str]) -> dict[str, Given]:
    if not isinstance(table, dict):
        raise InputError(f"{place}: {table!r}: must be a table")
    return {pattern: _given(f"{place}: {pattern!r}", e, valid) for pattern, e in table.items()}


def _given(place: str, entry: Any, valid: Sequence[str]) -> Given:
    if not isinstance(entry, dict) or not entry:
        raise InputError(f"{place} = {entry!r}: must be a table with one of {choices(valid)}")
    for key, value in entry.items():
        known(f"{place}: unknown entry", key, valid)
        more = ", inf where it is not judged" if key == "absolute" else ""
        if not (more and value == inf):
            number(f"{place}: {key}", value, 0.0, must=f"a number of at least 0{more}")
    return Given(**{key: float(value) for key, value in entry.items()})


@dataclass(frozen=True, slots=True)
class Compared:
    """A signal or metric of both runs, in the unit of the original, which is the reference.

    deviation is the largest (inf where only one run has a value of a metric), time in s when that
    is, original and candidate are the values then, of one the nearest within the shift that its
    band allows. span is the range of the original's signal. Metrics have no time and span.
    """

    name: str
    unit: str | None
    band: Band
    deviation: float
    original: float | None
    candidate: float | None
    time: float | None = None
    span: float | None = None

    @property
    def ratio(self) -> float:
        """The deviation in widths of its band."""
        if self.deviation == 0.0 or self.band.width == inf:
            return 0.0
        return self.deviation / self.band.width if self.band.width else inf

    @property
    def inside(self) -> bool:
        """True if the deviation is in its band."""
        return self.ratio <= 1.0


@dataclass(frozen=True, eq=False)
class Reference:
    """A run with which another is compared: all that both have, the worst first.

    `asked` are the metrics that are compared, `shift` is that in time in s which a derived band
    allows, `nominals` are the nominal values that its signals declare.
    """

    side: Side
    asked: tuple[Metric, ...]
    shift: float
    bands: Bands
    nominals: Mapping[str, float | None] = field(default_factory=dict)

    @cached_property
    def curves(self) -> Curves:
        """Its signals."""
        return self.side.curves()

    @cached_property
    def own(self) -> Values:
        """Its metrics, see values()."""
        return self.values(self.curves)

    def values(self, curves: Curves) -> Values:
        """The single metrics by name, like time_to_contact[1], of curves in our units."""
        if not curves:
            return {}
        columns = {name: c.values for name, c in curves.items()}
        side = replace(self.side, time=next(iter(curves.values())).time, signals=columns)
        return single_values(side.by_role(), self.asked)

    def check_bands(self, signals: Iterable[str] = (), metrics: Iterable[str] = ()) -> None:
        """InputError where an entry of the bands is for nothing, neither for what the other run
        may have beside: `signals` and `metrics`.
        """
        of, place = self.bands, self.bands.place
        check_patterns(f"{place}: [signals]", of.signals, (*self.curves, *signals))
        both = [n for name in self.own for n in dict.fromkeys((_plain(name), name))]
        check_patterns(f"{place}: [metrics]", of.metrics, (*both, *metrics))

    @property
    def derives(self) -> bool:
        """True if the width of some band is not given."""
        there = [name for name, value in self.own.items() if value is not None]
        given = [*map(self._of_signal, self.curves), *map(self._of_metric, there)]
        return not all(entry and entry.wide for entry in given)

    def _of_signal(self, name: str) -> Given | None:
        return entry_for(self.bands.signals, name)

    def _of_metric(self, name: str) -> Given | None:
        return entry_for(self.bands.metrics, name, _plain(name))

    def signals(self, candidate: Curves, again: Sequence[Curves]) -> tuple[Compared, ...]:
        """All signals that both have, up to the end of the run that ends first.

        The candidate's are in our units; again are our own run with other numerics.
        """
        found = []
        for name, reference in self.curves.items():
            if name not in candidate:
                continue
            theirs = candidate[name].until(float(reference.time[-1]))
            nominal, others = self.nominals.get(name), [run[name] for run in again]
            band = signal_band(reference, others, nominal, self.shift, self._of_signal(name))
            apart = deviation(reference.until(float(theirs.time[-1])), theirs, band.time)
            worst = apart.values.argmax()
            time, distance, ours, other = (float(column[worst]) for column in apart)
            span, unit = float(np.ptp(reference.values)), self.side.units[name]
            found.append(Compared(name, unit, band, distance, ours, other, time, span))
        return tuple(sorted(found, key=lambda c: -c.ratio))

    def metrics(self, theirs: Values, again: Sequence[Curves]) -> tuple[Compared, ...]:
        """The metrics that one of both has a value of.

        One that is not among theirs has no value there; but for optional ones, which the
        candidate's signals may not permit.
        """
        others = [self.values(run) for run in again]
        asked, found = {m.name: m for m in self.asked}, []
        for name, value in self.own.items():
            metric, other = asked[_plain(name)], theirs.get(name)
            if value is other is None or (metric.optional and name not in theirs):
                continue
            least = self.shift if metric.unit == "s" else SHARE if metric.unit == "1" else 0.0
            band = metric_band(
                value, (run.get(name) for run in others), least, self._of_metric(name)
            )
            apart = inf if value is None or other is None else abs(other - value)
            found.append(Compared(name, metric.unit, band, apart, value, other))
        return tuple(sorted(found, key=lambda c: -c.ratio))

    def absent(self, theirs: Values) -> tuple[str, ...]:
        """The metrics that neither run has a value of: nothing is judged by these."""
        return tuple(name for name, v in self.own.items() if v is theirs.get(name) is None)


def single_values(signals: Signals, asked: Iterable[Metric]) -> dict[str, float | None]:
    """The metrics of signals as single values by name; true is 1 and false 0."""
    found = measure(signals, asked).flat()
    return {name: None if v is None else float(v) for name, v in found.items()}


def every_second(curves: Curves) -> list[Curves]:
    """The same curves with the samples of even numbers, and with those of odd ones."""
    return [{n: c.thinned(first) for n, c in curves.items()} for first in (0, 1)]


def _plain(name: str) -> str:
    return name.partition("[")[0]
