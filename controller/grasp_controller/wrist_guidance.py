"""Layer 3 of a gripper in tandem: the wrist goes to where both fingers arrive together.

By Eq. (9) d·tanh(rho)/n is how far the middle of the object is from the wrist, to first order and
whatever gap and colour are:

    rho  = (xi_1 - e^beta·xi_2)/(xi_1 + e^beta·xi_2)         d = min(mean gap, w) + l_0
    T    = X + S·d·tanh(rho)/n                               within the fingertips of the start
    S    = product of xi_j^2/(xi_j^2 + (4·sigma)^2)          1 where both sensors see anything
    X_c' = clip(g·(1 - h')·(T - X_c), ±v_max)                g = 0.8/max(2/omega + tau, 0.06 s)
    h'   = h·(1 - min(1, (10·rho)^2))                        h of holding.py
"""

from dataclasses import dataclass
from functools import cached_property
from math import copysign, expm1, pi
from typing import Annotated

from block_variables import Group, Parameter, check

SHARE = 0.8
"""g as a share of 1/(2/omega + tau), the lag of a critically damped wrist and of its command.

T hardly depends on where the wrist is, so the lag is in no loop as long as d is right. Before its
colours are learnt an object of alpha = 0.3 seems 2.9 times as far: a loop up to a share of 1.4.
"""

SHORTEST_LAG = 0.06
"""s; a faster command gains nothing, as the grip takes 2 s, and follows every error of T."""

STEADY = 3.0
"""Closing speed over the wrist's from which on both fingers move alike. It allows for light and
positions that do not agree in time.
"""

FAINT = 4.0
"""Standard deviations of the noise, of an intensity that is seen by half: 1 mV, white in 2 m."""

DISAGREEING = 10.0
"""1/|rho| from which on the sensors do not agree on a grasp: 10 %, some tenth of d."""


@dataclass(frozen=True)  # no slots: what is worked out from the parameters is kept
class Wrist(Group, name="wrist"):
    """What is known of the wrist: the same words as at the plant.

    The speed limit is that of a robot next to people, ISO 10218-1.
    """

    bandwidth: Annotated[
        float,
        Parameter(
            "omega/(2·pi), natural frequency of the wrist's servo",
            unit="Hz",
            low=0.1,
            high=1000.0,
            tunable=True,
        ),
    ] = 5.0
    delay: Annotated[
        float,
        Parameter(
            "tau, delay of the command to the wrist", unit="s", low=0.0, high=10.0, tunable=True
        ),
    ] = 0.0
    speed_limit: Annotated[
        float,
        Parameter(
            "v_max, highest speed that the wrist is commanded to have",
            unit="m/s",
            low=1e-6,
            high=100.0,
            tunable=True,
        ),
    ] = 0.25

    def __post_init__(self) -> None:
        check(self, "wrist")

    @cached_property
    def gain(self) -> float:
        """g, 1/s."""
        return SHARE / max(1.0 / (pi * self.bandwidth) + self.delay, SHORTEST_LAG)


def agreed(hold: float, rho: float) -> float:
    """h', as h, but a grasp only as far as both sensors agree.

    What rho is left in a grasp, by noise and electronics, hardly moves the wrist: it is squared.
    """
    disagreement = DISAGREEING * rho
    return hold * (1.0 - min(1.0, disagreement * disagreement))


def steadiness(closing: float, moving: float) -> float:
    """How much of a point counts for a line while the grip closes and the wrist moves, in m/s.

    Positions that come late bend the line of a finger by how its speed changes. Only while the
    wrist is at rest both fingers' lines are bent alike, and their ratio stays.
    """
    closed, moved = closing * closing, STEADY * STEADY * moving * moving
    return closed / (closed + moved) if moved > 0.0 else 1.0


def sight(noise: float, xi_1: float, xi_2: float) -> float:
    """S: 1 where both intensities are far above the noise, 0 where one is not; all in V.

    One that sees nothing, as a sensor that has failed, tells nothing of a middle.
    """
    least = FAINT * FAINT * noise * noise
    seen_1, seen_2 = xi_1 * xi_1, xi_2 * xi_2
    return seen_1 / (seen_1 + least) * (seen_2 / (seen_2 + least))


def within(place: float, fingertips: tuple[float, float]) -> float:
    """A place in m, no further than the fingertips, right and left, were at the start.

    The object is between them; so a sensor that fails does not send the wrist any further.
    """
    right, left = fingertips
    return min(max(place, left), right)


def move(p: Wrist, command: float, target: float, free: float, h: float) -> float:
    """X_c in m h seconds later, exactly for a target T in m that is held; `free` is 1 - h'."""
    gain, fastest = p.gain * free, p.speed_limit
    deviation = target - command
    distance = abs(deviation)
    at_limit = 0.0  # s for which the speed is limited
    if gain * distance > fastest:
        at_limit = min(h, (distance - fastest / gain) / fastest)
    limited = fastest * at_limit
    travel = limited - expm1(-gain * (h - at_limit)) * (distance - limited)
    return command + copysign(travel, deviation)  # (3T)
