"""Reflected-light-intensity (O-RLI) proximity sensor, Eq. (9):  xi = K·alpha / (l + l_0)^n.

The output is offset-compensated: zero when nothing is near. Equations: sensor/README.md
"""

from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum
from types import MappingProxyType
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check


@dataclass(frozen=True, slots=True)
class Params:
    """K and n are the paper's fit to the white surface, R^2 = 0.9992; l_0 is by design."""

    reflectance: Annotated[
        float,
        Parameter(
            "alpha, reflectance relative to white; a surface by name wins",
            unit="1",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 1.0
    gain: Annotated[
        float,
        Parameter(
            "K = G·psi, fitted to the white surface", unit="V.m^n", low=0.0, high=1e6, tunable=True
        ),
    ] = 0.0024
    diffusion_exponent: Annotated[
        float, Parameter("n, diffusion exponent", unit="1", low=0.1, high=10.0, tunable=True)
    ] = 1.1506
    offset_distance: Annotated[
        float,
        Parameter(
            "l_0, from the sensor face to the sensing element",
            unit="m",
            low=1e-6,
            high=1.0,
            tunable=True,
        ),
    ] = 0.005

    def __post_init__(self) -> None:
        check(self)

    @property
    def alpha(self) -> float:
        """The reflectance that counts."""
        return self.reflectance


class Inputs(NamedTuple):
    """Inputs: the surface before the sensor."""

    gap: Annotated[
        float,
        Input(
            "l, distance from the sensor face to the object surface; inf: nothing in range",
            unit="m",
            nominal=0.1,
            infinite=True,
        ),
    ] = 0.1


class Outputs(NamedTuple):
    """Outputs of the sensor."""

    intensity: Annotated[
        float, Output("xi, offset-compensated output", unit="V", nominal=0.1, depends_on={"gap"})
    ]


FARTHEST = 1e6
"""m; what is further away is nothing in range, be it inf or the largest double."""


def check_inputs(p: Params, u: Inputs) -> None:
    """Refuse a gap of more than l_0 below zero: no object is behind the sensing element."""
    if u.gap < -p.offset_distance:
        raise ValueError(
            f"gap = {u.gap!r} m: must be from {-p.offset_distance:g} m on, where the sensing "
            "element is; a ray that hit nothing? Nothing in range is inf"
        )


def outputs(p: Params, u: Inputs) -> Outputs:
    """Eq. (9). The spacer keeps the object off the element: a gap below zero reads as zero."""
    if u.gap > FARTHEST:
        return Outputs(0.0)
    l = 0.0 if u.gap < 0.0 else u.gap
    return Outputs(p.gain * p.alpha / (l + p.offset_distance) ** p.diffusion_exponent)  # Eq. (9)


class Surface(IntEnum):
    """The coloured paper of the paper's experiments, Sec. IV.B; CUSTOM is given as a number."""

    CUSTOM = 0
    WHITE = 1
    BLUE = 2
    RED = 3
    BROWN = 4
    BLACK = 5


REFLECTANCE: Mapping[Surface, float] = MappingProxyType(
    {
        Surface.WHITE: 1.0,
        Surface.BLUE: 0.93,
        Surface.RED: 0.92,
        Surface.BROWN: 0.86,
        Surface.BLACK: 0.57,
    }
)
"""alpha relative to white."""
