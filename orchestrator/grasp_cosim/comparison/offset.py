"""By how much the clock of a log is off: the shift at which its signals are most like a run's.

Coarse, by correlation on a common grid of times; then between two of its points, by least squares.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from .side import Side

Floats = npt.NDArray[np.float64]

LEAST = 0.7
"""The correlation coefficient from which on a shift is believed."""

WIDTH = 25
"""Points of the grid around the coarse one, in which the least squares look: noise moves that."""

POINTS = 20_000
"""The most points of the grid."""


def fit_offset(log: Side, run: Side) -> float:
    """The time in s that has to be added to that of a log, for its signals to be like a run's.

    InputError where no signal of both changes, or where they are not alike at any shift.
    """
    names = [n for n in log.signals if n in run.signals and log.signals[n].dtype.kind == "f"]
    pairs = [(log.signals[n], np.asarray(run.signals[n], np.float64)) for n in names]
    pairs = [(a, b) for a, b in pairs if np.ptp(a) > 0.0 and np.ptp(b) > 0.0]
    if not pairs:
        raise InputError(
            f"{log.name}: time.offset = 'fit': no signal that {run.name} has, too, changes; must "
            "be a number of s"
        )
    span = max(np.ptp(log.time), np.ptp(run.time))
    step = max(span / POINTS, min(log.interval, run.interval))
    coefficients = [_correlation(log.time, a, run.time, b, step) for a, b in pairs]
    scores = np.mean(coefficients, axis=0)
    best = int(np.argmax(scores))
    if scores[best] < LEAST:
        raise InputError(
            f"{log.name}: time.offset = 'fit': its signals are like those of {run.name} at no "
            f"offset, the best correlation is {scores[best]:.2f}; must be a number of s"
        )
    count = len(np.arange(0.0, np.ptp(log.time) + 0.5 * step, step))
    coarse = run.time[0] - log.time[0] + (best - (count - 1)) * step
    return _refined(log.time, run.time, pairs, float(coarse), step)


def shifted(side: Side, offset: float) -> Side:
    """The side with another clock."""
    return replace(side, time=side.time + offset)


def _correlation(t: Floats, x: Floats, s: Floats, y: Floats, step: float) -> Floats:
    """The coefficients at all shifts of whole steps; 0 where less than a third overlaps."""
    from scipy.signal import correlate

    a = np.interp(np.arange(t[0], t[-1] + 0.5 * step, step), t, x)
    b = np.interp(np.arange(s[0], s[-1] + 0.5 * step, step), s, y)
    ones_a, ones_b = np.ones_like(a), np.ones_like(b)

    def over(u: Floats, v: Floats) -> Floats:
        return np.asarray(correlate(v, u, "full", "fft"))

    n = np.maximum(over(ones_a, ones_b), 1.0)
    mean_a, mean_b = over(a, ones_b) / n, over(ones_a, b) / n
    covariance = over(a, b) / n - mean_a * mean_b
    variance_a = over(a * a, ones_b) / n - mean_a**2
    variance_b = over(ones_a, b * b) / n - mean_b**2
    least = 1e-6 * a.var() * b.var()
    product = variance_a * variance_b
    enough = (n > min(len(a), len(b)) / 3) & (product > least)
    return np.where(enough, covariance / np.sqrt(np.maximum(product, least)), 0.0)


def _refined(
    t: Floats, s: Floats, pairs: list[tuple[Floats, Floats]], coarse: float, step: float
) -> float:
    """The offset near a coarse one that makes the sum of the squared differences least."""
    from scipy.optimize import minimize_scalar

    def distance(offset: float) -> float:
        inside = (t + offset >= s[0]) & (t + offset <= s[-1])
        total = 0.0
        for x, y in pairs:
            difference = x[inside] - np.interp(t[inside] + offset, s, y)
            total += float(np.mean(difference**2)) / float(np.var(y))
        return total

    near = WIDTH * step
    minimum = minimize_scalar(
        distance, bounds=(coarse - near, coarse + near), method="bounded",
        options={"xatol": 1e-4 * step},
    )  # fmt: skip
    return float(minimum.x)
