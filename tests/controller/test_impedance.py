"""A virtual object's exact transition, against other ways of solving its equation."""

from decimal import Decimal, localcontext
from math import inf, isfinite, nextafter, sqrt

import numpy as np
import pytest
from grasp_controller.impedance import advance, transition
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples


def oscillator(m, d, k, h):
    """What m·e'' + d·e' + k·e = 0 does to (e, e') in h seconds, row by row, in 120 digits.

    Taylor's series of the matrix scaled down to nearly nothing, squared up again.
    """
    with localcontext() as context:
        context.prec = 120
        mass, time = Decimal(m), Decimal(h)
        a = np.array([[Decimal(0), time], [-Decimal(k) / mass * time, -Decimal(d) / mass * time]])
        squarings = 0
        while abs(a).max() > Decimal("1e-6"):
            a, squarings = a / 2, squarings + 1
        power = result = np.array([[Decimal(1), Decimal(0)], [Decimal(0), Decimal(1)]])
        for n in range(1, 16):
            power = power @ a / n
            result = result + power
        for _ in range(squarings):
            result = result @ result
        return tuple(map(float, result.ravel()))


QUICK = examples(100)

EPS = float(np.finfo(float).eps)


def powers(low, high):
    """Numbers of all magnitudes from 10^low to 10^high."""
    return st.floats(low, high).map(lambda exponent: float(10.0**exponent))


MASSES = powers(-3.0, 3.0)
DAMPINGS = st.just(0.0) | powers(-6.0, 5.0)
STIFFNESSES = powers(-3.0, 6.0)
TIMES = powers(-6.0, -1.0)

CRITICAL = [(1.0, 12.0, 36.0), (1.0, 10.0, 25.0), (2.0, 8.0, 8.0), (0.25, 16.0, 256.0)]
"""Mass, damping, stiffness whose sigma^2 and omega^2 are the same floating point number."""

PUBLISHED = [
    pytest.param(1.0, 3.0, 36.0, id="weak"),
    pytest.param(1.0, 12.0, 36.0, id="critical"),
    pytest.param(1.0, 60.0, 36.0, id="strong"),
]


def scales(virtual):
    """The size the entries can have."""
    m, d, k, h = virtual
    s = min(h, sqrt(m / k), m / d if d else h)
    return 1.0, s, k / m * s, 1.0


def agree(a, b, virtual, roundings):
    """Equal but for roundings, each of which turns the phase omega·h by its share."""
    m, _, k, h = virtual
    tolerance = roundings * EPS * (1.0 + sqrt(k / m) * h)
    return all(
        abs(x - y) <= tolerance * size for x, y, size in zip(a, b, scales(virtual), strict=True)
    )


@QUICK
@given(MASSES, DAMPINGS, STIFFNESSES, TIMES)
def test_the_transition_is_exact_for_any_damping(m, d, k, h):
    a = transition(m, d, k, h)
    assert all(isfinite(entry) for entry in a)
    assert agree(a, oscillator(m, d, k, h), (m, d, k, h), roundings=8.0)


@pytest.mark.parametrize("m", [1e-3, 1e3])
@pytest.mark.parametrize("d", [0.0, 1e5])
@pytest.mark.parametrize("k", [1e-3, 1e6])
@pytest.mark.parametrize("h", [1e-6, 0.1])
def test_nothing_overflows_in_the_corners(m, d, k, h):
    a = transition(m, d, k, h)
    assert all(isfinite(entry) for entry in a)
    assert agree(a, oscillator(m, d, k, h), (m, d, k, h), roundings=8.0)


@pytest.mark.parametrize("h", [1e-4, 1e-2, 0.1])
@pytest.mark.parametrize(("m", "d", "k"), CRITICAL)
def test_nothing_jumps_at_critical_damping(m, d, k, h):
    """A relative change delta of the damping turns the transition by less than 2·sigma·h·delta."""
    here = transition(m, d, k, h)
    for beside in (nextafter(d, 0.0), nextafter(d, inf)):
        assert agree(transition(m, beside, k, h), here, (m, d, k, h), roundings=8.0)
    for delta in (-1e-3, -1e-6, -1e-9, -1e-12, 1e-12, 1e-9, 1e-6, 1e-3):
        beside = d * (1.0 + delta)
        a = transition(m, beside, k, h)
        turn = d / m * h * abs(delta)
        assert agree(a, here, (m, d, k, h), roundings=8.0 + turn / EPS)
        assert agree(a, oscillator(m, beside, k, h), (m, beside, k, h), roundings=8.0)


@pytest.mark.parametrize("start", [(0.3, 0.0), (0.0, -2.0), (-0.1, 0.7)])
@pytest.mark.parametrize(("m", "d", "k"), PUBLISHED)
def test_a_held_force_moves_the_object_around_its_rest(m, d, k, start):
    force, h = 5.0, 0.25
    motion = solve_ivp(
        lambda _, z: [z[1], (force - d * z[1] - k * z[0]) / m],
        (0.0, h),
        start,
        method="DOP853",
        rtol=1e-12,
        atol=1e-14,
    )
    after = advance(transition(m, d, k, h), *start, force / k)
    np.testing.assert_allclose(after, motion.y[:, -1], rtol=0.0, atol=1e-10)
