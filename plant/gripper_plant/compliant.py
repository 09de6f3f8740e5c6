"""Two-finger parallel gripper and a fixed object that gives, Eq. (1):  m_j·x_j'' = u_j + f_cj.

Each side of the object gives by itself; its middle stays where it is. Signs as in fingers.py.
Card: plant/README.md
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from . import contact_laws, fingers, friction, substeps
from .contact_laws import HuntCrossley, KelvinVoigt
from .fingers import Inputs as Inputs
from .fingers import Pair as Pair

ITERATIONS = 8
"""To find the contact force: each leaves 1/19 of the error, or less."""


@dataclass(frozen=True, slots=True)
class Params(fingers.Params):
    """Parameters; a value outside its declared range raises ValueError."""

    kelvin_voigt: KelvinVoigt = KelvinVoigt()
    hunt_crossley: HuntCrossley = HuntCrossley()
    squeeze_limit: Annotated[
        float, "m", "squeeze above which the object is damaged", (0.0, 10.0)
    ] = 0.01


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s, contact forces in N; damaged so far."""

    position: Pair
    velocity: Pair
    contact_force: Pair
    damaged: bool


class Outputs(NamedTuple):
    """Measured at the fingers and at the object; the gap of a finger that touches is zero."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    squeeze: Annotated[float, "m", "by how much the fingers press the object together", 0.01, set()]
    damaged: Annotated[bool, "", "the squeeze has been above its limit", set()]


def initial_state(p: Params, u: Inputs) -> State:
    """Both fingers at rest at their initial positions, free of the object."""
    return State(p.initial_position, (0.0, 0.0), (0.0, 0.0), False)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance both fingers by h seconds (h > 0), the forces held; each in its opening direction."""
    m_1, m_2 = p.finger_mass
    x_1, x_2 = x.position
    v_1, v_2 = x.velocity
    f_1, f_2 = x.contact_force
    u_1, u_2 = fingers.forces(p.actuator, u)
    rub_1, rub_2 = friction.laws(p.friction)
    right, left = fingers.surfaces(p)
    law = contact_laws.law(p.kelvin_voigt, p.hunt_crossley)
    s_2, v_2, u_2, f_2, damaged = -x_2, -v_2, -u_2, -f_2, x.damaged
    n = substeps.count(_rate(p, x, u, h), h)
    for _ in range(n):
        x_1, v_1, f_1 = _press(x_1, v_1, right, m_1, u_1, rub_1, law, h / n, f_1)
        s_2, v_2, f_2 = _press(s_2, v_2, left, m_2, u_2, rub_2, law, h / n, f_2)
        damaged = damaged or _squeeze(x_1 - right, s_2 - left) > p.squeeze_limit
    return State((x_1, -s_2), (v_1, 0.0 - v_2), (f_1, 0.0 - f_2), damaged)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """What the sensors see; no input reaches an output without a step."""
    x_1, x_2 = x.position
    right, left = fingers.surfaces(p)
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
    )


def _press(
    s: float,
    v: float,
    surface: float,
    m: float,
    f: float,
    rub: friction.Law,
    law: contact_laws.Law,
    d: float,
    guess: float,
) -> tuple[float, float, float]:
    """Position in m and velocity in m/s of a finger after d seconds, contact force in N over them.

    The force and the way that the finger goes under it are found by iteration, from a guess in N.
    """
    contact_force, after, rate = guess, s, v
    for _ in range(ITERATIONS):
        after, rate = friction.move(s, v, m, f + contact_force, rub, d)
        found = contact_laws.mean_force(law, surface - s, surface - after, d)
        if contact_laws.settled(found, contact_force):
            break
        contact_force = found
    return after, rate, contact_force


def _rate(p: Params, x: State, u: Inputs, h: float) -> float:
    """The fastest that either finger can do within h seconds, 1/s."""
    m = min(p.finger_mass)
    law = contact_laws.law(p.kelvin_voigt, p.hunt_crossley)
    rub_1, rub_2 = friction.laws(p.friction)
    right, left = fingers.surfaces(p)
    reach_1, reach_2 = fingers.reach(p, x.velocity, u, h)
    deepest = max(right - x.position[0] + reach_1, x.position[1] + left + reach_2)
    surface = contact_laws.rate(law, deepest, m)
    return max(surface, friction.rate(rub_1, m), friction.rate(rub_2, m))


def _squeeze(gap_1: float, gap_2: float) -> float:
    return max(0.0, -gap_1) + max(0.0, -gap_2)
