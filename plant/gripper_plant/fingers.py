"""The two fingers, Eq. (1):  m_j·x_j'' = u_j + f_cj,  and what every plant has: outputs, sub-steps.

The x axis is fixed to the wrist and points right. Finger 1 is the right one: it closes with
u_1 < 0 and the object pushes it back with f_c1 >= 0. Finger 2 mirrors it. Equations:
plant/README.md
"""

from dataclasses import dataclass, field
from functools import cached_property
from math import ceil, copysign, nan
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeAlias

from block_variables import Group, Input, Output, Parameter, check

from . import friction as finger_friction
from .friction import Pair as Pair
from .touch import TouchPair, initial

LONGEST_STEP = 2.0
"""s, of every plant; a longer communication step is discarded."""

SUBSTEP_RATIO = 0.1
"""Longest sub-step as a fraction of the fastest time constant."""

MAX_SUBSTEPS = 20_000
"""Sub-steps of a communication step, at most, so that none is endless; one that needs more has no
result.
"""

UNRESOLVED = (nan, nan)
"""Where the fingers are after more sub-steps than a plant takes: nowhere, so the step is refused.
"""


@dataclass(frozen=True, slots=True)
class Actuator(Group, name="actuator"):
    """Limits of the actuators."""

    force_limit: Annotated[
        Pair,
        Parameter(
            "largest force of the actuator, either way; 0 is no limit",
            unit="N",
            low=0.0,
            high=1e6,
            tunable=True,
        ),
    ] = (0.0, 0.0)


InitialPosition: TypeAlias = Annotated[
    Pair,
    Parameter("x_init,j, position of the fingertip at the start", unit="m", low=-10.0, high=10.0),
]
ObjectWidth: TypeAlias = Annotated[
    float, Parameter("W, width of the object", unit="m", low=0.0, high=10.0)
]
InitialObjectPosition: TypeAlias = Annotated[
    float, Parameter("x_m, centre of the object at the start", unit="m", low=-10.0, high=10.0)
]
"""Where every gripper and its object begin."""


class Place:
    """Of parameters that say where a gripper and its object begin: the object is between."""

    if TYPE_CHECKING:  # declared, and so ordered, where the parameters are
        initial_position: Pair
        object_width: float
        initial_object_position: float

    def __post_init__(self) -> None:
        right, left = self.initial_position
        x_m, w = self.initial_object_position, self.object_width
        if not left <= x_m - 0.5 * w <= x_m + 0.5 * w <= right:
            raise ValueError(
                f"object_width = {w!r} m at initial_object_position = {x_m!r} m: the object spans "
                f"{x_m - 0.5 * w:g} to {x_m + 0.5 * w:g} m, must fit between the fingertips at "
                f"{left:g} and {right:g} m"
            )


class Side(NamedTuple):
    """A finger and its face of the object, in the direction in which the finger opens."""

    surface: float
    """Where the object begins at the start, m."""
    mass: float
    """Of the finger, kg."""
    friction: finger_friction.Law


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params(Place):
    """Parameters of every plant; a value outside its declared range raises ValueError.

    The paper's gripper and object: fingers 110 mm to either side, and an object of 70 mm that is 30
    mm off the middle. So one finger arrives first without layer 3. It names no friction, no limit.
    """

    finger_mass: Annotated[
        Pair, Parameter("m_j, mass of the finger", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = (0.5, 0.5)
    initial_position: InitialPosition = (0.11, -0.11)
    object_width: ObjectWidth = 0.07
    initial_object_position: InitialObjectPosition = 0.03
    friction: finger_friction.Params = field(default=finger_friction.Params(), kw_only=True)
    actuator: Actuator = field(default=Actuator(), kw_only=True)

    def __post_init__(self) -> None:
        check(self)
        Place.__post_init__(self)

    @cached_property
    def sides(self) -> tuple[Side, Side]:
        """Right and left."""
        x_m, half = self.initial_object_position, 0.5 * self.object_width
        m_1, m_2 = self.finger_mass
        friction_1, friction_2 = finger_friction.laws(self.friction)
        return Side(half + x_m, m_1, friction_1), Side(half - x_m, m_2, friction_2)

    @cached_property
    def friction_rate(self) -> float:
        """How fast friction slows down the lighter finger, 1/s."""
        m = min(self.finger_mass)
        (_, _, friction_1), (_, _, friction_2) = self.sides
        return max(finger_friction.rate(friction_1, m), finger_friction.rate(friction_2, m))


Force: TypeAlias = Annotated[
    Pair, Input("u_j, actuator force on the finger", unit="N", nominal=1.0)
]
"""The input of every plant."""


class Inputs(NamedTuple):
    """Held over the step."""

    force: Force = (0.0, 0.0)


Position: TypeAlias = Annotated[
    Pair, Output("x_j, position of the fingertip", unit="m", nominal=0.1, depends_on=set())
]
Velocity: TypeAlias = Annotated[
    Pair, Output("x_j', velocity of the fingertip", unit="m/s", nominal=0.1, depends_on=set())
]
Gap: TypeAlias = Annotated[
    Pair,
    Output(
        "l_j, distance from the sensor face to the object surface",
        unit="m",
        nominal=0.1,
        depends_on=set(),
    ),
]
ContactForce: TypeAlias = Annotated[
    Pair, Output("f_cj, force of the object on the finger", unit="N", nominal=1.0, depends_on=set())
]
Contact: TypeAlias = Annotated[
    tuple[bool, bool], Output("the finger touches the object", depends_on=set())
]
ObjectPosition: TypeAlias = Annotated[
    float, Output("centre of the object", unit="m", nominal=0.1, depends_on=set())
]
"""The outputs of every plant, in this order."""


def initial_touch(p: Place) -> TouchPair:
    """Of both fingers at the start, where one that touches has no impact."""
    (x_1, x_2), x_m, half = p.initial_position, p.initial_object_position, 0.5 * p.object_width
    return initial(x_1 <= half + x_m), initial(-x_2 <= half - x_m)


def forces(p: Actuator, u: Inputs) -> Pair:
    """u_j in N as the actuators bring them up."""
    u_1, u_2 = u.force
    limit_1, limit_2 = p.force_limit
    return _limited(u_1, limit_1), _limited(u_2, limit_2)


def deepest(p: Params, position: Pair, velocity: Pair, faces: Pair, u: Inputs, h: float) -> float:
    """How deep a finger can get into its face, m, within h seconds, without what holds it back."""
    (x_1, x_2), (v_1, v_2) = position, velocity
    (m_1, m_2), (right, left) = p.finger_mass, faces
    u_1, u_2 = forces(p.actuator, u)
    reach_1 = h * (abs(v_1) + 0.5 * h * abs(u_1) / m_1)
    reach_2 = h * (abs(v_2) + 0.5 * h * abs(u_2) / m_2)
    return max(right - x_1 + reach_1, x_2 - left + reach_2)


def _limited(u: float, limit: float) -> float:
    return u if limit == 0.0 or abs(u) <= limit else copysign(limit, u)


def substep_count(rate: float, h: float) -> int:
    """Number of equal sub-steps that resolve a rate in 1/s within h seconds."""
    return max(1, ceil(h * rate / SUBSTEP_RATIO - 1e-9))
