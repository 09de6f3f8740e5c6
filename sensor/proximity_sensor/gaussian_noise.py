"""Noise of the raw voltage: Gaussian by Box and Muller, white. Card: sensor/README.md."""

from dataclasses import dataclass
from math import cos, log, pi, sqrt
from typing import Annotated

from block_variables import Group, Parameter

from . import mrg32k3a


@dataclass(frozen=True, slots=True)
class Params(Group, name="noise"):
    """5 mV is what R^2 = 0.9992 of the paper's fit leaves, over gaps from 0 to 0.1 m."""

    enabled: Annotated[bool, Parameter("noise of the raw voltage")] = False
    standard_deviation: Annotated[
        float,
        Parameter(
            "standard deviation of a sample of the raw voltage",
            unit="V",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.005
    seed: Annotated[int, Parameter("equal seeds, equal noise", low=0, high=1_000_000_000)] = 1


def normal(s: mrg32k3a.State) -> tuple[float, mrg32k3a.State]:
    """A number of the standard normal distribution, and the generator's state after it."""
    u_1, s = mrg32k3a.uniform(s)
    u_2, s = mrg32k3a.uniform(s)
    return sqrt(-2.0 * log(u_1)) * cos(2.0 * pi * u_2), s
