"""Bounded least squares with confidence intervals (scipy, the optional extra `identify`).

The intervals are those of the linearised model: with the Jacobian J of the n residuals at the
solution, s^2 = sum of squares / (n - k) and Student's t,

    value ± t(0.975, n - k) · s · sqrt(diag((J^T·J)^-1))

which assumes that the residuals are independent, of one variance and without a bias, and the model
straight over the interval. Parameters at a bound are held there, they are not among the k.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ...checks import extra_module
from ...errors import InputError, SimulationError
from ...numerals import counted

Vector = npt.NDArray[np.float64]

Residuals = Callable[[Sequence[Vector]], Sequence[Vector]]
"""The residuals at several points; they come together, so that they can be found in parallel."""

CONFIDENCE = 0.95

STEP = 0.01
"""Of the finite differences, as a share of a parameter's scale."""

MOST = 60
"""Steps of the fit at most, a Jacobian each; a fit of four parameters takes about eight."""

NEGLIGIBLE = 1e-6
"""A singular value of the scaled Jacobian so much smaller than the largest is none."""


class Parameter(NamedTuple):
    """What is fitted, within its bounds; scale is what a considerable change of it is.

    neutral is the value at which it does nothing, None where there is no such value.
    """

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float
    neutral: float | None


class Estimate(NamedTuple):
    """A fitted parameter with its 95 % confidence interval, or a remark that says why not."""

    name: str
    unit: str
    value: float
    interval: tuple[float, float] | None
    remark: str


@dataclass(frozen=True, slots=True, eq=False)
class Fit:
    """The estimates, the residuals at them, and how many points that took."""

    estimates: tuple[Estimate, ...]
    residuals: Vector
    points: int

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, in their unit."""
        return float(np.sqrt(np.mean(self.residuals**2)))


def fit(residuals: Residuals, parameters: Sequence[Parameter], place: str) -> Fit:
    """The parameters that make the sum of the squared residuals least; place names the data.

    InputError without scipy, or where there are no more residuals than parameters or one is not
    finite, SimulationError where the fit does not come to rest.
    """
    extra_module("scipy", "it fits the parameters", "identify")
    from scipy.optimize import least_squares

    low, high = (np.array([p[i] for p in parameters]) for i in (3, 4))
    scale = np.array([p.scale for p in parameters])
    points = 0

    def finite(points: Sequence[Vector]) -> Sequence[Vector]:
        with np.errstate(over="ignore", invalid="ignore"):
            found = residuals(points)
            wrong = [x for x, r in zip(points, found, strict=True) if not np.isfinite(r @ r)]
        if wrong:
            at = ", ".join(f"{p.name} = {v:.6g}" for p, v in zip(parameters, wrong[0], strict=True))
            raise InputError(
                f"{place}: the squares of the residuals are not finite at {at}; must be figures of "
                "a grasp"
            )
        return found

    def at(x: Vector) -> Vector:
        nonlocal points
        points += 1
        (found,) = finite([x])
        if len(found) <= len(parameters):
            raise InputError(
                f"{place}: {counted(len(found), 'figure')} for "
                f"{counted(len(parameters), 'parameter')}; must be more"
            )
        return found

    def jacobian(x: Vector) -> Vector:
        nonlocal points
        points += len(x)
        steps = np.where(x + STEP * scale > high, -STEP, STEP) * scale
        here, *moved = finite([x, *(x + row for row in np.diag(steps))])
        return np.column_stack([(m - here) / h for m, h in zip(moved, steps, strict=True)])

    found = least_squares(
        at,
        [p.start for p in parameters],
        jac=jacobian,
        bounds=(low, high),
        x_scale=scale,
        ftol=1e-5,
        xtol=1e-4,
        gtol=1e-8,
        max_nfev=MOST,
    )
    if not found.success:
        raise SimulationError(f"{place}: the fit has not come to rest after {MOST} steps")
    estimates = _estimates(parameters, found.x, found.fun, found.jac * scale, found.active_mask)
    return Fit(estimates, found.fun, points)


def _estimates(
    parameters: Sequence[Parameter],
    x: Vector,
    residuals: Vector,
    jacobian: Vector,
    active: npt.NDArray[np.int64],
) -> tuple[Estimate, ...]:
    """The estimates from the Jacobian by scaled parameters; active is -1, 0 or 1, as in scipy."""
    free = np.flatnonzero(active == 0)
    half = _half_widths(jacobian[:, free], residuals)
    widths = dict(zip(free.tolist(), half.tolist(), strict=True))
    return tuple(
        _estimate(p, float(value), int(bound), widths.get(i, np.inf))
        for i, (p, value, bound) in enumerate(zip(parameters, x, active, strict=True))
    )


def _estimate(p: Parameter, value: float, bound: int, width: float) -> Estimate:
    if bound:
        side, at = ("lower", p.low) if bound < 0 else ("upper", p.high)
        return Estimate(p.name, p.unit, at, None, f"at its {side} bound, held there")
    if not np.isfinite(width):
        return Estimate(p.name, p.unit, value, None, "the data do not determine it")
    interval = value - width * p.scale, value + width * p.scale
    remark = ""
    if p.neutral is not None and interval[0] <= p.neutral <= interval[1]:
        remark = f"cannot be told from {p.neutral:g}, where it does nothing"
    return Estimate(p.name, p.unit, value, interval, remark)


def _half_widths(jacobian: Vector, residuals: Vector) -> Vector:
    """Half the widths of the intervals; inf for what the residuals hardly depend on."""
    from scipy.stats import t

    n, k = jacobian.shape
    if not k:
        return np.empty(0)
    _, singular, v = np.linalg.svd(jacobian, full_matrices=False)
    lost = singular <= NEGLIGIBLE * max(singular.max(), np.finfo(float).tiny)
    variance = float(residuals @ residuals) / (n - k)
    kept = (v[~lost] / singular[~lost, None]) ** 2
    widths = t.ppf(0.5 + 0.5 * CONFIDENCE, n - k) * np.sqrt(variance * kept.sum(axis=0))
    return np.where((np.abs(v[lost]) > NEGLIGIBLE).any(axis=0), np.inf, widths)
