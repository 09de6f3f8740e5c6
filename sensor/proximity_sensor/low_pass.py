"""Butterworth low-pass filter of 5th order as a digital filter, in second-order sections.

    H(s) = 1/(s + 1) · 1/(s^2 + 2·cos(pi/5)·s + 1) · 1/(s^2 + 2·cos(2·pi/5)·s + 1)

with s = (1 - 1/z) / (k·(1 + 1/z)), the bilinear transform, and k = tan(pi·cutoff/rate), which puts
the -3 dB where they belong.
"""

from dataclasses import dataclass
from math import cos, pi, tan
from typing import Annotated

from block_variables import Group, Parameter

Section = tuple[float, float, float]
"""b_0, a_1, a_2 of b_0·(1 + 2/z + 1/z^2) / (1 + a_1/z + a_2/z^2)."""

Coefficients = tuple[float, float, Section, Section]
"""b_0, a_1 of b_0·(1 + 1/z) / (1 + a_1/z), and two sections of second order."""

Memory = tuple[float, float, float, float, float]
"""One value of the section of first order, two of each of the others, in V."""


@dataclass(frozen=True, slots=True)
class Params(Group, name="filter"):
    """500 Hz is the cutoff of the paper's bench, Sec. IV.B."""

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
