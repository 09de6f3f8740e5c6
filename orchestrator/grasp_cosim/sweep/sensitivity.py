"""Sobol indices: how much of a metric's variance comes from each parameter.

    S_i  = mean(f_B·(f_ABi - f_A)) / V                    first order, Saltelli et al. 2010
    S_Ti = mean((f_A - f_ABi)^2) / (2·V)                  total, Jansen 1999

as scipy.stats.sobol_indices has them, which takes a power of two of rows: not what is left where
a run failed, with which its whole row goes. The intervals are of a bootstrap over rows as if these
were independent; those of a Sobol sequence are spread more evenly, so the intervals are wide.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

RESAMPLES = 200
"""The number of resamples of the bootstrap."""

COVER = (2.5, 97.5)
"""%, of the intervals."""

ROUNDING = 1e-12
"""Values that are so near to each other, as a share of the greatest, do not vary."""


@dataclass(frozen=True, slots=True)
class Index:
    """The indices of one parameter, each with the 95 % interval of a bootstrap over rows."""

    parameter: str
    first: float
    first_interval: tuple[float, float]
    total: float
    total_interval: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Sensitivity:
    """The indices of one metric, and how many rows of all of the design were complete."""

    metric: str
    rows: int
    of: int
    parameters: tuple[Index, ...]


def sensitivity(
    metric: str, parameters: Sequence[str], values: Floats, seed: int
) -> Sensitivity | None:
    """The indices of values, a row per run in the order of a saltelli design, NaN where none.

    None where the values do not vary, or too few rows are complete.
    """
    width = len(parameters) + 2
    rows = values.reshape(-1, width)
    complete = rows[np.isfinite(rows).all(axis=1)]
    if len(complete) < 2 or not _varies(complete):
        return None
    first, total = indices(complete)
    generator = np.random.default_rng([seed, RESAMPLES])
    drawn = generator.integers(len(complete), size=(RESAMPLES, len(complete)))
    again = [indices(complete[d]) for d in drawn if _varies(complete[d])]
    spread = np.percentile(np.array(again), COVER, axis=0)  # (2, first and total, parameters)
    found = []
    for i, name in enumerate(parameters):
        of_first, of_total = ((float(low), float(high)) for low, high in spread[:, :, i].T)
        found.append(Index(name, float(first[i]), of_first, float(total[i]), of_total))
    return Sensitivity(metric, len(complete), len(rows), tuple(found))


def _varies(rows: Floats) -> bool:
    """Return True if f_A and f_B have a variance beyond rounding."""
    values = rows[:, :2]
    return bool(np.ptp(values) > ROUNDING * np.abs(values).max())


def indices(rows: Floats) -> tuple[Floats, Floats]:
    """First-order and total indices of rows f_A, f_B, f_AB1, f_AB2, ..."""
    scaled = rows / np.abs(rows).max()  # the squares of what is tiny would be zero
    centred = scaled - scaled[:, :2].mean()
    a, b, ab = centred[:, :1], centred[:, 1:2], centred[:, 2:]
    variance = float(np.var(centred[:, :2]))
    first = (b * (ab - a)).mean(axis=0) / variance
    total = 0.5 * ((a - ab) ** 2).mean(axis=0) / variance
    return first, total
