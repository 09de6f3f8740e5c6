"""One finger against a rigid surface: unilateral contact, Baumgarte stabilised.

Everything is counted in the direction in which the finger opens, the gap g = s - surface:
m·g'' = f + f_c, with the actuator's force f and the contact's f_c >= 0. Card: plant/README.md
"""

from math import inf, nan, sqrt
from typing import NamedTuple

from . import fingers, friction
from .fingers import Side

Finger = tuple[float, float, float]
"""Position s in m and velocity in m/s (opening positive), contact force in N (>= 0)."""

UNRESOLVED: Finger = (nan, nan, nan)
"""One that would take more sub-steps than there are: the step is refused."""


class Rates(NamedTuple):
    """Of the stabilised constraint: damping and natural rate, 1/s."""

    alpha: float
    beta: float


ITERATIONS = 8
"""To find the contact force beside friction: each leaves 1/19 of the error, or less."""


def fastest(rates: Rates) -> float:
    """The rate that sub-steps must resolve in contact, 1/s."""
    alpha, beta = rates
    return max(2.0 * alpha, beta)


def time_to_contact(gap: float, rate: float, acceleration: float) -> float:
    """Seconds until g + g'·t + g''·t^2/2 next reaches zero from above; inf if it never does.

    Zero for a finger that touches: below the surface, or on it and not about to leave.
    """
    if gap < 0.0 or (gap == 0.0 and (rate < 0.0 or (rate == 0.0 and acceleration <= 0.0))):
        return 0.0
    discriminant = rate * rate - 2.0 * acceleration * gap
    if discriminant < 0.0:
        return inf
    if rate < 0.0:
        return 2.0 * gap / (sqrt(discriminant) - rate)
    return (sqrt(discriminant) + rate) / -acceleration if acceleration < 0.0 else inf


def advance(side: Side, rates: Rates, s: float, v: float, f: float, h: float) -> Finger:
    """Advance a finger at s m with v m/s by h seconds, the actuator force f in N held.

    Without friction free flight is exact, and so is the moment of contact within a sub-step.
    """
    surface, m, rub = side
    if friction.acts(rub):
        return _advance_rubbing(side, rates, s, v, f, h)
    if time_to_contact(s - surface, v, f / m) >= h:
        return _fly(s, v, f / m, h)
    n = fingers.count(fastest(rates), h)
    if n > fingers.MOST:
        return UNRESOLVED
    contact_force = 0.0
    d = h / n
    for _ in range(n):
        free = time_to_contact(s - surface, v, f / m)
        if free >= d:
            s, v, contact_force = _fly(s, v, f / m, d)
        else:
            if free > 0.0:
                _, v, _ = _fly(s, v, f / m, free)
                s = surface
            s, v, contact_force = _touch(side, rates, s, v, f, d - free)
    return s, v, contact_force


def _advance_rubbing(side: Side, rates: Rates, s: float, v: float, f: float, h: float) -> Finger:
    """advance() of a finger with friction, which acts beside the contact force."""
    surface, m, rub = side
    n = fingers.count(max(fastest(rates), friction.rate(rub, m)), h)
    if n > fingers.MOST:
        return UNRESOLVED
    contact_force = 0.0
    d = h / n
    for _ in range(n):
        after, rate = friction.move(s, v, m, f, rub, d)
        if after > surface:
            s, v, contact_force = after, rate, 0.0
            continue
        free = min(d, time_to_contact(s - surface, v, (rate - v) / d)) if s > surface else 0.0
        if free > 0.0:
            _, v = friction.move(s, v, m, f, rub, free)
            s = surface
        s, v, contact_force = _touch_rubbing(side, rates, s, v, f, d - free)
    return s, v, contact_force


def _touch_rubbing(side: Side, rates: Rates, s: float, v: float, f: float, d: float) -> Finger:
    """One step of the stabilised constraint beside friction; the contact force is held over it.

    The force is that of the mean rate and the mean gap, found by iteration. It takes the energy
    2·alpha·m·d·(mean velocity)^2 and gives none.
    """
    surface, m, rub = side
    alpha, beta = rates
    contact_force = max(0.0, -f)
    after, rate = s, v
    for _ in range(ITERATIONS if d > 0.0 else 0):
        after, rate = friction.move(s, v, m, f + contact_force, rub, d)
        mean_rate, mean_gap = (after - s) / d, 0.5 * (s + after) - surface
        contact_force = max(0.0, -m * (2.0 * alpha * mean_rate + beta * beta * mean_gap) - f)
    return after, rate, contact_force if after <= surface else 0.0


def _fly(s: float, v: float, acceleration: float, d: float) -> Finger:
    after = v + acceleration * d
    return s + 0.5 * d * (v + after), after, 0.0


def _touch(side: Side, rates: Rates, s: float, v: float, f: float, d: float) -> Finger:
    """One trapezoidal step of the stabilised constraint; the contact force is held over it.

    The rule takes the energy 2·alpha·m·d·(mean velocity)^2 and gives none, whatever d is.
    """
    surface, m, _ = side
    alpha, beta = rates
    constrained = -(2.0 * alpha * v + beta * beta * (s - surface + 0.5 * d * v)) / (
        1.0 + alpha * d + 0.25 * beta * beta * d * d
    )
    contact_force = max(0.0, m * constrained - f)
    acceleration = (f + contact_force) / m
    after, v_after, _ = _fly(s, v, acceleration, d)
    if after > surface:
        return _leave(side, surface - s, v, acceleration, f, d)
    return after, v_after, contact_force


def _leave(side: Side, depth: float, v: float, acceleration: float, f: float, d: float) -> Finger:
    """The contact lets go where the finger passes the surface, depth m further out.

    A finger that would be back before the end of the sub-step stays: so short a bounce is not
    resolved, and taking its energy lets a pressed finger come to rest.
    """
    surface, m, _ = side
    leaving = sqrt(max(0.0, v * v + 2.0 * acceleration * depth))
    rest = d - (2.0 * depth / (v + leaving) if depth > 0.0 else 0.0)
    if time_to_contact(0.0, leaving, f / m) < rest:
        return surface, 0.0, max(0.0, -f)
    return _fly(surface, leaving, f / m, rest)
