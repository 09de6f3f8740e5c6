"""What a delicate body tolerates: a squeeze, a force, a pressure, the impulse of a blow.

It is damaged, and stays so, from the first one on that is above its limit. Limits of 0 are none.
Equations: plant/README.md
"""

from typing import NamedTuple

from .touch import IMPACT_WINDOW

BLOW = IMPACT_WINDOW
"""s from where a finger touches: so long its contact force is a blow, later it holds."""


class Blow(NamedTuple):
    """Of a finger: how long it has touched in s, and its impulse over BLOW from then on in N.s."""

    time: float
    impulse: float


NO_BLOW = Blow(0.0, 0.0)


class Limits(NamedTuple):
    """In m, N, Pa, N.s; 0 is no limit."""

    squeeze: float
    force: float
    pressure: float
    impulse: float


def blow(b: Blow, force: float, d: float) -> Blow:
    """The blow of a finger d seconds later, its contact force in N held; over where it lets go."""
    if force == 0.0:
        return NO_BLOW
    share = min(1.0, max(0.0, BLOW - b.time) / d)
    return Blow(b.time + d, b.impulse + share * d * force)


def exceeded(limits: Limits, squeeze: float, force: float, area: float, impulse: float) -> bool:
    """True where a squeeze in m, a force in N on m^2 of area, or an impulse in N.s is too much."""
    return (
        above(squeeze, limits.squeeze)
        or above(force, limits.force)
        or above(force / area, limits.pressure)
        or above(impulse, limits.impulse)
    )


def above(value: float, limit: float) -> bool:
    """True for a value above a limit that there is."""
    return 0.0 < limit < value
