"""Learns from the fingers' own motion how much brighter one face is than the other.

By Eq. (9) y = xi^(-1/n) is a straight line over the finger's way s, with the slope
kappa = (K·alpha)^(-1/n). Each finger fits its line while it moves; the slopes give alpha_1/alpha_2.
Derivation: controller/README.md

    (R1) y = kappa·(s - surface + l_0),   kappa = (K·alpha)^(-1/n)
    (R2) w = xi^q·travel                  weight of a point, by the travel that it stands for
    (R3) kappa = C_sy/C_ss                from weighted sums about the weighted means
    (R4) beta = sigma_b^2/(sigma_b^2 + V_1 + V_2)·clip(n·ln(kappa_2/kappa_1), -beta_max, beta_max)
    (R5) V = sigma^2·Q/C_sy^2,     Q = sum of (w·xi^(-1-1/n)·(s - mean of s))^2·(1 + 2·T_f/h)
"""

from dataclasses import dataclass
from math import exp, inf, log, sqrt
from typing import Annotated, NamedTuple, TypeAlias

from block_variables import Group, Output, Parameter

from .impact_reduction import Pair

Ratio: TypeAlias = Annotated[
    float,
    Output(
        "alpha_1/alpha_2, reflectance of the right face to that of the left one, as learnt",
        unit="1",
        nominal=1.0,
        depends_on=set(),
    ),
]
RatioDeviation: TypeAlias = Annotated[
    float,
    Output(
        "standard deviation of that ratio, by noise only",
        unit="1",
        nominal=1.0,
        depends_on=set(),
    ),
]
EstimatedGap: TypeAlias = Annotated[
    Pair,
    Output(
        "l_j, gap as learnt",
        unit="m",
        nominal=0.1,
        depends_on=set(),
        depends_initially_on={"intensity[j]"},
    ),
]
"""What is learnt, as a controller puts it out."""


@dataclass(frozen=True, slots=True)
class Params(Group, name="reflectance"):
    """The exponent of the sensors, the weights of the fits, and how far they are believed.

    `intensity_noise` is measured at rest, behind the low-pass of T_f: white noise of sigma_0 in
    samples h seconds apart leaves sigma_0/sqrt(1 + 2·T_f/h).
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
    intensity_noise: Annotated[
        float,
        Parameter(
            "sigma, standard deviation of the low-passed intensity at rest",
            unit="V",
            low=1e-12,
            high=10.0,
            tunable=True,
        ),
    ] = 2.5e-4
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
            "K of a white face, for the estimated gaps only",
            unit="V.m^n",
            low=1e-9,
            high=1e6,
            tunable=True,
        ),
    ] = 0.0024
    offset_distance: Annotated[
        float,
        Parameter(
            "l_0, from the face of the sensor to its element, for the estimated gaps only",
            unit="m",
            low=0.0,
            high=1.0,
            tunable=True,
        ),
    ] = 5e-3


class Line(NamedTuple):
    """A finger's line y over s: the last point, weighted sums over all before, what they tell.

    `ahead` is the way in m of the finger before its low-passed place s. `q_0` to `q_2` are sums of
    the noise of the points, by powers of their distance from the mean. `per_y` is 1/kappa in
    m.V^(1/n), and `variance` that of n·ln kappa by the noise of the intensity; 1 and infinite
    where there is no slope yet.
    """

    intensity: float
    s: float
    y: float
    ahead: float
    weight: float
    mean_s: float
    mean_y: float
    c_ss: float
    c_sy: float
    q_0: float
    q_1: float
    q_2: float
    per_y: float
    variance: float


Lines = tuple[Line, Line]
"""A line per finger: right, left."""


class LowPass(NamedTuple):
    """T_f·x_f' = x - x_f by Euler backward: the share of a sample in x_f, and how many steps white
    noise stays alike in it, the sum of its autocorrelation.
    """

    share: float
    alike: float


class Estimate(NamedTuple):
    """beta = ln(alpha_1/alpha_2), its standard deviation, and the darker face to the brighter."""

    beta: float
    deviation: float
    dimmed: float


def first_point(p: Params, floor: float, s: float, xi: float) -> Line:
    """The line of a finger at s in m that sees xi in V: a point, without a slope."""
    xi_f = max(xi, floor)
    return _point(xi_f, s, exp(-log(xi_f) / p.diffusion_exponent), 0.0)


def low_pass(p: Params, h: float) -> LowPass:
    """The low-pass for a step of h seconds."""
    return LowPass(h / (p.time_constant + h), 1.0 + 2.0 * p.time_constant / h)


def moved(
    p: Params, line: Line, floor: float, s: float, xi: float, believed: float, low_pass: LowPass
) -> Line:
    """The line a step later, the finger at s in m that sees xi in V.

    What is new weighs by the travel that position and light both report; `believed` is the share
    of it that counts, from 0 to 1.
    """
    # xi and s through the same low-pass
    share = low_pass.share
    xi_f = max(line.intensity + share * (max(xi, floor) - line.intensity), floor)
    s_f = line.s + share * (s - line.s)
    log_xi = log(xi_f)
    y = exp(-log_xi / p.diffusion_exponent)  # (R1)
    weight = believed * exp(p.weight_exponent * log_xi) * _travel(line, s_f, y)  # (R2)
    total = line.weight + weight
    if total <= 0.0:
        return _point(xi_f, s_f, y, s - s_f)
    # Means and sums about them, with one point more
    new = weight / total
    shift = new * (s_f - line.mean_s)
    mean_s = line.mean_s + shift
    distance = s_f - mean_s
    c_ss = line.c_ss + weight * (s_f - line.mean_s) * distance
    c_sy = line.c_sy + weight * (y - line.mean_y) * distance
    mean_y = line.mean_y + new * (y - line.mean_y)
    # Q of (R5), from moments about the mean that moves by `shift`
    noise = weight * y / xi_f
    noise = noise * noise * low_pass.alike
    q_0 = line.q_0 + noise
    q_1 = line.q_1 - shift * line.q_0 + noise * distance
    q_2 = line.q_2 + shift * (shift * line.q_0 - 2.0 * line.q_1) + noise * distance * distance
    per_y, variance = 1.0, inf
    if 0.0 < c_ss < inf and 0.0 < c_sy < inf and 0.0 < q_2 < inf:
        per_y = c_ss / c_sy  # 1/kappa, (R3)
        relative = p.intensity_noise / c_sy
        variance = relative * relative * q_2  # V, (R5)
    sums = (total, mean_s, mean_y, c_ss, c_sy, q_0, q_1, q_2)
    return Line(xi_f, s_f, y, s - s_f, *sums, per_y, variance)


def _point(xi_f: float, s_f: float, y: float, ahead: float) -> Line:
    return Line(xi_f, s_f, y, ahead, 0.0, s_f, y, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, inf)


def _travel(line: Line, s_f: float, y: float) -> float:
    """The travel in m from the last point, as far as the light agrees by the slope so far."""
    ds = s_f - line.s
    travel = abs(ds)
    if line.c_sy <= 0.0:
        return travel
    dy = y - line.y
    light_travel = (dy if ds > 0.0 else -dy) * line.per_y  # the travel of (R2)
    return _clamped(light_travel, 0.0, travel)


def first_points(p: Params, floor: float, position: Pair, xi: Pair) -> Lines:
    """The lines of fingers on one axis, right and left, at places in m that see xi in V."""
    (x_1, x_2), (xi_1, xi_2) = position, xi
    return first_point(p, floor, x_1, xi_1), first_point(p, floor, -x_2, xi_2)


def both_moved(
    p: Params, lines: Lines, floor: float, position: Pair, xi: Pair, believed: float, h: float
) -> Lines:
    """Those lines h seconds later, see moved()."""
    (line_1, line_2), (x_1, x_2), (xi_1, xi_2) = lines, position, xi
    filtered = low_pass(p, h)
    return (
        moved(p, line_1, floor, x_1, xi_1, believed, filtered),
        moved(p, line_2, floor, -x_2, xi_2, believed, filtered),
    )


def ratio(p: Params, line_1: Line, line_2: Line) -> Estimate:
    """The logarithm of the ratio, drawn towards 0 as far as the lines are uncertain."""
    prior = p.prior_deviation * p.prior_deviation
    if prior == 0.0:
        return Estimate(0.0, 0.0, 1.0)
    gain = prior / (prior + (line_1.variance + line_2.variance))
    fitted = p.diffusion_exponent * (log(line_1.per_y) - log(line_2.per_y))
    beta = gain * _clamped(fitted, -p.limit, p.limit)  # (R4)
    return Estimate(beta, p.prior_deviation * sqrt(1.0 - gain), exp(-abs(beta)))


def alike(estimate: Estimate, xi: Pair) -> Pair:
    """The intensities in V, that of the brighter face dimmed to what the darker one would give."""
    xi_1, xi_2 = xi
    dimmed = estimate.dimmed
    return (dimmed * xi_1, xi_2) if estimate.beta > 0.0 else (xi_1, dimmed * xi_2)


def learnt(estimate: Estimate) -> float:
    """The ratio alpha_1/alpha_2."""
    return 1.0 / estimate.dimmed if estimate.beta > 0.0 else estimate.dimmed


def white(p: Params) -> float:
    """1/kappa of a white face, m.V^(1/n)."""
    return exp(log(p.gain) / p.diffusion_exponent)


def gaps(p: Params, white: float, line_1: Line, line_2: Line) -> Pair:
    """The gaps in m that light and slopes tell; without a slope, that to a white face."""
    return gap(p, line_1, white), gap(p, line_2, white)


def gap(p: Params, line: Line, white: float) -> float:
    """The gap in m of a finger, 1/kappa drawn towards that of a white face as it is uncertain."""
    gain = known(p, line)
    per_y = (1.0 - gain) * white + gain * line.per_y
    return line.y * per_y - p.offset_distance + line.ahead  # (R1) for the gap


def known(p: Params, line: Line) -> float:
    """How far the slope of a line is known, from 0 without one to 1."""
    prior = p.prior_deviation * p.prior_deviation
    return prior / (prior + line.variance) if prior > 0.0 else 0.0


def _clamped(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)
