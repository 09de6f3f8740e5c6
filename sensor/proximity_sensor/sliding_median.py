"""Median of the last ten samples. Ten is even: the mean of the fifth and the sixth in order."""

from dataclasses import dataclass
from typing import Annotated

from block_variables import Parameter

Window = tuple[float, float, float, float, float, float, float, float, float, float]
"""The last ten samples in V, the oldest first."""


@dataclass(frozen=True, slots=True)
class Params:
    """Nothing but the switch: the ten samples are those of the paper's bench, Sec. IV.B."""

    enabled: Annotated[bool, Parameter("median of the last ten samples")] = False


def median(w: Window) -> float:
    """The median in V. Five passes over all neighbours, odd and even, put ten numbers in order."""
    a, b, c, d, e, f, g, h, i, j = w
    for _ in range(5):
        if a > b:
            a, b = b, a
        if c > d:
            c, d = d, c
        if e > f:
            e, f = f, e
        if g > h:
            g, h = h, g
        if i > j:
            i, j = j, i
        if b > c:
            b, c = c, b
        if d > e:
            d, e = e, d
        if f > g:
            f, g = g, f
        if h > i:
            h, i = i, h
    return 0.5 * (e + f)
