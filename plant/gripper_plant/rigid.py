"""Two-finger parallel gripper and a rigid, fixed object, Eq. (1):  m_j·x_j'' = u_j + f_cj.

The x axis is fixed to the wrist and points right. Finger 1 is the right one: it closes with
u_1 < 0 and the object pushes it back with f_c1 >= 0. Finger 2 mirrors it. Card: plant/README.md
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple, get_type_hints

from . import contact

Pair = tuple[float, float]
"""A value per finger: right, left."""


@dataclass(frozen=True, slots=True)
class Params:
    """Parameters; a value outside its declared range raises ValueError."""

    finger_mass: Annotated[Pair, "kg", "m_j, mass of the finger", (1e-3, 1e3)] = (0.5, 0.5)
    initial_position: Annotated[
        Pair, "m", "x_init,j, position of the fingertip at the start", (-10.0, 10.0)
    ] = (0.11, -0.11)
    object_width: Annotated[float, "m", "W, width of the object", (0.0, 10.0)] = 0.07
    initial_object_position: Annotated[
        float, "m", "x_m, centre of the object at the start", (-10.0, 10.0)
    ] = 0.03
    baumgarte_alpha: Annotated[
        float, "1/s", "alpha, damping rate of the contact stabilisation", (1.0, 1e5)
    ] = 200.0
    baumgarte_beta: Annotated[
        float, "1/s", "beta, natural rate of the contact stabilisation", (1.0, 1e5)
    ] = 200.0

    def __post_init__(self) -> None:
        for name, hint in get_type_hints(Params, include_extras=True).items():
            unit, _, (low, high) = hint.__metadata__
            declared = getattr(self, name)
            for value in declared if isinstance(declared, tuple) else (declared,):
                if not low <= value <= high:
                    raise ValueError(f"{name} = {value!r} {unit}: must be from {low:g} to {high:g}")
        right, left = self.initial_position
        x_m, w = self.initial_object_position, self.object_width
        if not left <= x_m - 0.5 * w <= x_m + 0.5 * w <= right:
            raise ValueError(
                f"object_width = {w!r} m at initial_object_position = {x_m!r} m: the object spans "
                f"{x_m - 0.5 * w:g} to {x_m + 0.5 * w:g} m, must fit between the fingertips at "
                f"{left:g} and {right:g} m"
            )


class Inputs(NamedTuple):
    """Held over the step."""

    force: Annotated[Pair, "N", "u_j, actuator force on the finger", 1.0] = (0.0, 0.0)


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s and contact forces in N."""

    position: Pair
    velocity: Pair
    contact_force: Pair


class Outputs(NamedTuple):
    """Measured at the fingers and at the object."""

    position: Annotated[Pair, "m", "x_j, position of the fingertip", 0.1, set()]
    velocity: Annotated[Pair, "m/s", "x_j', velocity of the fingertip", 0.1, set()]
    gap: Annotated[
        Pair, "m", "l_j, distance from the sensor face to the object surface", 0.1, set()
    ]
    contact_force: Annotated[Pair, "N", "f_cj, force of the object on the finger", 1.0, set()]
    contact: Annotated[tuple[bool, bool], "", "the finger touches the object", set()]
    object_position: Annotated[float, "m", "centre of the object", 0.1, set()]


def initial_state(p: Params, u: Inputs) -> State:
    """Both fingers at rest at their initial positions, free of the object."""
    return State(p.initial_position, (0.0, 0.0), (0.0, 0.0))


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance both fingers by h seconds (h > 0), the forces held; each in its opening direction."""
    m_1, m_2 = p.finger_mass
    x_1, x_2 = x.position
    v_1, v_2 = x.velocity
    u_1, u_2 = u.force
    right, left = _surfaces(p)
    alpha, beta = p.baumgarte_alpha, p.baumgarte_beta
    s_1, v_1, f_1 = contact.advance(x_1, v_1, right, m_1, u_1, alpha, beta, h)
    s_2, v_2, f_2 = contact.advance(-x_2, -v_2, left, m_2, -u_2, alpha, beta, h)
    return State((s_1, -s_2), (v_1, 0.0 - v_2), (f_1, 0.0 - f_2))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """What the sensors see; no input reaches an output without a step."""
    x_1, x_2 = x.position
    right, left = _surfaces(p)
    gap_1, gap_2 = x_1 - right, -x_2 - left
    return Outputs(
        x.position,
        x.velocity,
        (gap_1, gap_2),
        x.contact_force,
        (gap_1 <= 0.0, gap_2 <= 0.0),
        p.initial_object_position,
    )


def _surfaces(p: Params) -> Pair:
    """Where the object begins for each finger, in the finger's own opening direction, m."""
    x_m, half = p.initial_object_position, 0.5 * p.object_width
    return half + x_m, half - x_m
