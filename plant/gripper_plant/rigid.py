"""Two-finger parallel gripper and a rigid, fixed object, Eq. (1):  m_j·x_j'' = u_j + f_cj.

Signs as in fingers.py. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

from block_variables import Parameter

from . import contact, fingers, touch
from .fingers import Inputs as Inputs
from .fingers import Pair as Pair
from .touch import Clock, TouchPair

LONGEST_STEP = fingers.LONGEST_STEP


Alpha = Annotated[
    float,
    Parameter(
        "alpha, damping rate of the contact stabilisation",
        unit="1/s",
        low=1.0,
        high=1e5,
        tunable=True,
    ),
]
Beta = Annotated[
    float,
    Parameter(
        "beta, natural rate of the contact stabilisation",
        unit="1/s",
        low=1.0,
        high=1e5,
        tunable=True,
    ),
]


@dataclass(frozen=True)
class Params(fingers.Params):
    """Critical damping, alpha = beta: the paper names Baumgarte's method but no rates.

    At 200 1/s a finger that arrives with 6 mm/s sinks in by 11 um and is back within some 20 ms.
    """

    baumgarte_alpha: Alpha = 200.0
    baumgarte_beta: Beta = 200.0

    @cached_property
    def rates(self) -> contact.Rates:
        """Those of the contact."""
        return contact.Rates(self.baumgarte_alpha, self.baumgarte_beta)


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s, contact forces in N; touches, and the time."""

    position: Pair
    velocity: Pair
    contact_force: Pair
    touch: TouchPair
    clock: Clock


class Outputs(NamedTuple):
    """Measured at the fingers and at the object."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    contact_impulse: touch.ContactImpulse
    first_contact_time: touch.FirstContactTime
    impact_velocity: touch.ImpactVelocity
    touched: touch.Touched
    impact_impulse: touch.ImpactImpulse


def initial_state(p: Params, u: Inputs) -> State:
    """Both fingers at rest at their initial positions, free of the object."""
    return State(p.initial_position, (0.0, 0.0), (0.0, 0.0), fingers.initial_touch(p), touch.START)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance both fingers by h seconds (h > 0), the forces held; each in its opening direction."""
    x_1, x_2 = x.position
    v_1, v_2 = x.velocity
    u_1, u_2 = fingers.forces(p.actuator, u)
    right, left = p.sides
    touch_1, touch_2 = x.touch
    now = x.clock.seconds
    s_1, v_1, f_1, touch_1 = contact.advance(right, p.rates, x_1, v_1, u_1, h, touch_1, now)
    s_2, v_2, f_2, touch_2 = contact.advance(left, p.rates, -x_2, -v_2, -u_2, h, touch_2, now)
    return State(
        (s_1, -s_2),
        (v_1, 0.0 - v_2),
        (f_1, 0.0 - f_2),
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
        (gap_1, gap_2),
        x.contact_force,
        (gap_1 <= 0.0, gap_2 <= 0.0),
        p.initial_object_position,
        *touch.outputs(x.touch),
    )
