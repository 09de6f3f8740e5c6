"""A body that slides or sticks: Coulomb, viscous, Stribeck friction. Equations: plant/README.md."""

from dataclasses import dataclass
from math import copysign, exp
from typing import Annotated

from block_variables import Group, Parameter

Pair = tuple[float, float]
"""A value per finger: right, left."""

Law = tuple[float, float, float, float]
"""F_C in N, F_S in N (>= F_C), B in N.s/m, v_s in m/s (> 0)."""

Motion = tuple[float, float]
"""Position in m and velocity in m/s."""

NONE: Law = (0.0, 0.0, 0.0, 1.0)
"""No friction."""


@dataclass(frozen=True, slots=True)
class Params(Group, name="friction"):
    """None, as in the paper's simulation. v_s has no source; it matters where F_S > F_C."""

    coulomb: Annotated[
        Pair,
        Parameter(
            "F_Cj, Coulomb friction of the finger", unit="N", low=0.0, high=1e3, tunable=True
        ),
    ] = (0.0, 0.0)
    static: Annotated[
        Pair,
        Parameter(
            "F_Sj, breakaway force of the finger; less than F_Cj counts as F_Cj",
            unit="N",
            low=0.0,
            high=1e3,
            tunable=True,
        ),
    ] = (0.0, 0.0)
    viscous: Annotated[
        Pair,
        Parameter(
            "B_j, viscous friction of the finger", unit="N.s/m", low=0.0, high=1e3, tunable=True
        ),
    ] = (0.0, 0.0)
    stribeck_velocity: Annotated[
        float,
        Parameter(
            "v_s, velocity over which friction falls from F_Sj to F_Cj",
            unit="m/s",
            low=1e-6,
            high=1e3,
            tunable=True,
        ),
    ] = 0.01


def laws(p: Params) -> tuple[Law, Law]:
    """The friction of either finger."""
    c_1, c_2 = p.coulomb
    s_1, s_2 = p.static
    b_1, b_2 = p.viscous
    v_s = p.stribeck_velocity
    return (c_1, max(c_1, s_1), b_1, v_s), (c_2, max(c_2, s_2), b_2, v_s)


def acts(law: Law) -> bool:
    """True if there is any friction."""
    _, static, viscous, _ = law
    return static > 0.0 or viscous > 0.0


def rate(law: Law, m: float) -> float:
    """How fast friction slows down m kg, 1/s; a sub-step must resolve it."""
    _, _, viscous, _ = law
    return viscous / m


def resistance(law: Law, speed: float) -> float:
    """F(v) in N at a speed in m/s."""
    coulomb, static, viscous, v_s = law
    if static == coulomb:
        return coulomb + viscous * speed  # (F2) with F_S = F_C
    ratio = speed / v_s
    return coulomb + (static - coulomb) * exp(-ratio * ratio) + viscous * speed  # (F2)


def move(x: float, v: float, m: float, f: float, law: Law, d: float) -> Motion:
    """Advance m kg at x m with v m/s by d seconds, the force f in N held.

    Friction is held at the speed in the middle. The moment at which the body stops is met exactly:
    there it stays, unless f exceeds the breakaway force.
    """
    if not acts(law):
        next_v = v + d * f / m
        return x + 0.5 * d * (v + next_v), next_v
    _, static, _, _ = law
    if v == 0.0 and abs(f) <= static:
        return x, 0.0
    direction = copysign(1.0, v if v != 0.0 else f)
    middle_speed = direction * v + 0.5 * d * (direction * f - resistance(law, direction * v)) / m
    a = (f - direction * resistance(law, max(0.0, middle_speed))) / m  # (F1)
    next_v = v + a * d
    if direction * next_v >= 0.0:
        return x + 0.5 * d * (v + next_v), next_v
    stop_time = -v / a
    x += 0.5 * stop_time * v
    if abs(f) <= static:
        return x, 0.0
    remaining = d - stop_time
    next_v = remaining * (f - copysign(static, f)) / m
    return x + 0.5 * remaining * next_v, next_v
