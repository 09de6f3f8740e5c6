"""A hand of N fingers on rays from the wrist and a rigid, fixed object: a prism or a disc.

Each finger is that of rigid.py, with its own surface. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

from . import contact, fingers, friction, hand_fingers, rigid, touch
from .fingers import Side
from .hand_fingers import Inputs as Inputs
from .hand_fingers import Outputs as Outputs
from .hand_fingers import PerFinger, TouchOfEach
from .hand_size import FINGERS
from .touch import Clock

LONGEST_STEP = fingers.LONGEST_STEP

if TYPE_CHECKING:
    Sides = tuple[Side, ...]
else:
    Sides = tuple[(Side,) * FINGERS]


@dataclass(frozen=True)
class Params(hand_fingers.Params):
    """The contact is that of rigid.py."""

    baumgarte_alpha: rigid.Alpha = 200.0
    baumgarte_beta: rigid.Beta = 200.0

    @cached_property
    def rates(self) -> contact.Rates:
        """Those of the contact."""
        return contact.Rates(self.baumgarte_alpha, self.baumgarte_beta)

    @cached_property
    def sides(self) -> Sides:
        """Each finger and its face of the object."""
        return tuple(
            Side(surface, mass, friction.NONE)
            for surface, mass in zip(self.surfaces, self.finger_mass, strict=True)
        )


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s, contact forces in N; touches, and the time."""

    position: PerFinger
    velocity: PerFinger
    contact_force: PerFinger
    touch: TouchOfEach
    clock: Clock


def initial_state(p: Params, u: Inputs) -> State:
    """All fingers at rest at their initial positions, free of the object."""
    felt = tuple(
        touch.initial(s <= surface)
        for s, surface in zip(p.initial_position, p.surfaces, strict=True)
    )
    zeros = hand_fingers.ZEROS
    return State(p.initial_position, zeros, zeros, felt, touch.START)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance all fingers by h seconds (h > 0), the forces held."""
    moved_fingers = tuple(
        contact.advance(side, p.rates, s, v, f, h, felt, x.clock.seconds)
        for side, s, v, f, felt in zip(
            p.sides, x.position, x.velocity, u.force, x.touch, strict=True
        )
    )
    return State(
        tuple(finger.s for finger in moved_fingers),
        tuple(finger.v for finger in moved_fingers),
        tuple(finger.force for finger in moved_fingers),
        tuple(finger.touch for finger in moved_fingers),
        touch.later(x.clock, h),
    )


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    gaps = tuple(s - surface for s, surface in zip(x.position, p.surfaces, strict=True))
    return Outputs(
        x.position,
        x.velocity,
        gaps,
        x.contact_force,
        tuple(gap <= 0.0 for gap in gaps),
        p.initial_object_position,
        p.initial_object_angle,
        tuple(felt.impulse for felt in x.touch),
        tuple(felt.first_time for felt in x.touch),
        tuple(felt.speed for felt in x.touch),
        tuple(felt.touched for felt in x.touch),
        tuple(felt.impact for felt in x.touch),
    )
