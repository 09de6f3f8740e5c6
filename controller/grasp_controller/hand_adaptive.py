"""Multiple impedance control of a hand whose faces may differ in colour.

Layers 1 and 2 and the targets are those of hand.py; layer 3 compares the intensities as faces of
one colour would give them, and fades as the fingers hold:

    f_sk = (1 - h)·K_s·(phi_k - <phi>),   phi of  exp(min b - b_k)·xi_k       Eq. (2N')

Each finger's line (reflectance_ratio.py) gives a_k = ln(K·alpha_k) with the variance N_k by noise;
the prior of ln alpha_k is N(mu, sigma_b^2/2), its mean unknown, as is K:

    g_k = v/(v + N_k),    v = sigma_b^2/2,    mu = sum g_k·a_k/sum g_k
    b_k = t·g_k·(a_k - mu)     (R7)
    t = min(1, beta_max/(largest less smallest a_k with a slope))

With two fingers b_1 - b_2 is beta of reflectance_ratio.py, gain and limit included.
Equations: controller/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, log, sqrt
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Output, Parameter

from . import hand, holding, reflectance_ratio
from .hand import ZEROS, PerFinger
from .hand import Inputs as Inputs
from .hand_size import FINGERS
from .reflectance_ratio import Line, Sensor

if TYPE_CHECKING:
    Lines = tuple[Line, ...]
    Sensors = tuple[Sensor, ...]
else:
    Lines = tuple[(Line,) * FINGERS]
    Sensors = tuple[(Sensor,) * FINGERS]


@dataclass(frozen=True, slots=True)
class Reflectance(reflectance_ratio.Learning, name="reflectance"):
    """The sensors of all fingers, and what is learnt from them."""

    diffusion_exponent: Annotated[
        PerFinger, Parameter("n_k, diffusion exponent of the sensor", unit="1", low=0.1, high=10.0)
    ] = (1.1506,) * FINGERS
    offset_distance: Annotated[
        PerFinger,
        Parameter(
            "l_0k, from the face of the sensor to its element",
            unit="m",
            low=0.0,
            high=1.0,
            tunable=True,
        ),
    ] = (5e-3,) * FINGERS
    gain: Annotated[
        PerFinger,
        Parameter("K_k of a white face", unit="V.m^n", low=1e-9, high=1e6, tunable=True),
    ] = (0.0024,) * FINGERS


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params(hand.Params):
    """The weights and the three layers' parameters, and those of what is learnt."""

    reflectance: Reflectance = Reflectance()
    hold: holding.Params = holding.Params()

    @cached_property
    def sensors(self) -> Sensors:
        """Those of all fingers."""
        learnt = self.reflectance
        return tuple(
            Sensor(n, l_0, gain)
            for n, l_0, gain in zip(
                learnt.diffusion_exponent, learnt.offset_distance, learnt.gain, strict=True
            )
        )

    @cached_property
    def mean_sensor(self) -> Sensor:
        """The one that stands for all, with the means of n, l_0 and K."""
        n, l_0, gain = 0.0, 0.0, 0.0
        for eye in self.sensors:
            n, l_0, gain = n + eye.n, l_0 + eye.l_0, gain + eye.gain
        fingers = float(FINGERS)
        return Sensor(n / fingers, l_0 / fingers, gain / fingers)

    @cached_property
    def one_kind(self) -> bool:
        """Whether all sensors are the same."""
        first = self.sensors[0]
        return all(reflectance_ratio.same(first, eye) for eye in self.sensors)


class Brightness(NamedTuple):
    """b_k if the faces differ, and how far that acts."""

    full: PerFinger
    share: float


class State(NamedTuple):
    """The virtual objects, the fingers' lines, and what they told at the last sample."""

    layers: hand.State
    lines: Lines
    brightness: Brightness
    closing: float
    lasting: float
    hold: float


class Outputs(NamedTuple):
    """Those of the published law, and what has been learnt."""

    force: hand.Force
    target_position: hand.TargetPosition
    virtual_position: hand.VirtualPosition
    simultaneous_contact_force: hand.SimultaneousContactForce
    impact_reduction_force: hand.ImpactReductionForce
    reflectance_ratio: Annotated[
        PerFinger,
        Output(
            "alpha_k to the mean of all faces, reflectance as learnt",
            unit="1",
            nominal=1.0,
            depends_on=set(),
        ),
    ]
    reflectance_ratio_standard_deviation: Annotated[
        PerFinger,
        Output(
            "standard deviation of that ratio, by noise and calibration",
            unit="1",
            nominal=1.0,
            depends_on=set(),
        ),
    ]
    estimated_gap: Annotated[
        PerFinger,
        Output(
            "l_k, gap as learnt",
            unit="m",
            nominal=0.1,
            depends_on=set(),
            depends_initially_on={"intensity[j]"},
        ),
    ]
    hold: holding.Hold


def initial_state(p: Params, u: Inputs) -> State:
    """As the published law starts, with nothing learnt."""
    floor = p.impact_reduction.intensity_floor
    lines = tuple(
        reflectance_ratio.first_point(eye, floor, s, xi)
        for eye, s, xi in zip(p.sensors, u.position, u.intensity, strict=True)
    )
    seen = by_one_sensor(p, lines, u.intensity)
    layers = hand.initial_state(p, u._replace(intensity=seen))
    return State(layers, lines, Brightness(ZEROS, 1.0), 0.0, 0.0, 0.0)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance the virtual objects by h seconds (h > 0), the samples u held, and learn from them."""
    rate = 0.0
    for s_dot in u.velocity:
        rate = rate + s_dot
    closing = holding.filtered(p.hold, x.closing, 2.0 * rate / float(FINGERS), h)
    pressed = holding.pressed(p.hold, hand.published_squeeze(p, x.layers, u), closing)
    lasting = holding.lasting(p.hold, x.lasting, pressed, h)
    hold = pressed
    for eye, line in zip(p.sensors, x.lines, strict=True):
        hold = hold * holding.touching(p.hold, p.reflectance, eye, line, lasting)  # (R9)
    floor = p.impact_reduction.intensity_floor
    free, low_pass = 1.0 - hold, reflectance_ratio.low_pass(p.reflectance, h)
    lines = tuple(
        reflectance_ratio.moved(p.reflectance, eye, line, floor, s, xi, free, low_pass)
        for eye, line, s, xi in zip(p.sensors, x.lines, u.position, u.intensity, strict=True)
    )
    brightness = brightnesses(p, lines)
    b = tuple(brightness.share * full for full in brightness.full)
    seen = by_one_sensor(p, lines, u.intensity)
    f_s = hand.virtual_forces(p, alike(b, seen))
    # Eq. (2N')
    layers = hand.advance(p, x.layers, u._replace(intensity=seen), tuple(free * f for f in f_s), h)
    return State(layers, lines, brightness, closing, lasting, hold)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The forces for the samples u, and what has been learnt."""
    y = hand.outputs(p, x.layers, u)
    share, full = x.brightness.share, x.brightness.full
    ratios = tuple(exp(share * b) for b in full)
    deviations = tuple(
        ratio * deviation(p.reflectance, line, b, share)
        for ratio, line, b in zip(ratios, x.lines, full, strict=True)
    )
    return Outputs(
        y.force,
        y.target_position,
        y.virtual_position,
        y.simultaneous_contact_force,
        y.impact_reduction_force,
        ratios,
        deviations,
        tuple(
            reflectance_ratio.gap(p.reflectance, eye, line)
            for eye, line in zip(p.sensors, x.lines, strict=True)
        ),
        x.hold,
    )


def brightnesses(p: Params, lines: Lines) -> Brightness:
    """The reflectances of the faces to their mean, by the lines.

    All are zero before there is a slope.
    """
    gains = tuple(gain(p.reflectance, line) for line in lines)
    # a_k = ln alpha_k, but for what all have in common
    logs = tuple(
        eye.n * line.log_per_y - log(eye.gain / p.mean_sensor.gain)
        for eye, line in zip(p.sensors, lines, strict=True)
    )
    total, weighted, low, high = 0.0, 0.0, inf, -inf
    for g, a in zip(gains, logs, strict=True):
        total = total + g
        weighted = weighted + g * a
        low = min(low, a) if g > 0.0 else low
        high = max(high, a) if g > 0.0 else high
    if total <= 0.0:
        return Brightness(ZEROS, 1.0)
    mean = weighted / total
    limit = p.reflectance.limit
    t = limit / (high - low) if high - low > limit else 1.0
    share = reflectance_ratio.evidence(p.reflectance, t * t * squares(lines, logs))
    # (R7)
    return Brightness(tuple(t * g * (a - mean) for g, a in zip(gains, logs, strict=True)), share)


def squares(lines: Lines, logs: PerFinger) -> float:
    """How far a_k are from one another, in variances: the squares of their deviations, summed."""
    weight, weighted = 0.0, 0.0
    first = logs[0]
    for line, a in zip(lines, logs, strict=True):
        w = 1.0 / max(line.variance, reflectance_ratio.TINY)
        weight = weight + w
        weighted = weighted + w * (a - first)
    middle = weighted / weight if weight > 0.0 else 0.0
    total = 0.0
    for line, a in zip(lines, logs, strict=True):
        off = a - first - middle
        total = total + off * off / max(line.variance, reflectance_ratio.TINY)
    return total


def gain(p: Reflectance, line: Line) -> float:
    """g_k: how far noise lets a line be believed, from 0 without a slope to 1."""
    return reflectance_ratio.believed(_prior(p), line.noise_variance)  # g_k of (R7)


def deviation(p: Reflectance, line: Line, full: float, share: float) -> float:
    """The standard deviation of ln alpha_k to the mean that is left, b_k being share·full."""
    v = _prior(p)
    known = reflectance_ratio.believed(v, line.brightness_variance)
    missed = (1.0 - share) * known * full
    return sqrt(v * (1.0 - known) + missed * missed)


def by_one_sensor(p: Params, lines: Lines, intensity: PerFinger) -> PerFinger:
    """The intensities in V as the same sensor would give them on all fingers."""
    if p.one_kind:
        return intensity
    return tuple(
        translated(p, eye, line, xi)
        for eye, line, xi in zip(p.sensors, lines, intensity, strict=True)
    )


def translated(p: Params, eye: Sensor, line: Line, xi: float) -> float:
    """One of them."""
    gap = reflectance_ratio.gap(p.reflectance, eye, line)
    return reflectance_ratio.translated(eye, p.mean_sensor, gap) * xi


def alike(b: PerFinger, intensity: PerFinger) -> PerFinger:
    """The intensities in V as faces would give them that are all as dark as the darkest."""
    darkest = b[0]
    for b_k in b:
        darkest = min(darkest, b_k)
    return tuple(exp(darkest - b_k) * xi for b_k, xi in zip(b, intensity, strict=True))


def _prior(p: Reflectance) -> float:
    return 0.5 * p.prior_deviation * p.prior_deviation
