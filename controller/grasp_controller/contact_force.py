"""Layer 1, contact force control: an impedance from finger to virtual object, Eq. (7)."""

from dataclasses import dataclass
from typing import Annotated

from block_variables import Group, Parameter

from .impedance import Motion


@dataclass(frozen=True, slots=True)
class Params(Group, name="contact_force"):
    """The paper's gains.

    D_i = 2·sqrt(K_i·m_j) is critical damping of a finger of 0.5 kg; K_i·W/2 is the grasp, 3.43 N on
    an object of 70 mm. A grip force takes its place.
    """

    damping: Annotated[
        float,
        Parameter("D_i, damping of the impedance", unit="N.s/m", low=0.0, high=1e5, tunable=True),
    ] = 14.0
    stiffness: Annotated[
        float,
        Parameter("K_i, stiffness of the impedance", unit="N/m", low=0.0, high=1e6, tunable=True),
    ] = 98.0
    grip_force: Annotated[
        float,
        Parameter(
            "F, mean force with which fingers press; 0 for that of the published law, K_i·W/2",
            unit="N",
            low=0.0,
            high=1e4,
            tunable=True,
        ),
    ] = 0.0


def force(p: Params, x: float, x_dot: float, x_v1: Motion) -> float:
    """u_j in N, Eq. (7), from the finger's position in m and velocity in m/s and its virtual
    object's motion.
    """
    position, velocity = x_v1
    return -p.damping * (x_dot - velocity) - p.stiffness * (x - position)  # Eq. (7)
