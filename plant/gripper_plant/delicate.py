"""Two-finger parallel gripper and a delicate body, Eq. (1):  m_j·x_j'' = u_j + f_cj.

The body stands on a floor until the gripper lifts it, and then hangs between the fingertips by
friction. Its sides relax, behind pads on the fingertips; too much of a grasp damages it. It does
not turn. Signs as in fingers.py. Equations: plant/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Annotated, NamedTuple

from block_variables import Output, Parameter

from . import box, contact_laws, damage, fingers, friction, touch, zener
from . import lift as hanging
from .damage import Blow, Limits
from .fingers import Inputs as Inputs
from .fingers import Pair as Pair
from .lift import Height, Lift, Load
from .touch import Clock, TouchPair
from .zener import Pad, Side, Solid

LONGEST_STEP = fingers.LONGEST_STEP

MAX_FORCE_ITERATIONS = 8
"""To find the contact forces: each leaves a hundredth of the error, or less."""

NOTHING = 10.0
"""m, the gap of a fingertip that has no body before it any more."""


@dataclass(frozen=True)
class Params(fingers.Params):
    """A ripe tomato of 120 g, without limits: delicate.toml has some, and their sources."""

    object_mass: box.ObjectMass = 0.12
    object_height: box.ObjectHeight = 0.06
    floor_friction: box.FloorFriction = 0.3
    fingertip_friction: Annotated[
        float,
        Parameter(
            "mu, friction of the object on a fingertip", unit="1", low=0.0, high=10.0, tunable=True
        ),
    ] = 0.5
    contact_area: Annotated[
        float,
        Parameter("area of a contact", unit="m2", low=1e-9, high=1.0, tunable=True),
    ] = 1e-4
    side: Side = Side()
    pad: Pad = Pad()
    squeeze_limit: Annotated[
        float,
        Parameter(
            "squeeze above which the object is damaged; 0 is no limit",
            unit="m",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.0
    force_limit: Annotated[
        float,
        Parameter(
            "contact force above which the object is damaged; 0 is no limit",
            unit="N",
            low=0.0,
            high=1e6,
            tunable=True,
        ),
    ] = 0.0
    pressure_limit: Annotated[
        float,
        Parameter(
            "pressure of a contact above which the object is damaged; 0 is no limit",
            unit="Pa",
            low=0.0,
            high=1e12,
            tunable=True,
        ),
    ] = 0.0
    impulse_limit: Annotated[
        float,
        Parameter(
            "impulse of a finger's first 20 ms above which the object is damaged; 0 is no limit",
            unit="N.s", low=0.0, high=1e6, tunable=True,
        ),
    ] = 0.0  # fmt: skip
    lift: Lift = Lift()

    @cached_property
    def law(self) -> Solid:
        """Of a side of the object and the pad before it."""
        return zener.solid(self.side, self.pad)

    @cached_property
    def limits(self) -> Limits:
        """What the object tolerates."""
        return Limits(self.squeeze_limit, self.force_limit, self.pressure_limit, self.impulse_limit)

    @cached_property
    def lightest(self) -> float:
        """The mass with which a finger and the object move against each other, at least, kg."""
        return 1.0 / (1.0 / min(self.finger_mass) + 2.0 / self.object_mass)


class State(NamedTuple):
    """Fingertips in m, m/s, N; the ways z of the dashpots in m; the object's middle in m, m/s.

    Then heights and load, blows, the highest contact force in N, what has happened, touches, time.
    """

    position: Pair
    velocity: Pair
    contact_force: Pair
    dashpot: Pair
    object: friction.Motion
    height: Height
    load: Load
    blow_1: Blow
    blow_2: Blow
    peak_force: float
    damaged: bool
    dropped: bool
    touch: TouchPair
    clock: Clock


class Outputs(NamedTuple):
    """Measured at the fingers and at the object; without a pad the gap that touches is zero."""

    position: fingers.Position
    velocity: fingers.Velocity
    gap: fingers.Gap
    contact_force: fingers.ContactForce
    contact: fingers.Contact
    object_position: fingers.ObjectPosition
    squeeze: Annotated[
        float,
        Output(
            "by how much the fingers press the object together",
            unit="m",
            nominal=0.01,
            depends_on=set(),
        ),
    ]
    damaged: Annotated[bool, Output("a limit of the object has been exceeded", depends_on=set())]
    peak_force: Annotated[
        float,
        Output("highest contact force so far", unit="N", nominal=1.0, depends_on=set()),
    ]
    peak_pressure: Annotated[
        float,
        Output("highest pressure of a contact so far", unit="Pa", nominal=1e4, depends_on=set()),
    ]
    tangential_force: Annotated[
        Pair,
        Output(
            "T_j, force with which the fingertip lifts the object",
            unit="N",
            nominal=1.0,
            depends_on=set(),
        ),
    ]
    friction_limit: Annotated[
        Pair,
        Output("mu·N_j, above which the fingertip slips", unit="N", nominal=1.0, depends_on=set()),
    ]
    load: Annotated[
        float,
        Output(
            "m·(g + a), lifting force that it takes not to slip; 0 while the floor carries",
            unit="N",
            nominal=1.0,
            depends_on=set(),
        ),
    ]
    slip: Annotated[
        float,
        Output(
            "way by which the object has slipped down along the fingertips",
            unit="m",
            nominal=0.01,
            depends_on=set(),
        ),
    ]
    dropped: Annotated[
        bool,
        Output("the object has slipped out, by more than half its height", depends_on=set()),
    ]
    fingertip_height: Annotated[
        float,
        Output(
            "height of the fingertips above where they began",
            unit="m", nominal=0.1, depends_on=set(),
        ),
    ]  # fmt: skip
    contact_impulse: touch.ContactImpulse
    first_contact_time: touch.FirstContactTime
    impact_velocity: touch.ImpactVelocity
    touched: touch.Touched
    impact_impulse: touch.ImpactImpulse


def initial_state(p: Params, u: Inputs) -> State:
    """All at rest, the object on its floor and as if never touched."""
    return State(
        p.initial_position,
        (0.0, 0.0),
        (0.0, 0.0),
        (0.0, 0.0),
        (p.initial_object_position, 0.0),
        hanging.REST,
        hanging.NO_LOAD,
        damage.NO_BLOW,
        damage.NO_BLOW,
        0.0,
        False,
        False,
        fingers.initial_touch(p),
        touch.START,
    )


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance fingers and object by h seconds (h > 0), the forces held."""
    n = fingers.substep_count(_rate(p, x, u, h), h)
    if n > fingers.MAX_SUBSTEPS:
        return x._replace(position=fingers.UNRESOLVED)
    forces = fingers.forces(p.actuator, u)
    touches_1, touches_2 = _touches(p, x)
    touch_1, touch_2 = x.touch
    x = x._replace(
        touch=(touch.from_point(touch_1, touches_1), touch.from_point(touch_2, touches_2))
    )
    d = h / n
    for k in range(n):
        begin = x.clock.seconds + k * d
        lifting = p.lift.enabled and begin >= p.lift.time - 1e-9
        x = _substep(p, x, forces, lifting, d, begin)
    return x._replace(clock=touch.later(x.clock, h))


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The outputs, as the sensors see them; no input reaches an output without a step."""
    depth_1, depth_2 = _depths(p, x.position, x.object[0])
    z_1, z_2 = x.dashpot
    hold_1, hold_2 = _holds(p, x.contact_force)
    return Outputs(
        x.position,
        x.velocity,
        (_gap(p, depth_1, z_1, x.dropped), _gap(p, depth_2, z_2, x.dropped)),
        x.contact_force,
        _touches(p, x),
        x.object[0],
        _dent(p, depth_1, z_1) + _dent(p, depth_2, z_2) if not x.dropped else 0.0,
        x.damaged,
        x.peak_force,
        x.peak_force / p.contact_area,
        x.load.tangential,
        (hold_1, hold_2),
        x.load.demand,
        hanging.slip(x.height),
        x.dropped,
        x.height.tips,
        *touch.outputs(x.touch),
    )


def _touches(p: Params, x: State) -> tuple[bool, bool]:
    """Whether each fingertip is at its face, or in it."""
    gap_1, gap_2 = _free_gaps(p, x.position, x.object[0], x.dashpot)
    return not x.dropped and gap_1 <= 0.0, not x.dropped and gap_2 <= 0.0


def _free_gaps(p: Params, position: Pair, middle: float, dashpots: Pair) -> Pair:
    """From each tip to its free face, m; below 0 inside. The object's middle is there in m."""
    depth_1, depth_2 = _depths(p, position, middle)
    z_1, z_2 = dashpots
    return zener.surface(p.law, z_1) - depth_1, zener.surface(p.law, z_2) - depth_2


def _substep(p: Params, x: State, forces: Pair, lifting: bool, d: float, begin: float) -> State:
    """D seconds from `begin` in s on with the contact forces held.

    They and the ways under them are found by iteration.
    """
    (_, m_1, friction_1), (_, m_2, friction_2) = p.sides
    x_1, x_2 = x.position
    v_1, v_2 = x.velocity
    u_1, u_2 = forces
    z_1, z_2 = x.dashpot
    depth_1, depth_2 = _depths(p, x.position, x.object[0])
    f_1, f_2 = x.contact_force[0], -x.contact_force[1]
    floor = _floor(p, x)
    next_z_1, next_z_2 = z_1, z_2
    for _ in range(MAX_FORCE_ITERATIONS):
        # Eq. (1) for each finger, counted as it opens; (B1) for the object
        s_1, w_1 = friction.move(x_1, v_1, m_1, u_1 + f_1, friction_1, d)
        s_2, w_2 = friction.move(-x_2, -v_2, m_2, f_2 - u_2, friction_2, d)
        middle, speed = friction.move(x.object[0], x.object[1], p.object_mass, f_2 - f_1, floor, d)
        to_1, to_2 = _depths(p, (s_1, -s_2), middle)
        new_f_1, next_z_1 = _press(p, x.dropped, z_1, depth_1, to_1, d)
        new_f_2, next_z_2 = _press(p, x.dropped, z_2, depth_2, to_2, d)
        if contact_laws.settled(new_f_1, f_1) and contact_laws.settled(new_f_2, f_2):
            break
        f_1, f_2 = new_f_1, new_f_2
    contact_force = (f_1, 0.0 - f_2)
    next_gaps = _free_gaps(p, (s_1, -s_2), middle, (next_z_1, next_z_2))
    felt = _felt(p, x, forces, (f_1, f_2), next_gaps, d, begin)
    tips = hanging.rise(p.lift, x.height, lifting, d)
    height, load = hanging.carry(p.object_mass, x.height, tips, _holds(p, contact_force), d)
    moved = x._replace(
        position=(s_1, -s_2),
        velocity=(w_1, 0.0 - w_2),
        contact_force=contact_force,
        dashpot=(next_z_1, next_z_2),
        object=(middle, speed),
        height=height,
        load=hanging.NO_LOAD if x.dropped else load,
        touch=felt,
        dropped=x.dropped or abs(hanging.slip(height)) > 0.5 * p.object_height,
    )
    return _worn(p, moved, d)


def _felt(
    p: Params,
    x: State,
    forces: Pair,
    contact_forces: Pair,
    next_gaps: Pair,
    d: float,
    begin: float,
) -> TouchPair:
    """What the fingers have felt d seconds after `begin` in s, with contact forces in N over them.

    next_gaps in m are those at the end. A first contact is met at the speed relative to the object,
    which only the other finger pushes until then.
    """
    touch_1, touch_2 = x.touch
    if x.dropped:
        return x.touch
    (_, m_1, friction_1), (_, m_2, friction_2) = p.sides
    (x_1, x_2), (v_1, v_2), (u_1, u_2) = x.position, x.velocity, forces
    (f_1, f_2), (middle, speed) = contact_forces, x.object
    gap_1, gap_2 = _free_gaps(p, x.position, middle, x.dashpot)
    floor = _floor(p, x)
    if touch.touches(gap_1, next_gaps[0], f_1):
        if touch_1.first_time < 0.0:
            free_s, _ = friction.move(x_1, v_1, m_1, u_1, friction_1, d)
            pushed, _ = friction.move(middle, speed, p.object_mass, f_2, floor, d)
            free_gap = gap_1 + (free_s - x_1) - (pushed - middle)
            moment, closing = touch.meeting(gap_1, v_1 - speed, free_gap, d)
            touch_1 = touch.met(touch_1, begin + moment, closing)
        touch_1 = touch.pressed(touch_1, begin, d, f_1)
    if touch.touches(gap_2, next_gaps[1], f_2):
        if touch_2.first_time < 0.0:
            free_s, _ = friction.move(-x_2, -v_2, m_2, 0.0 - u_2, friction_2, d)
            pushed, _ = friction.move(middle, speed, p.object_mass, 0.0 - f_1, floor, d)
            free_gap = gap_2 + (free_s + x_2) + (pushed - middle)
            moment, closing = touch.meeting(gap_2, speed - v_2, free_gap, d)
            touch_2 = touch.met(touch_2, begin + moment, closing)
        touch_2 = touch.pressed(touch_2, begin, d, f_2)
    return touch_1, touch_2


def _worn(p: Params, x: State, d: float) -> State:
    """The state with what the last d seconds have done to the object."""
    f_1, f_2 = x.contact_force
    depth_1, depth_2 = _depths(p, x.position, x.object[0])
    z_1, z_2 = x.dashpot
    squeeze = _dent(p, depth_1, z_1) + _dent(p, depth_2, z_2)
    blow_1, blow_2 = damage.blow(x.blow_1, f_1, d), damage.blow(x.blow_2, -f_2, d)
    peak_force = max(x.peak_force, f_1, -f_2)
    impulse = max(blow_1.impulse, blow_2.impulse)
    exceeded = damage.exceeded(p.limits, squeeze, peak_force, p.contact_area, impulse)
    return x._replace(
        blow_1=blow_1,
        blow_2=blow_2,
        peak_force=peak_force,
        damaged=x.damaged or (exceeded and not x.dropped),
    )


def _press(
    p: Params, dropped: bool, z: float, from_depth: float, to_depth: float, d: float
) -> tuple[float, float]:
    """Contact force in N on a finger over d seconds, and z at the end; no force once dropped."""
    if dropped:
        return 0.0, zener.recovered(p.law, z, d)
    return zener.press(p.law, z, from_depth, to_depth, d)


def _depths(p: Params, position: Pair, middle: float) -> Pair:
    """How deep the tips are in the faces of an object with its middle there: side and pad, m."""
    x_1, x_2 = position
    half = 0.5 * p.object_width
    return half + middle - x_1, half - middle + x_2


def _dent(p: Params, depth: float, z: float) -> float:
    """By how much a side of the object is pressed in at a depth in m of side and pad, m."""
    return max(depth, zener.surface(p.law, z), 0.0) - _pressed_pad(p, depth, z)


def _pressed_pad(p: Params, depth: float, z: float) -> float:
    """By how much a pad is pressed together, m."""
    k_p = p.pad.stiffness
    return zener.force(p.law, depth, z) / k_p if k_p > 0.0 else 0.0


def _gap(p: Params, depth: float, z: float, dropped: bool) -> float:
    """From the face of the sensor, behind its pad, to the surface of the object, m."""
    if dropped:
        return NOTHING
    free = zener.surface(p.law, z) - depth
    pad = p.pad.thickness - _pressed_pad(p, depth, z)
    return max(0.0, free) + max(0.0, pad)


def _holds(p: Params, contact_force: Pair) -> Pair:
    """mu·N_j in N."""
    f_1, f_2 = contact_force
    return p.fingertip_friction * f_1, p.fingertip_friction * abs(f_2)


def _floor(p: Params, x: State) -> friction.Law:
    """The friction of the floor under the object, none in the air."""
    grip = p.floor_friction * hanging.floor_force(p.object_mass, x.height, x.load)
    return friction.coulomb(grip)  # (F1)


def _rate(p: Params, x: State, u: Inputs, h: float) -> float:
    """The fastest that a finger and the object can do within h seconds, 1/s."""
    middle, speed = x.object
    half = 0.5 * p.object_width
    faces = middle + half, middle - half
    deepest = h * abs(speed) + fingers.deepest(p, x.position, x.velocity, faces, u, h)
    touching = zener.rate(p.law, p.lightest) if deepest > 0.0 and not x.dropped else 0.0
    return max(touching, p.friction_rate)
