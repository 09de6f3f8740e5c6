"""Noise of the raw voltage, from MRG32k3a: a generator whose state is exact in doubles.

    x_n = (1403580·x_(n-2) -  810728·x_(n-3)) mod m_1,   m_1 = 2^32 - 209
    y_n = ( 527612·y_(n-1) - 1370589·y_(n-3)) mod m_2,   m_2 = 2^32 - 22853
    u_n = ((x_n - y_n) mod m_1) / (m_1 + 1),   m_1 in place of 0

L'Ecuyer, Operations Research 47 (1999) 159-164. No product reaches 2^53, so there is no rounding.
The period of 2^191 is cut into streams of 2^127 numbers: those of RngStreams (L'Ecuyer, Simard,
Chen and Kelton, Operations Research 50 (2002) 1073-1075) with its default seed.
"""

from dataclasses import dataclass
from functools import lru_cache
from math import cos, floor, fmod, log, pi, sqrt
from typing import Annotated

from block_variables import Group, Parameter

State = tuple[float, float, float, float, float, float]
"""x_(n-3), x_(n-2), x_(n-1), y_(n-3), y_(n-2), y_(n-1); whole numbers."""

Vector = tuple[float, float, float]

Matrix = tuple[Vector, Vector, Vector]
"""Row by row."""

M_1, M_2 = 4294967087.0, 4294944443.0

UNIT = 2.328306549295727688e-10
"""1 / (m_1 + 1)"""

JUMP_1: Matrix = (
    (2427906178.0, 3580155704.0, 949770784.0),
    (226153695.0, 1230515664.0, 3580155704.0),
    (1988835001.0, 986791581.0, 1230515664.0),
)
JUMP_2: Matrix = (
    (1464411153.0, 277697599.0, 1610723613.0),
    (32183930.0, 1464411153.0, 1022607788.0),
    (2824425944.0, 32183930.0, 2093834863.0),
)
"""What 2^127 draws do to the x and to the y."""


@dataclass(frozen=True, slots=True)
class Noise(Group, name="noise"):
    """Gaussian, by Box and Muller, and white.

    5 mV is what R^2 = 0.9992 of the paper's fit leaves, over gaps from 0 to 0.1 m.
    """

    enabled: Annotated[bool, Parameter("noise of the raw voltage")] = False
    standard_deviation: Annotated[
        float,
        Parameter(
            "standard deviation of a sample of the raw voltage",
            unit="V",
            low=0.0,
            high=10.0,
            tunable=True,
        ),
    ] = 0.005
    seed: Annotated[int, Parameter("equal seeds, equal noise", low=0, high=1_000_000_000)] = 1


def normal(s: State) -> tuple[float, State]:
    """A number of the standard normal distribution, and the generator's state after it."""
    u_1, s = uniform(s)
    u_2, s = uniform(s)
    return sqrt(-2.0 * log(u_1)) * cos(2.0 * pi * u_2), s


def uniform(s: State) -> tuple[float, State]:
    """A number between 0 and 1, both excluded, and the state after it."""
    x_3, x_2, x_1, y_3, y_2, y_1 = s
    x = fmod(1403580.0 * x_2 - 810728.0 * x_3, M_1)
    y = fmod(527612.0 * y_1 - 1370589.0 * y_3, M_2)
    x = x + M_1 if x < 0.0 else x
    y = y + M_2 if y < 0.0 else y
    z = x - y if x > y else x - y + M_1
    return z * UNIT, (x_2, x_1, x, y_2, y_1, y)


@lru_cache(maxsize=64)
def stream(number: float) -> State:
    """The state at the beginning of a stream: a whole number from 0 to 2^32 - 1.

    A pure function of its argument; the cache only saves time.
    """
    x: Vector = (12345.0, 12345.0, 12345.0)
    y = x
    jump_1, jump_2 = JUMP_1, JUMP_2
    for _ in range(32):
        half = floor(0.5 * number)
        if number != 2.0 * half:
            x, y = _image(jump_1, x, M_1), _image(jump_2, y, M_2)
        number = half
        jump_1, jump_2 = _square(jump_1, M_1), _square(jump_2, M_2)
    return (*x, *y)


def _square(a: Matrix, m: float) -> Matrix:
    r_1, r_2, r_3 = a
    columns = (
        (r_1[0], r_2[0], r_3[0]),
        (r_1[1], r_2[1], r_3[1]),
        (r_1[2], r_2[2], r_3[2]),
    )
    return _image(columns, r_1, m), _image(columns, r_2, m), _image(columns, r_3, m)


def _image(a: Matrix, v: Vector, m: float) -> Vector:
    r_1, r_2, r_3 = a
    return _dot(r_1, v, m), _dot(r_2, v, m), _dot(r_3, v, m)


def _dot(a: Vector, b: Vector, m: float) -> float:
    a_1, a_2, a_3 = a
    b_1, b_2, b_3 = b
    return fmod(_product(a_1, b_1, m) + _product(a_2, b_2, m) + _product(a_3, b_3, m), m)


def _product(a: float, b: float, m: float) -> float:
    """a·b mod m for whole numbers below 2^32, in two halves of 2^16 so that nothing is rounded."""
    high = floor(a / 65536.0)
    low = a - 65536.0 * high
    return fmod(65536.0 * fmod(high * b, m) + low * b, m)
