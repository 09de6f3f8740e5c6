"""Each of the controller's layers by itself, Eqs. (2) to (7)."""

from math import isnan, log, nan, nextafter, tanh

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


INTENSITIES = st.floats(1e-6, 10.0)
GAINS = st.floats(-1e3, 1e3)


# ------------------------------------------------- layer 3, the virtual force of Eq. (2)


def f_s(xi, gain=3.0):
    return layer_3.virtual_force(layer_3.Params(gain=gain), xi)


@pytest.mark.parametrize(
    ("xi", "newtons"),
    [
        ((3.0, 1.0), 1.38635147178),
        ((0.1, 0.3), -1.38635147178),
        ((0.2, 0.2), 0.0),
        ((0.57, 1.0), -0.801709332155),
    ],
)
def test_the_virtual_force_of_a_few_intensities(xi, newtons):
    """3 N times tanh(1/2) = 0.46211715726 and tanh(-0.43/1.57) = -0.267236444052."""
    assert f_s(xi) == pytest.approx(newtons, rel=1e-11)


@QUICK
@given(INTENSITIES, INTENSITIES, GAINS)
def test_the_virtual_force_is_bounded_and_odd(xi_1, xi_2, gain):
    force = f_s((xi_1, xi_2), gain)
    assert abs(force) <= abs(gain) * tanh(1.0)
    assert force == -f_s((xi_2, xi_1), gain)
    assert force == -f_s((xi_1, xi_2), -gain)


@pytest.mark.parametrize("xi", [(0.0, 0.0), (-0.1, 0.0), (-0.1, -0.2), (0.0, -1e-300)])
def test_no_virtual_force_where_neither_sensor_sees_anything(xi):
    assert f_s(xi) == 0.0


@pytest.mark.parametrize("xi", [5e-324, 1e-300, 0.1])
@pytest.mark.parametrize("nothing", [0.0, -1e-300, -0.5])
def test_all_of_the_virtual_force_where_one_sensor_sees_something(xi, nothing):
    assert f_s((xi, nothing)) == 3.0 * tanh(1.0)
    assert f_s((nothing, xi)) == -3.0 * tanh(1.0)
    assert f_s((xi, xi)) == 0.0


@pytest.mark.parametrize("xi", [(nan, 0.1), (0.1, nan), (nan, 0.0), (nan, nan)])
def test_an_intensity_that_is_no_number_is_not_taken_for_darkness(xi):
    assert isnan(f_s(xi))


# ------------------------------------------------------ layer 2, the virtual force of Eq. (5)


def f_p(xi, before, h):
    return layer_2.virtual_forces(layer_2.Params(), xi, before, h)


def test_the_virtual_viscous_force_is_a_difference_of_logarithms():
    """0.6·ln(0.5/0.4)/0.001 and -0.6·ln(0.2/0.25)/0.001, which are ln(5/4) both."""
    expected = 0.6 * (log(5.0) - log(4.0)) / 1e-3
    assert f_p((0.5, 0.2), (0.4, 0.25), 1e-3) == pytest.approx((expected, expected), rel=1e-13)
    assert f_p((0.5, 0.2), (0.4, 0.25), 2e-3) == pytest.approx((expected / 2,) * 2, rel=1e-13)
    assert f_p((0.5, 0.2), (0.5, 0.2), 1e-3) == (0.0, 0.0)


def test_the_virtual_viscous_force_opens_a_finger_that_approaches():
    right, left = f_p((0.3, 0.3), (0.2, 0.2), 1e-3)
    assert right > 0.0 > left


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


# ------------------------------------------------------------- layer 1, the force of Eq. (7)


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


def test_damping_and_stiffness_have_their_own_parameters():
    assert layer_1.force(layer_1.Params(damping=2.0), 0.0, 1.0, (0.0, 0.0)) == -2.0
    assert layer_1.force(layer_1.Params(stiffness=5.0), 1.0, 0.0, (0.0, 0.0)) == -5.0


# ---------------------------------------------------- layers 3 and 2, the motion of Eqs. (3), (6)

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


@pytest.mark.parametrize("x_d", [0.0, -0.02])
def test_the_virtual_objects_rest_where_the_springs_bear_the_forces(x_d):
    """x_v2 = x_d + f_s/K_a2, x_vj1 = x_v2 + f_pj/K_a1."""
    before = target = (x_d + 3.0 / 36.0, 0.0)
    target = layer_3.advance(layer_3.Params(), before, x_d, 3.0, 0.01)
    assert target == pytest.approx(before, abs=1e-16)
    virtual = ((target[0] + 2.0 / 25.0, 0.0), (target[0] - 1.0 / 25.0, 0.0))
    after = layer_2.advance(layer_2.Params(), virtual, before, target, (2.0, -1.0), 0.01)
    assert after[0] == pytest.approx(virtual[0], abs=1e-15)
    assert after[1] == pytest.approx(virtual[1], abs=1e-15)


def test_the_desired_position_is_the_middle():
    assert layer_3.desired_position((0.11, -0.11)) == 0.0
    assert layer_3.desired_position((0.5, 0.25)) == 0.375
