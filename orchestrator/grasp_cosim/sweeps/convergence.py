"""How a result tends to that of the finest communication step.

Three results with steps h1 < h2 < h3 that err by C h^p determine p (Roache, Perspective: a method
for uniform reporting of grid refinement studies, J. Fluids Engineering 116(3), 1994).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

MIN_ORDER, MAX_ORDER = 0.25, 4.0
"""Orders outside are none: the results do not settle, or what is seen is noise."""


class Convergence(NamedTuple):
    """How far a result is from that of the finest step, for each of the coarser `steps` in s.

    `finest` and `errors` are in the SI unit of the result, None where it has no value. `order` is
    that of the three finest steps; None where they show none.
    """

    steps: tuple[float, ...]
    finest: float | None
    errors: tuple[float | None, ...]
    order: float | None


def convergence_of(steps: Sequence[float], results: Sequence[float | None]) -> Convergence:
    """How the results for rising `steps` in s tend to the first; None is a result without value."""
    finest = results[0]
    errors = [
        None if result is None or finest is None else result - finest for result in results[1:]
    ]
    order = observed_order(steps[:3], results[:3]) if len(steps) > 2 else None
    return Convergence(tuple(steps[1:]), finest, tuple(errors), order)


def observed_order(steps: Sequence[float], results: Sequence[float | None]) -> float | None:
    """The p, MIN_ORDER to MAX_ORDER, of three results that err by C h^p, for rising steps h in s.

    None where there is none.
    """
    y_1, y_2, y_3 = results
    if y_1 is None or y_2 is None or y_3 is None or y_2 == y_1:
        return None
    h_1, h_2, h_3 = (h / steps[0] for h in steps)

    def excess(p: float) -> float:
        """(h3^p - h2^p) / (h2^p - h1^p), which rises with p, less the ratio of the results."""
        ratio: float = (h_3**p - h_2**p) / (h_2**p - h_1**p)
        return ratio - (y_3 - y_2) / (y_2 - y_1)

    if not excess(MIN_ORDER) <= 0.0 <= excess(MAX_ORDER):
        return None
    from scipy.optimize import brentq  # only here: it takes time to load

    return float(brentq(excess, MIN_ORDER, MAX_ORDER))
