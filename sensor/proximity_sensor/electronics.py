"""The stages between the optics and the controller's input, each of which can be off.

Ambient light, converter, low-pass, median, and the clock of their samples; noise has a file of its
own. Equations: sensor/README.md
"""

from dataclasses import dataclass
from math import ceil, cos, floor, ldexp, pi, tan
from typing import Annotated

from block_variables import Group, Parameter


@dataclass(frozen=True, slots=True)
class Ambient(Group, name="ambient"):
    """Light that adds an offset to the raw voltage, c = 0.35 V as in the paper's fit, Sec. IV.A.

    It may drift after the calibration, with which the run begins.
    """

    enabled: Annotated[bool, Parameter("offset by ambient light, and its compensation")] = False
    offset: Annotated[
        float, Parameter("c, offset at the calibration", unit="V", low=-10.0, high=10.0)
    ] = 0.35
    calibration_error: Annotated[
        float,
        Parameter("what the calibration missed of the offset", unit="V", low=-10.0, high=10.0),
    ] = 0.0
    drift: Annotated[
        float,
        Parameter("rate of the offset after the calibration", unit="V/s", low=-10.0, high=10.0),
    ] = 0.0


def ambient_voltage(p: Ambient, t: float) -> float:
    """The offset in V, t s after the calibration; before it, the one that was there then."""
    offset = p.offset + p.calibration_error
    return offset + p.drift * t if t > 0.0 else offset


@dataclass(frozen=True, slots=True)
class Adc(Group, name="adc"):
    """Rounds to the nearest of 2^bits levels, and saturates.

    The levels stand (high - low) / 2^bits apart, from low to one below high; 16 bits over 20 V are
    usual for controllers like the paper's.
    """

    enabled: Annotated[bool, Parameter("conversion to digital values")] = False
    bits: Annotated[int, Parameter("resolution", low=1, high=32, tunable=True)] = 16
    range: Annotated[
        tuple[float, float],
        Parameter(
            "lower and upper end of the input range", unit="V", low=-1e3, high=1e3, tunable=True
        ),
    ] = (-10.0, 10.0)

    def __post_init__(self) -> None:
        Group.__post_init__(self)
        low, high = self.range
        if not low < high:
            raise ValueError(f"adc.range = {low!r}, {high!r} V: the second must be above the first")


def converted(p: Adc, v: float) -> float:
    """The level in V for an input of v V."""
    low, high = p.range
    levels = ldexp(1.0, p.bits)
    step = (high - low) / levels
    code = float(floor((v - low) / step + 0.5))
    code = 0.0 if code < 0.0 else levels - 1.0 if code >= levels else code
    return low + code * step


Section = tuple[float, float, float]
"""b_0, a_1, a_2 of b_0·(1 + 2/z + 1/z^2) / (1 + a_1/z + a_2/z^2)."""

Coefficients = tuple[float, float, Section, Section]
"""b_0, a_1 of b_0·(1 + 1/z) / (1 + a_1/z), and two sections of second order."""

Memory = tuple[float, float, float, float, float]
"""One value of the section of first order, two of each of the others, in V."""


@dataclass(frozen=True, slots=True)
class Filter(Group, name="filter"):
    """Butterworth low-pass of 5th order as a digital filter, in second-order sections.

        H(s) = 1/(s + 1) · 1/(s^2 + 2·cos(pi/5)·s + 1) · 1/(s^2 + 2·cos(2·pi/5)·s + 1)

    with s = (1 - 1/z) / (k·(1 + 1/z)), the bilinear transform, and k = tan(pi·cutoff/rate), which
    puts the -3 dB where they belong. 500 Hz is the cutoff of the paper's bench, Sec. IV.B.
    """

    enabled: Annotated[bool, Parameter("low-pass filter, Butterworth of 5th order")] = False
    cutoff: Annotated[
        float,
        Parameter(
            "-3 dB, below half the sampling rate where enabled", unit="Hz", low=1e-3, high=5e5
        ),
    ] = 500.0


def coefficients(cutoff: float, rate: float) -> Coefficients:
    """The sections for a cutoff in Hz below half the sampling rate in Hz."""
    k = tan(pi * cutoff / rate)
    return (
        k / (1.0 + k),
        (k - 1.0) / (k + 1.0),
        _section(k, 2.0 * cos(pi / 5.0)),
        _section(k, 2.0 * cos(2.0 * pi / 5.0)),
    )


def settled(c: Coefficients, v: float) -> Memory:
    """The memory after v V for ever: every section gives v."""
    _, a, (b_1, _, a_12), (b_2, _, a_22) = c
    return (
        0.5 * (1.0 - a) * v,
        (1.0 - b_1) * v,
        (b_1 - a_12) * v,
        (1.0 - b_2) * v,
        (b_2 - a_22) * v,
    )


def filtered(c: Coefficients, z: Memory, v: float) -> tuple[float, Memory]:
    """The output in V for a sample of v V, and the memory after it (direct form II transposed)."""
    b, a, (b_1, a_11, a_12), (b_2, a_21, a_22) = c
    z_0, z_1, z_2, z_3, z_4 = z
    v_0 = b * v + z_0
    v_1 = b_1 * v_0 + z_1
    v_2 = b_2 * v_1 + z_3
    return v_2, (
        b * v - a * v_0,
        2.0 * b_1 * v_0 - a_11 * v_1 + z_2,
        b_1 * v_0 - a_12 * v_1,
        2.0 * b_2 * v_1 - a_21 * v_2 + z_4,
        b_2 * v_1 - a_22 * v_2,
    )


def _section(k: float, d: float) -> Section:
    """1 / (s^2 + d·s + 1), transformed."""
    scale = 1.0 / (1.0 + d * k + k * k)
    return k * k * scale, 2.0 * (k * k - 1.0) * scale, (1.0 - d * k + k * k) * scale


Window = tuple[float, float, float, float, float, float, float, float, float, float]
"""The last ten samples in V, the oldest first."""


@dataclass(frozen=True, slots=True)
class Median:
    """Of the last ten samples, as on the paper's bench, Sec. IV.B; nothing but the switch."""

    enabled: Annotated[bool, Parameter("median of the last ten samples")] = False


def median(w: Window) -> float:
    """The median in V: ten is even, so it is the mean of the fifth and the sixth in order.

    Five passes over all neighbours, odd and even, put ten numbers in order.
    """
    a, b, c, d, e, f, g, h, i, j = w
    for _ in range(5):
        if a > b:
            a, b = b, a
        if c > d:
            c, d = d, c
        if e > f:
            e, f = f, e
        if g > h:
            g, h = h, g
        if i > j:
            i, j = j, i
        if b > c:
            b, c = c, b
        if d > e:
            d, e = e, d
        if f > g:
            f, g = g, f
        if h > i:
            h, i = i, h
    return 0.5 * (e + f)


TOLERANCE = 1e-6
"""How near, in periods, an instant counts as reached; a nanosecond at 1 kHz."""


@dataclass(frozen=True, slots=True)
class Sampling(Group, name="sampling"):
    """The instants k / rate after the start, k = 0, 1, 2, ..., whatever the steps are.

    10 kHz is the sampling rate of the paper's bench, Sec. IV.B.
    """

    rate: Annotated[
        float, Parameter("sampling rate, where a stage is on", unit="Hz", low=1.0, high=1e6)
    ] = 10_000.0


def due(wait: float) -> bool:
    """True if the next instant, wait periods away, is now."""
    return wait <= TOLERANCE


def samples(p: Sampling, wait: float, h: float) -> tuple[int, float]:
    """How many instants lie in a step of h s, its end excluded, and the wait at its end.

    wait is the time to the next instant in periods, so that nothing adds up over a run but the
    rounding of the steps: a millionth of a period leaves space for ten thousand million of them.
    That of a state from bytes which were damaged may be any: no instant is further behind than a
    period, or the step would not end.
    """
    periods = h * p.rate
    wait = max(wait, -1.0)
    n = max(0, ceil(periods - wait - TOLERANCE))
    return n, wait + n - periods
