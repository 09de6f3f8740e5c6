"""Each of the controller's layers by itself, Eqs. (2) to (7), and noise in f_p."""

from itertools import accumulate, pairwise
from math import log, nan, nextafter, sqrt, tanh

import numpy as np
import pytest
from grasp_controller import contact_force as layer_1
from grasp_controller import impact_reduction as layer_2
from grasp_controller import simultaneous_contact as layer_3
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples

QUICK = examples(100)


def f_s(xi, gain=3.0):
    return layer_3.virtual_force(layer_3.Params(gain=gain), xi)


@pytest.mark.parametrize(
    ("xi", "share"),
    [
        ((3.0, 1.0), 0.46211715726), ((0.57, 1.0), -0.267236444052), ((0.2, 0.2), 0.0),
        ((0.0, 0.0), 0.0), ((-0.1, -0.2), 0.0), ((0.0, -1e-300), 0.0), ((5e-324, 5e-324), 0.0),
        ((5e-324, 0.0), tanh(1.0)), ((0.1, -0.5), tanh(1.0)), ((nan, 0.1), nan), ((nan, 0.0), nan),
    ],
)  # fmt: skip
def test_the_virtual_force_of_a_few_intensities(xi, share):
    """tanh(1/2) and tanh(-0.43/1.57); what is below zero counts as dark, no number as itself."""
    assert f_s(xi) == pytest.approx(3.0 * share, rel=1e-11, nan_ok=True)
    assert f_s(xi[::-1]) == pytest.approx(-3.0 * share, rel=1e-11, nan_ok=True)
    assert f_s(xi, -2.0) == pytest.approx(-2.0 * share, rel=1e-11, nan_ok=True)


def f_p(xi, before, h):
    return layer_2.virtual_forces(layer_2.Params(), xi, before, h)


def test_the_virtual_viscous_force_is_a_difference_of_logarithms():
    """0.6·ln(0.5/0.4)/0.001 and -0.6·ln(0.2/0.25)/0.001, which are ln(5/4) both."""
    expected = 0.6 * (log(5.0) - log(4.0)) / 1e-3
    assert f_p((0.5, 0.2), (0.4, 0.25), 1e-3) == pytest.approx((expected, expected), rel=1e-13)
    assert f_p((0.5, 0.2), (0.4, 0.25), 2e-3) == pytest.approx((expected / 2,) * 2, rel=1e-13)
    assert f_p((0.5, 0.2), (0.5, 0.2), 1e-3) == (0.0, 0.0)


@QUICK
@given(st.floats(1e-12, 1e3), st.floats(0.0, 0.999), st.floats(1.0, 10.0))
def test_below_the_floor_there_is_no_virtual_viscous_force(floor, share, excess):
    """Neither where the sample is below it nor where the one before was."""
    p = layer_2.Params(intensity_floor=floor)
    dark, bright = share * floor, (1.0 + excess) * floor
    assert layer_2.virtual_forces(p, (bright, dark), (dark, bright), 1e-3) == (0.0, 0.0)
    assert layer_2.virtual_forces(p, (dark, dark), (0.0, dark), 1e-3) == (0.0, 0.0)
    right, left = layer_2.virtual_forces(p, (bright, floor), (floor, bright), 1e-3)
    assert right > 0.0
    assert left > 0.0


@pytest.mark.parametrize("xi", [0.0, nextafter(1e-6, 0.0)])
def test_a_sensor_that_sees_nothing_does_not_disturb_the_other_finger(xi):
    right, left = f_p((0.5, xi), (0.4, 0.25), 1e-3)
    assert right == pytest.approx(600.0 * log(1.25), rel=1e-13)
    assert left == 0.0


@pytest.mark.parametrize(
    ("x", "x_dot", "virtual", "newtons"),
    [
        (0.11, -0.1, (0.05, 0.02), -4.2),
        (-0.11, 0.0, (0.0, 0.0), 10.78),
        (0.065, 0.0, (0.03, 0.0), -3.43),
        (0.03, 0.25, (0.03, 0.25), 0.0),
        (0.0, 1.0, (0.0, 0.0), -14.0),
    ],
)
def test_the_force_of_a_few_motions(x, x_dot, virtual, newtons):
    """-14·(x' - x_v1') - 98·(x - x_v1)."""
    assert layer_1.force(layer_1.Params(), x, x_dot, virtual) == pytest.approx(newtons, rel=1e-13)


TARGET = layer_3.Params(mass=1.5, damping=9.0, stiffness=40.0)
FINGER = layer_2.Params(mass=0.8, damping=12.0, stiffness=30.0)

HELD = [
    (0.00, 1.3, (0.4, -0.9), 0.040),
    (0.02, -0.7, (-2.0, 0.3), 0.013),
    (-0.01, 0.0, (0.0, 5.0), 0.070),
]
"""Desired position, virtual forces and how long they are held."""

START = ((0.01, 0.05), ((0.11, -0.02), (-0.10, 0.03)))


def derivative(z, x_d, force_s, force_p):
    """Of x_v2, x_v2', x_v11, x_v11', x_v21, x_v21', with the accelerations out of the equations."""
    x, v, *fingers = z
    a = (force_s - TARGET.damping * v - TARGET.stiffness * (x - x_d)) / TARGET.mass
    result = [v, a]
    for (y, w), force in zip((fingers[:2], fingers[2:]), force_p, strict=True):
        pull = force - FINGER.damping * (w - v) - FINGER.stiffness * (y - x)
        result += [w, a + pull / FINGER.mass]
    return result


def integrated():
    target, (right, left) = START
    z = [*target, *right, *left]
    for x_d, force_s, force_p, duration in HELD:
        motion = solve_ivp(
            lambda _, z, *held: derivative(z, *held),
            (0.0, duration),
            z,
            args=(x_d, force_s, force_p),
            method="DOP853",
            rtol=1e-12,
            atol=1e-14,
        )
        z = motion.y[:, -1].tolist()
    return z


def stepped(steps):
    """The two layers, every input held for so many steps."""
    target, virtual = START
    for x_d, force_s, force_p, duration in HELD:
        h = duration / steps
        for _ in range(steps):
            before, target = target, layer_3.advance(TARGET, target, x_d, force_s, h)
            virtual = layer_2.advance(FINGER, virtual, before, target, force_p, h)
    right, left = virtual
    return [*target, *right, *left]


@pytest.mark.parametrize("steps", [1, 2, 13, 100])
def test_the_virtual_objects_move_exactly_whatever_the_step(steps):
    np.testing.assert_allclose(stepped(steps), integrated(), rtol=0.0, atol=1e-11)


XI = 0.02
"""V; the order of what a dark face sends back."""

N = 50_000
"""Samples of a series of noise."""

SIGMAS = 5.0
"""So many standard errors a mean may be off: by chance once in two million draws."""


def right_f_p(xi, before, h):
    """Of finger 1, in N."""
    return f_p((xi, xi), (before, before), h)[0]


def noisy(s, r_1, seed):
    """Samples around XI: Gaussian, of relative standard deviation s, r_1 from one to the next."""
    first, *drawn = np.random.default_rng(seed).standard_normal(N + 1).tolist()
    own = sqrt(1.0 - r_1 * r_1)
    deviations = accumulate(drawn, lambda e, new: r_1 * e + own * new, initial=first)
    return [XI * (1.0 + s * e) for e in deviations]


@pytest.mark.parametrize(
    ("s", "r_1", "h", "seed"), [(0.066, 0.08, 1e-3, 1), (0.1, 0.5, 1e-3, 2), (0.1, 0.98, 1e-4, 3)]
)
def test_noise_biases_a_quotient_and_not_the_logarithms(s, r_1, h, seed):
    """The quotient has the mean -s^2·(1 - r_1)/h, and 3·s^2 of it more; the logarithms have none.

    With e and e' the relative noise of a sample and of the one before, the quotient is
    h·q = (e - e') + (e·e' - e^2) + ... The first part adds up to two samples' worth. The second
    has the mean -s^2·(1 - r_1), the variance s^4·(1 - r_1)·(3 - r_1), and where r_1 > 0 a negative
    correlation from term to term. What follows has the mean -3·s^4·(1 - r_1), -15·s^6·(1 - r_1).
    """
    xi = noisy(s, r_1, seed)
    bias = -s * s * (1.0 - r_1) / h
    of_the_ends = SIGMAS * sqrt(2.0) * s / (N * h)
    by_chance = SIGMAS * s * s * sqrt((1.0 - r_1) * (3.0 - r_1) / N) / h
    quotient = np.mean([(b - a) / (h * b) for a, b in pairwise(xi)])
    logarithms = np.mean([right_f_p(b, a, h) for a, b in pairwise(xi)]) / 0.6
    tolerance = of_the_ends + by_chance - 20.0 * s**4 * bias
    assert quotient == pytest.approx(bias * (1.0 + 3.0 * s * s), abs=tolerance)
    assert logarithms == pytest.approx(0.0, abs=of_the_ends)
    assert of_the_ends < -0.1 * bias  # no room for it
