"""Judges signals and metrics of two runs one by one, each in its band."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from math import inf

import numpy as np

from ..metrics.metric import Metric
from .bands import SHARE, Band, Bands, Compared, metric_band, plain, signal_band
from .side import Side
from .tube import Curve, deviation

Values = Mapping[str, float | None]
"""The values of metrics, by names like time_to_contact[1]."""

Curves = Mapping[str, Curve]
"""Signals as they are compared, by name."""


@dataclass(frozen=True, slots=True)
class Judge:
    """Compares signals and metrics of two runs one by one, each in its band.

    Both runs are in the units of the reference.
    """

    reference: Side
    """The run that the bands are derived from."""
    repetitions: Sequence[Side]
    """The same run with other numerics."""
    bands: Bands
    """Those that the user states."""
    shift: float
    """The shift in time in s that a derived band allows."""
    nominals: Mapping[str, float | None] = field(default_factory=dict)
    """The declared nominal values of signals."""
    required: Collection[str] = ()
    """A metric of these that is not optional is out of its band if only one run has a value. So is
    a signal that is a finite number in only one of them.
    """

    def signals(self, references: Curves, candidates: Curves) -> list[Compared]:
        """The signals of both runs, up to the end of the one that ends first."""
        repetitions = [run.curves() for run in self.repetitions]
        compared = (
            self._signal(name, reference, candidates[name], [run[name] for run in repetitions])
            for name, reference in references.items()
        )
        return [signal for signal in compared if signal is not None]

    def _signal(
        self, name: str, reference: Curve, candidate: Curve, repetitions: Sequence[Curve]
    ) -> Compared | None:
        """A signal, in its band; None where neither run has a finite number."""
        candidate = candidate.until(float(reference.time[-1]))
        gaps, candidate_gaps = reference.until(float(candidate.time[-1])).gaps, candidate.gaps
        reference, candidate = reference.without_gaps(), candidate.without_gaps()
        if not len(reference.time) and not len(candidate.time):
            return None
        unit, stated = self.reference.units[name], self.bands.of_signal(name)
        if not np.array_equal(gaps, candidate_gaps):
            exact = Band(0.0, self.shift, "derived")
            band = stated.band(0.0, exact) if stated else exact
            first_gap = float(np.setxor1d(gaps, candidate_gaps)[0])
            return Compared(name, unit, band, inf, None, None, first_gap)
        finite = (run.without_gaps() for run in repetitions)
        numerics = [curve for curve in finite if len(curve.time)]
        band = signal_band(reference, numerics, self.nominals.get(name), self.shift, stated)
        apart = deviation(reference.until(float(candidate.time[-1])), candidate, band.time)
        worst = apart.values.argmax()
        time, distance, original, value = (float(column[worst]) for column in apart)
        low, high = reference.range
        return Compared(name, unit, band, distance, original, value, time, high - low)

    def metrics(
        self, references: Values, candidates: Values, definitions: Sequence[Metric]
    ) -> list[Compared]:
        """The metrics of both runs."""
        repetitions = [run.measured(definitions) for run in self.repetitions]
        definition_of = {metric.name: metric for metric in definitions}
        compared = []
        for name in dict.fromkeys((*references, *candidates)):
            metric = definition_of.get(plain(name))
            if metric is None or not self._is_judged(metric, name, references, candidates):
                continue
            values = [run.get(name) for run in repetitions]
            original, value = references.get(name), candidates.get(name)
            compared.append(self._metric(name, metric, original, value, values))
        return compared

    def _is_judged(self, metric: Metric, name: str, references: Values, candidates: Values) -> bool:
        """True for a value that one run has, and both work out unless it is required."""
        if references.get(name) is None and candidates.get(name) is None:
            return False
        is_required = metric.name in self.required and not metric.optional
        return is_required or (name in references and name in candidates)

    def _metric(
        self,
        name: str,
        metric: Metric,
        original: float | None,
        value: float | None,
        repetitions: Sequence[float | None],
    ) -> Compared:
        """A metric in its band."""
        least = {"s": self.shift, "1": SHARE}.get(metric.unit or "", 0.0)
        band = metric_band(original, repetitions, least, self.bands.of_metric(name))
        distance = inf if value is None or original is None else abs(value - original)
        return Compared(name, metric.unit, band, distance, original, value)


def common_curves(reference: Side, candidate: Side) -> tuple[Curves, Curves]:
    """The signals that both have, held in both where they are in one."""
    references, candidates = reference.curves(), candidate.curves()
    names = [name for name in references if name in candidates]
    return (
        {name: references[name] for name in names},
        {
            name: curve._replace(held=curve.held or references[name].held)
            for name, curve in candidates.items()
            if name in references
        },
    )
