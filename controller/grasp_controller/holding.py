"""Tells a grasp from an approach: the fingers press, and no longer move towards each other.

P: mean force with which they press         h = P^2/(P^2 + P_0^2) · w_0^2/(w_0^2 + w^2)    (R6)
"""

from dataclasses import dataclass
from typing import Annotated

from block_variables import Group, Output, Parameter

Hold = Annotated[
    float,
    Output("h, from 0 while approaching to 1 in a grasp", unit="1", nominal=1.0, depends_on=set()),
]


@dataclass(frozen=True, slots=True)
class Params(Group, name="hold"):
    """From which squeeze on, and below which speed, it is a grasp."""

    squeeze: Annotated[
        float,
        Parameter(
            "P_0, mean force that is half a grasp", unit="N", low=1e-6, high=1e12, tunable=True
        ),
    ] = 0.1
    speed: Annotated[
        float,
        Parameter(
            "w_0, speed of closing that is half a grasp",
            unit="m/s",
            low=1e-9,
            high=1e3,
            tunable=True,
        ),
    ] = 2e-3
    time_constant: Annotated[
        float,
        Parameter("low-pass of the speed of closing", unit="s", low=1e-6, high=1e3, tunable=True),
    ] = 0.02


def filtered(p: Params, previous: float, closing: float, h: float) -> float:
    """The low-passed speed of closing in m/s, h seconds later."""
    return previous + h / (p.time_constant + h) * (closing - previous)


def hold(p: Params, squeeze: float, closing: float) -> float:
    """Return h from the mean closing force in N and the low-passed speed of closing in m/s.

    1 is a grasp; fingers that pull apart have none.
    """
    squeeze = max(0.0, squeeze)
    pressed, slow = squeeze * squeeze, p.speed * p.speed
    denominator = (pressed + p.squeeze * p.squeeze) * (slow + closing * closing)
    return pressed * slow / denominator  # (R6)
