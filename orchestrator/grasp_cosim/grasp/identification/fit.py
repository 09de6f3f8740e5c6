"""Bounded least squares with confidence intervals.

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

from ...base.errors import InputError, SimulationError
from ...base.text import counted

Vector = npt.NDArray[np.float64]

Residuals = Callable[[Sequence[Vector]], Sequence[Vector]]
"""The residuals at several points; they come together, so that they can be solution in parallel."""

CONFIDENCE = 0.95

DIFFERENCE_STEP = 0.01
"""The step of the finite differences, as a share of a parameter's scale."""

MAX_FIT_STEPS = 60
"""Steps of the fit at most, a Jacobian each; a fit of four parameters takes about eight."""

NEGLIGIBLE = 1e-6
"""A singular value of the scaled Jacobian so much smaller than the largest is none."""


class Parameter(NamedTuple):
    """What is fitted, within its bounds; scale is what a considerable change of it is."""

    name: str
    unit: str
    start: float
    low: float
    high: float
    scale: float


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
    left_out: Vector | None = None
    """Of a cross-validation: the residual of each figure in a fit without its row."""

    @property
    def rms(self) -> float:
        """Root mean square of the residuals, in their unit."""
        return root_mean_square(self.residuals)


def root_mean_square(residuals: Vector) -> float:
    """Of residuals, in their unit."""
    return float(np.sqrt(np.mean(residuals**2)))


def fit(residuals: Residuals, parameters: Sequence[Parameter], place: str) -> Fit:
    """The parameters that make the sum of the squared residuals least; place names the data.

    InputError where there are no more residuals than parameters or where one is not finite,
    SimulationError where the fit does not come to rest.
    """
    from scipy.optimize import least_squares

    start, low, high, scale = np.array([p[2:] for p in parameters]).T

    def jacobian(x: Vector) -> Vector:
        steps = np.where(x + DIFFERENCE_STEP * scale > high, -DIFFERENCE_STEP, DIFFERENCE_STEP)
        steps *= scale
        at_x, *at_moved = residuals([x, *(x + row for row in np.diag(steps))])
        columns = [(moved - at_x) / h for moved, h in zip(at_moved, steps, strict=True)]
        return np.column_stack(columns)

    (first,) = residuals([start])
    if len(first) <= len(parameters):
        raise InputError(
            f"{place}: {counted(len(first), 'figure')} for "
            f"{counted(len(parameters), 'parameter')}; must be more"
        )
    if not np.isfinite(first).all():
        raise InputError(f"{place}: the residuals are not finite; must be figures of a grasp")
    solution = least_squares(
        lambda x: residuals([x])[0],
        start,
        jac=jacobian,
        bounds=(low, high),
        x_scale=scale,
        ftol=1e-5,
        xtol=1e-4,
        gtol=1e-8,
        max_nfev=MAX_FIT_STEPS,
    )
    if not solution.success:
        raise SimulationError(f"{place}: the fit has not come to rest after {MAX_FIT_STEPS} steps")
    free = np.flatnonzero(solution.active_mask == 0)  # others are at a bound: -1 or 1
    widths = np.full(len(parameters), np.inf)
    widths[free] = scale[free] * _half_widths((solution.jac * scale)[:, free], solution.fun)
    estimates = map(
        _estimate, parameters, solution.x.tolist(), solution.active_mask, widths.tolist()
    )
    return Fit(tuple(estimates), solution.fun, solution.nfev + solution.njev * len(parameters))


def _estimate(p: Parameter, value: float, bound: int, width: float) -> Estimate:
    if bound:
        side, at = ("lower", p.low) if bound < 0 else ("upper", p.high)
        return Estimate(p.name, p.unit, at, None, f"at its {side} bound, held there")
    if not np.isfinite(width):
        return Estimate(p.name, p.unit, value, None, "the data do not determine it")
    return Estimate(p.name, p.unit, value, (value - width, value + width), "")


def _half_widths(jacobian: Vector, residuals: Vector) -> Vector:
    """Half the widths of the intervals, in scales; inf for what the residuals hardly depend on."""
    from scipy.stats import t

    n, k = jacobian.shape
    if not k:
        return np.empty(0)
    _, singular, v = np.linalg.svd(jacobian, full_matrices=False)
    is_zero = singular <= NEGLIGIBLE * max(singular.max(), np.finfo(float).tiny)
    variance = float(residuals @ residuals) / (n - k)
    inverse = (v[~is_zero] / singular[~is_zero, None]) ** 2
    deviations = np.sqrt(variance * inverse.sum(axis=0))
    widths = t.ppf(0.5 + 0.5 * CONFIDENCE, n - k) * deviations
    is_undetermined = (np.abs(v[is_zero]) > NEGLIGIBLE).any(axis=0)
    return np.where(is_undetermined, np.inf, widths)
