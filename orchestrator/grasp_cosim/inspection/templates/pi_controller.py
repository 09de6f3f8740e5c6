"""Closes each finger by itself: a PI controller of its speed, limited to the force of the grip.

    e_j = v_c - s_j·v_j          s_1 = -1, s_2 = +1: the direction in which finger j closes
    w_j' = K_i·e_j               w_j from 0 to F
    u_j = s_j·(w_j + K_p·e_j)    from -F to F

A finger that comes near, where xi_j is above xi_c, closes more slowly: v_c = v·xi_c / xi_j. One
that the object holds presses with F in the end. The integral is exact for inputs that are held.
"""

from dataclasses import dataclass
from typing import Annotated, NamedTuple

from block_variables import Input, Output, Parameter, check

Pair = tuple[float, float]
"""A value per finger: right, left."""


@dataclass(frozen=True, slots=True)
class Params:
    """Each with its meaning, unit and range; check() refuses what is out of it."""

    speed: Annotated[
        float, Parameter("v, at which a finger closes", unit="m/s", low=1e-6, high=1.0)
    ] = 0.1
    near: Annotated[
        float, Parameter("xi_c, intensity from which it slows down", unit="V", low=1e-6, high=10.0)
    ] = 0.1
    gain: Annotated[
        float, Parameter("K_p, proportional gain", unit="N.s/m", low=0.0, high=1e3, tunable=True)
    ] = 40.0
    integral_gain: Annotated[
        float, Parameter("K_i, integral gain", unit="N/m", low=0.0, high=1e4, tunable=True)
    ] = 400.0
    grip_force: Annotated[
        float, Parameter("F, of each finger", unit="N", low=0.0, high=100.0, tunable=True)
    ] = 3.0

    def __post_init__(self) -> None:
        check(self)


class Inputs(NamedTuple):
    """Each with its start value; nominal is the size that it usually has."""

    position: Annotated[Pair, Input("x_j, of the fingertip", unit="m", nominal=0.1)] = (0.0, 0.0)
    velocity: Annotated[Pair, Input("v_j, of the fingertip", unit="m/s", nominal=0.1)] = (0.0, 0.0)
    intensity: Annotated[Pair, Input("xi_j, of its sensor", unit="V", nominal=0.1)] = (0.0, 0.0)


class State(NamedTuple):
    """Whatever step() needs to go on from; floats, booleans, integers, and tuples of them."""

    integral: Pair


class Outputs(NamedTuple):
    """Each with the inputs it depends on without a step."""

    force: Annotated[
        Pair,
        Output(
            "u_j, on the finger", unit="N", nominal=1.0, depends_on={"velocity[j]", "intensity[j]"}
        ),
    ]


def initial_state(p: Params, u: Inputs) -> State:
    """No force yet."""
    return State((0.0, 0.0))


def step(p: Params, s: State, u: Inputs, h: float) -> State:
    """Advance by h seconds (h > 0), u held."""
    e_1, e_2 = _errors(p, u)
    w_1, w_2 = s.integral
    w_1 = _limited(w_1 + p.integral_gain * e_1 * h, 0.0, p.grip_force)
    w_2 = _limited(w_2 + p.integral_gain * e_2 * h, 0.0, p.grip_force)
    return State((w_1, w_2))


def outputs(p: Params, s: State, u: Inputs) -> Outputs:
    """The forces on the fingers."""
    e_1, e_2 = _errors(p, u)
    w_1, w_2 = s.integral
    force = p.grip_force
    f_1 = _limited(w_1 + p.gain * e_1, -force, force)
    f_2 = _limited(w_2 + p.gain * e_2, -force, force)
    return Outputs((-f_1, f_2))


def _errors(p: Params, u: Inputs) -> Pair:
    """How much too slowly each finger closes, in m/s."""
    v_1, v_2 = _closing_speed(p, u.intensity[0]), _closing_speed(p, u.intensity[1])
    return v_1 + u.velocity[0], v_2 - u.velocity[1]


def _closing_speed(p: Params, intensity: float) -> float:
    """The speed at which a finger is to close, in m/s."""
    return p.speed * p.near / max(p.near, intensity)


def _limited(force: float, low: float, high: float) -> float:
    return min(max(force, low), high)
