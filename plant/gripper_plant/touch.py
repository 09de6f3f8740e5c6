"""What a finger has felt of the object since the start: the contact force's impulse, and when and
how fast the finger touched first. So a contact between two communication points is not lost.

Everything is counted in the direction in which the finger opens: a force is >= 0, and the speed of
a touch is the rate at which the gap closes just before it. Equations: plant/README.md
"""

from math import inf, sqrt
from typing import Annotated, NamedTuple, TypeAlias

from block_variables import Output

from .friction import Pair

IMPACT_WINDOW = 0.02
"""s from the first contact; the impulse until then is that of the impact."""

NEVER = -1.0
"""s; the time of a first contact that has not come."""


class Touch(NamedTuple):
    """Of one finger, since the start."""

    impulse: float
    """Of the contact force, N.s."""
    first_time: float
    """Of the first contact, s; NEVER before."""
    speed: float
    """Of the first contact, m/s."""
    impact: float
    """Impulse within IMPACT_WINDOW from the first contact, N.s."""
    touched: bool
    """Since the last communication point."""


TouchPair = tuple[Touch, Touch]
"""Right, left."""


class Clock(NamedTuple):
    """Seconds since the start, and the rounding of that sum, which the next step takes up.

    So the sum is as exact as one double: it does not drift, however many steps it is of.
    """

    seconds: float
    carried: float


START = Clock(0.0, 0.0)
"""The clock at the start."""


def later(clock: Clock, h: float) -> Clock:
    """The clock h seconds later: the sum and its exact rounding (Knuth's TwoSum)."""
    y = h + clock.carried
    seconds = clock.seconds + y
    added = seconds - clock.seconds
    return Clock(seconds, (clock.seconds - (seconds - added)) + (y - added))


def initial(touches: bool) -> Touch:
    """At the start; a finger that touches has done so since then, without an impact."""
    return Touch(0.0, 0.0 if touches else NEVER, 0.0, 0.0, touches)


def from_point(x: Touch, touches: bool) -> Touch:
    """At a communication point, from which on `touched` counts again."""
    return x._replace(touched=touches)


def met(x: Touch, at: float, speed: float) -> Touch:
    """After a contact has begun at s since the start, the gap closing with a speed in m/s."""
    if x.first_time >= 0.0:
        return x._replace(touched=True)
    return Touch(x.impulse, at, max(0.0, speed), x.impact, True)


def pressed(x: Touch, begin: float, d: float, force: float) -> Touch:
    """After d seconds with a held, or a mean, contact force in N, from `begin` in s on."""
    in_window = min(d, max(0.0, x.first_time + IMPACT_WINDOW - begin))
    impulse, impact = x.impulse + d * force, x.impact + in_window * force
    return Touch(impulse, x.first_time, x.speed, impact, True)


def touches(gap: float, next_gap: float, force: float) -> bool:
    """True if a finger touches in a sub-step: at an end of it, in m, or by a force in N."""
    return gap <= 0.0 or next_gap <= 0.0 or force > 0.0


def meeting(gap: float, rate: float, free_gap: float, d: float) -> tuple[float, float]:
    """When in d seconds the gap runs out, in s from their begin, and its closing speed then in m/s.

    The gap in m closes from its rate in m/s on with a held acceleration. free_gap is the one after
    d seconds without this contact.
    """
    acceleration = 2.0 * (free_gap - gap - d * rate) / (d * d)
    moment = min(d, time_to_contact(gap, rate, acceleration))
    return moment, -(rate + moment * acceleration)


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


ContactImpulse: TypeAlias = Annotated[
    Pair,
    Output(
        "impulse of the contact force since the start",
        unit="N.s",
        nominal=0.01,
        depends_on=set(),
    ),
]
FirstContactTime: TypeAlias = Annotated[
    Pair,
    Output(
        "time of the first contact since the start; -1 before",
        unit="s",
        nominal=1.0,
        depends_on=set(),
    ),
]
ImpactVelocity: TypeAlias = Annotated[
    Pair,
    Output(
        "rate at which the gap closed at the first contact; 0 before",
        unit="m/s",
        nominal=0.1,
        depends_on=set(),
    ),
]
Touched: TypeAlias = Annotated[
    tuple[bool, bool],
    Output(
        "the finger touched since the last communication point, or touches now", depends_on=set()
    ),
]
ImpactImpulse: TypeAlias = Annotated[
    Pair,
    Output(
        "impulse of the contact force within 20 ms from the first contact",
        unit="N.s",
        nominal=0.01,
        depends_on=set(),
    ),
]
"""What is felt, as a plant puts it out."""


class Felt(NamedTuple):
    """The outputs of every plant with two fingers, in this order."""

    contact_impulse: ContactImpulse
    first_contact_time: FirstContactTime
    impact_velocity: ImpactVelocity
    touched: Touched
    impact_impulse: ImpactImpulse


def outputs(x: TouchPair) -> Felt:
    """What the plant puts out of its fingers' touches, the impulses with the sign of the force."""
    right, left = x
    return Felt(
        (right.impulse, 0.0 - left.impulse),
        (right.first_time, left.first_time),
        (right.speed, left.speed),
        (right.touched, left.touched),
        (right.impact, 0.0 - left.impact),
    )
