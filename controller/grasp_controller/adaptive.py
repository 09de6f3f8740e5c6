"""The three layers in series, with a layer 3 that learns how the faces' reflectances differ.

Layers 1 and 2 and the target are those of series.py; the virtual force of layer 3 compares the
intensities as equal faces would give them, and fades as the fingers hold:

    f_s = (1 - h)·K_s·tanh((xi_1 - e^beta·xi_2)/(xi_1 + e^beta·xi_2))                  Eq. (2')
"""

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from . import holding, reflectance_ratio, series
from . import simultaneous_contact as layer_3
from .series import Inputs as Inputs


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Params(series.Params):
    """The parameters of the three layers, and of what is learnt."""

    reflectance: reflectance_ratio.Params = reflectance_ratio.Params()
    hold: holding.Params = holding.Params()

    @cached_property
    def sensors(self) -> reflectance_ratio.Sensors:
        """Right and left."""
        return reflectance_ratio.sensors(self.reflectance)

    @cached_property
    def mean_sensor(self) -> reflectance_ratio.Sensor:
        """The one that stands for both."""
        return reflectance_ratio.mean_sensor(self.sensors)


class State(NamedTuple):
    """The virtual objects, the fingers' lines, and what they told at the last sample."""

    layers: series.State
    line_1: reflectance_ratio.Line
    line_2: reflectance_ratio.Line
    estimate: reflectance_ratio.Estimate
    closing: float
    lasting: float
    hold: float


class Outputs(NamedTuple):
    """Those of the published law, and what has been learnt."""

    force: series.Force
    target_position: series.TargetPosition
    virtual_position: series.VirtualPosition
    simultaneous_contact_force: series.SimultaneousContactForce
    impact_reduction_force: series.ImpactReductionForce
    reflectance_ratio: reflectance_ratio.Ratio
    reflectance_ratio_standard_deviation: reflectance_ratio.RatioDeviation
    estimated_gap: reflectance_ratio.EstimatedGap
    hold: holding.Hold


def initial_state(p: Params, u: Inputs) -> State:
    """As the published law starts, with nothing learnt."""
    floor = p.impact_reduction.intensity_floor
    line_1, line_2 = reflectance_ratio.first_points(p.sensors, floor, u.position, u.intensity)
    estimate = reflectance_ratio.ratio(p.reflectance, p.sensors, line_1, line_2)
    seen = reflectance_ratio.by_one_sensor(
        p.reflectance, p.sensors, p.mean_sensor, line_1, line_2, u.intensity
    )
    layers = series.initial_state(p, Inputs(u.position, u.velocity, seen))
    return State(layers, line_1, line_2, estimate, 0.0, 0.0, 0.0)


def step(p: Params, x: State, u: Inputs, h: float) -> State:
    """Advance the virtual objects by h seconds (h > 0), the samples u held, and learn from them."""
    v_1, v_2 = u.velocity
    closing = holding.filtered(p.hold, x.closing, v_1 - v_2, h)
    pressed = holding.pressed(p.hold, series.published_squeeze(p, x.layers, u), closing)
    lasting = holding.lasting(p.hold, x.lasting, pressed, h)
    eye_1, eye_2 = p.sensors
    touching_1 = holding.touching(p.hold, p.reflectance, eye_1, x.line_1, lasting)
    touching_2 = holding.touching(p.hold, p.reflectance, eye_2, x.line_2, lasting)
    hold = pressed * (touching_1 * touching_2)  # (R9)
    floor = p.impact_reduction.intensity_floor
    free, lines = 1.0 - hold, (x.line_1, x.line_2)
    line_1, line_2 = reflectance_ratio.both_moved(
        p.reflectance, p.sensors, lines, floor, u.position, u.intensity, free, h
    )
    estimate = reflectance_ratio.ratio(p.reflectance, p.sensors, line_1, line_2)
    seen = reflectance_ratio.by_one_sensor(
        p.reflectance, p.sensors, p.mean_sensor, line_1, line_2, u.intensity
    )
    alike = reflectance_ratio.alike(estimate, seen)
    f_s = free * layer_3.virtual_force(p.simultaneous_contact, alike)  # Eq. (2')
    layers = series.advance(p, x.layers, Inputs(u.position, u.velocity, seen), f_s, h)
    return State(layers, line_1, line_2, estimate, closing, lasting, hold)


def outputs(p: Params, x: State, u: Inputs) -> Outputs:
    """The forces for the samples u, and what has been learnt."""
    y = series.outputs(p, x.layers, u)
    ratio = reflectance_ratio.learnt(x.estimate)
    return Outputs(
        y.force,
        y.target_position,
        y.virtual_position,
        y.simultaneous_contact_force,
        y.impact_reduction_force,
        ratio,
        ratio * x.estimate.deviation,
        reflectance_ratio.gaps(p.reflectance, p.sensors, x.line_1, x.line_2),
        x.hold,
    )
