"""Noise of the raw voltage: Gaussian, white, a number of its own for every sample.

    v = sqrt(-2·ln u_1)·cos(2·pi·u_2)                                                Box-Muller

The numbers depend on the seed and on the number of the sample, on nothing else. Seeds are streams
of MRG32k3a, so two seeds share no numbers.
"""

from dataclasses import dataclass
from math import cos, log, pi, sqrt
from typing import Annotated

from block_variables import Parameter, check

from . import mrg32k3a


@dataclass(frozen=True, slots=True)
class Params:
    """Parameters; a value outside its declared range raises ValueError.

    5 mV is what R^2 = 0.9992 of the paper's fit leaves, over gaps from 0 to 0.1 m.
    """

    enabled: Annotated[bool, Parameter("noise of the raw voltage")] = False
    standard_deviation: Annotated[
        float,
        Parameter(
            "standard deviation of a sample of the raw voltage", unit="V", low=0.0, high=10.0
        ),
    ] = 0.005
    seed: Annotated[int, Parameter("equal seeds, equal noise", low=0, high=1_000_000_000)] = 1

    def __post_init__(self) -> None:
        check(self, "noise")


def normal(s: mrg32k3a.State) -> tuple[float, mrg32k3a.State]:
    """A number of the standard normal distribution, and the generator's state after it."""
    u_1, s = mrg32k3a.uniform(s)
    u_2, s = mrg32k3a.uniform(s)
    return sqrt(-2.0 * log(u_1)) * cos(2.0 * pi * u_2), s
