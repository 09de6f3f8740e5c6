"""Tells a grasp from an approach: the fingers press, move no more, and the light is at its end.

    p   = P^2/(P^2 + P_0^2) · w_0^2/(w_0^2 + w^2)     they press with P, and close with w     (R6)
    e_j = l_h^8/(l_h^8 + l_j^8)                       finger j is at a face, by its line      (R8)
    h   = p · product of (g_j·e_j + (1 - g_j)·p_f)                                            (R9)

Friction gives p, too. Without a line, g_j = 0, the light tells no gap: then p has to last, and p_f
is p behind a low-pass of T_h.
"""

from dataclasses import dataclass
from typing import Annotated

from block_variables import Group, Output, Parameter

from . import reflectance_ratio
from .low_pass import low_passed
from .reflectance_ratio import Learning, Line, Sensor

Hold = Annotated[
    float,
    Output("h, from 0 while approaching to 1 in a grasp", unit="1", nominal=1.0, depends_on=set()),
]


@dataclass(frozen=True, slots=True)
class Params(Group, name="hold"):
    """From which squeeze on, below which speed and within which gap it is a grasp.

    A gap of 3 mm allows for lines that err: with an error of 1.5 mm at the face, e_j is 0.996.
    """

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
    ] = 5e-4
    time_constant: Annotated[
        float,
        Parameter("low-pass of the speed of closing", unit="s", low=1e-6, high=1e3, tunable=True),
    ] = 0.02
    gap: Annotated[
        float,
        Parameter(
            "l_h, gap by a finger's line that is half a contact",
            unit="m",
            low=1e-6,
            high=1e3,
            tunable=True,
        ),
    ] = 3e-3
    blind_time: Annotated[
        float,
        Parameter(
            "T_h, time constant of a grasp of which the light tells nothing",
            unit="s",
            low=1e-6,
            high=1e3,
            tunable=True,
        ),
    ] = 1.0


def filtered(p: Params, previous: float, closing: float, h: float) -> float:
    """The low-passed speed of closing in m/s, h seconds later."""
    return low_passed(previous, closing, p.time_constant, h)


def lasting(p: Params, previous: float, pressed: float, h: float) -> float:
    """p_f h seconds later, `pressed` held."""
    return low_passed(previous, pressed, p.blind_time, h)


def pressed(p: Params, squeeze: float, closing: float) -> float:
    """Return p from the mean closing force in N and the low-passed speed of closing in m/s.

    1 is force without motion; fingers that pull apart have none.
    """
    squeeze = max(0.0, squeeze)
    square, slow = squeeze * squeeze, p.speed * p.speed
    denominator = (square + p.squeeze * p.squeeze) * (slow + closing * closing)
    return square * slow / denominator  # (R6)


def touching(p: Params, learning: Learning, eye: Sensor, line: Line, lasting: float) -> float:
    """How far a finger may be at its face, from 0 to 1; `lasting` is p_f.

    Light and way both tell the gap, and the smaller one counts: the light errs where a sensor
    saturates or fails, and the way where the object is carried along.
    """
    by_light = line.y * line.per_y
    by_way = line.mean_y * line.per_y + (line.s - line.mean_s)
    gap = min(by_light, by_way) + line.ahead - eye.l_0
    known = reflectance_ratio.known(learning, line)
    return known * near(p, gap) + (1.0 - known) * lasting  # a factor of (R9)


def near(p: Params, gap: float) -> float:
    """e_j from a gap in m, a half where it is `p.gap`."""
    ratio = max(0.0, gap) / p.gap
    square = ratio * ratio
    fourth = square * square
    return 1.0 / (1.0 + fourth * fourth)  # (R8)
