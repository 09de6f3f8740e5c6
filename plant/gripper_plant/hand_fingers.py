"""The fingers of a hand, m_k·s_k'' = u_k + f_k, its object, and what every such plant declares.

A finger moves along its ray from the wrist; s_k >= 0 is its way there, in the direction e_k of
`angle[k]`, and everything of it counts as it opens. The object is seen from above: a prism with a
flat face under each finger, or a disc.

    prism: nu_k = Rot(theta)·e_k,      surface on the ray  (h_k + nu_k·c)/(nu_k·e_k)
    disc:  nu_k = (p_k - c)/|p_k - c|,  surface on the ray  c·e_k + sqrt(R^2 - q_k^2)

nu_k is the outward normal where finger k is, q_k how far its ray passes next to the centre.
Equations (H1) and card: plant/README.md
"""

from dataclasses import dataclass
from enum import IntEnum
from functools import cached_property
from math import cos, fmod, inf, nan, pi, sin, sqrt
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

from .hand_size import FINGERS
from .touch import Touch

MIN_FACING = 0.1
"""Cosine of a prism's turn below which its faces do not look to the rays any more."""

FAR = 10.0
"""m; as far is what is next to a finger."""


class Shape(IntEnum):
    """Of the object, seen from above."""

    PRISM = 1
    DISC = 2


class Ray(NamedTuple):
    """A finger's direction e_k, its angle in rad, and how far the face under it is out, in m."""

    x: float
    y: float
    angle: float
    half_width: float


class Pose(NamedTuple):
    """Of the object: its centre in m, its turn in rad."""

    x: float
    y: float
    angle: float


class Normal(NamedTuple):
    """The outward normal at a finger, and how deep in m the fingertip is below the face there."""

    x: float
    y: float
    depth: float


if TYPE_CHECKING:
    PerFinger = tuple[float, ...]
    Touches = tuple[bool, ...]
    Rays = tuple[Ray, ...]
    TouchOfEach = tuple[Touch, ...]
else:
    PerFinger = tuple[(float,) * FINGERS]
    Touches = tuple[(bool,) * FINGERS]
    Rays = tuple[(Ray,) * FINGERS]
    TouchOfEach = tuple[(Touch,) * FINGERS]

Plane = tuple[float, float]
"""x and y in the plane of the rays, the wrist at the origin."""

ZEROS: PerFinger = (0.0,) * FINGERS
OUTSIDE: Touches = (False,) * FINGERS

UNRESOLVED: PerFinger = (nan,) * FINGERS
"""Where the fingers are after more sub-steps than a plant takes: the step is refused."""

OPPOSITE_TOLERANCE = 1e-6
"""rad by which two directions may be off and yet be opposite."""


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params:
    """Parameters of every plant with a hand; a value outside its range raises ValueError.

    Fingers at equal angles and 110 mm out, as the paper has two; an object of 70 mm in the middle.
    """

    angle: Annotated[
        PerFinger,
        Parameter(
            "direction of the finger, from the x axis", unit="rad", low=-2.0 * pi, high=2.0 * pi
        ),
    ] = tuple(2.0 * pi * k / FINGERS for k in range(FINGERS))
    finger_mass: Annotated[
        PerFinger, Parameter("m_k, mass of the finger", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = (0.5,) * FINGERS
    initial_position: Annotated[
        PerFinger,
        Parameter(
            "s_init,k, way of the fingertip from the wrist at the start",
            unit="m",
            low=-10.0,
            high=10.0,
        ),
    ] = (0.11,) * FINGERS
    shape: Annotated[Shape, Parameter("of the object, seen from above")] = Shape.PRISM
    object_radius: Annotated[
        float, Parameter("R, radius of a disc", unit="m", low=1e-4, high=10.0)
    ] = 0.035
    half_width: Annotated[
        PerFinger,
        Parameter(
            "h_k, from the middle of a prism to its face under the finger",
            unit="m",
            low=1e-4,
            high=10.0,
        ),
    ] = (0.035,) * FINGERS
    initial_object_position: Annotated[
        Plane,
        Parameter("c, centre of the object at the start, x and y", unit="m", low=-10.0, high=10.0),
    ] = (0.0, 0.0)
    initial_object_angle: Annotated[
        float,
        Parameter(
            "theta, turn of a prism at the start; at 0 its faces are square to the rays",
            unit="rad",
            low=-1.0,
            high=1.0,
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        check(self)
        widest, second = angles_between(self.angle)
        if widest > pi + OPPOSITE_TOLERANCE or (
            widest > pi - OPPOSITE_TOLERANCE and second < pi - OPPOSITE_TOLERANCE
        ):
            raise ValueError(
                f"angle: there is no finger within {widest:.6g} rad of another; fingers can hold "
                f"where that is less than {pi:.6g}, or where all are on one line, at both ends"
            )
        for s, begins in zip(self.initial_position, self.surfaces, strict=True):
            if begins == -inf:
                raise ValueError(
                    f"object_radius = {self.object_radius!r} m: the disc is next to the ray of a "
                    "finger, must be under all of them"
                )
            if s < begins:
                raise ValueError(
                    f"initial_position = {s!r} m: must be at least {begins:g} m, where the object "
                    "begins on the ray of that finger"
                )

    @cached_property
    def rays(self) -> Rays:
        """The directions of the fingers, and the object's faces under them."""
        return tuple(
            Ray(cos(a), sin(a), a, half)
            for a, half in zip(self.angle, self.half_width, strict=True)
        )

    @cached_property
    def first_pose(self) -> Pose:
        """Where the object is at the start."""
        x, y = self.initial_object_position
        return Pose(x, y, self.initial_object_angle)

    @cached_property
    def surfaces(self) -> PerFinger:
        """Where the object begins on each ray at the start, m; -inf where it is next to the ray."""
        shape, radius, pose = self.shape, self.object_radius, self.first_pose
        return tuple(surface(shape, radius, ray, pose) for ray in self.rays)


def angles_between(angle: PerFinger) -> tuple[float, float]:
    """The widest and the second widest angle in rad between neighbouring directions."""
    widest, second = 0.0, 0.0
    for a in angle:
        following = 2.0 * pi
        for b in angle:
            angle_ahead = fmod(b - a, 2.0 * pi)
            angle_ahead = angle_ahead + 2.0 * pi if angle_ahead <= 0.0 else angle_ahead
            following = min(following, angle_ahead)
        second = max(second, min(widest, following))
        widest = max(widest, following)
    return widest, second


def surface(shape: Shape, radius: float, ray: Ray, pose: Pose) -> float:
    """Where the object begins on a ray, m from the wrist; -inf where it is next to the ray."""
    if shape == Shape.PRISM:
        facing = cos(pose.angle)
        if facing < MIN_FACING:
            return -inf
        x, y = cos(ray.angle + pose.angle), sin(ray.angle + pose.angle)
        return (ray.half_width + x * pose.x + y * pose.y) / facing
    along = ray.x * pose.x + ray.y * pose.y
    beside = ray.x * pose.y - ray.y * pose.x
    half_chord_squared = radius * radius - beside * beside
    return along + sqrt(half_chord_squared) if half_chord_squared >= 0.0 else -inf


def normal(shape: Shape, radius: float, face: float, ray: Ray, pose: Pose, s: float) -> Normal:
    """The normal where the fingertip is, s m out on the ray, and its depth.

    A face of a prism ends half of its length `face` in m away from its middle.
    """
    arm_x, arm_y = s * ray.x - pose.x, s * ray.y - pose.y
    if shape == Shape.PRISM:
        facing = cos(pose.angle)
        x, y = cos(ray.angle + pose.angle), sin(ray.angle + pose.angle)
        if facing < MIN_FACING or abs(arm_x * y - arm_y * x) > 0.5 * face:
            return Normal(x, y, -FAR)
        return Normal(x, y, ray.half_width + x * pose.x + y * pose.y - s * facing)
    x, y = arm_x, arm_y
    distance = sqrt(x * x + y * y)
    if distance <= 0.0:
        return Normal(ray.x, ray.y, radius)
    return Normal(x / distance, y / distance, radius - distance)


class Inputs(NamedTuple):
    """Held over the step."""

    force: Annotated[
        PerFinger, Input("u_k, actuator force on the finger, opening", unit="N", nominal=1.0)
    ] = ZEROS


class Outputs(NamedTuple):
    """Measured at the fingers and at the object."""

    position: Annotated[
        PerFinger,
        Output("s_k, way of the fingertip from the wrist", unit="m", nominal=0.1, depends_on=set()),
    ]
    velocity: Annotated[
        PerFinger,
        Output(
            "s_k', velocity of the fingertip, opening", unit="m/s", nominal=0.1, depends_on=set()
        ),
    ]
    gap: Annotated[
        PerFinger,
        Output(
            "l_k, distance from the sensor face to the object surface along the ray",
            unit="m",
            nominal=0.1,
            depends_on=set(),
        ),
    ]
    contact_force: Annotated[
        PerFinger,
        Output(
            "f_ck, force of the object on the finger along the ray",
            unit="N",
            nominal=1.0,
            depends_on=set(),
        ),
    ]
    contact: Annotated[Touches, Output("the finger touches the object", depends_on=set())]
    object_position: Annotated[
        Plane, Output("c, centre of the object, x and y", unit="m", nominal=0.1, depends_on=set())
    ]
    object_angle: Annotated[
        float,
        Output(
            "theta, turn of the object, counter-clockwise",
            unit="rad",
            nominal=0.1,
            depends_on=set(),
        ),
    ]
    contact_impulse: Annotated[
        PerFinger,
        Output(
            "impulse of the contact force since the start",
            unit="N.s",
            nominal=0.01,
            depends_on=set(),
        ),
    ]
    first_contact_time: Annotated[
        PerFinger,
        Output(
            "time of the first contact since the start; -1 before",
            unit="s",
            nominal=1.0,
            depends_on=set(),
        ),
    ]
    impact_velocity: Annotated[
        PerFinger,
        Output(
            "rate at which the gap closed at the first contact; 0 before",
            unit="m/s",
            nominal=0.1,
            depends_on=set(),
        ),
    ]
    touched: Annotated[
        Touches,
        Output(
            "the finger touched since the last communication point, or touches now",
            depends_on=set(),
        ),
    ]
    impact_impulse: Annotated[
        PerFinger,
        Output(
            "impulse of the contact force within 20 ms from the first contact",
            unit="N.s",
            nominal=0.01,
            depends_on=set(),
        ),
    ]
