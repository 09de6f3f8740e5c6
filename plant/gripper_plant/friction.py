"""A body that slides or sticks: Coulomb, viscous, Stribeck friction. Equations: plant/README.md."""

from dataclasses import dataclass
from math import copysign, exp, inf, sqrt
from typing import Annotated, NamedTuple

from block_variables import Group, Parameter

Pair = tuple[float, float]
"""A value per finger: right, left."""

Motion = tuple[float, float]
"""Position in m and velocity in m/s."""


class Law(NamedTuple):
    """The friction of a body, which may be greater on the inner part of its way."""

    coulomb: float
    """F_C in N."""
    static: float
    """F_S in N, at least F_C."""
    viscous: float
    """B in N.s/m."""
    stribeck_velocity: float
    """v_s in m/s, above 0."""
    inner: float
    """F_I in N, which the inner part adds."""
    inner_begin: float
    """Where the inner part begins, in m: it is below."""


NONE = Law(0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
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
    inner: Annotated[
        Pair,
        Parameter(
            "F_Ij, additional friction on the inner part of the way",
            unit="N",
            low=0.0,
            high=1e3,
            tunable=True,
        ),
    ] = (0.0, 0.0)
    inner_begin: Annotated[
        Pair,
        Parameter(
            "x_Ij, where the inner part begins: below it for x_1, above it for x_2",
            unit="m",
            low=-10.0,
            high=10.0,
            tunable=True,
        ),
    ] = (0.0, 0.0)


def laws(p: Params) -> tuple[Law, Law]:
    """The friction of either finger, counted as it opens."""
    c_1, c_2 = p.coulomb
    s_1, s_2 = p.static
    b_1, b_2 = p.viscous
    v_s = p.stribeck_velocity
    inner_1, inner_2 = p.inner
    begin_1, begin_2 = p.inner_begin
    return (
        Law(c_1, max(c_1, s_1), b_1, v_s, inner_1, begin_1),
        Law(c_2, max(c_2, s_2), b_2, v_s, inner_2, -begin_2),
    )


def coulomb(force: float) -> Law:
    """Coulomb friction and nothing else, of a force in N."""
    return Law(force, force, 0.0, 1.0, 0.0, 0.0)


def acts(law: Law) -> bool:
    """True if there is any friction."""
    return law.static > 0.0 or law.viscous > 0.0 or law.inner > 0.0


def rate(law: Law, m: float) -> float:
    """How fast friction slows down m kg, 1/s; a sub-step must resolve it."""
    return law.viscous / m


def resistance(law: Law, speed: float) -> float:
    """F(v) in N at a speed in m/s, on the outer part of the way."""
    coulomb, static, viscous, v_s, _, _ = law
    if static == coulomb:
        return coulomb + viscous * speed  # (F2) with F_S = F_C
    ratio = speed / v_s
    return coulomb + (static - coulomb) * exp(-ratio * ratio) + viscous * speed  # (F2)


def move(x: float, v: float, m: float, f: float, law: Law, d: float) -> Motion:
    """Advance m kg at x m with v m/s by d seconds, the force f in N held.

    Friction is held at the speed in the middle. The moment at which the body stops is met exactly:
    there it stays, unless f exceeds the breakaway force. Where it gets from one part of its way to
    the other, it goes on with the friction there; if it turns, it keeps that to the end.
    """
    if not acts(law):
        next_v = v + d * f / m
        return x + 0.5 * d * (v + next_v), next_v
    if law.inner == 0.0:
        return _move_on_a_part(x, v, m, f, law, d)
    towards = copysign(1.0, v if v != 0.0 else f)
    here = _law_of_part(law, x, towards)
    a = _acceleration(v, m, f, here, towards, d)
    time = _time_over(towards * (law.inner_begin - x), towards * v, towards * a)
    if time >= d:
        return _move_on_a_part(x, v, m, f, here, d)
    v += a * time
    there = _law_of_part(law, law.inner_begin, towards)
    return _move_on_a_part(law.inner_begin, v, m, f, there, d - time)


def _law_of_part(law: Law, x: float, towards: float) -> Law:
    """The friction at x m, where a border belongs to the part that lies towards: 1 or -1."""
    begin = law.inner_begin
    is_inner = x < begin or (x == begin and towards < 0.0)
    more = law.inner if is_inner else 0.0
    return Law(law.coulomb + more, law.static + more, law.viscous, law.stribeck_velocity, 0.0, 0.0)


def _time_over(distance: float, speed: float, acceleration: float) -> float:
    """Seconds until a body is over a border that is ahead by a distance in m; inf if it never is.

    It moves with a speed >= 0 in m/s, and stays where it stops.
    """
    square = speed * speed + 2.0 * acceleration * distance
    if distance <= 0.0 or square <= 0.0:
        return inf
    return 2.0 * distance / (speed + sqrt(square))


def _acceleration(v: float, m: float, f: float, law: Law, towards: float, d: float) -> float:
    """Acceleration in m/s^2 of a body that slides: the friction is that in the middle of d s."""
    speed = towards * v
    middle_speed = speed + 0.5 * d * (towards * f - resistance(law, speed)) / m
    return (f - towards * resistance(law, max(0.0, middle_speed))) / m  # (F1)


def _move_on_a_part(x: float, v: float, m: float, f: float, law: Law, d: float) -> Motion:
    """move() where the friction is the same all along the way."""
    if v == 0.0 and abs(f) <= law.static:
        return x, 0.0
    towards = copysign(1.0, v if v != 0.0 else f)
    a = _acceleration(v, m, f, law, towards, d)
    next_v = v + a * d
    if towards * next_v >= 0.0:
        return x + 0.5 * d * (v + next_v), next_v
    stop_time = -v / a
    x += 0.5 * stop_time * v
    if abs(f) <= law.static:
        return x, 0.0
    remaining = d - stop_time
    next_v = remaining * (f - copysign(law.static, f)) / m
    return x + 0.5 * remaining * next_v, next_v
