"""A side that gives and relaxes: a spring, parallel to a spring on a dashpot. It never pulls.

    F = k_inf·delta + k_1·(delta - z),  z' = (delta - z)/tau    (Z1)

Held at a depth, F falls from (k_inf + k_1)·delta to k_inf·delta with the time constant tau. Let go,
the surface stays behind and comes back. Equations: plant/README.md
"""

from dataclasses import dataclass
from math import exp, expm1, sqrt
from typing import Annotated

from block_variables import Group, Parameter

Solid = tuple[float, float, float]
"""k_inf in N/m (> 0), k_1 in N/m, tau in s (> 0)."""

SERIES = 1e-3
"""d/tau below which the means over a sub-step are worked out by their series."""


@dataclass(frozen=True, slots=True)
class Side(Group, name="side"):
    """By default a side of a ripe tomato, as in delicate.toml."""

    stiffness: Annotated[
        float,
        Parameter(
            "k_inf, stiffness of a side that has relaxed",
            unit="N/m",
            low=1e-3,
            high=1e7,
            tunable=True,
        ),
    ] = 3100.0
    relaxing_stiffness: Annotated[
        float,
        Parameter(
            "k_1, stiffness of a side that relaxes; it adds to k_inf",
            unit="N/m",
            low=0.0,
            high=1e7,
            tunable=True,
        ),
    ] = 2100.0
    relaxation_time: Annotated[
        float,
        Parameter(
            "tau, time in which a side relaxes", unit="s", low=1e-6, high=1e6, tunable=True
        ),
    ] = 5.0  # fmt: skip


@dataclass(frozen=True, slots=True)
class Pad(Group, name="pad"):
    """None: the fingertip is rigid, and the face of the sensor touches the object."""

    stiffness: Annotated[
        float,
        Parameter(
            "k_p, stiffness of the pad on a fingertip; 0 is a rigid pad",
            unit="N/m",
            low=0.0,
            high=1e7,
            tunable=True,
        ),
    ] = 0.0
    thickness: Annotated[
        float,
        Parameter(
            "t_p, thickness of the free pad, behind which the face of the sensor is",
            unit="m", low=0.0, high=0.1,
        ),
    ] = 0.0  # fmt: skip


def solid(side: Side, pad: Pad) -> Solid:
    """Side and pad in series, which is again such a solid; its depth is that of both."""
    k_inf, k_1, tau, k_p = (
        side.stiffness, side.relaxing_stiffness, side.relaxation_time, pad.stiffness,
    )  # fmt: skip
    if k_p == 0.0:
        return k_inf, k_1, tau
    k_s = k_inf + k_1
    series_inf = k_p * k_inf / (k_p + k_inf)
    return series_inf, k_p * k_s / (k_p + k_s) - series_inf, tau * (k_p + k_s) / (k_p + k_inf)


def rate(law: Solid, m: float) -> float:
    """The fastest that m kg on the surface can do, 1/s."""
    k_inf, k_1, _ = law
    return sqrt((k_inf + k_1) / m)


def surface(law: Solid, z: float) -> float:
    """The depth in m of the free surface, where (Z1) has no force."""
    k_inf, k_1, _ = law
    return z * k_1 / (k_inf + k_1)


def force(law: Solid, depth: float, z: float) -> float:
    """F in N at a depth in m; none above the surface."""
    k_inf, k_1, _ = law
    return max(0.0, k_inf * depth + k_1 * (depth - z))  # (Z1)


def energy(law: Solid, depth: float, z: float) -> float:
    """Energy stored in both springs at a depth in m, in J; above the surface as at the surface."""
    k_inf, k_1, _ = law
    d = max(depth, surface(law, z))
    return 0.5 * k_inf * d * d + 0.5 * k_1 * (d - z) * (d - z)


def recovered(law: Solid, z: float, d: float) -> float:
    """The way z in m of the dashpot d seconds later, nothing touching the surface."""
    k_inf, k_1, tau = law
    return z * exp(-d * k_inf / ((k_inf + k_1) * tau))


def press(
    law: Solid, z: float, from_depth: float, to_depth: float, d: float
) -> tuple[float, float]:
    """F in N, held over d seconds in which a finger goes from one depth to another; z at the end.

    The finger goes at one speed, for which (Z1) is met exactly, and F is its mean: the work of F is
    the energy that the springs take and the dashpot wastes. Its impulse is right also where the
    contact begins on the way; a contact that ends on the way lets go at the end of the sub-step.
    """
    later = recovered(law, z, d)
    gap, later_gap = surface(law, z) - from_depth, surface(law, later) - to_depth
    if gap < 0.0:
        mean, next_z = _ramp(law, z, from_depth, to_depth, d)
        return (mean, next_z) if mean > 0.0 else (0.0, later)
    if later_gap >= 0.0:
        return 0.0, later
    free = gap / (gap - later_gap)  # the share of the sub-step in which nothing touches
    touched = z + free * (later - z)
    begin = from_depth + free * (to_depth - from_depth)
    mean, next_z = _ramp(law, touched, begin, to_depth, (1.0 - free) * d)
    return ((1.0 - free) * mean, next_z) if mean > 0.0 else (0.0, later)


def _ramp(
    law: Solid, z: float, from_depth: float, to_depth: float, d: float
) -> tuple[float, float]:
    """The mean of (Z1) in N over d seconds at one speed in contact, below 0 if it pulls, and z."""
    k_inf, k_1, tau = law
    x = d / tau
    # Means of exp(-t/tau) and of what a stretch at one speed leaves of itself
    held = -expm1(-x) / x if x > 0.0 else 1.0
    stretched = (1.0 - held) / x if x > SERIES else 0.5 - x / 6.0 + x * x / 24.0
    travel, stretch = to_depth - from_depth, from_depth - z
    mean = k_inf * (from_depth + 0.5 * travel) + k_1 * (held * stretch + stretched * travel)
    return mean, to_depth - (exp(-x) * stretch + held * travel)
