"""Is the step small enough? How metrics of runs with several steps tend to those of the finest.

Three results with steps h1 < h2 < h3 that err by C h^p determine p (Roache, Perspective: a method
for uniform reporting of grid refinement studies, J. Fluids Engineering 116(3), 1994).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from .table import Table

STEP = "experiment.step"

LOWEST, HIGHEST = 0.25, 4.0
"""Orders outside are none: the results do not settle, or what is seen is noise."""


@dataclass(frozen=True, slots=True)
class Convergence:
    """How far a metric is from that of the finest step, for each of the coarser `steps` in s.

    errors and finest are in the metric's SI unit, None where a run has no value. order is that of
    the three finest steps; None where they show none, or there are fewer.
    """

    steps: tuple[float, ...]
    finest: float | None
    errors: tuple[float | None, ...]
    order: float | None


def is_study(table: Table) -> bool:
    """True if the communication step is all that varies, and there are several."""
    return table.varied == (STEP,) and len(set(table.columns[STEP])) == len(table) > 1


def convergence(table: Table) -> Mapping[str, Convergence]:
    """How each metric of a study of the step tends to that of the finest, by column."""
    rising = np.argsort(table[STEP])
    steps = table[STEP][rising]
    found = {}
    for name in table.metrics:
        values = [None if np.isnan(v) else float(v) for v in table[name][rising]]
        finest = values[0]
        errors = tuple(None if v is None or finest is None else v - finest for v in values[1:])
        order = observed_order(steps[:3].tolist(), values[:3]) if len(steps) > 2 else None
        found[name] = Convergence(tuple(map(float, steps[1:])), finest, errors, order)
    return found


def observed_order(steps: Sequence[float], results: Sequence[float | None]) -> float | None:
    """The p of three results that err by C h^p, for rising steps h in s.

    None where there is none from LOWEST to HIGHEST.
    """
    y_1, y_2, y_3 = results
    if y_1 is None or y_2 is None or y_3 is None or y_2 == y_1:
        return None
    h_1, h_2, h_3 = (h / steps[0] for h in steps)

    def excess(p: float) -> float:
        """Of (h3^p - h2^p) / (h2^p - h1^p), which rises with p, over what was seen."""
        ratio: float = (h_3**p - h_2**p) / (h_2**p - h_1**p)
        return ratio - (y_3 - y_2) / (y_2 - y_1)

    if not excess(LOWEST) <= 0.0 <= excess(HIGHEST):
        return None
    from scipy.optimize import brentq  # only here: it takes time to load

    return float(brentq(excess, LOWEST, HIGHEST))
