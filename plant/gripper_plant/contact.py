"""One finger against a rigid surface: unilateral contact, Baumgarte stabilised.

Everything is counted in the direction in which the finger opens, the gap g = s - surface:
m·g'' = f + f_c, with the actuator's force f and the contact's f_c >= 0. Equation (C1) and card:
plant/README.md
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


MAX_FORCE_ITERATIONS = 8
"""To find the contact force together with friction: each leaves 1/19 of the error, or less."""


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
    surface, m, friction_law = side
    if friction.acts(friction_law):
        return _advance_with_friction(side, rates, s, v, f, h)
    if time_to_contact(s - surface, v, f / m) >= h:
        return _free_flight(s, v, f / m, h)
    n = fingers.substep_count(fastest(rates), h)
    if n > fingers.MAX_SUBSTEPS:
        return UNRESOLVED
    contact_force = 0.0
    d = h / n
    for _ in range(n):
        flight_time = time_to_contact(s - surface, v, f / m)
        if flight_time >= d:
            s, v, contact_force = _free_flight(s, v, f / m, d)
        else:
            if flight_time > 0.0:
                _, v, _ = _free_flight(s, v, f / m, flight_time)
                s = surface
            s, v, contact_force = _advance_contact(side, rates, s, v, f, d - flight_time)
    return s, v, contact_force


def _advance_with_friction(
    side: Side, rates: Rates, s: float, v: float, f: float, h: float
) -> Finger:
    """advance() of a finger with friction, which acts in addition to the contact force."""
    surface, m, friction_law = side
    n = fingers.substep_count(max(fastest(rates), friction.rate(friction_law, m)), h)
    if n > fingers.MAX_SUBSTEPS:
        return UNRESOLVED
    contact_force = 0.0
    d = h / n
    for _ in range(n):
        next_s, next_v = friction.move(s, v, m, f, friction_law, d)
        if next_s > surface:
            s, v, contact_force = next_s, next_v, 0.0
            continue
        flight_time = 0.0
        if s > surface:
            flight_time = min(d, time_to_contact(s - surface, v, (next_v - v) / d))
        if flight_time > 0.0:
            _, v = friction.move(s, v, m, f, friction_law, flight_time)
            s = surface
        s, v, contact_force = _advance_contact_with_friction(side, rates, s, v, f, d - flight_time)
    return s, v, contact_force


def _advance_contact_with_friction(
    side: Side, rates: Rates, s: float, v: float, f: float, d: float
) -> Finger:
    """One step of the stabilised constraint with friction; the contact force is held over it.

    The force is that of the mean rate and the mean gap, found by iteration. It takes the energy
    2·alpha·m·d·(mean velocity)^2 and gives none.
    """
    surface, m, friction_law = side
    alpha, beta = rates
    contact_force = max(0.0, -f)
    next_s, next_v = s, v
    for _ in range(MAX_FORCE_ITERATIONS if d > 0.0 else 0):
        next_s, next_v = friction.move(s, v, m, f + contact_force, friction_law, d)
        mean_rate, mean_gap = (next_s - s) / d, 0.5 * (s + next_s) - surface
        # (C1) for g'', in m·g'' = f + f_c
        contact_force = max(0.0, -m * (2.0 * alpha * mean_rate + beta * beta * mean_gap) - f)
    return next_s, next_v, contact_force if next_s <= surface else 0.0


def _free_flight(s: float, v: float, acceleration: float, d: float) -> Finger:
    """The finger after d seconds without contact, exactly."""
    next_v = v + acceleration * d
    return s + 0.5 * d * (v + next_v), next_v, 0.0


def _advance_contact(side: Side, rates: Rates, s: float, v: float, f: float, d: float) -> Finger:
    """One trapezoidal step of the stabilised constraint; the contact force is held over it.

    The rule takes the energy 2·alpha·m·d·(mean velocity)^2 and gives none, whatever d is.
    """
    surface, m, _ = side
    alpha, beta = rates
    # g'' of (C1) at the mean of both ends
    constrained = -(2.0 * alpha * v + beta * beta * (s - surface + 0.5 * d * v)) / (
        1.0 + alpha * d + 0.25 * beta * beta * d * d
    )
    contact_force = max(0.0, m * constrained - f)  # m·g'' = f + f_c, and no pull
    acceleration = (f + contact_force) / m
    next_s, next_v, _ = _free_flight(s, v, acceleration, d)
    if next_s > surface:
        return _lift_off(side, surface - s, v, acceleration, f, d)
    return next_s, next_v, contact_force


def _lift_off(
    side: Side, depth: float, v: float, acceleration: float, f: float, d: float
) -> Finger:
    """The contact lets go where the finger passes the surface, depth m further out.

    A finger that would be back before the end of the sub-step stays: so short a bounce is not
    resolved, and taking its energy lets a pressed finger come to rest.
    """
    surface, m, _ = side
    leaving_v = sqrt(max(0.0, v * v + 2.0 * acceleration * depth))
    time_to_surface = 2.0 * depth / (v + leaving_v) if depth > 0.0 else 0.0
    remaining = d - time_to_surface
    if time_to_contact(0.0, leaving_v, f / m) < remaining:
        return surface, 0.0, max(0.0, -f)
    return _free_flight(surface, leaving_v, f / m, remaining)
