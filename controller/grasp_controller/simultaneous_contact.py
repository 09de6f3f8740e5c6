"""Layer 3, simultaneous contact: moves the target to where both fingers arrive together.

Eq. (2) to (4); the target starts at the middle of the fingers, x_d, and at rest.
"""

from dataclasses import dataclass
from math import tanh
from typing import Annotated

from block_variables import Group, Parameter

from . import impedance
from .impedance import Motion


@dataclass(frozen=True, slots=True)
class Params(Group, name="simultaneous_contact"):
    """The paper's gains.

    D_a2 = 2·sqrt(K_a2·M_a2) is critical damping, at 6 rad/s. K_s·tanh(1)/K_a2 = 63 mm is the
    furthest that the target can stay from the middle of the fingers.
    """

    enabled: Annotated[
        bool, Parameter("layer 3 on; off, the target is the middle of the fingers", tunable=True)
    ] = True
    mass: Annotated[
        float, Parameter("M_a2, virtual mass", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = 1.0
    damping: Annotated[
        float, Parameter("D_a2, virtual damping", unit="N.s/m", low=0.0, high=1e5, tunable=True)
    ] = 12.0
    stiffness: Annotated[
        float, Parameter("K_a2, virtual stiffness", unit="N/m", low=1e-3, high=1e6, tunable=True)
    ] = 36.0
    gain: Annotated[
        float,
        Parameter("K_s, gain of the virtual force", unit="N", low=-1e3, high=1e3, tunable=True),
    ] = 3.0


def virtual_force(p: Params, xi: tuple[float, float]) -> float:
    """f_s in N, Eq. (2), from the intensities in V; zero where neither sensor sees anything."""
    xi_1, xi_2 = xi
    # Eq. (2)
    return p.gain * contrast(lit(xi_1), lit(xi_2))


def lit(xi: float) -> float:
    """An intensity in V; what is below zero counts as none."""
    return 0.0 if xi < 0.0 else xi


def contrast(xi: float, other_xi: float) -> float:
    """How much brighter than the other an intensity is, both from 0 V on: from -tanh(1) to tanh(1).

    Zero where both are zero.
    """
    return tanh(relative(xi, other_xi))


def relative(xi: float, other_xi: float) -> float:
    """The difference of two intensities as a share of their sum, both from 0 V on: from -1 to 1.

    Zero where both are zero.
    """
    total = xi + other_xi
    return 0.0 if total == 0.0 else (xi - other_xi) / total


def desired_position(x: tuple[float, float]) -> float:
    """x_d in m, Eq. (4): the middle of the fingertips."""
    x_1, x_2 = x
    return 0.5 * (x_1 + x_2)  # Eq. (4)


def advance(p: Params, x_v2: Motion, x_d: float, f_s: float, h: float) -> Motion:
    """The target h seconds later, Eq. (3), x_d in m and f_s in N held."""
    a = impedance.transition(p.mass, p.damping, p.stiffness, h)
    return follow(p, a, x_v2, x_d, f_s)


def follow(p: Params, a: impedance.Matrix, x_v2: Motion, x_d: float, f_s: float) -> Motion:
    """The target after the transition a of the layer, x_d in m and f_s in N held."""
    position, velocity = x_v2
    e, e_dot = impedance.advance(a, position - x_d, velocity, f_s / p.stiffness)  # Eq. (3)
    return x_d + e, e_dot
