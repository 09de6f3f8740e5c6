"""One finger against a rigid surface: unilateral contact, Baumgarte stabilised.

Everything is counted in the direction in which the finger opens, the gap g = s - surface:
m·g'' = f + f_c, with the actuator's force f and the contact's f_c >= 0. Equation (C1) and card:
plant/README.md
"""

from math import nan, sqrt
from typing import NamedTuple

from . import fingers, friction
from .fingers import Side
from .friction import Motion
from .touch import Touch, from_point, met, pressed, time_to_contact


class Finger(NamedTuple):
    """Position s in m and velocity in m/s (opening positive), contact force in N (>= 0), its touch.

    One that would take more sub-steps than there are is nowhere (nan): the step is refused.
    """

    s: float
    v: float
    force: float
    touch: Touch


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


def advance(
    side: Side, rates: Rates, s: float, v: float, f: float, h: float, touch: Touch, now: float
) -> Finger:
    """Advance a finger at s m with v m/s by h seconds, the actuator force f in N held.

    Without friction free flight is exact, and so is the moment of contact within a sub-step. `now`
    is the time of the begin in s since the start.
    """
    surface, m, friction_law = side
    touch = from_point(touch, s <= surface)
    if friction.acts(friction_law):
        return _advance_with_friction(side, rates, s, v, f, h, touch, now)
    if time_to_contact(s - surface, v, f / m) >= h:
        return _free_flight(side, s, v, f, h, touch, now)
    n = fingers.substep_count(fastest(rates), h)
    if n > fingers.MAX_SUBSTEPS:
        return Finger(nan, nan, nan, touch)
    contact_force = 0.0
    d = h / n
    for i in range(n):
        begin = now + i * d
        flight_time = time_to_contact(s - surface, v, f / m)
        if flight_time >= d:
            s, v, contact_force, touch = _free_flight(side, s, v, f, d, touch, begin)
        else:
            if flight_time > 0.0:
                _, v = _moved(s, v, f / m, flight_time)
                s = surface
            touch = met(touch, begin + flight_time, -v)
            s, v, contact_force, touch = _advance_contact(
                side, rates, s, v, f, d - flight_time, touch, begin + flight_time
            )
    return Finger(s, v, contact_force, touch)


def _advance_with_friction(
    side: Side, rates: Rates, s: float, v: float, f: float, h: float, touch: Touch, now: float
) -> Finger:
    """advance() of a finger with friction, which acts in addition to the contact force."""
    surface, m, friction_law = side
    n = fingers.substep_count(max(fastest(rates), friction.rate(friction_law, m)), h)
    if n > fingers.MAX_SUBSTEPS:
        return Finger(nan, nan, nan, touch)
    contact_force = 0.0
    d = h / n
    for i in range(n):
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
        begin = now + i * d + flight_time
        touch = met(touch, begin, -v)
        s, v, contact_force, touch = _advance_contact_with_friction(
            side, rates, s, v, f, d - flight_time, touch, begin
        )
    return Finger(s, v, contact_force, touch)


def _advance_contact_with_friction(
    side: Side, rates: Rates, s: float, v: float, f: float, d: float, touch: Touch, begin: float
) -> Finger:
    """One step of the stabilised constraint with friction; the contact force is held over it.

    The force is that of the mean rate and the mean gap, found by iteration. It takes the energy
    2·alpha·m·d·(mean velocity)^2 and gives none.
    """
    surface, m, friction_law = side
    alpha, beta = rates
    contact_force = max(0.0, -f)
    next_s, next_v = s, v
    force_acted = 0.0
    for _ in range(MAX_FORCE_ITERATIONS if d > 0.0 else 0):
        force_acted = contact_force
        next_s, next_v = friction.move(s, v, m, f + contact_force, friction_law, d)
        mean_rate, mean_gap = (next_s - s) / d, 0.5 * (s + next_s) - surface
        # (C1) for g'', in m·g'' = f + f_c
        contact_force = max(0.0, -m * (2.0 * alpha * mean_rate + beta * beta * mean_gap) - f)
    touch = pressed(touch, begin, d, force_acted)
    return Finger(next_s, next_v, contact_force if next_s <= surface else 0.0, touch)


def _moved(s: float, v: float, acceleration: float, d: float) -> Motion:
    """Position in m and velocity in m/s after d seconds, the acceleration in m/s^2 held."""
    next_v = v + acceleration * d
    return s + 0.5 * d * (v + next_v), next_v


def _free_flight(
    side: Side, s: float, v: float, f: float, d: float, touch: Touch, begin: float
) -> Finger:
    """The finger after d seconds without contact, exactly; it may end where the object begins."""
    surface, m, _ = side
    next_s, next_v = _moved(s, v, f / m, d)
    if next_s <= surface:
        touch = met(touch, begin + d, -next_v)
    return Finger(next_s, next_v, 0.0, touch)


def _advance_contact(
    side: Side, rates: Rates, s: float, v: float, f: float, d: float, touch: Touch, begin: float
) -> Finger:
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
    next_s, next_v = _moved(s, v, (f + contact_force) / m, d)
    if next_s > surface:
        return _lift_off(side, s, v, contact_force, f, d, touch, begin)
    return Finger(next_s, next_v, contact_force, pressed(touch, begin, d, contact_force))


def _lift_off(
    side: Side,
    s: float,
    v: float,
    contact_force: float,
    f: float,
    d: float,
    touch: Touch,
    begin: float,
) -> Finger:
    """The contact lets go where the finger passes the surface.

    A finger that would be back before the end of the sub-step stays: so short a bounce is not
    resolved, and taking its energy lets a pressed finger come to rest. The impulse is that of the
    force while it acts, or of a finger that stays, all that stops it.
    """
    surface, m, _ = side
    depth, acceleration = surface - s, (f + contact_force) / m
    leaving_v = sqrt(max(0.0, v * v + 2.0 * acceleration * depth))
    time_to_surface = 2.0 * depth / (v + leaving_v) if depth > 0.0 else 0.0
    remaining = d - time_to_surface
    if time_to_contact(0.0, leaving_v, f / m) < remaining:
        mean_force = max(0.0, -f - m * v / d)  # m·(0 - v) = (f + mean force)·d
        return Finger(surface, 0.0, max(0.0, -f), pressed(touch, begin, d, mean_force))
    touch = pressed(touch, begin, time_to_surface, contact_force)
    return _free_flight(side, surface, leaving_v, f, remaining, touch, begin + time_to_surface)
