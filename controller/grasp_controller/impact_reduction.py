"""Layer 2, impact reduction: the nearer the surface, the more the approach is slowed down.

Each finger has its own virtual object, Eq. (5) and (6), which follows the target of layer 3.
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


Floor = Annotated[
    float,
    Parameter(
        "intensity below which the sensor sees nothing", unit="V", low=1e-12, high=1e3, tunable=True
    ),
]

LeastPull = Annotated[
    float,
    Parameter(
        "least force that pulls the virtual object to close; 0 for the published law",
        unit="N",
        low=0.0,
        high=1e3,
        tunable=True,
    ),
]


@dataclass(frozen=True, slots=True)
class Gains(Group, name="impact_reduction"):
    """The paper's gains, but for the viscosity.

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


@dataclass(frozen=True, slots=True)
class Params(Gains, name="impact_reduction"):
    """Of two fingers on one axis, which close in opposite directions."""

    viscosity: Annotated[
        Pair,
        Parameter(
            "D_pj, viscosity of the virtual force", unit="N.s", low=-1e3, high=1e3, tunable=True
        ),
    ] = (0.6, -0.6)
    intensity_floor: Floor = 1e-6
    least_pull: LeastPull = 0.0


def virtual_forces(p: Params, xi: Pair, previous_xi: Pair, h: float) -> Pair:
    """f_pj in N, Eq. (5), from two samples of the intensities in V, h seconds apart."""
    xi_1, xi_2 = xi
    previous_1, previous_2 = previous_xi
    d_1, d_2 = p.viscosity
    floor = p.intensity_floor
    return (
        virtual_force(d_1, floor, xi_1, previous_1, h),
        virtual_force(d_2, floor, xi_2, previous_2, h),
    )


def virtual_force(viscosity: float, floor: float, xi: float, previous_xi: float, h: float) -> float:
    """f_p in N of one finger, Eq. (5), from two samples of its intensity in V, h seconds apart.

    xi'/xi is the rate of ln xi, and is sampled as the difference of two logarithms: noise then has
    no mean in it, which it has in (xi - previous_xi)/(h·xi). Zero unless both samples
    reach the floor: where xi is nothing, xi'/xi has no meaning.
    """
    if xi < floor or previous_xi < floor:
        return 0.0
    return viscosity * log(xi / previous_xi) / h  # Eq. (5)


def with_least_pull(
    least_pull: float, stiffness: float, f_p: float, opening: float, way: float
) -> float:
    """f_p in N, and what the pull lacks of a finger that is `way` in m outside its target.

    `opening` is the direction in which the finger opens. Inside, the pull is K_a1·way at most: so
    the virtual object ends least_pull/K_a1 beyond the target.
    """
    if least_pull <= 0.0:
        return f_p
    return f_p - opening * max(0.0, least_pull - stiffness * max(0.0, way))


def advance(
    p: Params, x_v1: Motions, old_target: Motion, new_target: Motion, f_p: Pair, h: float
) -> Motions:
    """The virtual objects of both fingers h seconds later, Eq. (6), the forces f_p in N held.

    The targets are the motion x_v2 at the two ends of the step.
    """
    a = impedance.transition(p.mass, p.damping, p.stiffness, h)
    x_1, x_2 = x_v1
    target, _ = old_target
    least, k = p.least_pull, p.stiffness
    f_1 = with_least_pull(least, k, f_p[0], 1.0, x_1[0] - target)
    f_2 = with_least_pull(least, k, f_p[1], -1.0, target - x_2[0])
    return (
        follow(p, a, x_1, old_target, new_target, f_1),
        follow(p, a, x_2, old_target, new_target, f_2),
    )


def follow(
    p: Gains, a: impedance.Matrix, x_v1: Motion, old_target: Motion, new_target: Motion, f_p: float
) -> Motion:
    """The virtual object of one finger after the transition a of the layer, f_p in N held."""
    position, velocity = x_v1
    x, v = old_target
    e, e_dot = impedance.advance(a, position - x, velocity - v, f_p / p.stiffness)  # Eq. (6)
    x, v = new_target
    return x + e, v + e_dot
