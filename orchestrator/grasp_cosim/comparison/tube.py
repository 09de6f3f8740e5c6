"""How far two curves are apart where a shift in time is allowed: a tube around each.

Why so: docs/explanation/tolerance_bands.md.
"""

from typing import NamedTuple

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]

ROUNDING = 0.5e-9
"""s, half a nanosecond; a sample this close to the end of a window is at its end."""

FAR = 1e300
"""As far from zero as a value counts: inf and the largest double, a distance to nothing."""


class Curve(NamedTuple):
    """Samples values over time in s, rising; between them linear, or held where held is true."""

    time: Array
    values: Array
    held: bool = False

    @property
    def range(self) -> tuple[float, float]:
        """The lowest and the highest value that is not FAR from zero; 0 where there is none."""
        near = self.values[np.abs(self.values) < FAR]
        return (float(near.min()), float(near.max())) if len(near) else (0.0, 0.0)

    def at(self, time: Array) -> Array:
        """The values at other times; before the first and after the last sample those of it."""
        if not self.held:
            return np.interp(time, self.time, self.values)
        last_sample = np.searchsorted(self.time, time + ROUNDING, side="right") - 1
        return self.values[np.clip(last_sample, 0, None)]

    @property
    def gaps(self) -> Array:
        """The times at which there is no finite number."""
        return self.time[~np.isfinite(self.values)]

    def without_gaps(self) -> "Curve":
        """The samples that are finite numbers."""
        finite = np.isfinite(self.values)
        return self if finite.all() else Curve(self.time[finite], self.values[finite], self.held)

    def until(self, end: float) -> "Curve":
        """What there is up to the time end in s."""
        count = int(np.searchsorted(self.time, end + ROUNDING, side="right"))
        return Curve(self.time[:count], self.values[:count], self.held)

    def continued(self, shift: float) -> "Curve":
        """The curve and how it goes on for a shift in s; a held one stays."""
        end, last = self.time[-1], self.values[-1]
        mirrored = (self.time < end) & (self.time >= end - shift - ROUNDING)
        if self.held or not mirrored.any():
            return self
        return Curve(
            np.concatenate([self.time, 2.0 * end - self.time[mirrored][::-1]]),
            np.concatenate([self.values, 2.0 * last - self.values[mirrored][::-1]]),
        )


class Deviation(NamedTuple):
    """How far apart two curves are at each time in s, at least 0.

    The distance is that between reference and candidate: the value of the one that is further out,
    and the nearest that the other takes within the shift.
    """

    time: Array
    values: Array
    reference: Array
    candidate: Array


def tube(around: Curve, time: Array, shift: float) -> tuple[Array, Array]:
    """The least and the largest value of a curve from time - shift to time + shift, both in s."""
    around = around.continued(shift)
    edges = around.at(time - shift), around.at(time + shift)
    low, high = np.minimum(*edges), np.maximum(*edges)
    first = np.searchsorted(around.time, time - shift - ROUNDING, side="left")
    last = np.searchsorted(around.time, time + shift + ROUNDING, side="right")
    some = last > first
    low[some] = np.minimum(low[some], _least(around.values, first[some], last[some]))
    high[some] = np.maximum(high[some], -_least(-around.values, first[some], last[some]))
    return low, high


def deviation(reference: Curve, candidate: Curve, shift: float) -> Deviation:
    """How far the curves are from each other's tubes, the larger of the two, at all their times.

    0 where the one is, but for a shift of up to shift in s, the other. Symmetric.
    """
    time = np.union1d(reference.time, candidate.time)
    reference_values, candidate_values = reference.at(time), candidate.at(time)
    around_reference, around_candidate = (tube(c, time, shift) for c in (reference, candidate))
    nearest_candidate = np.clip(candidate_values, *around_reference)
    nearest_reference = np.clip(reference_values, *around_candidate)
    candidate_outside, reference_outside = (
        np.abs(candidate_values - nearest_candidate),
        np.abs(reference_values - nearest_reference),
    )
    candidate_is_further = candidate_outside >= reference_outside
    return Deviation(
        time,
        np.where(candidate_is_further, candidate_outside, reference_outside),
        np.where(candidate_is_further, nearest_candidate, reference_values),
        np.where(candidate_is_further, candidate_values, nearest_reference),
    )


def _least(values: Array, first: npt.NDArray[np.intp], last: npt.NDArray[np.intp]) -> Array:
    """The least of values[first:last] for each pair; no pair is empty.

    From the least of every 1, 2, 4, 8, ... values in a row: two of those cover any range.
    """
    result = np.empty(len(first))
    length = last - first
    least, span = values, 1
    while len(result):
        covered = (span <= length) & (length < 2 * span)
        result[covered] = np.minimum(least[first[covered]], least[last[covered] - span])
        if not (length >= 2 * span).any():
            break
        least = np.minimum(least[:-span], least[span:])
        span *= 2
    return result
