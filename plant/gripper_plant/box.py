"""An upright box on a floor, pushed from both sides: it slides, tilts about an edge, falls back.

theta > 0 is a tilt over the right edge; the mirrored box tilts to the left. Equations of motion,
their symbols and their limits: plant/README.md.
"""

from dataclasses import dataclass
from math import atan2, copysign, cos, sin, tan
from typing import TYPE_CHECKING, Annotated, NamedTuple, TypeAlias

from block_variables import Output, Parameter

from . import fingers, friction
from .contact import time_to_contact

GRAVITY = 9.80665
"""m/s^2."""

PIECES = 4
"""Most parts of a sub-step: it is cut where the edge stops sliding and where the box lands.

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


def energy(q: Shape, box: Box) -> float:
    """Of the motion and of the height above that of the flat box, J."""
    x, z = _arms(q, abs(box.tilt))
    forward = box.v + z * box.w
    turning = x * x + (q.a * q.a + q.b * q.b) / 3.0
    return q.m * (0.5 * forward * forward + 0.5 * turning * box.w * box.w + GRAVITY * (z - q.a))


def advance(q: Shape, box: Box, push: Pushes, d: float) -> Box:
    """The box d seconds later, the pushes held."""
    rest = d
    for _ in range(PIECES):
        side = _side(q, box, push)
        if side == 0.0:
            weight = q.mu * q.m * GRAVITY
            floor = (weight, weight, 0.0, 1.0)
            x, v = friction.move(box.x, box.v, q.m, push.left - push.right, floor, rest)
            return Box(x, 0.0, v, 0.0)
        if side > 0.0:
            box, used = _turn(q, box, push, rest)
        else:
            box, used = _turn(q, _mirrored(box), Pushes(push.right, push.left), rest)
            box = _mirrored(box)
        rest -= used
        if rest <= 0.0:
            break
    return box


def _mirrored(box: Box) -> Box:
    return Box(-box.x, 0.0 - box.tilt, 0.0 - box.v, 0.0 - box.w)


def _side(q: Shape, box: Box, push: Pushes) -> float:
    """1 for a box on its right edge, -1 on its left; 0 for one that is flat and stays so.

    A flat box starts to turn about an edge where the floor can bear it nowhere else.
    """
    if box.tilt != 0.0:
        return copysign(1.0, box.tilt)
    weight, force = q.m * GRAVITY, push.left - push.right
    grip = q.mu * weight
    sticks = box.v == 0.0 and abs(force) <= grip
    net = 0.0 if sticks else force - copysign(grip, box.v if box.v != 0.0 else force)
    moment = force * q.h - net * q.a
    return 1.0 if moment > weight * q.b else -1.0 if moment < -weight * q.b else 0.0


def _turn(q: Shape, box: Box, push: Pushes, d: float) -> tuple[Box, float]:
    """A box on its right edge, and how many of the d seconds it took to get there.

    It stops early where the edge comes to rest, or the box lands.
    """
    slip = _slip(q, box.tilt, box.v, box.w, push)
    after, turn = _ahead(q, box, push, slip, d)
    used = d
    if box.v * after.v < 0.0:
        used = d * box.v / (box.v - after.v)
        after, turn = _ahead(q, box, push, slip, used)
        after = Box(after.x, after.tilt, 0.0, after.w)
    if after.tilt <= 0.0 and (box.tilt > 0.0 or after.tilt < 0.0):
        used = min(used, time_to_contact(box.tilt, box.w, turn))
        after, _ = _ahead(q, box, push, slip, used)
        after = _landed(q, after)
    return after, used


def _ahead(q: Shape, box: Box, push: Pushes, slip: float, d: float) -> tuple[Box, float]:
    """The box after d seconds by the midpoint rule, and its angular acceleration on the way."""
    _, turn = _accelerations(q, box.tilt, box.w, push, slip)
    tilt, w = box.tilt + 0.5 * d * box.w, box.w + 0.5 * d * turn
    slide, turn = _accelerations(q, tilt, w, push, slip)
    x = box.x + d * (box.v + 0.5 * d * slide)
    tilt = box.tilt + d * (box.w + 0.5 * d * turn)
    return Box(x, tilt, box.v + d * slide, box.w + d * turn), turn


def _landed(q: Shape, box: Box) -> Box:
    """Flat again, without a rebound: the floor takes the turning, its friction what it can of the
    sliding. The impulse of the floor is m·b·|theta'|.
    """
    v = box.v + q.a * box.w
    left = max(0.0, abs(v) - q.mu * q.b * abs(box.w))
    return Box(box.x, 0.0, copysign(left, v), 0.0)


def _slip(q: Shape, tilt: float, v: float, w: float, push: Pushes) -> float:
    """The way in which the right edge slides, 1 or -1; 0 where it sticks."""
    if v != 0.0:
        return copysign(1.0, v)
    x, z = _arms(q, tilt)
    _, turn = _accelerations(q, tilt, w, push, 0.0)
    needed = q.m * (z * turn + x * w * w) - (push.left - push.right)
    normal = q.m * x * turn + _load(q, tilt, w, push)
    return 0.0 if abs(needed) <= q.mu * normal else -copysign(1.0, needed)


def _accelerations(
    q: Shape, tilt: float, w: float, push: Pushes, slip: float
) -> tuple[float, float]:
    """P'' in m/s^2 and theta'' in rad/s^2 of a box on its right edge that slips as given."""
    x, z = _arms(q, tilt)
    inertia = 4.0 / 3.0 * q.m * (q.a * q.a + q.b * q.b)
    squeeze = cos(tilt) * cos(tilt)
    moment = (push.left * (q.h - 2.0 * q.b * sin(tilt)) - push.right * q.h) / squeeze
    moment -= q.m * GRAVITY * x
    if slip == 0.0:
        return 0.0, moment / inertia
    force, load = push.left - push.right - q.m * x * w * w, _load(q, tilt, w, push)
    drag = slip * q.mu
    turn = (moment - z * (force - drag * load)) / (inertia - q.m * z * (z + drag * x))
    if load + q.m * x * turn < 0.0:  # the floor does not hold the box down
        drag = 0.0
        turn = (moment - z * force) / (inertia - q.m * z * z)
    return (force - drag * load) / q.m - (z + drag * x) * turn, turn


def _load(q: Shape, tilt: float, w: float, push: Pushes) -> float:
    """N less its part m·X·theta'', N."""
    _, z = _arms(q, tilt)
    return q.m * (GRAVITY - z * w * w) + (push.left - push.right) * tan(tilt)


def _arms(q: Shape, tilt: float) -> tuple[float, float]:
    """X and Z in m."""
    return q.b * cos(tilt) - q.a * sin(tilt), q.b * sin(tilt) + q.a * cos(tilt)
