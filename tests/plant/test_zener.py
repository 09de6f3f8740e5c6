"""A side that relaxes: known relaxation and creep, the exact ramp, a pad in series, its energy."""

from math import exp

import numpy as np
import pytest
from gripper_plant import zener
from gripper_plant.zener import Pad, Side
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from support.marks import examples

QUICK = examples(60)

LAW = 300.0, 700.0, 0.4
"""k_inf in N/m, k_1 in N/m, tau in s."""


def pressed(law, depth):
    """Z after a depth that was reached at once."""
    _, z = zener.press(law, 0.0, 0.0, depth, 1e-12)
    return z


@pytest.mark.parametrize("h", [1e-3, 0.1, 3.0])
def test_relaxation_at_a_held_squeeze_is_the_closed_form(h):
    """F = d·(k_inf + k_1·exp(-t/tau)), whatever the step."""
    k_inf, k_1, tau = LAW
    depth = 2e-3
    z, t = pressed(LAW, depth), 0.0
    for _ in range(10):
        mean, z = zener.press(LAW, z, depth, depth, h)
        decay = tau / h * (exp(-t / tau) - exp(-(t + h) / tau))
        t += h
        assert mean == pytest.approx(depth * (k_inf + k_1 * decay), rel=1e-9)
        closed = depth * (k_inf + k_1 * exp(-t / tau))
        assert zener.force(LAW, depth, z) == pytest.approx(closed, rel=1e-9)


def test_creep_under_a_held_force_is_the_closed_form():
    k_inf, k_1, tau = LAW
    force, h = 1.5, 2e-3
    depth = force / (k_inf + k_1)
    z = pressed(LAW, depth)
    for k in range(1, 501):
        start, before = depth, z
        depth = brentq(
            lambda d, b=before, s=start: zener.press(LAW, b, s, d, h)[0] - force, 0.0, 0.01
        )
        _, z = zener.press(LAW, before, start, depth, h)
        retardation = tau * (k_inf + k_1) / k_inf
        closed = force / k_inf * (1.0 - k_1 / (k_inf + k_1) * exp(-k * h / retardation))
        assert depth == pytest.approx(closed, rel=1e-5)


def test_a_surface_that_nothing_touches_comes_back():
    k_inf, k_1, tau = LAW
    z = 1e-3
    begin = zener.surface(LAW, z)
    for _ in range(7):
        force, z = zener.press(LAW, z, -0.01, -0.02, 0.3)
        assert force == 0.0
    back = exp(-2.1 * k_inf / (tau * (k_inf + k_1)))
    assert zener.surface(LAW, z) == pytest.approx(begin * back, rel=1e-12)
    assert zener.force(LAW, zener.surface(LAW, z), z) == pytest.approx(0.0, abs=1e-15)


def of_a_ramp(law, z, start, end, d):
    """Mean force, z and the energy that the dashpot wastes, by an ODE solver."""
    k_inf, k_1, tau = law
    speed = (end - start) / d

    def rates(t, y):
        depth = start + speed * t
        stretch = depth - y[0]
        return [stretch / tau, k_inf * depth + k_1 * stretch, k_1 * stretch * stretch / tau]

    y = solve_ivp(rates, (0.0, d), (z, 0.0, 0.0), "LSODA", rtol=1e-11, atol=1e-15).y[:, -1]
    return y[1] / d, y[0], y[2]


@pytest.mark.parametrize("tau", [1e-3, 0.4, 1e4])
@pytest.mark.parametrize("end", [2e-3, 4e-3, 1.9e-3])
def test_a_ramp_is_exact_and_its_work_is_stored_or_wasted(tau, end):
    law, z, start, d = (300.0, 700.0, tau), 1e-3, 2e-3, 7e-3
    force, next_z = zener.press(law, z, start, end, d)
    mean, expected_z, wasted = of_a_ramp(law, z, start, end, d)
    assert force == pytest.approx(mean, rel=1e-8)
    assert next_z == pytest.approx(expected_z, rel=1e-8)
    stored = zener.energy(law, end, next_z) - zener.energy(law, start, z)
    assert force * (end - start) == pytest.approx(stored + wasted, rel=1e-7, abs=1e-12)


def test_the_impulse_is_right_where_the_contact_begins_on_the_way():
    force, next_z = zener.press(LAW, 0.0, -1e-3, 3e-3, 0.02)
    mean, expected_z, _ = of_a_ramp(LAW, 0.0, 0.0, 3e-3, 0.015)
    assert force * 0.02 == pytest.approx(mean * 0.015, rel=1e-9)
    assert next_z == pytest.approx(expected_z, rel=1e-9)


DEPTHS = st.floats(-2e-3, 5e-3)


@QUICK
@given(
    st.tuples(st.floats(10.0, 1e4), st.floats(0.0, 1e4), st.floats(1e-4, 1e3)),
    st.lists(st.tuples(DEPTHS, st.floats(1e-5, 0.1)), min_size=4, max_size=12),
)
def test_a_side_never_pulls_and_gives_no_more_than_it_was_given(law, history):
    depth, z = -1e-3, 0.0
    for to_depth, d in history:
        before = zener.energy(law, depth, z)
        force, next_z = zener.press(law, z, depth, to_depth, d)
        assert force >= 0.0
        after = zener.energy(law, to_depth, next_z)
        work = force * (to_depth - depth)
        assert after - before - work <= 1e-9 * (after + before + abs(work)) + 1e-18
        depth, z = to_depth, next_z


def test_side_and_pad_in_series_are_one_solid():
    """In statics by the closed form, at once and relaxed; on the way by an ODE of both."""
    side, k_p, depth = Side(300.0, 700.0, 0.4), 500.0, 3e-3
    law = zener.solid(side, Pad(k_p))
    at_once = depth / (1.0 / 1000.0 + 1.0 / k_p)
    relaxed = depth / (1.0 / 300.0 + 1.0 / k_p)
    z = pressed(law, depth)
    assert zener.force(law, depth, z) == pytest.approx(at_once, rel=1e-9)
    t = np.linspace(0.0, 1.0, 6)[1:]
    # The pad and the side share the depth: k_p·(depth - s) = 300·s + 700·(s - z)
    shared = solve_ivp(
        lambda _, y: [((k_p * depth + 700.0 * y[0]) / (1000.0 + k_p) - y[0]) / 0.4],
        (0.0, 1.0), [0.0], t_eval=t, rtol=1e-11, atol=1e-15,
    ).y[0]  # fmt: skip
    for way in shared:
        _, z = zener.press(law, z, depth, depth, 0.2)
        s = (k_p * depth + 700.0 * way) / (1000.0 + k_p)
        assert zener.force(law, depth, z) == pytest.approx(k_p * (depth - s), rel=1e-8)
    _, z = zener.press(law, z, depth, depth, 100.0)
    assert zener.force(law, depth, z) == pytest.approx(relaxed, rel=1e-9)


def test_a_rigid_pad_is_the_limit_of_a_stiff_one():
    side = Side(300.0, 700.0, 0.4)
    assert zener.solid(side, Pad(1e7)) == pytest.approx(zener.solid(side, Pad()), rel=3e-4)
