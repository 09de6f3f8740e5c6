"""A run as the reference of another: each signal and each metric of the two in its band."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any

import numpy as np

from ..interface.units import Conversion
from ..metrics.metric import Metric, Signals, measure
from ..recording.result import Result
from .bands import SHARE, Band, Bands, Given, check_patterns, entry_for, metric_band, signal_band
from .tube import Curve, curve, deviation

FEWEST_STEPS = 2
"""The least shift in time a derived band allows, in steps: one for the step, one for the scheme."""

Curves = Mapping[str, Curve]
Values = Mapping[str, float | None]
Entries = Mapping[str, Given | None]


@dataclass(frozen=True, slots=True)
class Compared:
    """A signal or metric of both runs, in the unit of the original, which is the reference.

    deviation is the largest (inf where only one run has a value of a metric), time in s when that
    is, original and candidate are the values then, of one the nearest within the shift that its
    band allows. span is the range of the original's signal.
    Metrics have no time and span.
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


@dataclass(frozen=True, slots=True)
class Reference:
    """A run with which another is compared.

    `shift` is that in time in s which a derived band allows, `nominals` are the nominal values that
    its signals declare, `asked` the metrics that are compared.
    """

    curves: Curves
    units: Mapping[str, str | None]
    shift: float
    asked: tuple[Metric, ...]
    roles: Mapping[str, str] = field(default_factory=dict)
    given: Mapping[str, Any] = field(default_factory=dict, kw_only=True)
    """The start values that the system sets."""
    to_si: Mapping[str, Conversion] = field(default_factory=dict)
    nominals: Mapping[str, float | None] = field(default_factory=dict)

    def entries(
        self, bands: Bands, signals: Iterable[str] = (), metrics: Iterable[str] = ()
    ) -> tuple[Entries, Entries]:
        """Each signal and each metric with its entry; InputError where an entry is for nothing.

        `signals` and `metrics` are what the other run may have beside.
        """
        names = self.values(self.curves)
        check_patterns(f"{bands.place}: [signals]", bands.signals, (*self.curves, *signals))
        both = [n for name in names for n in dict.fromkeys((_plain(name), name))]
        check_patterns(f"{bands.place}: [metrics]", bands.metrics, (*both, *metrics))
        return (
            {name: entry_for(bands.signals, name) for name in self.curves},
            {name: entry_for(bands.metrics, name, _plain(name)) for name in names},
        )

    def signals(
        self, candidate: Curves, again: Sequence[Curves], given: Entries
    ) -> tuple[Compared, ...]:
        """All signals that both have, up to the end of the run that ends first, the worst
        first.

        The candidate's are in our units; again are our own run with other numerics.
        """
        found = []
        for name, reference in self.curves.items():
            if name not in candidate:
                continue
            theirs = candidate[name].until(float(reference.time[-1]))
            nominal, others = self.nominals.get(name), [run[name] for run in again]
            band = signal_band(reference, others, nominal, self.shift, given[name])
            apart = deviation(reference.until(float(theirs.time[-1])), theirs, band.time)
            worst = apart.values.argmax()
            time, distance, ours, other = (float(column[worst]) for column in apart)
            span = float(np.ptp(reference.values))
            unit = self.units[name]
            found.append(Compared(name, unit, band, distance, ours, other, time, span))
        return tuple(sorted(found, key=lambda c: -c.ratio))

    def metrics(
        self, theirs: Values, again: Sequence[Curves], given: Entries
    ) -> tuple[Compared, ...]:
        """The metrics that one of both has a value of, the worst first.

        One that is not among theirs has no value there; but for optional ones, which the
        candidate's signals may not permit.
        """
        others = [self.values(run) for run in again]
        asked, found = {m.name: m for m in self.asked}, []
        for name, value in self.values(self.curves).items():
            metric, other = asked[_plain(name)], theirs.get(name)
            if value is other is None or (metric.optional and name not in theirs):
                continue
            least = self.shift if metric.unit == "s" else SHARE if metric.unit == "1" else 0.0
            band = metric_band(value, [run.get(name) for run in others], least, given[name])
            apart = inf if value is None or other is None else abs(other - value)
            found.append(Compared(name, metric.unit, band, apart, value, other))
        return tuple(sorted(found, key=lambda c: -c.ratio))

    def absent(self, theirs: Values) -> tuple[str, ...]:
        """The metrics that neither run has a value of: nothing is judged by these."""
        ours = self.values(self.curves)
        return tuple(name for name, v in ours.items() if v is theirs.get(name) is None)

    def values(self, curves: Curves) -> Values:
        """The single metrics by name, like time_to_contact[1], of curves in our units."""
        if not curves:
            return {}
        time = next(iter(curves.values())).time
        columns = {n: c.values for n, c in curves.items()}
        signals = Signals(time, columns, self.roles, self.to_si, self.given)
        return single_values(signals, self.asked)


def single_values(signals: Signals, asked: Iterable[Metric]) -> dict[str, float | None]:
    """The metrics of signals as single values by name; true is 1 and false 0."""
    found = measure(signals, asked).flat()
    return {name: None if v is None else float(v) for name, v in found.items()}


def curves_of(result: Result) -> dict[str, Curve]:
    """The signals of a result that are numbers."""
    return {name: curve(result.time, values) for name, values in result.numbers.items()}


def every_second(curves: Curves) -> list[Curves]:
    """The same curves with the samples of even numbers, and with those of odd ones."""
    return [{n: c.thinned(first) for n, c in curves.items()} for first in (0, 1)]


def _plain(value: str) -> str:
    return value.partition("[")[0]
