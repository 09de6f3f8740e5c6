"""A finger in free flight and against the object, with and without friction, against scipy."""

from itertools import count, islice
from math import inf, isfinite

import numpy as np
import pytest
from gripper_plant import contact, friction, rigid, touch
from gripper_plant.contact import Rates
from gripper_plant.fingers import MAX_SUBSTEPS, Side, substep_count
from gripper_plant.friction import Law
from gripper_plant.rigid import Inputs, Params
from gripper_plant.touch import time_to_contact
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples

M = 0.5  # kg
RATES = (Rates(200.0, 200.0), Rates(400.0, 200.0), Rates(20.0, 200.0))
"""Critical, strong and weak damping."""
VISCOUS = Law(0.0, 0.0, 5.0, 1.0, 0.0, 0.0)
STRIBECK = Law(0.4, 0.7, 2.0, 0.02, 0.0, 0.0)
INNER = STRIBECK._replace(inner=0.6, inner_begin=2e-3)


def run(s, v, f, rates, h, law=friction.NONE, m=M):
    """Step after step of a finger whose object begins at zero, the force held."""
    for finger in touching_run(s, v, f, rates, h, law, m):
        yield finger[:3]


def touching_run(s, v, f, rates, h, law=friction.NONE, m=M):
    """As run(), with what the finger has felt."""
    side, felt = Side(0.0, m, law), touch.initial(s <= 0.0)
    for k in count():
        s, v, contact_force, felt = contact.advance(side, rates, s, v, f, h, felt, k * h)
        yield s, v, contact_force, felt


def contact_force(s, v, f, rates):
    """What holds the stabilised constraint, g'' + 2 alpha g' + beta^2 g = 0, and never pulls."""
    alpha, beta = rates
    return max(0.0, -M * (2.0 * alpha * v + beta * beta * s) - f) if s <= 0.0 else 0.0


def exact(s, v, f, rates, law, times):
    """Positions and speeds by an integration that knows no step, stopped at each crossing of 0."""

    def slope(t, y):
        pushed = contact_force(min(y[0], side * 1e-30), y[1], f, rates) if side < 0 else 0.0
        return [y[1], (f + pushed - law[2] * y[1]) / M]

    def crosses(t, y):
        return y[0]

    crosses.terminal = True
    found, start, side = [], 0.0, -1 if s <= 0.0 and v <= 0.0 else 1
    while start < times[-1]:
        left = [t for t in times if t > start]
        crosses.direction = -side
        done = solve_ivp(
            slope,
            (start, left[-1]),
            [s, v],
            "DOP853",
            left,
            events=crosses,
            rtol=1e-11,
            atol=1e-15,
            max_step=1e-3,
        )
        found += [*zip(*done.y, strict=True)] if np.size(done.y) else []
        if not done.t_events[0].size:
            break
        start, (s, v) = done.t_events[0][0], done.y_events[0][0]
        s, side = 0.0, -side
    return np.array(found)


# Start and speed in m and m/s, force in N
CASES = {
    "flies": (0.01, -0.1, 0.0),
    "comes back": (2e-3, 0.05, -1.0),
    "arrives": (2e-3, -0.1, 0.0),
    "is pressed on": (2e-3, -0.1, -3.43),
    "is drawn off": (1e-5, -0.1, 5.0),
    "begins inside": (-1e-4, 0.0, -3.43),
    "leaves": (0.0, 0.02, 1.0),
}


@pytest.mark.parametrize("law", [friction.NONE, VISCOUS], ids=["free", "viscous"])
@pytest.mark.parametrize("rates", RATES, ids=["critical", "strong", "weak"])
@pytest.mark.parametrize("case", CASES)
def test_it_moves_as_scipy_has_it(case, rates, law):
    """In steps of 40 us, and to a quarter of that nearer in steps of half, as second order does."""
    s, v, f = CASES[case]
    times = np.arange(1, 26) * 1e-3
    expected = exact(s, v, f, rates, law, times)
    errors = []
    for h in (4e-5, 2e-5):
        every = round(1e-3 / h)
        rows = np.array([*islice(run(s, v, f, rates, h, law), every - 1, 25 * every, every)])
        errors.append(np.abs((rows[:, :2] - expected) / (1e-3, 0.1)).max())
        forces = [contact_force(*row, f, rates) for row in expected]
        assert rows[:, 2] == pytest.approx(forces, rel=0.0, abs=0.025 * max(forces) + 1e-9)
    assert errors[0] < (3e-3 if law is VISCOUS and rates is RATES[2] else 1e-4)
    assert errors[1] < errors[0] / 3.0 or errors[1] < 1e-12


@pytest.mark.parametrize("law", [friction.NONE, VISCOUS], ids=["free", "viscous"])
@pytest.mark.parametrize("rates", RATES, ids=["critical", "strong", "weak"])
@pytest.mark.parametrize("case", CASES)
def test_a_long_step_is_made_of_sub_steps(case, rates, law):
    """Which are those of a run in steps as long as they are, to the rounding."""
    n = max(substep_count(contact.fastest(rates), 5e-3), substep_count(law[2] / M, 5e-3))
    *_, fine = islice(run(*CASES[case], rates, 5e-3 / n, law), n)
    assert next(run(*CASES[case], rates, 5e-3, law)) == pytest.approx(fine, rel=1e-9, abs=1e-15)


@examples(100)
@given(
    st.floats(1e-3, 1e3), st.floats(-1e-3, 1e-3), st.floats(-1.0, 1.0), st.floats(-50.0, 50.0),
    st.floats(0.0, 2000.0), st.floats(0.0, 2000.0), st.floats(1e-5, 5e-3),
    st.sampled_from([friction.NONE, VISCOUS, STRIBECK, INNER]),
)  # fmt: skip
def test_the_object_never_pulls_and_gives_no_energy(m, s, v, a, alpha, beta, h, law):
    """Without an actuator: that of the motion, and of the depth as of a spring m beta^2."""
    rates = Rates(alpha, beta)
    assert all(force >= 0.0 for _, _, force in islice(run(s, v, m * a, rates, h, law, m), 10))
    before = inf
    for after, rate, _ in [(s, v, 0.0), *islice(run(s, v, 0.0, rates, h, law, m), 10)]:
        stored = 0.5 * m * (rate**2 + (beta * min(after, 0.0)) ** 2)
        assert stored <= before * (1.0 + 1e-12) + 1e-300
        before = stored


def test_time_to_contact_is_the_next_root_of_the_parabola():
    """Over gaps, rates and accelerations of every sign, by numpy's roots."""
    for gap in (1e-6, 1e-3, 1.0):
        for rate in (-2.0, -1e-3, 0.0, 1e-3, 2.0):
            for acceleration in (-50.0, -1.0, 0.0, 1e-4, 1.0, 50.0):
                roots = np.roots([0.5 * acceleration, rate, gap])
                ahead = [r.real for r in roots if abs(r.imag) < 1e-12 and r.real > 0.0]
                found = time_to_contact(gap, rate, acceleration)
                assert found == pytest.approx(min(ahead, default=inf), rel=1e-6)
    assert time_to_contact(-1e-9, 2.0, 50.0) == 0.0
    for rate, acceleration, expected in [
        (-1.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, -1.0, 0.0), (0.0, 1.0, inf), (1.0, -2.0, 1.0),
        (1.0, 0.0, inf),
    ]:  # fmt: skip
        assert time_to_contact(0.0, rate, acceleration) == expected


@pytest.mark.parametrize("h", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize(
    ("rates", "law"),
    [*((rates, friction.NONE) for rates in RATES), *((rates, VISCOUS) for rates in RATES[:2])],
)
def test_a_pressed_finger_comes_to_rest_and_leaves_when_the_force_turns(rates, law, h):
    *_, (s, v, force) = islice(run(2e-3, -0.1, -3.43, rates, h, law), round(3.0 / h))
    assert abs(s) < 1e-12
    assert abs(v) < 1e-10
    assert force == pytest.approx(3.43, rel=1e-8)
    *_, (s, v, force) = islice(run(s, v, 3.43, rates, h), round(0.01 / h))
    assert s == pytest.approx(0.5 * 6.86 * 0.01**2, abs=6.86 * 0.01 * 5e-4)
    assert (v, force) == (pytest.approx(0.0686, abs=6.86 * 5e-4), 0.0)


def test_a_finger_that_sticks_inside_stays():
    """Between it and the object any contact force within F_S of the actuator's is at rest."""
    law = Law(1.0, 1.0, 0.0, 1.0, 0.0, 0.0)
    *_, (s, v, force) = islice(run(-1e-5, 0.0, -3.43, RATES[0], 1e-3, law), 50)
    assert (s, v) == (-1e-5, 0.0)
    assert abs(force - 3.43) <= 1.0


@pytest.mark.parametrize("viscous", [0.0, 1e-6])
@pytest.mark.parametrize(("share", "finite"), [(0.999, True), (1.001, False)])
def test_a_finger_with_too_many_sub_steps_has_no_result(viscous, share, finite):
    rates = Rates(0.5 * share * MAX_SUBSTEPS, 1.0)
    after = next(run(0.0, 0.0, -1.0, rates, 0.1, Law(0.0, 0.0, viscous, 1.0, 0.0, 0.0)))
    assert all(map(isfinite, after)) == finite


@pytest.mark.parametrize(
    ("rate", "h", "n"), [(400.0, 1e-4, 1), (400.0, 1e-3, 4), (900.0, 1e-3, 9), (0.0, 1.0, 1)]
)
def test_sub_steps_of_round_numbers(rate, h, n):
    assert substep_count(rate, h) == n
    assert contact.fastest(Rates(rate / 2.0, 0.1 * rate)) == rate


def test_both_fingers_feel_their_own_side_of_the_object():
    """Each pressed at its surface by its own force, into the object by nothing."""
    p = Params(initial_object_position=0.01, finger_mass=(0.2, 2.0))
    x = rigid.initial_state(p, Inputs())
    force = (-3.0, 5.0)
    for _ in range(600):
        x = rigid.step(p, x, Inputs(force), 1e-3)
    assert x.position == pytest.approx((0.045, -0.025), abs=1e-12)
    assert x.contact_force == pytest.approx((3.0, -5.0), rel=1e-9)
    assert rigid.outputs(p, x, Inputs(force)).contact == (True, True)
