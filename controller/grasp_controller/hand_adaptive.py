"""Multiple impedance control of a hand whose faces may differ in colour.

Layers 1 and 2 and the targets are those of hand.py; layer 3 compares the intensities as faces of
one colour would give them, and fades as the fingers hold:

    f_sk = (1 - h)·K_s·(phi_k - <phi>),   phi of  exp(min b - b_k)·xi_k       Eq. (2N')

Each finger's line (reflectance_ratio.py) gives a_k = ln(K·alpha_k) with the variance V_k; the prior
of ln alpha_k is N(mu, sigma_b^2/2), its mean unknown, as is K:

    g_k = v/(v + V_k),    v = sigma_b^2/2,    mu = sum g_k·a_k/sum g_k
    b_k = t·g_k·(a_k - mu)     (R7)
    t = min(1, beta_max/(largest less smallest a_k with a slope))

With two fingers b_1 - b_2 is beta of reflectance_ratio.py, gain and limit included.
Equations: controller/README.md
"""

from dataclasses import dataclass
from functools import cached_property
from math import exp, inf, log, sqrt
from typing import TYPE_CHECKING, Annotated, NamedTuple

from block_variables import Output

from . import hand, holding, reflectance_ratio
from .hand import Inputs as Inputs
from .hand import PerFinger
from .hand_size import FINGERS
from .reflectance_ratio import Line

if TYPE_CHECKING:
    Lines = tuple[Line, ...]
else:
    Lines = tuple[(Line,) * FINGERS]


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params(hand.Params):
    """The weights and the three layers' parameters, and those of what is learnt."""

    reflectance: reflectance_ratio.Params = reflectance_ratio.Params()
    hold: holding.Params = holding.Params()

    @cached_property
    def white(self) -> float:
        """1/kappa of a white face, m.V^(1/n)."""
        return reflectance_ratio.white(self.reflectance)


class State(NamedTuple):
    """The virtual objects, the fingers' lines, and what they told at the last sample."""

    layers: hand.State
    lines: Lines
    brightness: PerFinger
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
            "standard deviation of that ratio, by noise only",
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
        reflectance_ratio.first_point(p.reflectance, floor, s, xi)
        for s, xi in zip(u.position, u.intensity, strict=True)
    )
    return State(hand.initial_state(p, u), lines, hand.ZEROS, 0.0, 0.0, 0.0)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance the virtual objects by h seconds (h > 0), the samples u held, and learn from them."""
    rate, squeeze = 0.0, 0.0
    forces = hand.published_forces(p, x.layers, u)
    for s_dot, force in zip(u.velocity, forces, strict=True):
        rate = rate + s_dot
        squeeze = squeeze - force
    fingers = float(FINGERS)
    closing = holding.filtered(p.hold, x.closing, 2.0 * rate / fingers, h)
    pressed = holding.pressed(p.hold, squeeze / fingers, closing)
    lasting = holding.lasting(p.hold, x.lasting, pressed, h)
    hold = pressed
    for line in x.lines:
        hold = hold * holding.touching(p.hold, p.reflectance, line, lasting)  # (R9)
    floor = p.impact_reduction.intensity_floor
    free, low_pass = 1.0 - hold, reflectance_ratio.low_pass(p.reflectance, h)
    lines = tuple(
        reflectance_ratio.moved(p.reflectance, line, floor, s, xi, free, low_pass)
        for line, s, xi in zip(x.lines, u.position, u.intensity, strict=True)
    )
    b = brightnesses(p.reflectance, lines)
    f_s = hand.virtual_forces(p, alike(b, u.intensity))
    # Eq. (2N')
    layers = hand.advance(p, x.layers, u, tuple(free * f for f in f_s), h)
    return State(layers, lines, b, closing, lasting, hold)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The forces for the samples u, and what has been learnt."""
    y = hand.outputs(p, x.layers, u)
    ratios = tuple(exp(b) for b in x.brightness)
    deviations = tuple(
        ratio * deviation(p.reflectance, line) for ratio, line in zip(ratios, x.lines, strict=True)
    )
    return Outputs(
        y.force,
        y.target_position,
        y.virtual_position,
        y.simultaneous_contact_force,
        y.impact_reduction_force,
        ratios,
        deviations,
        tuple(reflectance_ratio.gap(p.reflectance, line, p.white) for line in x.lines),
        x.hold,
    )


def brightnesses(p: reflectance_ratio.Params, lines: Lines) -> PerFinger:
    """b_k, the logarithm of each face's reflectance to the mean, as far as the lines are certain.

    All are zero before there is a slope.
    """
    gains = tuple(gain(p, line) for line in lines)
    # a_k = ln(K·alpha_k)
    log_gains = tuple(p.diffusion_exponent * log(line.per_y) for line in lines)
    total, weighted, low, high = 0.0, 0.0, inf, -inf
    for g, a in zip(gains, log_gains, strict=True):
        total = total + g
        weighted = weighted + g * a
        low = min(low, a) if g > 0.0 else low
        high = max(high, a) if g > 0.0 else high
    if total <= 0.0:
        return tuple(0.0 for _ in gains)
    mean = weighted / total
    t = p.limit / (high - low) if high - low > p.limit else 1.0
    # (R7)
    return tuple(t * g * (a - mean) for g, a in zip(gains, log_gains, strict=True))


def gain(p: reflectance_ratio.Params, line: Line) -> float:
    """g_k: how far a line is believed, from 0 without a slope to 1."""
    v = _prior(p)
    return v / (v + line.variance) if v > 0.0 else 0.0  # g_k of (R7)


def deviation(p: reflectance_ratio.Params, line: Line) -> float:
    """The standard deviation of b_k that is left, by noise only."""
    return sqrt(_prior(p) * (1.0 - gain(p, line)))


def alike(b: PerFinger, intensity: PerFinger) -> PerFinger:
    """The intensities in V as faces would give them that are all as dark as the darkest."""
    darkest = b[0]
    for b_k in b:
        darkest = min(darkest, b_k)
    return tuple(exp(darkest - b_k) * xi for b_k, xi in zip(b, intensity, strict=True))


def _prior(p: reflectance_ratio.Params) -> float:
    return 0.5 * p.prior_deviation * p.prior_deviation
