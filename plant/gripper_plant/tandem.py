"""Two-finger gripper whose fingers move in tandem, on the wrist of an arm, and its object.

X is where the wrist is, w half the opening:  x_1 = X + w,  x_2 = X - w,

    M·w'' = F + f_c1 - f_c2 - friction      (T1), with F = u_1 - u_2 and M of both fingers

The wrist is positioned (wrist.py), the drive is commanded a force (drive.py). The object is fixed,
or a box on a floor (box.py), and gives (contact_laws.py). Signs as in fingers.py: F < 0 closes.
Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple, TypeAlias

from block_variables import Input, Output, Parameter, check

from . import box as standing
from . import command_delay, contact_laws, drive, fingers, friction, touch, wrist
from .box import Box, Pushes, Shape
from .command_delay import Line
from .contact_laws import HuntCrossley, KelvinVoigt
from .drive import Drive
from .fingers import Pair as Pair
from .friction import Motion
from .touch import Clock, Touch, TouchPair
from .wrist import Wrist

LONGEST_STEP = fingers.LONGEST_STEP

MAX_FORCE_ITERATIONS = 16
"""To find the forces that are held over a sub-step: each leaves 1/19 of the error, or less."""

SAME_MOMENT = 1e-9
"""Share of a step below which two moments in it are one."""

WRIST_UNRESOLVED = fingers.UNRESOLVED
"""Where the wrist is after more sub-steps than a plant takes: so the step is refused."""


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params(fingers.Place, standing.Standing, contact_laws.Giving):
    """The paper's fingers, object and start, and the box of movable.py, on an arm of 5 Hz."""

    moving_mass: Annotated[
        float,
        Parameter(
            "M = 2·m, mass of both fingers, as the drive moves it",
            unit="kg",
            low=1e-3,
            high=1e3,
            tunable=True,
        ),
    ] = 1.0
    initial_position: fingers.InitialPosition = (0.11, -0.11)
    object_width: fingers.ObjectWidth = 0.07
    initial_object_position: fingers.InitialObjectPosition = 0.03
    object_fixed: Annotated[
        bool, Parameter("the object is held fast; else it stands on a floor", tunable=True)
    ] = False
    object_mass: standing.ObjectMass = 0.05
    object_height: standing.ObjectHeight = 0.1
    contact_height: standing.ContactHeight = 0.05
    floor_friction: standing.FloorFriction = 0.3
    kelvin_voigt: KelvinVoigt = KelvinVoigt(stiffness=10000.0, damping=20.0)
    hunt_crossley: HuntCrossley = HuntCrossley(stiffness=200000.0)
    wrist: Wrist = Wrist()
    drive: Drive = Drive()

    def __post_init__(self) -> None:
        check(self)
        fingers.Place.__post_init__(self)
        standing.Standing.__post_init__(self)

    @cached_property
    def shape(self) -> Shape:
        """The box and its floor."""
        return standing.shape(self)

    @cached_property
    def lightest(self) -> float:
        """The mass with which a finger and the object move against each other, at least, kg."""
        of_object = 0.0 if self.object_fixed else 2.0 / self.object_mass
        return 1.0 / (2.0 / self.moving_mass + of_object + 2.0 * self.wrist.mobility)

    @cached_property
    def servo_rate(self) -> float:
        """What sub-steps must resolve of the wrist and of the drive, 1/s."""
        return max(self.wrist.rate, self.drive.omega)


class Inputs(NamedTuple):
    """Held over the step."""

    grip_force: Annotated[
        float,
        Input(
            "F, force of the drive on half the opening; below 0 it closes", unit="N", nominal=1.0
        ),
    ] = 0.0
    wrist_command: Annotated[
        float, Input("X_c, commanded position of the wrist", unit="m", nominal=0.1)
    ] = 0.0


class Body(NamedTuple):
    """Wrist and half the opening in m and m/s, what the drive's servo follows in m/s, contact
    forces in N; the box; toppled so far; touches.
    """

    wrist: Motion
    opening: Motion
    reference: float
    contact_force: Pair
    box: Box
    toppled: bool
    touch: TouchPair


class State(NamedTuple):
    """What moves, the commands that are on their way to the wrist, and the time."""

    body: Body
    line: Line
    clock: Clock


WristPosition: TypeAlias = Annotated[
    float, Output("X, position of the wrist", unit="m", nominal=0.1, depends_on=set())
]
WristVelocity: TypeAlias = Annotated[
    float, Output("X', velocity of the wrist", unit="m/s", nominal=0.1, depends_on=set())
]
WristForce: TypeAlias = Annotated[
    float,
    Output(
        "f_c1 + f_c2, contact forces as a sensor at the wrist has them, without inertia",
        unit="N",
        nominal=1.0,
        depends_on=set(),
    ),
]


class Outputs(NamedTuple):
    """Measured at the fingers, at the object and at the wrist."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    tilt: standing.Tilt
    toppled: standing.Toppled
    wrist_position: WristPosition
    wrist_velocity: WristVelocity
    wrist_force: WristForce
    contact_impulse: touch.ContactImpulse
    first_contact_time: touch.FirstContactTime
    impact_velocity: touch.ImpactVelocity
    touched: touch.Touched
    impact_impulse: touch.ImpactImpulse


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest, the fingers free of the object; the wrist is commanded to be where it is."""
    x_1, x_2 = p.initial_position
    middle = 0.5 * (x_1 + x_2)
    box = Box(p.initial_object_position, 0.0, 0.0, 0.0)
    line = command_delay.first(middle, p.wrist.delay)
    right, left = standing.faces(p.shape, box)
    felt = touch.initial(x_1 <= right), touch.initial(x_2 >= left)
    body = Body((middle, 0.0), (0.5 * (x_1 - x_2), 0.0), 0.0, (0.0, 0.0), box, False, felt)
    return State(body, line, touch.START)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance gripper, wrist and object by h seconds (h > 0), force and command held."""
    now, clock = x.clock.seconds, touch.later(x.clock, h)
    body = _from_point(p, x.body)
    if p.wrist.delay == 0.0:
        return State(_advance(p, body, u.grip_force, u.wrist_command, h, now), x.line, clock)
    line = command_delay.entered(x.line, u.wrist_command, p.wrist.delay, h)
    elapsed = 0.0
    for command, end in zip(line.value, line.end, strict=True):
        until = h if end > h - SAME_MOMENT * h else end
        if until > elapsed + SAME_MOMENT * h:
            body = _advance(p, body, u.grip_force, command, until - elapsed, now + elapsed)
            elapsed = until
    return State(body, command_delay.later(line, h), clock)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    q, body = p.shape, x.body
    (middle, speed), (half, closing) = body.wrist, body.opening
    x_1, x_2 = middle + half, middle - half
    right, left = standing.faces(q, body.box)
    f_1, f_2 = body.contact_force
    return Outputs(
        (x_1, x_2),
        (speed + closing, speed - closing),
        (max(0.0, x_1 - right), max(0.0, left - x_2)),
        body.contact_force,
        (x_1 <= right, x_2 >= left),
        standing.centre(q, body.box),
        body.box.tilt,
        body.toppled,
        middle,
        speed,
        f_1 + f_2,
        *touch.outputs(body.touch),
    )


def _from_point(p: Params, x: Body) -> Body:
    """At a communication point, from which on touches count again."""
    right, left = standing.faces(p.shape, x.box)
    middle, half = x.wrist[0], x.opening[0]
    touch_1 = touch.from_point(x.touch[0], middle + half <= right)
    touch_2 = touch.from_point(x.touch[1], middle - half >= left)
    return x._replace(touch=(touch_1, touch_2))


def _advance(p: Params, x: Body, grip_force: float, command: float, h: float, now: float) -> Body:
    """H seconds from `now` in s on, the drive's force in N and the wrist's command in m held."""
    if x.wrist[0] != x.wrist[0]:  # it is not resolved
        return x
    n = fingers.substep_count(max(_contact_rate(p, x, grip_force, command, h), p.servo_rate), h)
    if n > fingers.MAX_SUBSTEPS:
        return x._replace(wrist=WRIST_UNRESOLVED)
    d = h / n
    a = wrist.transition(p.wrist, d)
    for i in range(n):
        x = _substep(p, a, x, grip_force, command, d, now + i * d)
    return x


def _substep(
    p: Params,
    a: wrist.Matrix,
    x: Body,
    grip_force: float,
    command: float,
    d: float,
    begin: float,
) -> Body:
    """D seconds from `begin` in s on with all forces held.

    They and the ways under them are found by iteration.
    """
    q, m, (middle, v), (half, speed) = p.shape, p.moving_mass, x.wrist, x.opening
    right, left = standing.faces(q, x.box)
    gap_1, gap_2 = half + middle - right, half - middle + left
    approach = v - x.box.v - q.h * x.box.w  # speed of the wrist relative to the faces, m/s
    f_1 = contact_laws.mean_force(p.law, -gap_1, -gap_1 - d * (speed + approach), d)
    f_2 = contact_laws.mean_force(p.law, -gap_2, -gap_2 - d * (speed - approach), d)
    mean = x.reference + 0.5 * d * grip_force / m
    drive_force = drive.force(p.drive, m, grip_force, mean, speed)
    next_wrist, opening, box = x.wrist, x.opening, x.box
    next_gap_1, next_gap_2 = gap_1, gap_2
    for _ in range(MAX_FORCE_ITERATIONS):
        next_wrist = wrist.follow(p.wrist, a, x.wrist, command, f_1 - f_2, d)  # (T2)
        # (T1); friction of the drive as in (F1)
        opening = friction.move(half, speed, m, drive_force + (f_1 + f_2), p.drive.law, d)
        if not (p.object_fixed or x.toppled):
            box = standing.advance(q, x.box, Pushes(f_2, f_1), d)
        next_right, next_left = standing.faces(q, box)
        next_gap_1, next_gap_2 = (
            opening[0] + next_wrist[0] - next_right,
            opening[0] - next_wrist[0] + next_left,
        )
        new_f_1 = contact_laws.mean_force(p.law, -gap_1, -next_gap_1, d)
        new_f_2 = contact_laws.mean_force(p.law, -gap_2, -next_gap_2, d)
        new_drive_force = drive.force(p.drive, m, grip_force, mean, (opening[0] - half) / d)
        contacts_settled = contact_laws.settled(new_f_1, f_1) and contact_laws.settled(new_f_2, f_2)
        if contacts_settled and contact_laws.settled(abs(new_drive_force), abs(drive_force)):
            break
        f_1, f_2, drive_force = new_f_1, new_f_2, new_drive_force
    touch_1, touch_2 = x.touch
    old_f_1 = f_1 if touch_1.first_time >= 0.0 else 0.0
    old_f_2 = f_2 if touch_2.first_time >= 0.0 else 0.0
    if touch.touches(gap_1, next_gap_1, f_1):
        if touch_1.first_time < 0.0:
            touch_1 = _met(p, a, x, command, (drive_force, 0.0, old_f_2), 1.0, d, begin)
        touch_1 = touch.pressed(touch_1, begin, d, f_1)
    if touch.touches(gap_2, next_gap_2, f_2):
        if touch_2.first_time < 0.0:
            touch_2 = _met(p, a, x, command, (drive_force, old_f_1, 0.0), -1.0, d, begin)
        touch_2 = touch.pressed(touch_2, begin, d, f_2)
    toppled = x.toppled or standing.topples(q, box)
    if toppled:
        box = Box(box.x, box.tilt, 0.0, 0.0)
    reference = drive.reference(p.drive, m, grip_force, x.reference, opening[1], d)
    felt = touch_1, touch_2
    return Body(next_wrist, opening, reference, (f_1, 0.0 - f_2), box, toppled, felt)


def _met(
    p: Params,
    a: wrist.Matrix,
    x: Body,
    command: float,
    forces: tuple[float, float, float],
    side: float,
    d: float,
    begin: float,
) -> Touch:
    """The first contact of the finger on a side, 1 the right one and -1 the left one.

    It is within the d seconds from `begin` in s on. forces in N are held: of the drive, and of the
    contacts without this one. The speed is that relative to the face.
    """
    q, (middle, v), (half, speed) = p.shape, x.wrist, x.opening
    drive_force, f_1, f_2 = forces
    free_middle, _ = wrist.follow(p.wrist, a, x.wrist, command, f_1 - f_2, d)
    free_half, _ = friction.move(
        half, speed, p.moving_mass, drive_force + (f_1 + f_2), p.drive.law, d
    )
    fixed = p.object_fixed or x.toppled
    box = x.box if fixed else standing.advance(q, x.box, Pushes(f_2, f_1), d)
    (right, left), (free_right, free_left) = standing.faces(q, x.box), standing.faces(q, box)
    right_speed, left_speed = standing.face_speeds(q, x.box)
    face, face_speed, free_face = right, right_speed, free_right
    if side < 0.0:
        face, face_speed, free_face = left, left_speed, free_left
    gap, rate = half + side * (middle - face), speed + side * (v - face_speed)
    moment, closing = touch.meeting(gap, rate, free_half + side * (free_middle - free_face), d)
    felt = x.touch[0] if side > 0.0 else x.touch[1]
    return touch.met(felt, begin + moment, closing)


def _contact_rate(p: Params, x: Body, grip_force: float, command: float, h: float) -> float:
    """The fastest that a contact can do within h seconds, 1/s; 0 where no finger comes so far."""
    q, (middle, v), (half, speed) = p.shape, x.wrist, x.opening
    right, left = standing.faces(q, x.box)
    m, p_d = p.moving_mass, p.drive
    pushed = abs(drive.limited(p_d, grip_force)) / m + p_d.omega * (abs(x.reference) + abs(speed))
    accelerated = pushed + wrist.acceleration_bound(p.wrist, x.wrist, command)
    travel_rate = abs(v) + abs(speed) + abs(x.box.v) + q.h * abs(x.box.w) + 0.5 * h * accelerated
    deepest = h * travel_rate + max(right - middle - half, middle - left - half)
    return contact_laws.rate(p.law, deepest, p.lightest)
