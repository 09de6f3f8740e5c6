"""Distributions of a parameter: each maps a number u from 0 to 1 to a value."""

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from ..checks import number
from ..errors import InputError
from ..interface.interface import Value

WIDEST = 1e6
"""A normal distribution of which so little is left keeps 9 digits of its quantiles."""


@dataclass(frozen=True, slots=True)
class Listed:
    """Values one by one: a grid has each of them, elsewhere each is as likely as the next."""

    values: tuple[Value, ...]

    @property
    def levels(self) -> int:
        """The number of values."""
        return len(self.values)

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Each one."""
        return self.values

    def at(self, u: float) -> Value:
        """The value whose share of [0, 1] has u in it."""
        return self.values[min(int(u * len(self.values)), len(self.values) - 1)]


class _Bounded:
    """A continuum of values from low to high; InputError where these are in no order."""

    __slots__ = ()
    low: float
    high: float
    levels = None

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Low and high."""
        return self.low, self.high

    def __post_init__(self) -> None:
        bounds = f"low = {self.low!r}, high = {self.high!r}"
        if not self.low < self.high:
            raise InputError(f"{bounds}: must have low below high")
        if not math.isfinite(self.high - self.low):
            raise InputError(f"{bounds}: must be nearer to each other")


@dataclass(frozen=True, slots=True)
class Uniform(_Bounded):
    """Each value from low to high is as likely."""

    low: float
    high: float

    def at(self, u: float) -> float:
        """The value at u of the way from low to high."""
        return min(self.low + u * (self.high - self.low), self.high)


@dataclass(frozen=True, slots=True)
class Normal(_Bounded):
    """Gaussian, cut off at low and high."""

    mean: float
    standard_deviation: float
    low: float
    high: float

    def __post_init__(self) -> None:
        _Bounded.__post_init__(self)
        low, high, deviation = self.low, self.high, self.standard_deviation
        number("standard_deviation", deviation, 0.0, above=True, must="greater than 0")
        if deviation > WIDEST * (high - low):
            raise InputError(
                f"standard_deviation = {deviation!r}: must be at most {WIDEST:g} times high - low, "
                "or the form uniform, which it comes to"
            )
        number("mean", self.mean, low, high, must=f"from low, {low!r}, to high, {high!r}")

    def at(self, u: float) -> float:
        """The quantile of u among what is not cut off."""
        normal = NormalDist(self.mean, self.standard_deviation)
        below, above = normal.cdf(self.low), normal.cdf(self.high)
        share = below + u * (above - below)
        if share <= 0.0 or share >= 1.0:  # where rounding leaves nothing of a far tail
            return self.low if share <= 0.0 else self.high
        return min(max(normal.inv_cdf(share), self.low), self.high)


Distribution = Listed | Uniform | Normal
"""Values of one parameter: `levels`, how many there are, None where they are a continuum;
`extremes`, values that must be valid for all to be; at(u), below which a share u of them lies.
"""


def spaced(first: float, last: float, count: int, logarithmic: bool) -> Listed:
    """So many values from first to last, with equal distances or, logarithmic, equal ratios."""
    values = (np.geomspace if logarithmic else np.linspace)(first, last, count)
    return Listed(tuple(values.tolist()))
