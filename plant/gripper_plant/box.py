"""An upright box on a floor, pushed from both sides: it slides, tilts about an edge, falls back.

theta > 0 is a tilt over the right edge; the mirrored box tilts to the left. Equations of motion,
(B1) to (B3), their symbols and their limits: plant/README.md.
"""

from dataclasses import dataclass
from math import atan2, copysign, cos, sin, tan
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeAlias

from block_variables import Output, Parameter

from . import fingers, friction, touch

GRAVITY = 9.80665
"""m/s^2."""

MAX_PARTS = 4
"""Parts of a sub-step, at most: it is cut where the edge stops sliding and where the box lands.

A box that does more than that within one rattles, and what is left of the sub-step is not resolved.
"""


ObjectMass: TypeAlias = Annotated[
    float, Parameter("m, mass of the object", unit="kg", low=1e-3, high=1e3, tunable=True)
]
ObjectHeight: TypeAlias = Annotated[
    float, Parameter("H, height of the object", unit="m", low=1e-3, high=10.0)
]
ContactHeight: TypeAlias = Annotated[
    float, Parameter("h, height of the fingertips above the floor", unit="m", low=0.0, high=10.0)
]
FloorFriction: TypeAlias = Annotated[
    float,
    Parameter("mu, friction of the object on the floor", unit="1", low=0.0, high=1.0, tunable=True),
]


class Standing:
    """Of parameters of a box on its floor: the fingertips are at its height."""

    if TYPE_CHECKING:  # declared, and so ordered, where the parameters are
        object_width: float
        object_mass: float
        object_height: float
        contact_height: float
        floor_friction: float

    def __post_init__(self) -> None:
        if self.contact_height > self.object_height:
            raise ValueError(
                f"contact_height = {self.contact_height!r} m: must be from 0 to object_height, "
                f"{self.object_height:g}"
            )


@dataclass(frozen=True)
class Params(fingers.Params, Standing):
    """Parameters of every plant with a box; a value outside its range raises ValueError.

    A light box: mu·m·g = 0.15 N shift it, and it slides before it tilts, as mu < W/H and the
    fingers push at half its height.
    """

    object_mass: ObjectMass = 0.05
    object_height: ObjectHeight = 0.1
    contact_height: ContactHeight = 0.05
    floor_friction: FloorFriction = 0.3

    def __post_init__(self) -> None:
        fingers.Params.__post_init__(self)
        Standing.__post_init__(self)


Tilt: TypeAlias = Annotated[
    float,
    Output("theta, tilt of the object, to the right", unit="rad", nominal=0.1, depends_on=set()),
]
Toppled: TypeAlias = Annotated[
    bool, Output("the object has tilted past its balance", depends_on=set())
]


class Outputs(NamedTuple):
    """Measured at the fingers and at the object; the gap of a finger that touches is zero."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    tilt: Tilt
    toppled: Toppled
    contact_impulse: touch.ContactImpulse
    first_contact_time: touch.FirstContactTime
    impact_velocity: touch.ImpactVelocity
    touched: touch.Touched
    impact_impulse: touch.ImpactImpulse


class Shape(NamedTuple):
    """Of the box: half its width and height in m, its mass in kg; of the floor: mu; h in m."""

    b: float
    a: float
    m: float
    mu: float
    h: float


class Box(NamedTuple):
    """Middle of the base while flat, from there on its edge less b, in m; tilt in rad; rates."""

    x: float
    tilt: float
    v: float
    w: float


class Pushes(NamedTuple):
    """Horizontal forces on the faces in N (>= 0): from the left and from the right."""

    left: float
    right: float


def shape(p: Standing) -> Shape:
    """The box and its floor as the parameters have them."""
    return Shape(
        0.5 * p.object_width,
        0.5 * p.object_height,
        p.object_mass,
        p.floor_friction,
        p.contact_height,
    )


def balance(q: Shape) -> float:
    """The tilt in rad from which the box topples: its centre is above the edge."""
    return atan2(q.b, q.a)


def topples(q: Shape, box: Box) -> bool:
    """True for a box that is tilted past its balance."""
    return box.tilt != 0.0 and abs(box.tilt) >= balance(q)


def centre(q: Shape, box: Box) -> float:
    """Where the centre of the box is, m."""
    side = copysign(1.0, box.tilt)
    return box.x + side * (q.b - q.b * cos(box.tilt)) + q.a * sin(box.tilt)


def faces(q: Shape, box: Box) -> tuple[float, float]:
    """Where the fingertips meet the right and the left face, m."""
    if box.tilt == 0.0:
        return box.x + q.b, box.x - q.b
    lean, width = q.h * tan(box.tilt), 2.0 * q.b / cos(box.tilt)
    if box.tilt > 0.0:
        return box.x + q.b + lean, box.x + q.b + lean - width
    return box.x - q.b + lean + width, box.x - q.b + lean


def face_speeds(q: Shape, box: Box) -> tuple[float, float]:
    """How fast the right and the left face move where the fingertips meet them, m/s."""
    if box.tilt == 0.0:
        return box.v, box.v
    cos_squared = cos(box.tilt) * cos(box.tilt)
    leaning = box.v + q.h * box.w / cos_squared
    widening = 2.0 * q.b * sin(box.tilt) * box.w / cos_squared
    if box.tilt > 0.0:
        return leaning, leaning - widening
    return leaning + widening, leaning


def energy(q: Shape, box: Box) -> float:
    """Of the motion and of the height above that of the flat box, J."""
    x, z = _arms(q, abs(box.tilt))
    forward = box.v + z * box.w
    turning = x * x + (q.a * q.a + q.b * q.b) / 3.0
    return q.m * (0.5 * forward * forward + 0.5 * turning * box.w * box.w + GRAVITY * (z - q.a))


def advance(q: Shape, box: Box, push: Pushes, d: float) -> Box:
    """The box d seconds later, the pushes held."""
    remaining = d
    for _ in range(MAX_PARTS):
        side = _pivot_side(q, box, push)
        if side == 0.0:
            grip = q.mu * q.m * GRAVITY
            floor = friction.coulomb(grip)  # (F1)
            x, v = friction.move(box.x, box.v, q.m, push.left - push.right, floor, remaining)
            return Box(x, 0.0, v, 0.0)
        if side > 0.0:
            box, used = _turn_about_edge(q, box, push, remaining)
        else:
            box, used = _turn_about_edge(
                q, _mirrored(box), Pushes(push.right, push.left), remaining
            )
            box = _mirrored(box)
        remaining -= used
        if remaining <= 0.0:
            break
    return box


def _mirrored(box: Box) -> Box:
    return Box(-box.x, 0.0 - box.tilt, 0.0 - box.v, 0.0 - box.w)


def _pivot_side(q: Shape, box: Box, push: Pushes) -> float:
    """The edge that the box turns about: 1 for the right one, -1 for the left one, 0 for neither.

    A flat box starts to turn about an edge where the floor can bear it nowhere else.
    """
    if box.tilt != 0.0:
        return copysign(1.0, box.tilt)
    weight, force = q.m * GRAVITY, push.left - push.right
    grip = q.mu * weight
    sticks = box.v == 0.0 and abs(force) <= grip
    net = 0.0 if sticks else force - copysign(grip, box.v if box.v != 0.0 else force)
    moment = force * q.h - net * q.a  # about the centre; (B2) at theta = 0 and at rest
    return 1.0 if moment > weight * q.b else -1.0 if moment < -weight * q.b else 0.0


def _turn_about_edge(q: Shape, box: Box, push: Pushes, d: float) -> tuple[Box, float]:
    """A box on its right edge, and how many of the d seconds it took to get there.

    It stops early where the edge comes to rest, or the box lands.
    """
    slip = _slip(q, box.tilt, box.v, box.w, push)
    next_box, theta_ddot = _midpoint_step(q, box, push, slip, d)
    used = d
    if box.v * next_box.v < 0.0:
        used = d * box.v / (box.v - next_box.v)
        next_box, theta_ddot = _midpoint_step(q, box, push, slip, used)
        next_box = Box(next_box.x, next_box.tilt, 0.0, next_box.w)
    if next_box.tilt <= 0.0 and (box.tilt > 0.0 or next_box.tilt < 0.0):
        used = min(used, touch.time_to_contact(box.tilt, box.w, theta_ddot))
        next_box, _ = _midpoint_step(q, box, push, slip, used)
        next_box = _land(q, next_box)
    return next_box, used


def _midpoint_step(q: Shape, box: Box, push: Pushes, slip: float, d: float) -> tuple[Box, float]:
    """The box after d seconds by the midpoint rule, and its angular acceleration on the way."""
    _, theta_ddot = _accelerations(q, box.tilt, box.w, push, slip)
    midpoint_tilt, midpoint_w = box.tilt + 0.5 * d * box.w, box.w + 0.5 * d * theta_ddot
    p_ddot, theta_ddot = _accelerations(q, midpoint_tilt, midpoint_w, push, slip)
    x = box.x + d * (box.v + 0.5 * d * p_ddot)
    tilt = box.tilt + d * (box.w + 0.5 * d * theta_ddot)
    return Box(x, tilt, box.v + d * p_ddot, box.w + d * theta_ddot), theta_ddot


def _land(q: Shape, box: Box) -> Box:
    """Flat again, without a rebound: the floor takes the turning, its friction what it can of the
    sliding. The impulse of the floor is m·b·|theta'|.
    """
    v = box.v + q.a * box.w
    speed = max(0.0, abs(v) - q.mu * q.b * abs(box.w))
    return Box(box.x, 0.0, copysign(speed, v), 0.0)


def _slip(q: Shape, tilt: float, v: float, w: float, push: Pushes) -> float:
    """The direction in which the right edge slides, 1 or -1; 0 where it sticks."""
    if v != 0.0:
        return copysign(1.0, v)
    x, z = _arms(q, tilt)
    _, theta_ddot = _accelerations(q, tilt, w, push, 0.0)
    needed = q.m * (z * theta_ddot + x * w * w) - (push.left - push.right)  # F_f of (B1), p at rest
    normal = q.m * x * theta_ddot + _load(q, tilt, w, push)  # (B3)
    return 0.0 if abs(needed) <= q.mu * normal else -copysign(1.0, needed)


def _accelerations(
    q: Shape, tilt: float, w: float, push: Pushes, slip: float
) -> tuple[float, float]:
    """The pair p'' in m/s^2 and theta'' in rad/s^2 of a box on its right edge that slips."""
    x, z = _arms(q, tilt)
    inertia = 4.0 / 3.0 * q.m * (q.a * q.a + q.b * q.b)
    cos_squared = cos(tilt) * cos(tilt)
    moment = (push.left * (q.h - 2.0 * q.b * sin(tilt)) - push.right * q.h) / cos_squared
    moment -= q.m * GRAVITY * x  # Q - m·g·X of (B2)
    if slip == 0.0:
        return 0.0, moment / inertia  # (B2), p at rest
    force, load = push.left - push.right - q.m * x * w * w, _load(q, tilt, w, push)
    drag = slip * q.mu
    # (B1) to (B3) with F_f = -drag·N, solved for theta''
    theta_ddot = (moment - z * (force - drag * load)) / (inertia - q.m * z * (z + drag * x))
    if load + q.m * x * theta_ddot < 0.0:  # the floor does not hold the box down
        drag = 0.0
        theta_ddot = (moment - z * force) / (inertia - q.m * z * z)
    p_ddot = (force - drag * load) / q.m - (z + drag * x) * theta_ddot  # (B1) with (B3)
    return p_ddot, theta_ddot


def _load(q: Shape, tilt: float, w: float, push: Pushes) -> float:
    """The part of N in (B3) without theta'', N."""
    _, z = _arms(q, tilt)
    return q.m * (GRAVITY - z * w * w) + (push.left - push.right) * tan(tilt)


def _arms(q: Shape, tilt: float) -> tuple[float, float]:
    """X and Z of (B1) to (B3): from the edge to the centre, m."""
    return q.b * cos(tilt) - q.a * sin(tilt), q.b * sin(tilt) + q.a * cos(tilt)
