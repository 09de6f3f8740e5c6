"""A grip force in newtons on top of layer 1: fingers press with F, however wide the object is.

By Eq. (7) their mean squeeze is A - D_i·v, at the end of a grasp K_i·W/2 with W unknown; v is the
speed at which they close. With F > 0 it is P - D_i·v:

    P  = A_F + g·max(0, F - A_F),    A_F = min(A, F + D_i·max(0, v))               (G1)
    g' = [c·(1 - g) - r·(1 - g_c)^2·g]/T,    g_c = min(1, 2·c)                     (G2)
    c  = P^2/(P^2 + P_0^2) · q(w/w_g) · product of q(xi_j'/xi_j/lambda_0)          (G3)

with q(x) = 1/(1 + x^4) and w = 2·v. So no finger closes with more than F on the mean. c tells a
contact: the fingers press, and no light rises any more. From c = 1/2 on, g goes to 1 with nothing
left over.
Derivation: controller/README.md
"""

from math import expm1, log
from typing import NamedTuple

from .low_pass import low_passed

LIFT_TIME = 0.4
"""T in s: slow for fingers of up to 2 kg on soft objects."""

RELEASE = 8.0
"""r: an object that is lost is let go within T/r = 50 ms."""

FILTER_TIME = 0.1
"""s, low-pass of w and of the rates of the light: 0.5 mV of noise at 0.3 V leaves 0.02 1/s."""

LEAST_SQUEEZE = 0.1
"""P_0 in N."""

CLOSING = 0.02
"""w_g in m/s: a soft object gives way no faster while the force rises."""

RISING = 0.2
"""lambda_0 in 1/s: layer 2 lets the light rise with K_a1·(W/2 + l)/D_p, 0.42 1/s at 20 mm."""


class State(NamedTuple):
    """g, and w in m/s behind the low-pass."""

    share: float
    closing: float


AT_REST = State(0.0, 0.0)


def change(grip_force: float, squeeze: float, brake: float, share: float) -> float:
    """Return P - A in N, what is added to the mean squeeze A - D_i·v; `brake` is D_i·v.

    There is a grip force, above 0.
    """
    drive = squeeze + brake
    limited = min(drive, grip_force + max(0.0, brake))
    return limited + share * max(0.0, grip_force - limited) - drive  # (G1)


def light_rate(floor: float, previous: float, xi: float, previous_xi: float, h: float) -> float:
    """xi'/xi in 1/s behind the low-pass, from two samples in V; 0 below the floor."""
    rate = 0.0 if xi < floor or previous_xi < floor else log(xi / previous_xi) / h
    return low_passed(previous, rate, FILTER_TIME, h)


def quiet(rate: float) -> float:
    """The factor q of a finger whose light changes at this rate in 1/s."""
    return _within(rate / RISING)


def advance(x: State, squeeze: float, closing: float, all_quiet: float, h: float) -> State:
    """The state h seconds later: P in N, the rate of closing in m/s and the product of q held."""
    closing = low_passed(x.closing, closing, FILTER_TIME, h)
    pressed = squeeze * squeeze if squeeze > 0.0 else 0.0
    least = LEAST_SQUEEZE * LEAST_SQUEEZE
    contact = pressed / (pressed + least) * _within(closing / CLOSING) * all_quiet  # (G3)
    apart = 1.0 - min(1.0, 2.0 * contact)
    rate = contact + RELEASE * apart * apart
    rest = contact / rate
    return State(x.share - expm1(-rate / LIFT_TIME * h) * (rest - x.share), closing)  # (G2)


def _within(x: float) -> float:
    square = x * x
    return 1.0 / (1.0 + square * square)
