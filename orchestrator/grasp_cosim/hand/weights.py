"""Balance weights: how much of the grasp each finger of a hand takes over.

    sum n_k·e_k = 0,   mean n_k = 1,   nearest to 1, all at least 0.25 where there are such

They exist with all n_k > 0 where the fingers can hold without friction: no two neighbours are more
than 180 degrees apart, or all are on one line, at both ends. Derivation: controller/README.md.
"""

from collections.abc import Sequence
from functools import lru_cache
from itertools import product

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError

MIN_WEIGHT = 0.25
"""A finger of less weight is soft, and late: its layer 1 is weak."""

NEGLIGIBLE_WEIGHT = 1e-6
"""A weight that holds nothing."""

DIGITS = 12
"""Decimals of a weight: what is below is rounding."""

Floats = npt.NDArray[np.float64]


def balance_weights(angles: Sequence[float]) -> tuple[float, ...]:
    """The weights of fingers in these directions, in degrees; InputError where they cannot hold."""
    return _balanced(tuple(angles))


@lru_cache(maxsize=64)
def _balanced(angles: tuple[float, ...]) -> tuple[float, ...]:
    """balance_weights(), which several ask for on the way to one system."""
    radians = np.radians(angles)
    conditions = np.vstack([np.cos(radians), np.sin(radians), np.ones(len(angles))])
    weights = _nearest(conditions, MIN_WEIGHT)
    if weights is None and (floor := _highest_floor(conditions)) >= NEGLIGIBLE_WEIGHT:
        weights = _nearest(conditions, floor * (1.0 - 1e-9))
    if weights is None:
        raise InputError(_why_not(angles))
    return tuple(round(float(n), DIGITS) for n in weights)


def imbalance(angles: Sequence[float], weights: Sequence[float]) -> float:
    """|sum n_k·e_k| of directions in rad: 0 where the fingers balance."""
    return float(abs(np.dot(weights, np.exp(1j * np.asarray(angles)))))


def _nearest(conditions: Floats, floor: float) -> Floats | None:
    """The weights nearest to 1 that are at least `floor`; None where there are none.

    The quadratic programme is solved by trying which weights are at the floor: at most 2^8 ways.
    """
    count = conditions.shape[1]
    required = np.array([0.0, 0.0, count])
    best: tuple[float, Floats] | None = None
    for at_floor in product((False, True), repeat=count):
        on_floor = np.array(at_floor)
        weights = np.where(on_floor, floor, 1.0)
        free = conditions[:, ~on_floor]
        change, *_ = np.linalg.lstsq(free, required - conditions @ weights, rcond=1e-9)
        weights[~on_floor] += change
        distance = float(np.sum((weights - 1.0) ** 2))
        fits = np.abs(conditions @ weights - required).max() < 1e-9 and weights.min() > floor - 1e-9
        if fits and (best is None or distance < best[0] - 1e-12):
            best = distance, weights
    return None if best is None else best[1]


def _highest_floor(conditions: Floats) -> float:
    """The highest that the smallest weight can be; negative where no weights balance."""
    from scipy.optimize import linprog  # only here: it takes long to load

    count = conditions.shape[1]
    solution = linprog(
        np.append(np.zeros(count), -1.0),
        A_ub=np.hstack([-np.eye(count), np.ones((count, 1))]),
        b_ub=np.zeros(count),
        A_eq=np.hstack([conditions, np.zeros((3, 1))]),
        b_eq=[0.0, 0.0, count],
        bounds=[(None, None)] * (count + 1),
    )
    return float(solution.x[-1]) if solution.status == 0 else -1.0


def _why_not(angles: Sequence[float]) -> str:
    ordered = sorted(a % 360.0 for a in angles)
    following = [*ordered[1:], ordered[0] + 360.0]
    widest, at = max((b - a, a) for a, b in zip(ordered, following, strict=True))
    angles_text = ", ".join(f"{a:g}" for a in angles)
    return (
        f"angles {angles_text} degrees: there is no finger for {widest:g} degrees after {at:g}; "
        "fingers hold nothing unless that is less than 180, or all are on one line, at both ends"
    )
