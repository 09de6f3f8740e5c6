"""Two-finger parallel gripper and a fixed object that gives, Eq. (1):  m_j·x_j'' = u_j + f_cj.

Each side of the object gives by itself; its middle stays where it is. Signs as in fingers.py.
Equations: plant/README.md
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Output, Parameter

from . import contact_laws, fingers, friction, touch
from .contact_laws import HuntCrossley, KelvinVoigt
from .fingers import Inputs as Inputs
from .fingers import Pair as Pair
from .fingers import Side
from .touch import Clock, Touch, TouchPair

LONGEST_STEP = fingers.LONGEST_STEP

MAX_FORCE_ITERATIONS = 8
"""To find the contact force: each leaves 1/19 of the error, or less."""


@dataclass(frozen=True)
class Params(fingers.Params, contact_laws.Giving):
    """A paper cup: the grasp of 3.1 N takes 6 mm of it, and 10 mm are too much."""

    kelvin_voigt: KelvinVoigt = KelvinVoigt()
    hunt_crossley: HuntCrossley = HuntCrossley()
    squeeze_limit: Annotated[
        float,
        Parameter(
            "squeeze above which the object is damaged", unit="m", low=0.0, high=10.0, tunable=True
        ),
    ] = 0.01


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s, contact forces in N; damaged so far; touches
    and time.
    """

    position: Pair
    velocity: Pair
    contact_force: Pair
    damaged: bool
    touch: TouchPair
    clock: Clock


class Outputs(NamedTuple):
    """Measured at the fingers and at the object; the gap of a finger that touches is zero."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    squeeze: Annotated[
        float,
        Output(
            "by how much the fingers press the object together",
            unit="m",
            nominal=0.01,
            depends_on=set(),
        ),
    ]
    damaged: Annotated[bool, Output("the squeeze has been above its limit", depends_on=set())]
    contact_impulse: touch.ContactImpulse
    first_contact_time: touch.FirstContactTime
    impact_velocity: touch.ImpactVelocity
    touched: touch.Touched
    impact_impulse: touch.ImpactImpulse


def initial_state(p: Params, u: Inputs) -> State:
    """Both fingers at rest at their initial positions, free of the object."""
    return State(
        p.initial_position, (0.0, 0.0), (0.0, 0.0), False, fingers.initial_touch(p), touch.START
    )


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance both fingers by h seconds (h > 0), the forces held; each in its opening direction."""
    n = fingers.substep_count(_rate(p, x, u, h), h)
    if n > fingers.MAX_SUBSTEPS:
        return x._replace(position=fingers.UNRESOLVED)
    x_1, x_2 = x.position
    v_1, v_2 = x.velocity
    f_1, f_2 = x.contact_force
    u_1, u_2 = fingers.forces(p.actuator, u)
    right, left = p.sides
    s_2, v_2, u_2, f_2, damaged = -x_2, -v_2, -u_2, -f_2, x.damaged
    touch_1 = touch.from_point(x.touch[0], x_1 <= right.surface)
    touch_2 = touch.from_point(x.touch[1], s_2 <= left.surface)
    d = h / n
    for i in range(n):
        begin = x.clock.seconds + i * d
        x_1, v_1, f_1, touch_1 = _press(right, p.law, x_1, v_1, u_1, d, f_1, touch_1, begin)
        s_2, v_2, f_2, touch_2 = _press(left, p.law, s_2, v_2, u_2, d, f_2, touch_2, begin)
        squeeze = _squeeze(x_1 - right.surface, s_2 - left.surface)
        damaged = damaged or squeeze > p.squeeze_limit
    return State(
        (x_1, -s_2),
        (v_1, 0.0 - v_2),
        (f_1, 0.0 - f_2),
        damaged,
        (touch_1, touch_2),
        touch.later(x.clock, h),
    )


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    x_1, x_2 = x.position
    (right, _, _), (left, _, _) = p.sides
    gap_1, gap_2 = x_1 - right, -x_2 - left
    return Outputs(
        x.position,
        x.velocity,
        (max(0.0, gap_1), max(0.0, gap_2)),
        x.contact_force,
        (gap_1 <= 0.0, gap_2 <= 0.0),
        p.initial_object_position,
        _squeeze(gap_1, gap_2),
        x.damaged,
        *touch.outputs(x.touch),
    )


def _press(
    side: Side,
    law: contact_laws.Law,
    s: float,
    v: float,
    f: float,
    d: float,
    guess: float,
    felt: Touch,
    begin: float,
) -> tuple[float, float, float, Touch]:
    """Position in m and velocity in m/s of a finger after d seconds, contact force in N over them.

    The force and the way that the finger goes under it are found by iteration, from a guess in N.
    The d seconds begin at `begin` s since the start; what the finger has felt goes on.
    """
    surface, m, friction_law = side
    contact_force, next_s, next_v = guess, s, v
    for _ in range(MAX_FORCE_ITERATIONS):
        next_s, next_v = friction.move(s, v, m, f + contact_force, friction_law, d)  # Eq. (1)
        new_force = contact_laws.mean_force(law, surface - s, surface - next_s, d)
        if contact_laws.settled(new_force, contact_force):
            break
        contact_force = new_force
    if touch.touches(s - surface, next_s - surface, contact_force):
        if felt.first_time < 0.0:
            free_s, _ = friction.move(s, v, m, f, friction_law, d)
            moment, speed = touch.meeting(s - surface, v, free_s - surface, d)
            felt = touch.met(felt, begin + moment, speed)
        felt = touch.pressed(felt, begin, d, contact_force)
    return next_s, next_v, contact_force, felt


def _rate(p: Params, x: State, u: Inputs, h: float) -> float:
    """The fastest that either finger can do within h seconds, 1/s."""
    right, left = p.sides
    faces = right.surface, -left.surface
    deepest = fingers.deepest(p, x.position, x.velocity, faces, u, h)
    surface = contact_laws.rate(p.law, deepest, min(p.finger_mass))
    return max(surface, p.friction_rate)


def _squeeze(gap_1: float, gap_2: float) -> float:
    return max(0.0, -gap_1) + max(0.0, -gap_2)
