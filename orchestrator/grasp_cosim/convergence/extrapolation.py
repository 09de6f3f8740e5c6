"""How a number that was computed with several steps tends to its limit for steps towards zero.

An order and a limit that need no exact solution: three results with steps h1 < h2 < h3 that err by
C h^p determine p, C and the limit (Roache, Perspective: a method for uniform reporting of grid
refinement studies, J. Fluids Engineering 116(3), 1994; the extrapolation is Richardson's).
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from statistics import linear_regression

LOWEST, HIGHEST = 0.25, 4.0
"""Orders outside are none: the results do not settle, or what is seen is noise."""

WHOLE = 0.2
"""An observed order this near to a whole number is taken for that one."""


@dataclass(frozen=True, slots=True)
class Convergence:
    """Results over steps against their limit; errors and orders have one entry per step.

    limit is extrapolated from the two finest steps, uncertainty how much it differs from that of
    the next two; both None where it cannot be told. errors are result - limit. orders[i] is the
    order of the results at step i and the two finer ones, from these three alone. settled is the
    number of steps, from the finest on, that show one and the same order; order is the slope of
    log |error| over log step among them, of the errors that exceed the uncertainty. remark says
    what is missing and why, else it is empty.
    """

    limit: float | None
    uncertainty: float | None
    errors: tuple[float | None, ...]
    orders: tuple[float | None, ...]
    settled: int
    order: float | None
    remark: str

    def within(self, i: int, tolerance: float) -> bool:
        """True if the result with step i is that near to the limit, with its uncertainty."""
        error = self.errors[i]
        if error is None or self.uncertainty is None:
            return False
        return abs(error) + self.uncertainty <= tolerance


def converge(steps: Sequence[float], results: Sequence[float | None]) -> Convergence:
    """The limit of the results, at least three, and their order; steps rise. None: no result."""
    orders = tuple(
        None if i < 2 else _order_of(steps[i - 2 : i + 1], results[i - 2 : i + 1])
        for i in range(len(steps))
    )
    (h_1, h_2, h_3), (y_1, y_2, y_3) = steps[:3], results[:3]
    if y_1 is None or y_2 is None or y_3 is None:
        none = (None,) * len(steps)
        return Convergence(
            None, None, none, orders, 0, None, "no result at one of the three finest"
        )
    whole, settled = _settled(orders)
    if settled:
        limit = _extrapolated(h_1, h_2, y_1, y_2, whole)
        uncertainty = abs(_extrapolated(h_2, h_3, y_2, y_3, whole) - limit)
    else:  # the finest result stands for the limit, as uncertain as the last changes were large
        limit, uncertainty = y_1, max(abs(y_2 - y_1), abs(y_3 - y_2))
    errors = tuple(None if y is None else y - limit for y in results)
    order = _slope(steps[:settled], errors[:settled], uncertainty)
    remark = ""
    if not settled:
        remark = (
            "the three finest steps show no whole order, they are too long or their differences "
            "are noise: the errors are against the finest"
        )
    elif order is None:
        remark = "fewer than three errors exceed the uncertainty of the limit"
    return Convergence(limit, uncertainty, errors, orders, settled, order, remark)


def _settled(orders: Sequence[float | None]) -> tuple[int, int]:
    """The whole order that the finest steps show, and how many steps do; 0 and 0 without one."""
    finest = orders[2]
    whole = round(finest) if finest else 0
    if not whole:
        return 0, 0
    for i, order in enumerate(orders[2:], start=2):
        if order is None or abs(order - whole) > WHOLE:
            return (whole, i) if i > 2 else (0, 0)
    return whole, len(orders)


def _extrapolated(h_1: float, h_2: float, y_1: float, y_2: float, order: int) -> float:
    """The limit of results that err by C h^order."""
    return y_1 - (y_2 - y_1) / ((h_2 / h_1) ** order - 1.0)


def _order_of(steps: Sequence[float], results: Sequence[float | None]) -> float | None:
    """The p of three results that err by C h^p; None where none from LOWEST to HIGHEST does."""
    y_1, y_2, y_3 = results
    if y_1 is None or y_2 is None or y_3 is None or y_2 == y_1:
        return None
    wanted = (y_3 - y_2) / (y_2 - y_1)
    low, high = LOWEST, HIGHEST
    if not _ratio(steps, low) <= wanted <= _ratio(steps, high):
        return None
    while high - low > 1e-9:
        middle = 0.5 * (low + high)
        if _ratio(steps, middle) < wanted:
            low = middle
        else:
            high = middle
    return 0.5 * (low + high)


def _ratio(steps: Sequence[float], order: float) -> float:
    """(h3^p - h2^p) / (h2^p - h1^p), which rises with p."""
    powers = [math.pow(h / steps[0], order) for h in steps]
    fine, coarse = (b - a for a, b in pairwise(powers))
    return coarse / fine


def _slope(
    steps: Sequence[float], errors: Sequence[float | None], uncertainty: float
) -> float | None:
    """Slope of log |error| over log step; None with fewer than three errors that are certain."""
    certain = [
        (math.log(h), math.log(abs(e)))
        for h, e in zip(steps, errors, strict=True)
        if e is not None and abs(e) > uncertainty
    ]
    if len(certain) < 3:
        return None
    logarithms = list(zip(*certain, strict=True))
    return linear_regression(*logarithms).slope
