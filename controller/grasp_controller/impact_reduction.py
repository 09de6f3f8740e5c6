"""Layer 2, impact reduction: the nearer the surface, the more the approach is slowed down.

Each finger has a virtual object of its own, Eq. (5) and (6); both follow the target of layer 3.
"""

from dataclasses import dataclass
from math import log
from typing import Annotated

from block_variables import Group, Parameter

from . import impedance
from .impedance import Motion

Pair = tuple[float, float]
"""A value per finger: right, left."""

Motions = tuple[Motion, Motion]
"""A motion per finger: right, left."""


@dataclass(frozen=True, slots=True)
class Params(Group, name="impact_reduction"):
    """The paper's gains.

    D_a1 = 2·sqrt(K_a1·M_a1) is critical damping, at 5 rad/s. By Eq. (9) f_p is that of a damper
    D_pj·n/(l + l_0), 138 N.s/m at the surface, where K_a1·W/2 = 0.9 N pulls: so a finger arrives
    with 6 mm/s. The floor is far below all in reach: a white surface gives 1 uV from 0.9 km.
    """

    enabled: Annotated[
        bool, Parameter("layer 2 on; off, the fingers head for the target directly", tunable=True)
    ] = True
    mass: Annotated[
        float, Parameter("M_a1, virtual mass", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = 1.0
    damping: Annotated[
        float, Parameter("D_a1, virtual damping", unit="N.s/m", low=0.0, high=1e5, tunable=True)
    ] = 10.0
    stiffness: Annotated[
        float, Parameter("K_a1, virtual stiffness", unit="N/m", low=1e-3, high=1e6, tunable=True)
    ] = 25.0
    viscosity: Annotated[
        Pair,
        Parameter(
            "D_pj, viscosity of the virtual force", unit="N.s", low=-1e3, high=1e3, tunable=True
        ),
    ] = (0.6, -0.6)
    intensity_floor: Annotated[
        float,
        Parameter(
            "intensity below which the sensor sees nothing",
            unit="V",
            low=1e-12,
            high=1e3,
            tunable=True,
        ),
    ] = 1e-6


def virtual_forces(p: Params, xi: Pair, xi_before: Pair, h: float) -> Pair:
    """f_pj in N, Eq. (5), from two samples of the intensities in V, h seconds apart.

    xi'/xi is the rate of ln xi, and is sampled as the difference of two logarithms: noise then has
    no mean in it, which it has in (xi - xi_before)/(h·xi). Zero unless both samples reach the
    floor: where xi is nothing, xi'/xi has no meaning.
    """
    xi_1, xi_2 = xi
    was_1, was_2 = xi_before
    d_1, d_2 = p.viscosity
    floor = p.intensity_floor
    return (
        0.0 if xi_1 < floor or was_1 < floor else d_1 * log(xi_1 / was_1) / h,
        0.0 if xi_2 < floor or was_2 < floor else d_2 * log(xi_2 / was_2) / h,
    )


def advance(
    p: Params, x_v1: Motions, before: Motion, after: Motion, f_p: Pair, h: float
) -> Motions:
    """The virtual objects of both fingers h seconds later, Eq. (6), the forces f_p in N held.

    before and after are the target's motion x_v2 at the two ends of the step.
    """
    a = impedance.transition(p.mass, p.damping, p.stiffness, h)
    (x_1, v_1), (x_2, v_2) = x_v1
    x, v = before
    f_1, f_2 = f_p
    e_1, e_1_dot = impedance.advance(a, x_1 - x, v_1 - v, f_1 / p.stiffness)
    e_2, e_2_dot = impedance.advance(a, x_2 - x, v_2 - v, f_2 / p.stiffness)
    x, v = after
    return (x + e_1, v + e_1_dot), (x + e_2, v + e_2_dot)
