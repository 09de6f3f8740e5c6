"""A hand of N fingers and an object on a floor that slides and turns: a prism or a disc.

    m_k·s_k'' = u_k + f_k·(nu_k·e_k)
    m·c'' = -sum f_k·nu_k + F,    m·r^2·theta'' = -sum (p_k - c) x f_k·nu_k + M            (H1)

F and M are the friction of the floor. The fingertips are points without friction on stiff rails.
Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from math import inf, sqrt
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Parameter

from . import contact_laws, fingers, friction, hand_fingers, touch
from .box import GRAVITY
from .contact_laws import HuntCrossley, KelvinVoigt
from .hand_fingers import FAR, Normal, PerFinger, Pose, Ray, Rays, Shape, Touches, TouchOfEach
from .hand_fingers import Inputs as Inputs
from .hand_fingers import Outputs as Outputs
from .hand_size import FINGERS
from .movable import MAX_FORCE_ITERATIONS
from .touch import Clock, Touch

LONGEST_STEP = fingers.LONGEST_STEP

SHALLOW = 1e-3
"""m; a finger that comes through a face is not deeper when it is first seen below it."""


class Line(NamedTuple):
    """Of a normal force: direction, its share along the ray, its lever about the centre in m."""

    x: float
    y: float
    share: float
    lever: float


if TYPE_CHECKING:
    Normals = tuple[Normal, ...]
    Lines = tuple[Line, ...]
else:
    Normals = tuple[(Normal,) * FINGERS]
    Lines = tuple[(Line,) * FINGERS]


@dataclass(frozen=True)
class Params(hand_fingers.Params, contact_laws.Giving):
    """A light object, which 0.15 N shift and 3 mN.m turn, with the walls of movable.py."""

    face_length: Annotated[
        float,
        Parameter("of the faces of a prism, from end to end", unit="m", low=1e-3, high=10.0),
    ] = 0.2
    object_mass: Annotated[
        float, Parameter("m, mass of the object", unit="kg", low=1e-3, high=1e3, tunable=True)
    ] = 0.05
    radius_of_gyration: Annotated[
        float,
        Parameter(
            "r, radius of gyration about the vertical axis",
            unit="m",
            low=1e-4,
            high=10.0,
            tunable=True,
        ),
    ] = 0.025
    floor_friction: Annotated[
        float,
        Parameter(
            "mu, friction of the object on the floor", unit="1", low=0.0, high=1.0, tunable=True
        ),
    ] = 0.3
    floor_contact_radius: Annotated[
        float,
        Parameter(
            "r_t, radius at which the floor's friction holds a turn",
            unit="m",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.02
    kelvin_voigt: KelvinVoigt = KelvinVoigt(stiffness=10000.0, damping=20.0)
    hunt_crossley: HuntCrossley = HuntCrossley(stiffness=200000.0)

    @cached_property
    def drag(self) -> float:
        """The floor's friction on an object that slides, N."""
        return self.floor_friction * self.object_mass * GRAVITY


class Body(NamedTuple):
    """Where the object is, and its rates in m/s and rad/s."""

    pose: Pose
    x_dot: float
    y_dot: float
    turning: float


class State(NamedTuple):
    """Fingertip positions in m, velocities in m/s, normal forces in N; the object; touches, time.

    A finger that is below a face and not `inside` has come there around an edge, and touches
    nothing.
    """

    position: PerFinger
    velocity: PerFinger
    normal_force: PerFinger
    inside: Touches
    body: Body
    touch: TouchOfEach
    clock: Clock


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest, the fingers free of the object."""
    body = Body(p.first_pose, 0.0, 0.0, 0.0)
    zeros, outside = hand_fingers.ZEROS, hand_fingers.OUTSIDE
    felt = tuple(touch.initial(False) for _ in p.rays)
    x = State(p.initial_position, zeros, zeros, outside, body, felt, touch.START)
    return x._replace(touch=tuple(touch.initial(n.depth >= 0.0) for n in _normals(p, p.rays, x)))


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance fingers and object by h seconds (h > 0), the forces held."""
    rays = p.rays
    n = fingers.substep_count(_rate(p, rays, x, u, h), h)
    if n > fingers.MAX_SUBSTEPS:
        return x._replace(position=hand_fingers.UNRESOLVED)
    touching = tuple(normal.depth >= 0.0 for normal in _normals(p, rays, x))
    x = x._replace(
        touch=tuple(
            touch.from_point(felt, touches) for felt, touches in zip(x.touch, touching, strict=True)
        )
    )
    d = h / n
    for i in range(n):
        x = _substep(p, rays, x, u.force, d, x.clock.seconds + i * d)
    return x._replace(clock=touch.later(x.clock, h))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step.

    The gap of a finger that touches is zero.
    """
    pose, rays = x.body.pose, p.rays
    normals = _normals(p, rays, x)
    surfaces = tuple(hand_fingers.surface(p.shape, p.object_radius, ray, pose) for ray in rays)
    gaps = tuple(
        _gap(normal.depth, s - surface)
        for normal, s, surface in zip(normals, x.position, surfaces, strict=True)
    )
    forces = tuple(
        0.0 + f * (normal.x * ray.x + normal.y * ray.y)
        for f, normal, ray in zip(x.normal_force, normals, rays, strict=True)
    )
    return Outputs(
        x.position,
        x.velocity,
        gaps,
        forces,
        tuple(normal.depth >= 0.0 for normal in normals),
        (pose.x, pose.y),
        pose.angle,
        tuple(felt.impulse for felt in x.touch),
        tuple(felt.first_time for felt in x.touch),
        tuple(felt.speed for felt in x.touch),
        tuple(felt.touched for felt in x.touch),
        tuple(felt.impact for felt in x.touch),
    )


def _gap(depth: float, distance: float) -> float:
    """The gap in m of a finger from its depth and its distance to the object along the ray, m."""
    if depth >= 0.0:
        return 0.0
    return FAR if depth <= -FAR else min(FAR, max(0.0, distance))


def _normals(p: Params, rays: Rays, x: State) -> Normals:
    """The normals at the fingertips; what a finger does not touch is far away."""
    raw_normals = _raw_normals(p, rays, x)
    return tuple(
        normal if inside or normal.depth <= SHALLOW else Normal(normal.x, normal.y, -FAR)
        for normal, inside in zip(raw_normals, x.inside, strict=True)
    )


def _raw_normals(p: Params, rays: Rays, x: State) -> Normals:
    return tuple(
        hand_fingers.normal(p.shape, p.object_radius, p.face_length, ray, x.body.pose, s)
        for ray, s in zip(rays, x.position, strict=True)
    )


def _substep(p: Params, rays: Rays, x: State, u: PerFinger, d: float, begin: float) -> State:
    """D seconds from `begin` in s on with the normal forces held.

    They are found by iteration, and so are the lines along which they act: those of the mean over
    the way, by which the work of a force is what the contact stores.
    """
    normals = _normals(p, rays, x)
    forces, next_state, next_normals = x.normal_force, x, normals
    lines = _lines(p, rays, x, normals, x, normals)
    for _ in range(MAX_FORCE_ITERATIONS):
        lines = _lines(p, rays, x, normals, next_state, next_normals)
        body = _advance_object(p, x, lines, forces, d)
        moved_fingers = tuple(
            friction.move(s, v, m, f + line.share * push, friction.NONE, d)
            for s, v, m, f, line, push in zip(
                x.position, x.velocity, p.finger_mass, u, lines, forces, strict=True
            )
        )
        tips, rates = tuple(s for s, _ in moved_fingers), tuple(v for _, v in moved_fingers)
        next_state = State(tips, rates, forces, x.inside, body, x.touch, x.clock)
        next_normals = _raw_normals(p, rays, next_state)
        new_forces = tuple(
            0.0
            if normal.depth <= -FAR
            else contact_laws.mean_force(p.law, normal.depth, next_normal.depth, d)
            for normal, next_normal in zip(normals, next_normals, strict=True)
        )
        if all(contact_laws.settled(new, old) for new, old in zip(new_forces, forces, strict=True)):
            break
        forces = new_forces
    inside = tuple(
        normal.depth >= 0.0 and (was_inside or normal.depth <= SHALLOW)
        for normal, was_inside in zip(_raw_normals(p, rays, next_state), x.inside, strict=True)
    )
    felt = _felt(p, rays, x, next_state, normals, lines, u, d, begin)
    return next_state._replace(inside=inside, touch=felt)


def _felt(
    p: Params,
    rays: Rays,
    x: State,
    next_state: State,
    normals: Normals,
    lines: Lines,
    u: PerFinger,
    d: float,
    begin: float,
) -> TouchOfEach:
    """What the fingers have felt after the d seconds from `begin` in s on, from x to next_state."""
    forces = next_state.normal_force
    touching = tuple(
        touch.touches(-normal.depth, -next_normal.depth, f)
        for normal, next_normal, f in zip(
            normals, _normals(p, rays, next_state), forces, strict=True
        )
    )
    felt = x.touch
    if any(
        touches and one.first_time < 0.0 for touches, one in zip(touching, x.touch, strict=True)
    ):
        felt = _met(p, rays, x, normals, touching, forces, u, d, begin)
    return tuple(
        touch.pressed(one, begin, d, f * line.share) if touches else one
        for one, touches, f, line in zip(felt, touching, forces, lines, strict=True)
    )


def _met(
    p: Params,
    rays: Rays,
    x: State,
    normals: Normals,
    touching: Touches,
    forces: PerFinger,
    u: PerFinger,
    d: float,
    begin: float,
) -> TouchOfEach:
    """The touches after the first contacts within the d seconds from `begin` in s on.

    The way until then is that without them: of the finger, and of the object under the other
    forces. The gap along the ray closes by the depth's rate over nu·e.
    """
    old_forces = tuple(
        0.0 if touches and felt.first_time < 0.0 else f
        for touches, felt, f in zip(touching, x.touch, forces, strict=True)
    )
    body = _advance_object(p, x, _lines(p, rays, x, normals, x, normals), old_forces, d)
    free_tips = tuple(
        friction.move(s, v, m, f, friction.NONE, d)[0]
        for s, v, m, f in zip(x.position, x.velocity, p.finger_mass, u, strict=True)
    )
    free_normals = _raw_normals(p, rays, x._replace(position=free_tips, body=body))
    return tuple(
        _met_one(ray, x.body, s, v, normal, free_normal, felt, d, begin) if touches else felt
        for ray, s, v, normal, free_normal, felt, touches in zip(
            rays, x.position, x.velocity, normals, free_normals, x.touch, touching, strict=True
        )
    )


def _met_one(
    ray: Ray,
    body: Body,
    s: float,
    v: float,
    normal: Normal,
    free_normal: Normal,
    felt: Touch,
    d: float,
    begin: float,
) -> Touch:
    """The touch of a finger at s m with v m/s that comes down to free_normal within d seconds."""
    arm_x, arm_y = s * ray.x - body.pose.x, s * ray.y - body.pose.y
    of_object = normal.x * (body.x_dot - body.turning * arm_y) + normal.y * (
        body.y_dot + body.turning * arm_x
    )
    share = normal.x * ray.x + normal.y * ray.y
    rate = share * v - of_object
    moment, speed = d, -rate  # of one that comes to a face from its end
    if normal.depth > -FAR and free_normal.depth > -FAR:
        moment, speed = touch.meeting(-normal.depth, rate, -free_normal.depth, d)
    return touch.met(felt, begin + moment, speed / share if share > 0.0 else 0.0)


def _lines(
    p: Params, rays: Rays, x: State, normals: Normals, next_x: State, next_normals: Normals
) -> Lines:
    """The lines of the normal forces over the way from one state to another."""
    return tuple(
        _line(p, ray, x.body.pose, s, normal, next_x.body.pose, next_s, next_normal)
        for ray, s, normal, next_s, next_normal in zip(
            rays, x.position, normals, next_x.position, next_normals, strict=True
        )
    )


def _line(
    p: Params,
    ray: Ray,
    pose: Pose,
    s: float,
    normal: Normal,
    next_pose: Pose,
    next_s: float,
    next_normal: Normal,
) -> Line:
    """The line for which the depth changes by what fingertip and object move along it.

    Of a prism, nu·(p - c) changes by the mean of nu times the change of p - c, and the other way
    round. Of a disc, |p - c| does by the sum of both p - c over the sum of their lengths.
    """
    arm_x, arm_y = s * ray.x - pose.x, s * ray.y - pose.y
    next_arm_x, next_arm_y = next_s * ray.x - next_pose.x, next_s * ray.y - next_pose.y
    share_before = 0.5
    if p.shape == Shape.DISC:
        length, next_length = p.object_radius - normal.depth, p.object_radius - next_normal.depth
        sum_of_both = length + next_length
        share_before = length / sum_of_both if sum_of_both > 0.0 else 0.5
    x = share_before * normal.x + (1.0 - share_before) * next_normal.x
    y = share_before * normal.y + (1.0 - share_before) * next_normal.y
    lever = 0.5 * ((arm_x + next_arm_x) * y - (arm_y + next_arm_y) * x)
    return Line(x, y, x * ray.x + y * ray.y, lever)


def _advance_object(p: Params, x: State, lines: Lines, forces: PerFinger, d: float) -> Body:
    """The object d seconds later under normal forces in N, with the friction of the floor.

    The floor takes what it can of the speeds that the object would have without it: it comes to
    rest, and stays so, wherever that is within what friction can do.
    """
    pose, m = x.body.pose, p.object_mass
    push_x, push_y, moment = 0.0, 0.0, 0.0
    for line, f in zip(lines, forces, strict=True):
        push_x = push_x - f * line.x
        push_y = push_y - f * line.y
        moment = moment - f * line.lever
    # (H1) without the floor
    x_dot, y_dot = x.body.x_dot + d * push_x / m, x.body.y_dot + d * push_y / m
    inertia = m * p.radius_of_gyration * p.radius_of_gyration
    turning = x.body.turning + d * moment / inertia
    # F and M of (H1): what friction can take of the speeds
    sliding_share = _remaining_share(sqrt(x_dot * x_dot + y_dot * y_dot), d * p.drag / m)
    turning_share = _remaining_share(abs(turning), d * p.drag * p.floor_contact_radius / inertia)
    x_dot, y_dot, turning = sliding_share * x_dot, sliding_share * y_dot, turning_share * turning
    next_pose = Pose(
        pose.x + 0.5 * d * (x.body.x_dot + x_dot),
        pose.y + 0.5 * d * (x.body.y_dot + y_dot),
        pose.angle + 0.5 * d * (x.body.turning + turning),
    )
    return Body(next_pose, x_dot, y_dot, turning)


def _remaining_share(speed: float, loss: float) -> float:
    """The share of a speed that is left after friction has taken `loss` of it."""
    return 0.0 if speed <= loss else (speed - loss) / speed


def _rate(p: Params, rays: Rays, x: State, u: Inputs, h: float) -> float:
    """The fastest that a finger and the object can do within h seconds, 1/s.

    The object gives way to a push by what it weighs, and turns by its lever about the centre.
    """
    body, pose = x.body, x.body.pose
    speed = sqrt(body.x_dot * body.x_dot + body.y_dot * body.y_dot)
    normals = _normals(p, rays, x)
    deepest, touching, even, odd, turning = -inf, 0.0, 0.0, 0.0, 0.0
    for ray, normal, s, v, m, f in zip(
        rays, normals, x.position, x.velocity, p.finger_mass, u.force, strict=True
    ):
        lever = (s * ray.x - pose.x) * normal.y - (s * ray.y - pose.y) * normal.x
        ratio = lever / p.radius_of_gyration
        reach = speed + abs(body.turning * lever) + abs(v) + 0.5 * h * abs(f) / m
        depth = normal.depth + h * reach
        touches = 1.0 if depth > 0.0 else 0.0
        touching = touching + touches
        even = even + touches * (normal.x * normal.x - normal.y * normal.y)
        odd = odd + touches * 2.0 * normal.x * normal.y
        turning = turning + touches * ratio * ratio
        deepest = max(deepest, depth)
    pushing = 0.5 * (touching + sqrt(even * even + odd * odd))  # the most, in any direction
    mobility = 1.0 / min(p.finger_mass) + (pushing + turning) / p.object_mass
    return contact_laws.rate(p.law, deepest, 1.0 / mobility)
