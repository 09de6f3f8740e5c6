"""Analogue-to-digital converter: rounds to the nearest of 2^bits levels, and saturates.

The levels stand (high - low) / 2^bits apart, from low to one below high.
"""

from dataclasses import dataclass
from math import floor, ldexp
from typing import Annotated

from block_variables import Group, Parameter


@dataclass(frozen=True, slots=True)
class Params(Group, name="adc"):
    """16 bits over 20 V are usual for controllers like the paper's."""

    enabled: Annotated[bool, Parameter("conversion to digital values")] = False
    bits: Annotated[int, Parameter("resolution", low=1, high=32, tunable=True)] = 16
    range: Annotated[
        tuple[float, float],
        Parameter(
            "lower and upper end of the input range", unit="V", low=-1e3, high=1e3, tunable=True
        ),
    ] = (-10.0, 10.0)

    def __post_init__(self) -> None:
        Group.__post_init__(self)
        low, high = self.range
        if not low < high:
            raise ValueError(f"adc.range = {low!r}, {high!r} V: the second must be above the first")


def converted(p: Params, v: float) -> float:
    """The level in V for an input of v V."""
    low, high = p.range
    levels = ldexp(1.0, p.bits)
    step = (high - low) / levels
    code = float(floor((v - low) / step + 0.5))
    code = 0.0 if code < 0.0 else levels - 1.0 if code >= levels else code
    return low + code * step
