"""Sliding and sticking: analytic, exact at the stop, and without chatter."""

from math import exp

import numpy as np
import pytest
from gripper_plant import compliant, friction, movable, rigid
from gripper_plant.fingers import Inputs
from gripper_plant.friction import Law, Params, move, resistance
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples

QUICK = examples(100)

STRIBECK = Law(0.4, 0.7, 2.0, 0.02, 0.0, 0.0)
MASSES = st.floats(0.01, 100.0)
SPEEDS = st.floats(-1.0, 1.0)
STEPS = st.floats(1e-5, 5e-3)


def run(x, v, m, f, law, d, n):
    for _ in range(n):
        x, v = move(x, v, m, f, law, d)
    return x, v


@pytest.mark.parametrize("n", [1, 3, 100])
def test_a_sliding_block_stops_after_its_stopping_distance(n):
    """v^2 / (2·mu·g), in whatever steps, and then it is at rest."""
    mu, g, v, m = 0.3, 9.80665, 0.8, 0.05
    law = Law(mu * m * g, mu * m * g, 0.0, 1.0, 0.0, 0.0)
    x, rate = run(0.1, v, m, 0.0, law, 0.5 / n, n)
    assert x == pytest.approx(0.1 + v**2 / (2.0 * mu * g), rel=1e-12)
    assert rate == 0.0


def test_a_block_that_is_pushed_back_stops_turns_and_goes():
    """Both ways on the analytic parabolas, though the stop is within the step."""
    m, v, f, mu = 2.0, 0.5, -9.0, 4.0
    law = Law(mu, mu, 0.0, 1.0, 0.0, 0.0)
    x, rate = move(0.0, v, m, f, law, 0.3)
    stop = v / ((mu - f) / m)
    back = (f + mu) / m
    assert x == pytest.approx(0.5 * v * stop + 0.5 * back * (0.3 - stop) ** 2, rel=1e-12)
    assert rate == pytest.approx(back * (0.3 - stop), rel=1e-12)


@QUICK
@given(MASSES, SPEEDS, st.floats(-5.0, 5.0), STEPS)
def test_friction_never_gives_energy(m, v, f, d):
    x, rate = move(0.0, v, m, f, STRIBECK, d)
    gained = 0.5 * m * (rate**2 - v**2) - f * x
    assert gained <= 1e-12 * (0.5 * m * (rate**2 + v**2) + abs(f * x))


def test_the_stribeck_curve():
    assert resistance(STRIBECK, 0.0) == 0.7
    assert resistance(STRIBECK, 0.02) == pytest.approx(0.4 + 0.3 / exp(1.0) + 0.04)
    assert resistance(STRIBECK, 1.0) == pytest.approx(2.4)


def test_the_order_of_convergence():
    """Second, on the whole Stribeck curve: half the step, a quarter of the error."""
    m, f, v, t = 0.5, -0.2, 0.08, 0.035
    motion = solve_ivp(
        lambda _, z: [z[1], (f - resistance(STRIBECK, z[1])) / m],
        (0.0, t), (0.0, v), method="DOP853", rtol=1e-12, atol=1e-14,
    )  # fmt: skip
    assert motion.y[1, -1] > 0.0  # it still slides
    steps = [40, 80, 160, 320]
    errors = [
        np.hypot(*(np.array(run(0.0, v, m, f, STRIBECK, t / n, n)) - motion.y[:, -1]))
        for n in steps
    ]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.1)


INNER = STRIBECK._replace(inner=0.6, inner_begin=0.0011)


@pytest.mark.parametrize("n", [1, 2, 7, 100])
@pytest.mark.parametrize("force", [-1.5, -0.8, 0.0])
def test_a_block_that_gets_into_the_inner_part(force, n):
    """On two parabolas, in whatever steps; the last two forces let it stop there."""
    m, v, outer, inner, x_0, border = 0.5, -0.4, 0.3, 0.9, 0.02, 0.005
    law = Law(outer, outer, 0.0, 1.0, inner, border)
    t = 0.1
    x, rate = run(x_0, v, m, force, law, t / n, n)
    before = (force + outer) / m
    v_border = -np.sqrt(v**2 + 2.0 * before * (border - x_0))
    t_border = (v_border - v) / before if before else (border - x_0) / v
    after_it = (force + outer + inner) / m
    remaining = t - t_border
    if v_border + after_it * remaining > 0.0 and abs(force) <= outer + inner:
        remaining = -v_border / after_it
    assert 0.0 < t_border < t
    assert x == pytest.approx(
        border + v_border * remaining + 0.5 * after_it * remaining**2, rel=1e-9, abs=1e-15
    )
    assert rate == pytest.approx(v_border + after_it * remaining, rel=1e-9, abs=1e-12)


def test_the_order_of_convergence_over_the_border():
    """Second there, too, on the Stribeck curve; the reference is solved up to the border and on."""
    m, f, v, t, x_0 = 0.5, -0.6, -0.08, 0.05, 0.003

    def rates(more):
        return lambda _, z: [z[1], (f + more + resistance(STRIBECK, -z[1])) / m]

    def border(_, z):
        return z[0] - INNER.inner_begin

    border.terminal = True
    exactly = {"method": "DOP853", "rtol": 1e-12, "atol": 1e-15}
    outer = solve_ivp(rates(0.0), (0.0, t), (x_0, v), events=border, **exactly)
    assert outer.status == 1
    inner = solve_ivp(rates(INNER.inner), (outer.t[-1], t), outer.y[:, -1], **exactly)
    assert inner.y[1, -1] < 0.0  # it still slides
    steps = [50, 100, 200, 400, 800]
    errors = [
        np.hypot(*(np.array(run(x_0, v, m, f, INNER, t / n, n)) - inner.y[:, -1])) for n in steps
    ]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.2)


@QUICK
@given(st.floats(-3e-3, 3e-3), MASSES, SPEEDS, st.floats(-5.0, 5.0), STEPS)
def test_the_inner_part_takes_energy(x_0, m, v, f, d):
    """At least what it has to take between both ends; a body that turns has the part's friction."""
    law = INNER._replace(inner_begin=0.0)
    x, rate = move(x_0, v, m, f, law, d)
    gained = 0.5 * m * (rate**2 - v**2) - f * (x - x_0)
    taken = law.coulomb * abs(x - x_0)
    if v * rate >= 0.0:
        taken += law.inner * abs(min(x, 0.0) - min(x_0, 0.0))
    assert gained <= -taken + 1e-9 * (0.5 * m * (rate**2 + v**2) + abs(f * (x - x_0)) + 1e-6)


def test_a_block_at_rest_inside_needs_a_greater_force():
    law = Law(0.3, 0.5, 0.0, 1.0, 0.4, 0.01)
    assert move(0.005, 0.0, 1.0, 0.89, law, 1e-3) == (0.005, 0.0)
    assert move(0.005, 0.0, 1.0, 0.91, law, 1e-3)[1] > 0.0
    assert move(0.015, 0.0, 1.0, 0.51, law, 1e-3)[1] > 0.0
    assert move(0.01, 0.0, 1.0, -0.89, law, 1e-3) == (0.01, 0.0)
    assert move(0.01, 0.0, 1.0, 0.51, law, 1e-3)[1] > 0.0


@pytest.mark.parametrize("plant", [rigid, compliant, movable])
def test_the_inner_part_of_a_finger_is_towards_the_other(plant):
    """A finger stops there by the friction that the other one has all along."""
    values = {"inner": (0.0, 0.4), "inner_begin": (0.0, -0.05), "coulomb": (0.2, 0.2)}
    p = plant.Params(object_width=0.0, initial_object_position=0.0, friction=Params(**values))
    x = plant.initial_state(p, Inputs())
    for _ in range(100):
        x = plant.step(p, x, Inputs((-0.5, 0.5)), 5e-3)
        if x.position[0] < 0.05:
            break
    (right, left), (v_1, v_2) = x.position, x.velocity
    assert left > -0.05
    assert v_2 < -v_1
    speed_at_border_2 = 0.36 / 5.0  # (0.5 - 0.2)/0.5 over 60 mm, squared
    border = {"rel": 1e-9}
    assert v_2**2 == pytest.approx(
        speed_at_border_2 - 2.0 * (0.6 - 0.5) / 0.5 * (left + 0.05), **border
    )
    assert v_1**2 == pytest.approx(2.0 * 0.6 * (0.11 - right), **border)


def gripper(**values):
    return rigid.Params(friction=Params(**values))


def after(p, x, force, h, n):
    for _ in range(n):
        x = rigid.step(p, x, Inputs(force), h)
    return x


def test_a_finger_sticks_until_its_own_breakaway_force():
    p = gripper(static=(0.5, 0.2))
    start = rigid.initial_state(p, Inputs())
    assert after(p, start, (-0.5, 0.2), 1e-3, 50)[:3] == start[:3]
    x = after(p, start, (-0.4, 0.21), 1e-3, 50)
    assert x.velocity[0] == 0.0
    assert x.velocity[1] > 0.0


def test_a_static_force_below_coulombs_counts_as_that():
    p = gripper(coulomb=(0.5, 0.5), static=(0.1, 0.9))
    assert [law[:4] for law in friction.laws(p.friction)] == [
        (0.5, 0.5, 0.0, 0.01),
        (0.5, 0.9, 0.0, 0.01),
    ]


@pytest.mark.parametrize("h", [1e-4, 1e-3, 5e-3])
def test_a_pressed_finger_with_friction_comes_to_rest_exactly(h):
    """In contact, and what the object bears is within the breakaway force of what is pressed."""
    p = gripper(coulomb=(0.1, 0.1), static=(0.15, 0.15), viscous=(1.0, 1.0))
    x = after(p, rigid.initial_state(p, Inputs()), (-3.0, 3.0), h, round(0.8 / h))
    y = rigid.outputs(p, x, Inputs((-3.0, 3.0)))
    assert y.velocity == (0.0, 0.0)
    assert y.contact == (True, True)
    assert np.abs(y.contact_force) == pytest.approx([3.0, 3.0], abs=0.15)
    assert np.abs(y.gap) == pytest.approx([0.0, 0.0], abs=0.15 / (0.5 * 200.0**2))
    assert after(p, x, (-3.0, 3.0), h, 10)[:3] == x[:3]
