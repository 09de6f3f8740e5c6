"""Two-finger parallel gripper and a box that stands on a floor, Eq. (1):  m_j·x_j'' = u_j + f_cj.

A push that the other finger does not answer shifts the box, or topples it. Signs as in fingers.py;
tilt > 0 is over the right edge. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from . import box as standing
from . import contact_laws, fingers, friction
from .box import Box, Pushes, Shape
from .box import Outputs as Outputs
from .contact_laws import HuntCrossley, KelvinVoigt
from .fingers import Inputs as Inputs
from .fingers import Pair as Pair

LONGEST_STEP = fingers.LONGEST_STEP

MAX_FORCE_ITERATIONS = 16
"""To find the contact forces: each leaves 1/19 of the error, or less; 1/5 where the box tilts."""


@dataclass(frozen=True)
class Params(standing.Params, contact_laws.Giving):
    """Walls ten times as stiff as those of the paper cup in compliant.py: the box moves instead."""

    kelvin_voigt: KelvinVoigt = KelvinVoigt(stiffness=10000.0, damping=20.0)
    hunt_crossley: HuntCrossley = HuntCrossley(stiffness=200000.0)

    @cached_property
    def lightest(self) -> float:
        """The mass with which a finger and the box move against each other, at least, kg."""
        return 1.0 / (1.0 / min(self.finger_mass) + 2.0 / self.object_mass)


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s, contact forces in N; the box; toppled so far."""

    position: Pair
    velocity: Pair
    contact_force: Pair
    box: Box
    toppled: bool


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest, the fingers free of the object."""
    box = Box(p.initial_object_position, 0.0, 0.0, 0.0)
    return State(p.initial_position, (0.0, 0.0), (0.0, 0.0), box, False)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance fingers and box by h seconds (h > 0), the forces held."""
    q = standing.shape(p)
    n = fingers.substep_count(_rate(p, q, x, u, h), h)
    if n > fingers.MAX_SUBSTEPS:
        return x._replace(position=fingers.UNRESOLVED)
    forces = fingers.forces(p.actuator, u)
    for _ in range(n):
        x = _substep(p, q, x, forces, h / n)
    return x


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    x_1, x_2 = x.position
    q = standing.shape(p)
    right, left = standing.faces(q, x.box)
    return Outputs(
        x.position,
        x.velocity,
        (max(0.0, x_1 - right), max(0.0, left - x_2)),
        x.contact_force,
        (x_1 <= right, x_2 >= left),
        standing.centre(q, x.box),
        x.box.tilt,
        x.toppled,
    )


def _substep(p: Params, q: Shape, x: State, forces: Pair, d: float) -> State:
    """D seconds with the contact forces held; they and the ways under them found by iteration."""
    (_, m_1, friction_1), (_, m_2, friction_2) = p.sides
    x_1, x_2 = x.position
    v_1, v_2 = x.velocity
    u_1, u_2 = forces
    right, left = standing.faces(q, x.box)
    f_1, f_2 = x.contact_force[0], -x.contact_force[1]
    for _ in range(MAX_FORCE_ITERATIONS):
        # Eq. (1) for each finger, counted as it opens; (B1) to (B3) for the box
        s_1, w_1 = friction.move(x_1, v_1, m_1, u_1 + f_1, friction_1, d)
        s_2, w_2 = friction.move(-x_2, -v_2, m_2, f_2 - u_2, friction_2, d)
        box = x.box if x.toppled else standing.advance(q, x.box, Pushes(f_2, f_1), d)
        next_right, next_left = standing.faces(q, box)
        new_f_1 = contact_laws.mean_force(p.law, right - x_1, next_right - s_1, d)
        new_f_2 = contact_laws.mean_force(p.law, x_2 - left, -s_2 - next_left, d)
        if contact_laws.settled(new_f_1, f_1) and contact_laws.settled(new_f_2, f_2):
            break
        f_1, f_2 = new_f_1, new_f_2
    toppled = x.toppled or standing.topples(q, box)
    if toppled:
        box = Box(box.x, box.tilt, 0.0, 0.0)
    return State((s_1, -s_2), (w_1, 0.0 - w_2), (f_1, 0.0 - f_2), box, toppled)


def _rate(p: Params, q: Shape, x: State, u: Inputs, h: float) -> float:
    """The fastest that a finger and the box can do within h seconds, 1/s."""
    shift = h * (abs(x.box.v) + q.h * abs(x.box.w))
    faces = standing.faces(q, x.box)
    deepest = shift + fingers.deepest(p, x.position, x.velocity, faces, u, h)
    return max(contact_laws.rate(p.law, deepest, p.lightest), p.friction_rate)
