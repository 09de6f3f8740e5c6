"""The gripper rises with an object between its fingertips, which sticks or slips at each of them.

    m·y'' = T_1 + T_2 + N - m·g,  |T_j| <= mu·N_j    (L1)

The fingertips are at one height Y, the object at y above its floor, which pushes with N >= 0 only.
Equations: plant/README.md
"""

from dataclasses import dataclass
from math import copysign, sqrt
from typing import Annotated, NamedTuple

from block_variables import Group, Parameter

from .box import GRAVITY

Pair = tuple[float, float]
"""A value per finger: right, left."""


@dataclass(frozen=True, slots=True)
class Lift(Group, name="lift"):
    """A quick robot, and no lift before it is enabled."""

    enabled: Annotated[
        bool, Parameter("the gripper lifts; off, it stays or stops", tunable=True)
    ] = False
    time: Annotated[
        float,
        Parameter(
            "moment from which the gripper lifts if that is enabled",
            unit="s",
            low=0.0,
            high=1e6,
            tunable=True,
        ),
    ] = 0.0
    acceleration: Annotated[
        float,
        Parameter(
            "a, acceleration of the lift, and its deceleration",
            unit="m/s2",
            low=1e-3,
            high=1e3,
            tunable=True,
        ),
    ] = 2.0
    speed: Annotated[
        float,
        Parameter("highest speed of the lift", unit="m/s", low=1e-3, high=100.0, tunable=True),
    ] = 0.25
    height: Annotated[
        float,
        Parameter("height to which the lift goes", unit="m", low=0.0, high=100.0, tunable=True),
    ] = 0.1  # fmt: skip


class Height(NamedTuple):
    """Of the fingertips Y above where they began, of the object y above its floor, m; rates."""

    tips: float
    tips_rate: float
    body: float
    body_rate: float


REST = Height(0.0, 0.0, 0.0, 0.0)


class Load(NamedTuple):
    """What the fingertips carry, in N: T_1, T_2; m·(g + a), which takes them to stick."""

    tangential: Pair
    demand: float


NO_LOAD = Load((0.0, 0.0), 0.0)


def slip(y: Height) -> float:
    """How far the object has slipped down along the fingertips, m."""
    return y.tips - y.body


def floor_force(m: float, y: Height, load: Load) -> float:
    """N in (L1), of m kg; 0 for an object that hangs."""
    t_1, t_2 = load.tangential
    return max(0.0, m * GRAVITY - (t_1 + t_2)) if y.body <= 0.0 else 0.0


def rise(p: Lift, y: Height, lifting: bool, d: float) -> Pair:
    """Y in m and Y' in m/s d seconds later: as fast as the limits allow, at rest at the height."""
    a, v = p.acceleration, y.tips_rate
    top = p.speed if lifting else 0.0
    # From which a brakes it at the height: Y + d·(v + w)/2 + w^2/(2·a) = height, for w
    half = 0.5 * a * d
    way = p.height - y.tips - 0.5 * d * v
    braking = sqrt(half * half + 2.0 * a * way) - half if way > 0.0 else 0.0
    w = max(0.0, v - a * d, min(v + a * d, top, braking))
    return y.tips + 0.5 * d * (v + w), w


def carry(m: float, y: Height, tips: Pair, holds: Pair, d: float) -> tuple[Height, Load]:
    """The object of m kg d seconds later, and its load; holds are mu·N_j in N, tips Y and Y'.

    The object sticks where the fingertips can hold it to their speed, which is met at the end.
    """
    hold_1, hold_2 = holds
    hold = hold_1 + hold_2
    way, speed = tips
    v = y.body_rate
    if y.body <= 0.0 and v == 0.0 and speed <= 0.0:
        return Height(way, speed, y.body, 0.0), NO_LOAD
    sticking = m * (GRAVITY + (speed - v) / d)
    total = min(max(sticking, -hold), hold)
    w = v + d * (total / m - GRAVITY)  # (L1)
    height = y.body + 0.5 * d * (v + w)
    demand = m * abs(GRAVITY + (speed - y.tips_rate) / d)
    if height <= 0.0 and w <= 0.0:
        height, w = 0.0, 0.0
    return Height(way, speed, height, w), Load(shares(total, holds), demand)


def shares(total: float, holds: Pair) -> Pair:
    """T_1 and T_2 of a total in N: halves, or what one cannot hold of its half, the other does."""
    hold_1, hold_2 = holds
    smaller = copysign(min(0.5 * abs(total), hold_1, hold_2), total)
    larger = total - smaller
    return (smaller, larger) if hold_1 <= hold_2 else (larger, smaller)
