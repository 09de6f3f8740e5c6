"""Learns from the fingers' own motion how much brighter one face is than the other.

By Eq. (9) y = xi^(-1/n) is a straight line over the finger's way s, with the slope
kappa = (K·alpha)^(-1/n). Each finger fits its line while it moves; the slopes give alpha_1/alpha_2.
Derivation: controller/README.md
"""

from dataclasses import dataclass
from math import exp, inf, log, sqrt
from typing import Annotated, NamedTuple

from block_variables import Group, Parameter

MOST_VOLTS = 1e3
"""Intensities count as this at most, that powers of them stay numbers."""

MOST_METRES = 1e3
"""And positions as this at most, on both sides."""

STEEPEST = 1e150
"""And slopes as this at most, or as one over it at least."""


@dataclass(frozen=True, slots=True)
class Params(Group, name="reflectance"):
    """The exponent of the sensors, the weights of the fits, and how far they are believed.

    `intensity_noise` is that of the low-passed intensity, over a millimetre of travel.
    """

    diffusion_exponent: Annotated[
        float, Parameter("n, diffusion exponent of both sensors", unit="1", low=0.1, high=10.0)
    ] = 1.1506
    time_constant: Annotated[
        float,
        Parameter(
            "T_f, low-pass of intensity and position", unit="s", low=1e-6, high=1e3, tunable=True
        ),
    ] = 0.02
    weight_exponent: Annotated[
        float,
        Parameter("q, the brighter the more weight", unit="1", low=0.0, high=20.0, tunable=True),
    ] = 5.0
    travel: Annotated[
        float,
        Parameter(
            "ell, travel that counts as a sample", unit="m", low=1e-9, high=1.0, tunable=True
        ),
    ] = 1e-3
    intensity_noise: Annotated[
        float,
        Parameter(
            "sigma, standard deviation of the low-passed intensity",
            unit="V",
            low=1e-12,
            high=10.0,
            tunable=True,
        ),
    ] = 5e-4
    prior_deviation: Annotated[
        float,
        Parameter(
            "sigma_b, standard deviation of ln(alpha_1/alpha_2) before anything is learnt",
            unit="1",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 1.0
    limit: Annotated[
        float,
        Parameter(
            "beta_max, most of ln(alpha_1/alpha_2)", unit="1", low=0.0, high=10.0, tunable=True
        ),
    ] = 2.5
    gain: Annotated[
        float,
        Parameter(
            "K of a white face, for the estimated gaps alone",
            unit="V.m^n",
            low=1e-9,
            high=1e6,
            tunable=True,
        ),
    ] = 0.0024
    offset_distance: Annotated[
        float,
        Parameter(
            "l_0, from the face of the sensor to its element, for the estimated gaps alone",
            unit="m",
            low=0.0,
            high=1.0,
            tunable=True,
        ),
    ] = 5e-3


class Line(NamedTuple):
    """A finger's line y over s: the last point, weighted sums over all before, what they tell.

    `slope` is kappa in m^-1.V^(-1/n), and `variance` that of n·ln kappa by the noise of the
    intensity; 1 and infinite where there is no slope yet.
    """

    intensity: float
    s: float
    y: float
    weight: float
    mean_s: float
    mean_y: float
    c_ss: float
    c_sy: float
    slope: float
    variance: float


class Estimate(NamedTuple):
    """beta = ln(alpha_1/alpha_2), and its standard deviation."""

    beta: float
    deviation: float


def first_point(p: Params, floor: float, s: float, xi: float) -> Line:
    """The line of a finger at s in m that sees xi in V: a point, without a slope."""
    seen = _clamped(xi, floor, MOST_VOLTS)
    y = exp(-log(seen) / p.diffusion_exponent)
    at = _clamped(s, -MOST_METRES, MOST_METRES)
    return Line(seen, at, y, 0.0, at, y, 0.0, 0.0, 1.0, inf)


def low_pass(p: Params, h: float) -> float:
    """The share of a sample in its low-pass after h seconds: T_f·x_f' = x - x_f, Euler backward."""
    return h / (p.time_constant + h)


def moved(
    p: Params, line: Line, floor: float, s: float, xi: float, believed: float, share: float
) -> Line:
    """The line a step later, the finger at s in m that sees xi in V.

    What is new weighs by the travel that position and light both report, each metre of it by
    `believed`; `share` is that of low_pass.
    """
    seen = line.intensity + share * (_clamped(xi, floor, MOST_VOLTS) - line.intensity)
    seen = _clamped(seen, floor, MOST_VOLTS)
    at = line.s + share * (_clamped(s, -MOST_METRES, MOST_METRES) - line.s)
    brightness = log(seen)
    y = exp(-brightness / p.diffusion_exponent)
    light = exp(p.weight_exponent * brightness)
    weight = believed * light * _travel(line, at, y)
    total = line.weight + weight
    if total <= 0.0:
        return Line(seen, at, y, 0.0, at, y, 0.0, 0.0, 1.0, inf)
    ds = at - line.mean_s
    dy = y - line.mean_y
    mean_s = line.mean_s + weight / total * ds
    mean_y = line.mean_y + weight / total * dy
    c_ss = line.c_ss + weight * ds * (at - mean_s)
    c_sy = line.c_sy + weight * ds * (y - mean_y)
    if c_sy <= 0.0 or c_ss <= 0.0:
        return Line(seen, at, y, total, mean_s, mean_y, c_ss, c_sy, 1.0, inf)
    slope = _clamped(c_sy / c_ss, 1.0 / STEEPEST, STEEPEST)
    relative = (p.intensity_noise / c_sy) * (y / seen)
    variance = relative * relative * c_ss * light
    return Line(seen, at, y, total, mean_s, mean_y, c_ss, c_sy, slope, variance)


def _travel(line: Line, at: float, y: float) -> float:
    """The way in m from the last point, as far as the light agrees with it by the slope so far."""
    ds = at - line.s
    way = abs(ds)
    if line.c_sy <= 0.0:
        return way
    dy = y - line.y
    seen = (dy if ds > 0.0 else -dy) / line.slope
    return _clamped(seen, 0.0, way)


def ratio(p: Params, line_1: Line, line_2: Line) -> Estimate:
    """The logarithm of the ratio, drawn towards 0 as far as the lines are uncertain."""
    prior = p.prior_deviation * p.prior_deviation
    if prior == 0.0:
        return Estimate(0.0, 0.0)
    gain = prior / (prior + (line_1.variance + line_2.variance))
    fitted = p.diffusion_exponent * (log(line_2.slope) - log(line_1.slope))
    beta = gain * _clamped(fitted, -p.limit, p.limit)
    return Estimate(beta, p.prior_deviation * sqrt(1.0 - gain))


def gaps(p: Params, line_1: Line, line_2: Line) -> tuple[float, float]:
    """The gaps in m that light and slopes tell; without a slope, that to a white face."""
    white = exp(log(p.gain) / p.diffusion_exponent)
    return _gap(p, line_1, white), _gap(p, line_2, white)


def _gap(p: Params, line: Line, white: float) -> float:
    """The gap in m of a finger, 1/kappa drawn towards that of a white face as it is uncertain."""
    prior = p.prior_deviation * p.prior_deviation
    gain = prior / (prior + line.variance) if prior > 0.0 else 0.0
    return line.y * ((1.0 - gain) * white + gain / line.slope) - p.offset_distance


def _clamped(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)
