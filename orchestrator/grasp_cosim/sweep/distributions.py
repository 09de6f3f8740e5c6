"""What a parameter may be: each maps a number u from 0 to 1 to a value."""

from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, Protocol

import numpy as np

from ..errors import InputError
from ..interface.interface import Value


class Distribution(Protocol):
    """Values of one parameter."""

    @property
    def levels(self) -> int | None:
        """How many values there are, None where they are a continuum."""

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Values that must be valid for all to be: the lowest and highest, or each one."""

    def at(self, u: float) -> Value:
        """The value below which a share u of all lies; u is from 0 to 1."""


@dataclass(frozen=True, slots=True)
class Listed:
    """Values one by one: a grid has each of them, elsewhere each is as likely as the next."""

    values: tuple[Value, ...]

    @property
    def levels(self) -> int:
        """How many values there are."""
        return len(self.values)

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Each one."""
        return self.values

    def at(self, u: float) -> Value:
        """The value whose share of [0, 1] has u in it."""
        return self.values[min(int(u * len(self.values)), len(self.values) - 1)]


@dataclass(frozen=True, slots=True)
class Uniform:
    """Each value from low to high is as likely."""

    low: float
    high: float
    levels = None

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Low and high."""
        return self.low, self.high

    def at(self, u: float) -> float:
        """The value at u of the way from low to high."""
        return min(self.low + u * (self.high - self.low), self.high)


@dataclass(frozen=True, slots=True)
class Normal:
    """Gaussian, cut off at low and high."""

    mean: float
    standard_deviation: float
    low: float
    high: float
    levels = None

    @property
    def extremes(self) -> tuple[Value, ...]:
        """Low and high."""
        return self.low, self.high

    def at(self, u: float) -> float:
        """The quantile of u among what is not cut off."""
        normal = NormalDist(self.mean, self.standard_deviation)
        below, above = normal.cdf(self.low), normal.cdf(self.high)
        share = below + u * (above - below)
        if share <= 0.0 or share >= 1.0:  # where rounding leaves nothing of a far tail
            return self.low if share <= 0.0 else self.high
        return min(max(normal.inv_cdf(share), self.low), self.high)


def spaced(first: float, last: float, count: int, logarithmic: bool) -> Listed:
    """So many values from first to last, with equal distances or, logarithmic, equal ratios."""
    values = (np.geomspace if logarithmic else np.linspace)(first, last, count)
    return Listed(tuple(values.tolist()))


def scipy_stats() -> Any:
    """The module scipy.stats; InputError without scipy."""
    try:
        from scipy import stats
    except ImportError as error:
        raise InputError(
            "scipy is not installed, it makes the designs of studies; "
            "install it with: pip install 'grasp-cosim[sweep]'"
        ) from error
    return stats
