"""A virtual object  M·e'' + D·e' + K·e = f,  advanced exactly for f held over the step.

e is the deviation from the reference. With sigma = D/2M, omega^2 = K/M and
r = sqrt(sigma^2 - omega^2) the deviation from its rest e_inf = f/K moves by

    exp(-sigma·h) · [ cosh(r·h) + sigma·S     S                    ]        S = sinh(r·h) / r
                    [ -omega^2·S              cosh(r·h) - sigma·S  ]

which holds for weak damping (r imaginary), critical damping (r = 0, S = h) and strong damping.
"""

from functools import lru_cache
from math import cos, exp, expm1, sin, sqrt

Motion = tuple[float, float]
"""Position in m and velocity in m/s."""

Matrix = tuple[float, float, float, float]
"""A 2 x 2 matrix, row by row."""


@lru_cache(maxsize=64)
def transition(m: float, d: float, k: float, h: float) -> Matrix:
    """The matrix above for m > 0 in kg, d >= 0 in N.s/m, k > 0 in N/m over h seconds.

    A pure function of its arguments; the cache only saves time.
    """
    sigma = 0.5 * d / m
    omega2 = k / m
    r2 = sigma * sigma - omega2
    if r2 > 0.0:
        r = sqrt(r2)
        slow = exp(-omega2 / (sigma + r) * h)
        s = -slow * expm1(-2.0 * r * h) / (2.0 * r)
        c = 0.5 * slow * (1.0 + exp(-2.0 * r * h))
    elif r2 < 0.0:
        r = sqrt(-r2)
        c = exp(-sigma * h) * cos(r * h)
        s = exp(-sigma * h) * sin(r * h) / r
    else:
        c = exp(-sigma * h)
        s = exp(-sigma * h) * h
    return c + sigma * s, s, -omega2 * s, c - sigma * s


def advance(a: Matrix, e: float, e_dot: float, e_inf: float) -> Motion:
    """The deviation e in m and its rate after the transition a, around rest = f/K in m."""
    a_11, a_12, a_21, a_22 = a
    z = e - e_inf
    return e_inf + a_11 * z + a_12 * e_dot, a_21 * z + a_22 * e_dot
