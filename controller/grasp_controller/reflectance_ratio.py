"""Learns from the fingers' own motion how much brighter one face is than the other.

By Eq. (9) y = xi^(-1/n) is a straight line over the finger's way s, with the slope
kappa = (K·alpha)^(-1/n). Each finger fits its line while it moves; the slopes give alpha_1/alpha_2.
Derivation: controller/README.md

    (R1) y = kappa·(s - surface + l_0),   kappa = (K·alpha)^(-1/n)
    (R2) w = xi^q·travel                  weight of a point, by the travel that it stands for
    (R3) kappa = C_sy/C_ss                from weighted sums about the weighted means
    (R4) beta = p·sigma_b^2/(sigma_b^2 + N)·f,   p = clip(2 - 2·gamma·sqrt(V)/|f|, 0, 1),
         f = clip(ln alpha_1 - ln alpha_2, -beta_max, beta_max),   ln alpha = -n·ln kappa - ln K
    (R5) N = N_1 + N_2,   N_j = sigma^2·Q/C_sy^2,
         Q = sum of (w·xi^(-1-1/n)·(s - mean of s))^2·(1 + 2·T_f/h)
    (R10) what one sensor with the means of n, l_0 and K gives at the gaps that are learnt
    (R11) V = V_1 + V_2,   V_j: N_j, and the squares of what errors of the calibration move
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
        "standard deviation of that ratio, by noise and calibration",
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
class Learning(Group):
    """The weights of the fits, and how far they are believed: the same for each finger.

    `intensity_noise` is measured at rest, behind the low-pass of T_f: white noise of sigma_0 in
    samples h seconds apart leaves sigma_0/sqrt(1 + 2·T_f/h). The deviations of the calibration are
    those of a fit like the paper's, between sensors: an error that all share is of no effect.
    """

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
    exponent_deviation: Annotated[
        float,
        Parameter(
            "sigma_n, standard deviation of the calibrated n",
            unit="1",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.01
    offset_deviation: Annotated[
        float,
        Parameter(
            "sigma_c, standard deviation of the offset voltage that is compensated",
            unit="V",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 1.8e-3
    offset_distance_deviation: Annotated[
        float,
        Parameter(
            "sigma_l, standard deviation of the calibrated l_0",
            unit="m",
            low=0.0,
            high=1.0,
            tunable=True,
        ),
    ] = 0.0
    gain_deviation: Annotated[
        float,
        Parameter(
            "sigma_K, standard deviation of ln K as calibrated",
            unit="1",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.05
    caution: Annotated[
        float,
        Parameter(
            "gamma, deviations below which a ratio does not act; 0: any acts",
            unit="1",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.65
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


@dataclass(frozen=True, slots=True)
class Params(Learning, name="reflectance"):
    """The sensors of two fingers, and what is learnt from them."""

    diffusion_exponent: Annotated[
        Pair, Parameter("n_j, diffusion exponent of the sensor", unit="1", low=0.1, high=10.0)
    ] = (1.1506, 1.1506)
    offset_distance: Annotated[
        Pair,
        Parameter(
            "l_0j, from the face of the sensor to its element",
            unit="m",
            low=0.0,
            high=1.0,
            tunable=True,
        ),
    ] = (5e-3, 5e-3)
    gain: Annotated[
        Pair,
        Parameter("K_j of a white face", unit="V.m^n", low=1e-9, high=1e6, tunable=True),
    ] = (0.0024, 0.0024)


class Sensor(NamedTuple):
    """n, l_0 in m and K in V.m^n of a sensor."""

    n: float
    l_0: float
    gain: float


Sensors = tuple[Sensor, Sensor]
"""A sensor per finger: right, left."""


def sensors(p: Params) -> Sensors:
    """Those of both fingers, right and left."""
    (n_1, n_2), (l_1, l_2), (k_1, k_2) = p.diffusion_exponent, p.offset_distance, p.gain
    return Sensor(n_1, l_1, k_1), Sensor(n_2, l_2, k_2)


class Line(NamedTuple):
    """A finger's line y over s: the last point, weighted sums over all before, what they tell.

    `ahead` is the way in m of the finger before its low-passed place s. `q_0` to `q_2` are sums of
    the noise of the points, by powers of their distance from the mean. `c_so` and `c_sn` are those
    of how an error of the offset and of n moves y. `per_y` is 1/kappa in m.V^(1/n); 1 where there
    is no slope yet. `noise_variance` is that of n·ln kappa by noise, `variance` that with which
    light tells whether the gaps are equal, and `brightness_variance` that of ln alpha; infinite
    without a slope.
    """

    intensity: float
    s: float
    y: float
    ahead: float
    weight: float
    mean_s: float
    mean_y: float
    mean_o: float
    mean_n: float
    c_ss: float
    c_sy: float
    c_so: float
    c_sn: float
    q_0: float
    q_1: float
    q_2: float
    per_y: float
    log_per_y: float
    noise_variance: float
    variance: float
    brightness_variance: float


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


def first_point(eye: Sensor, floor: float, s: float, xi: float) -> Line:
    """The line of a finger at s in m that sees xi in V: a point, without a slope."""
    xi_f = max(xi, floor)
    log_y = -log(xi_f) / eye.n
    return _point(xi_f, s, exp(log_y), log_y, 0.0)


def low_pass(p: Learning, h: float) -> LowPass:
    """The low-pass for a step of h seconds."""
    return LowPass(h / (p.time_constant + h), 1.0 + 2.0 * p.time_constant / h)


def moved(
    p: Learning,
    eye: Sensor,
    line: Line,
    floor: float,
    s: float,
    xi: float,
    believed: float,
    low_pass: LowPass,
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
    log_y = -log_xi / eye.n
    y = exp(log_y)  # (R1)
    weight = believed * exp(p.weight_exponent * log_xi) * _travel(line, s_f, y)  # (R2)
    total = line.weight + weight
    if total <= 0.0:
        return _point(xi_f, s_f, y, log_y, s - s_f)
    # Means and sums about them, with one point more
    o, n = y / xi_f, y * log_y
    new = weight / total
    shift = new * (s_f - line.mean_s)
    mean_s = line.mean_s + shift
    distance = s_f - mean_s
    moment = weight * distance
    from_y, from_o, from_n = y - line.mean_y, o - line.mean_o, n - line.mean_n
    c_ss = line.c_ss + weight * (s_f - line.mean_s) * distance
    c_sy = line.c_sy + moment * from_y
    c_so = line.c_so + moment * from_o
    c_sn = line.c_sn + moment * from_n
    # Q of (R5), from moments about the mean that moves by `shift`
    noise = weight * o
    noise = noise * noise * low_pass.alike
    q_0 = line.q_0 + noise
    q_1 = line.q_1 - shift * line.q_0 + noise * distance
    q_2 = line.q_2 + shift * (shift * line.q_0 - 2.0 * line.q_1) + noise * distance * distance
    per_y, log_per_y, noise_variance, variance, brightness_variance = 1.0, 0.0, inf, inf, inf
    if 0.0 < c_ss < inf and 0.0 < c_sy < inf and 0.0 < q_2 < inf:
        per_y = c_ss / c_sy  # 1/kappa, (R3)
        log_per_y = log(per_y)
        relative = p.intensity_noise / c_sy
        noise_variance = relative * relative * q_2  # (R5)
        # (R11)
        by_offset = p.offset_deviation * c_so / c_sy
        known = noise_variance + by_offset * by_offset
        bend = c_sn / c_sy
        by_n = p.exponent_deviation * (bend - log_y)
        by_l_0 = p.offset_distance_deviation * eye.n / (y * per_y)
        variance = known + by_n * by_n + by_l_0 * by_l_0
        by_n = p.exponent_deviation * (bend + log_per_y)
        brightness_variance = known + by_n * by_n + p.gain_deviation * p.gain_deviation
    means = (total, mean_s, line.mean_y + new * from_y)
    more = (line.mean_o + new * from_o, line.mean_n + new * from_n)
    sums = (c_ss, c_sy, c_so, c_sn, q_0, q_1, q_2)
    last = (xi_f, s_f, y, s - s_f)
    told = (per_y, log_per_y, noise_variance, variance, brightness_variance)
    return Line(*last, *means, *more, *sums, *told)


def _point(xi_f: float, s_f: float, y: float, log_y: float, ahead: float) -> Line:
    sums = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return Line(
        xi_f, s_f, y, ahead, 0.0, s_f, y, y / xi_f, y * log_y, *sums, 1.0, 0.0, inf, inf, inf
    )  # fmt: skip


def _travel(line: Line, s_f: float, y: float) -> float:
    """The travel in m from the last point, as far as the light agrees by the slope so far."""
    ds = s_f - line.s
    travel = abs(ds)
    if line.c_sy <= 0.0:
        return travel
    dy = y - line.y
    light_travel = (dy if ds > 0.0 else -dy) * line.per_y  # the travel of (R2)
    return _clamped(light_travel, 0.0, travel)


def first_points(eyes: Sensors, floor: float, position: Pair, xi: Pair) -> Lines:
    """The lines of fingers on one axis, right and left, at places in m that see xi in V."""
    (eye_1, eye_2), (x_1, x_2), (xi_1, xi_2) = eyes, position, xi
    return first_point(eye_1, floor, x_1, xi_1), first_point(eye_2, floor, -x_2, xi_2)


def both_moved(
    p: Params,
    eyes: Sensors,
    lines: Lines,
    floor: float,
    position: Pair,
    xi: Pair,
    believed: float,
    h: float,
) -> Lines:
    """Those lines h seconds later, see moved()."""
    (line_1, line_2), (x_1, x_2), (xi_1, xi_2) = lines, position, xi
    eye_1, eye_2 = eyes
    filtered = low_pass(p, h)
    return (
        moved(p, eye_1, line_1, floor, x_1, xi_1, believed, filtered),
        moved(p, eye_2, line_2, floor, -x_2, xi_2, believed, filtered),
    )


def ratio(p: Params, eyes: Sensors, line_1: Line, line_2: Line) -> Estimate:
    """The logarithm of the ratio, drawn towards 0 as far as noise makes the lines uncertain.

    What is uncertain by calibration does not fade it: that would leave a share of a ratio that is
    plain. It decides whether there is a ratio, see evidence().
    """
    prior = p.prior_deviation * p.prior_deviation
    if prior == 0.0:
        return Estimate(0.0, 0.0, 1.0)
    eye_1, eye_2 = eyes
    log_1, log_2 = line_1.log_per_y, line_2.log_per_y
    fitted = (
        0.5 * (eye_1.n + eye_2.n) * (log_1 - log_2)
        + 0.5 * (eye_1.n - eye_2.n) * (log_1 + log_2)
        - log(eye_1.gain / eye_2.gain)
    )
    within = _clamped(fitted, -p.limit, p.limit)
    share = evidence(p, within * within / max(line_1.variance + line_2.variance, TINY))
    noise_variance = line_1.noise_variance + line_2.noise_variance
    beta = share * believed(prior, noise_variance) * within  # (R4)
    brightness_variance = line_1.brightness_variance + line_2.brightness_variance
    gain = believed(prior, brightness_variance)
    missed = (1.0 - share) * gain * within
    spread = prior * (1.0 - gain) + missed * missed
    return Estimate(beta, sqrt(spread), exp(-abs(beta)))


TINY = 1e-60
"""Variance that is none."""


def evidence(p: Learning, squares: float) -> float:
    """How far a ratio acts that is sqrt(`squares`) deviations off 1, from 0 to 1.

    While errors stay within gamma deviations, what acts is at most twice the true logarithm. So the
    gaps are never less equal than without it.
    """
    if squares <= 0.0:
        return 1.0 if p.caution == 0.0 else 0.0
    return _clamped(2.0 - 2.0 * p.caution / sqrt(squares), 0.0, 1.0)  # p of (R4)


def alike(estimate: Estimate, xi: Pair) -> Pair:
    """The intensities in V, that of the brighter face dimmed to what the darker one would give."""
    xi_1, xi_2 = xi
    dimmed = estimate.dimmed
    return (dimmed * xi_1, xi_2) if estimate.beta > 0.0 else (xi_1, dimmed * xi_2)


def learnt(estimate: Estimate) -> float:
    """The ratio alpha_1/alpha_2."""
    return 1.0 / estimate.dimmed if estimate.beta > 0.0 else estimate.dimmed


def mean_sensor(eyes: Sensors) -> Sensor:
    """The sensor that stands for both."""
    (n_1, l_1, k_1), (n_2, l_2, k_2) = eyes
    return Sensor(0.5 * (n_1 + n_2), 0.5 * (l_1 + l_2), 0.5 * (k_1 + k_2))


def by_one_sensor(
    p: Params, eyes: Sensors, mean: Sensor, line_1: Line, line_2: Line, xi: Pair
) -> Pair:
    """The intensities in V as the same sensor would give them on both sides, at the learnt gaps."""
    eye_1, eye_2 = eyes
    if same(eye_1, eye_2):
        return xi
    (gap_1, gap_2), (xi_1, xi_2) = gaps(p, eyes, line_1, line_2), xi
    return translated(eye_1, mean, gap_1) * xi_1, translated(eye_2, mean, gap_2) * xi_2


def same(eye: Sensor, other: Sensor) -> bool:
    """Whether two sensors are the same."""
    return eye.n == other.n and eye.l_0 == other.l_0 and eye.gain == other.gain


def translated(eye: Sensor, mean: Sensor, gap: float) -> float:
    """How much more a sensor `mean` gives than `eye` at a gap in m, whatever the face."""
    gap = max(gap, 0.0)
    d, common = max(gap + eye.l_0, TINY), max(gap + mean.l_0, TINY)
    # (R10)
    return mean.gain / eye.gain * exp(eye.n * log(d) - mean.n * log(common))


def gaps(p: Params, eyes: Sensors, line_1: Line, line_2: Line) -> Pair:
    """The gaps in m that light and slopes tell; without a slope, that to a white face."""
    eye_1, eye_2 = eyes
    return gap(p, eye_1, line_1), gap(p, eye_2, line_2)


def gap(p: Learning, eye: Sensor, line: Line) -> float:
    """The gap in m of a finger, 1/kappa drawn towards that of a white face as it is uncertain."""
    gain = known(p, line)
    white = exp(log(eye.gain) / eye.n)
    per_y = (1.0 - gain) * white + gain * line.per_y
    return line.y * per_y - eye.l_0 + line.ahead  # (R1) for the gap


def known(p: Learning, line: Line) -> float:
    """How far the slope of a line is known from noise, from 0 without one to 1."""
    return believed(p.prior_deviation * p.prior_deviation, line.noise_variance)


def believed(prior: float, variance: float) -> float:
    """How far an estimate of that variance counts against a prior of variance `prior`, 0 to 1."""
    return prior / (prior + variance) if prior > 0.0 else 0.0


def _clamped(x: float, low: float, high: float) -> float:
    return min(max(x, low), high)
