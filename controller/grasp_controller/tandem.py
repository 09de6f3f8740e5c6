"""Grasp control of a gripper whose fingers move in tandem, on a wrist that is positioned.

Layers 1 and 2 close the grip, layer 3 moves the wrist; nothing switches:

    layer 3   X_c' = clip(g·(1 - h')·(T - X_c), ±v_max)          (2T, 3T)  wrist_guidance.py
    layer 2   M·w_v'' + D·w_v' + K·(1 - rho^2)^p·w_v = (f_p1 - f_p2)/2     (6T)  it waits
    layer 1   F = -2·D_i·(w' - w_v') - 2·K_i·(w - w_v)                      (7T)

w = (x_1 - x_2)/2 is half the opening. Derivation: controller/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from math import pow as power
from math import tanh
from typing import Annotated, NamedTuple, TypeAlias

from block_variables import Group, Output, Parameter

from . import contact_force as layer_1
from . import grip, holding, impedance, reflectance_ratio, wrist_guidance
from . import impact_reduction as layer_2
from . import simultaneous_contact as published
from .impact_reduction import Pair
from .impedance import Motion
from .reflectance_ratio import Estimate, EstimatedGap, Line, Ratio, RatioDeviation
from .series import ImpactReductionForce, brake, gripped
from .series import Inputs as Inputs
from .wrist_guidance import Wrist

SOFTEST = 1e-6
"""Share of K_a1 that pulls at least, so that there is a place where the grip would rest."""


@dataclass(frozen=True, slots=True)
class SimultaneousContact(Group, name="simultaneous_contact"):
    """While the wrist is off the middle by a tenth of d the grip pulls with 0.95 of K_a1.

    At a third of d it is a half, at a half a fifth. A wrist of 2 Hz needs 8, and K_a1 = 10 N/m.
    """

    enabled: Annotated[
        bool, Parameter("layer 3 on; off, the wrist stays where it is", tunable=True)
    ] = True
    patience: Annotated[
        float,
        Parameter(
            "p, exponent by which the grip waits while the wrist is off the middle",
            unit="1",
            low=0.0,
            high=100.0,
            tunable=True,
        ),
    ] = 4.0


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params:
    """The parameters of the three layers, and of what is learnt.

    One finger cannot be held up by friction here. So the grasp counts from 2 mm/s on: the sooner
    it does, the less the wrist moves after the contacts.
    """

    simultaneous_contact: SimultaneousContact = SimultaneousContact()
    impact_reduction: layer_2.Params = layer_2.Params()
    contact_force: layer_1.Params = layer_1.Params()
    reflectance: reflectance_ratio.Params = reflectance_ratio.Params()
    hold: holding.Params = holding.Params(speed=2e-3)
    wrist: Wrist = Wrist()

    @cached_property
    def sensors(self) -> reflectance_ratio.Sensors:
        """Right and left."""
        return reflectance_ratio.sensors(self.reflectance)

    @cached_property
    def mean_sensor(self) -> reflectance_ratio.Sensor:
        """The one that stands for both."""
        return reflectance_ratio.mean_sensor(self.sensors)


class State(NamedTuple):
    """Half the virtual opening, where the wrist is sent, where the object is seen and where the
    fingertips were at the start, in m; what the last sample left behind; the fingers' lines, and
    what they told.
    """

    virtual: Motion
    wrist_command: float
    target: float
    fingertips: Pair
    intensity: Pair
    impact_reduction_force: Pair
    line_1: Line
    line_2: Line
    estimate: Estimate
    closing: float
    lasting: float
    hold: float
    grip: grip.State
    light_rate: layer_2.Pair


GripForce: TypeAlias = Annotated[
    float,
    Output(
        "F, force of the drive on half the opening; below 0 it closes",
        unit="N",
        nominal=1.0,
        depends_on={"position", "velocity"},
    ),
]
WristCommand: TypeAlias = Annotated[
    float,
    Output(
        "X_c, commanded position of the wrist",
        unit="m",
        nominal=0.1,
        depends_on=set(),
        depends_initially_on={"position"},
    ),
]


class Outputs(NamedTuple):
    """The commands to grip and wrist, the inner signals, and what has been learnt."""

    grip_force: GripForce
    wrist_command: WristCommand
    target_position: Annotated[
        float,
        Output(
            "T, middle of the object as the light tells it, where the wrist is to be",
            unit="m",
            nominal=0.1,
            depends_on=set(),
            depends_initially_on={"position", "intensity"},
        ),
    ]
    virtual_opening: Annotated[
        float,
        Output(
            "w_v, virtual object of half the opening",
            unit="m",
            nominal=0.1,
            depends_on=set(),
            depends_initially_on={"position"},
        ),
    ]
    impact_reduction_force: ImpactReductionForce
    reflectance_ratio: Ratio
    reflectance_ratio_standard_deviation: RatioDeviation
    estimated_gap: EstimatedGap
    hold: holding.Hold


def initial_state(p: Params, u: Inputs) -> State:
    """Virtual opening and wrist as measured and at rest, so that nothing jumps at the start."""
    floor = p.impact_reduction.intensity_floor
    line_1, line_2 = reflectance_ratio.first_points(p.sensors, floor, u.position, u.intensity)
    estimate = reflectance_ratio.ratio(p.reflectance, p.sensors, line_1, line_2)
    middle = _middle(u)
    gaps = reflectance_ratio.gaps(p.reflectance, p.sensors, line_1, line_2)
    seen = reflectance_ratio.by_one_sensor(
        p.reflectance, p.sensors, p.mean_sensor, line_1, line_2, u.intensity
    )
    rho = _imbalance(estimate, seen)
    offset = _offset_to_middle(p, u, gaps, line_1, line_2, rho)
    target = wrist_guidance.within(middle + offset, u.position)
    virtual = (_half_opening(u) if p.impact_reduction.enabled else 0.0), 0.0
    nothing = (0.0, 0.0)
    return State(
        virtual, middle, target, u.position, seen, nothing,
        line_1, line_2, estimate, 0.0, 0.0, 0.0, grip.AT_REST, nothing,
    )  # fmt: skip


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance virtual opening and wrist by h seconds (h > 0), the samples u held, and learn."""
    v_1, v_2 = u.velocity
    closing = holding.filtered(p.hold, x.closing, v_1 - v_2, h)
    seen = reflectance_ratio.by_one_sensor(
        p.reflectance, p.sensors, p.mean_sensor, x.line_1, x.line_2, u.intensity
    )
    squeeze = -0.5 * _published_force(p, x.virtual, u)
    pressed = holding.pressed(p.hold, squeeze, closing)
    lasting = holding.lasting(p.hold, x.lasting, pressed, h)
    eye_1, eye_2 = p.sensors
    touching_1 = holding.touching(p.hold, p.reflectance, eye_1, x.line_1, lasting)
    touching_2 = holding.touching(p.hold, p.reflectance, eye_2, x.line_2, lasting)
    held = pressed * (touching_1 * touching_2)  # (R9)
    hold = wrist_guidance.agreed(held, _imbalance(x.estimate, seen))
    free = 1.0 - hold
    believed = free * wrist_guidance.steadiness(0.5 * (v_1 - v_2), 0.5 * (v_1 + v_2))
    floor, lines = p.impact_reduction.intensity_floor, (x.line_1, x.line_2)
    line_1, line_2 = reflectance_ratio.both_moved(
        p.reflectance, p.sensors, lines, floor, u.position, u.intensity, believed, h
    )
    estimate = reflectance_ratio.ratio(p.reflectance, p.sensors, line_1, line_2)
    gaps = reflectance_ratio.gaps(p.reflectance, p.sensors, line_1, line_2)
    seen = reflectance_ratio.by_one_sensor(
        p.reflectance, p.sensors, p.mean_sensor, line_1, line_2, u.intensity
    )
    rho = _imbalance(estimate, seen)
    offset = _offset_to_middle(p, u, gaps, line_1, line_2, rho)
    target = wrist_guidance.within(_middle(u) + offset, x.fingertips)
    wrist_command, pull = x.wrist_command, 1.0
    if p.simultaneous_contact.enabled:
        wrist_command = wrist_guidance.move(p.wrist, wrist_command, target, free, h)
        pull = max(SOFTEST, power(1.0 - rho * rho, p.simultaneous_contact.patience))
    f_p = layer_2.virtual_forces(p.impact_reduction, seen, x.intensity, h)
    virtual = _closed(p, x.virtual, pull, f_p, h)
    gripping, light_rate = grip.AT_REST, (0.0, 0.0)
    if p.contact_force.grip_force > 0.0:
        samples = u._replace(intensity=seen)
        gripping, light_rate = gripped(
            p.contact_force, floor, squeeze, x.grip, x.light_rate, x.intensity, samples, h
        )
    return State(
        virtual, wrist_command, target, x.fingertips, seen, f_p,
        line_1, line_2, estimate, closing, lasting, hold, gripping, light_rate,
    )  # fmt: skip


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The commands for the samples u, and what has been learnt."""
    ratio = reflectance_ratio.learnt(x.estimate)
    return Outputs(
        _grip_force(p, x, u),
        x.wrist_command,
        x.target,
        x.virtual[0],
        x.impact_reduction_force,
        ratio,
        ratio * x.estimate.deviation,
        reflectance_ratio.gaps(p.reflectance, p.sensors, x.line_1, x.line_2),
        x.hold,
    )


def _middle(u: Inputs) -> float:
    """X in m: the wrist is where the middle of the fingertips is."""
    return published.desired_position(u.position)


def _half_opening(u: Inputs) -> float:
    """W in m."""
    x_1, x_2 = u.position
    return 0.5 * (x_1 - x_2)


def _imbalance(estimate: Estimate, seen: Pair) -> float:
    """rho: how much more light finger 1 has, as of faces that are alike, from -1 to 1.

    `seen` are the intensities in V, by one sensor.
    """
    xi_1, xi_2 = reflectance_ratio.alike(estimate, seen)
    return published.relative(published.lit(xi_1), published.lit(xi_2))


def _offset_to_middle(
    p: Params, u: Inputs, gaps: Pair, line_1: Line, line_2: Line, rho: float
) -> float:
    """S·d·tanh(rho)/n: from the wrist to the object's middle, m."""
    gap_1, gap_2 = gaps
    between = min(0.5 * (gap_1 + gap_2), _half_opening(u))
    d = between + p.mean_sensor.l_0
    noise = p.reflectance.intensity_noise
    sight = wrist_guidance.sight(noise, line_1.intensity, line_2.intensity)
    return sight * d * tanh(rho) / p.mean_sensor.n  # T - X of (2T)


def _closed(p: Params, virtual: Motion, pull: float, f_p: Pair, h: float) -> Motion:
    """Half the virtual opening h seconds later, a share `pull` of K_a1 and f_p in N held.

    With layer 2 off it is closed.
    """
    gains = p.impact_reduction
    if not gains.enabled:
        return 0.0, 0.0
    f_1, f_2 = f_p
    stiffness = pull * gains.stiffness
    a = impedance.transition(gains.mass, gains.damping, stiffness, h)
    half, rate = virtual
    least, mean = gains.least_pull, 0.5 * (f_1 - f_2)
    closing = layer_2.with_least_pull(least, gains.stiffness, mean, pull, half)
    return impedance.advance(a, half, rate, closing / stiffness)  # (6T)


def _grip_force(p: Params, x: State, u: Inputs) -> float:
    """F in N: twice what a finger presses with, below 0."""
    published = _published_force(p, x.virtual, u)
    force = p.contact_force.grip_force
    if force <= 0.0:
        return published
    braked = brake(p.contact_force, u)
    return published - 2.0 * grip.change(force, -0.5 * published, braked, x.grip.share)


def _published_force(p: Params, virtual: Motion, u: Inputs) -> float:
    """F in N, layer 1, Eq. (7T), whatever the grip force is."""
    v_1, v_2 = u.velocity
    return 2.0 * layer_1.force(p.contact_force, _half_opening(u), 0.5 * (v_1 - v_2), virtual)
