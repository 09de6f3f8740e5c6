"""Two-finger parallel gripper and a box that stands on a floor, Eq. (1):  m_j·x_j'' = u_j + f_cj.

A push that the other finger does not answer shifts the box, or topples it. Signs as in fingers.py;
tilt > 0 is over the right edge. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from . import box as standing
from . import contact_laws, fingers, friction, touch
from .box import Box, Pushes, Shape
from .box import Outputs as Outputs
from .contact_laws import HuntCrossley, KelvinVoigt
from .fingers import Inputs as Inputs
from .fingers import Pair as Pair
from .touch import Clock, TouchPair

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
    """Fingertip positions in m, velocities in m/s, contact forces in N; the box; toppled so far;
    touches, and the time.
    """

    position: Pair
    velocity: Pair
    contact_force: Pair
    box: Box
    toppled: bool
    touch: TouchPair
    clock: Clock


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest, the fingers free of the object."""
    box = Box(p.initial_object_position, 0.0, 0.0, 0.0)
    return State(
        p.initial_position,
        (0.0, 0.0),
        (0.0, 0.0),
        box,
        False,
        fingers.initial_touch(p),
        touch.START,
    )


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance fingers and box by h seconds (h > 0), the forces held."""
    q = standing.shape(p)
    n = fingers.substep_count(_rate(p, q, x, u, h), h)
    if n > fingers.MAX_SUBSTEPS:
        return x._replace(position=fingers.UNRESOLVED)
    forces = fingers.forces(p.actuator, u)
    (right, left), (x_1, x_2) = standing.faces(q, x.box), x.position
    touch_1, touch_2 = x.touch
    x = x._replace(
        touch=(touch.from_point(touch_1, x_1 <= right), touch.from_point(touch_2, x_2 >= left))
    )
    d = h / n
    for i in range(n):
        x = _substep(p, q, x, forces, d, x.clock.seconds + i * d)
    return x._replace(clock=touch.later(x.clock, h))


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
        *touch.outputs(x.touch),
    )


def _substep(p: Params, q: Shape, x: State, forces: Pair, d: float, begin: float) -> State:
    """D seconds from `begin` in s on with the contact forces held.

    They and the ways under them are found by iteration.
    """
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
    next_gaps = s_1 - next_right, s_2 + next_left
    felt = _felt(p, q, x, forces, (f_1, f_2), next_gaps, d, begin)
    toppled = x.toppled or standing.topples(q, box)
    if toppled:
        box = Box(box.x, box.tilt, 0.0, 0.0)
    return State((s_1, -s_2), (w_1, 0.0 - w_2), (f_1, 0.0 - f_2), box, toppled, felt, x.clock)


def _felt(
    p: Params,
    q: Shape,
    x: State,
    forces: Pair,
    contact_forces: Pair,
    next_gaps: Pair,
    d: float,
    begin: float,
) -> TouchPair:
    """What the fingers have felt d seconds after `begin` in s, with contact forces in N over them.

    next_gaps in m are those at the end. A first contact is met at the speed relative to the face
    that the box moves, pushed only by the other finger.
    """
    (_, m_1, friction_1), (_, m_2, friction_2) = p.sides
    (x_1, x_2), (v_1, v_2), (u_1, u_2) = x.position, x.velocity, forces
    (f_1, f_2), (touch_1, touch_2) = contact_forces, x.touch
    right, left = standing.faces(q, x.box)
    right_speed, left_speed = standing.face_speeds(q, x.box)
    if touch.touches(x_1 - right, next_gaps[0], f_1):
        if touch_1.first_time < 0.0:
            free_s, _ = friction.move(x_1, v_1, m_1, u_1, friction_1, d)
            box = x.box if x.toppled else standing.advance(q, x.box, Pushes(f_2, 0.0), d)
            free_gap = free_s - standing.faces(q, box)[0]
            moment, speed = touch.meeting(x_1 - right, v_1 - right_speed, free_gap, d)
            touch_1 = touch.met(touch_1, begin + moment, speed)
        touch_1 = touch.pressed(touch_1, begin, d, f_1)
    if touch.touches(left - x_2, next_gaps[1], f_2):
        if touch_2.first_time < 0.0:
            free_s, _ = friction.move(-x_2, -v_2, m_2, 0.0 - u_2, friction_2, d)
            box = x.box if x.toppled else standing.advance(q, x.box, Pushes(0.0, f_1), d)
            free_gap = free_s + standing.faces(q, box)[1]
            moment, speed = touch.meeting(left - x_2, left_speed - v_2, free_gap, d)
            touch_2 = touch.met(touch_2, begin + moment, speed)
        touch_2 = touch.pressed(touch_2, begin, d, f_2)
    return touch_1, touch_2


def _rate(p: Params, q: Shape, x: State, u: Inputs, h: float) -> float:
    """The fastest that a finger and the box can do within h seconds, 1/s."""
    shift = h * (abs(x.box.v) + q.h * abs(x.box.w))
    faces = standing.faces(q, x.box)
    deepest = shift + fingers.deepest(p, x.position, x.velocity, faces, u, h)
    return max(contact_laws.rate(p.law, deepest, p.lightest), p.friction_rate)
