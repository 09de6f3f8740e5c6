"""A finger in free flight and against the object: exact, unilateral and passive."""

from fractions import Fraction
from itertools import islice, pairwise
from math import ceil, exp, floor, inf, isclose, isfinite, pi, sqrt

import numpy as np
import pytest
from gripper_plant import contact, friction, rigid
from gripper_plant.contact import Rates, time_to_contact
from gripper_plant.fingers import Side
from gripper_plant.rigid import Inputs, Params, State
from gripper_plant.substeps import MOST
from gripper_plant.substeps import count as substeps_of
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq
from support.examples import examples

QUICK = examples(100)

EPS = float(np.finfo(float).eps)

TINY = float(np.finfo(float).tiny)
"""Below this, numbers lose their digits."""

MASSES = st.floats(1e-3, 1e3)
RATES = st.floats(0.0, 2000.0)
STEPS = st.floats(1e-5, 5e-3)
SPEEDS = st.floats(1e-3, 1.0)

BAUMGARTE = [(200.0, 200.0), (400.0, 200.0), (60.0, 200.0)]
"""Critical, strong and weak damping."""


def advance(s, v, surface, m, f, alpha, beta, h):
    """A finger without friction, h seconds later."""
    side = Side(surface, m, friction.NONE)
    return contact.advance(side, Rates(alpha, beta), s, v, f, h)


def substeps(alpha, beta, h):
    return substeps_of(contact.fastest(Rates(alpha, beta)), h)


def run(s, v, m, f, alpha, beta, h):
    """Step after step of a finger whose object begins at zero, the force held."""
    while True:
        s, v, contact_force = advance(s, v, 0.0, m, f, alpha, beta, h)
        yield s, v, contact_force


def longest_substep(alpha, beta):
    """In s; the contact is linear and slow where it has next to no rates."""
    return 0.1 / max(2.0 * alpha, beta, 1e-9)


# ---------------------------------------------------------------------------- free flight


@QUICK
@given(MASSES, SPEEDS, st.lists(STEPS, min_size=1, max_size=50))
def test_a_finger_without_force_keeps_its_speed_exactly(m, v, history):
    s = start = 1.0
    for h in history:
        s, after, contact_force = advance(s, -v, 0.0, m, 0.0, 200.0, 200.0, h)
        assert (after, contact_force) == (-v, 0.0)
    assert s == pytest.approx(start - v * sum(history), rel=1e-14)


@QUICK
@given(
    MASSES, st.floats(-1.0, 1.0), st.floats(-20.0, 20.0), st.lists(STEPS, min_size=1, max_size=50)
)
def test_free_flight_is_the_parabola(m, v, a, history):
    """Each of the steps rounds the position and the speed a few times, and no more."""
    f = m * a
    s, start, rate = 10.0, 10.0, v
    for h in history:
        s, rate, contact_force = advance(s, rate, 0.0, m, f, 200.0, 200.0, h)
        assert contact_force == 0.0
    t, exact = sum(map(Fraction, history)), Fraction(f) / Fraction(m)
    roundings = 4 * len(history) * EPS
    assert rate == pytest.approx(float(Fraction(v) + exact * t), rel=0.0, abs=6.0 * roundings)
    parabola = float(start + Fraction(v) * t + exact * t * t / 2)
    assert s == pytest.approx(parabola, rel=0.0, abs=12.0 * roundings)


# ---------------------------------------------------------------- the moment of contact


def crossing(gap, rate, acceleration, upper):
    """The root of the parabola between zero and upper, where it is above and below zero."""
    return float(
        brentq(
            lambda t: gap + t * (rate + 0.5 * acceleration * t), 0.0, upper, xtol=1e-300, rtol=1e-15
        )
    )


@QUICK
@given(st.floats(1e-6, 1.0), st.floats(-2.0, 0.0), st.floats(-50.0, -1e-3))
def test_time_to_contact_of_a_finger_pushed_onto_the_object(gap, rate, acceleration):
    t = time_to_contact(gap, rate, acceleration)
    upper = 2.0 * sqrt(2.0 * gap / -acceleration)
    assert t == pytest.approx(crossing(gap, rate, acceleration, upper), rel=1e-13)


@QUICK
@given(st.floats(1e-12, 1.0), st.floats(0.0, 2.0), st.floats(-50.0, -1.0))
def test_time_to_contact_of_a_finger_that_comes_back(gap, rate, acceleration):
    t = time_to_contact(gap, rate, acceleration)
    roots = np.roots([0.5 * acceleration, rate, gap])
    assert t == pytest.approx(max(roots), rel=1e-12)


@QUICK
@given(st.floats(1e-6, 1.0), st.floats(-2.0, -1e-3), st.floats(0.0, 0.999))
def test_time_to_contact_of_a_finger_that_is_slowed_down(gap, rate, share):
    """It arrives where the braking takes less than its whole speed, and never otherwise."""
    acceleration = share * rate * rate / (2.0 * gap)
    t = time_to_contact(gap, rate, acceleration)
    upper = min(-rate / acceleration, 2.0 * gap / -rate) if acceleration > 0.0 else gap / -rate
    assert t == pytest.approx(crossing(gap, rate, acceleration, upper * (1 + 1e-15)), rel=1e-12)
    assert time_to_contact(gap, rate, 1.001 * rate * rate / (2.0 * gap)) == inf


@QUICK
@given(st.floats(1e-9, 1.0), st.floats(0.0, 2.0), st.floats(0.0, 50.0))
def test_a_finger_that_opens_never_arrives(gap, rate, acceleration):
    assert time_to_contact(gap, rate, acceleration) == inf


@QUICK
@given(st.floats(-1.0, -1e-12), st.floats(-2.0, 2.0), st.floats(-50.0, 50.0))
def test_a_finger_that_touches_has_arrived(gap, rate, acceleration):
    assert time_to_contact(gap, rate, acceleration) == 0.0
    assert time_to_contact(0.0, -abs(rate), -abs(acceleration)) == 0.0


@pytest.mark.parametrize("gap", [1e-3, 1e-6, 1e-13, 1e-17, 0.0])
def test_time_to_contact_of_a_finger_that_has_only_just_left(gap):
    """It flies out at 1 m/s and is back after 2·v/a, whatever little gap it started from."""
    assert time_to_contact(gap, 1.0, -2000.0) == pytest.approx(
        (1.0 + sqrt(1.0 + 4000.0 * gap)) / 2000.0, rel=1e-12
    )


@QUICK
@given(st.floats(1e-5, 5e-3), SPEEDS, st.floats(0.0, 10.0), st.floats(1e-4, 5e-3))
def test_contact_occurs_in_the_step_in_which_the_parabola_arrives(gap, v, a, h):
    arrival = crossing(gap, -v, -a, gap / v * (1 + 1e-15))
    step = floor(arrival / h)
    assume(1e-6 < arrival / h - step < 1.0 - 1e-6)
    fingers = run(gap, -v, 0.5, -0.5 * a, 200.0, 200.0, h)
    assert all(contact_force == 0.0 for _, _, contact_force in islice(fingers, step))
    _, _, contact_force = next(fingers)
    assert contact_force > 0.0


# ------------------------------------------------------------------ the contact response


def response(v, alpha, beta, t):
    """Gap and rate t after contact at speed v: g'' + 2·alpha·g' + beta^2·g = 0 from (0, -v)."""
    rows = np.array([[0.0, 1.0], [-beta * beta, -2.0 * alpha]])
    return np.asarray(expm(rows * t) @ np.array([0.0, -v]))


@st.composite
def arrivals(draw):
    """Gap, speed, acceleration, alpha, beta and a step in which the finger arrives to stay.

    Strong or critical damping; the held force presses harder than the contact's response can pull.
    """
    beta, h, v = draw(st.floats(20.0, 1000.0)), draw(st.floats(1e-4, 5e-3)), draw(SPEEDS)
    alpha = beta * draw(st.floats(1.0, 2.0))
    return v * h * draw(st.floats(0.05, 0.95)), v, beta * v + 1.0, alpha, beta, h


@QUICK
@given(arrivals())
def test_contact_starts_at_its_moment_within_a_step(arrival):
    """The trapezoidal rule's error, from its eigenvalues z <= 0 with x = |z|·t and |z|·d <= 0.1:

    position (|z|·d)^2/12 · t·(3 + x)·exp(-x) · v <= 0.0127·v·d, speed (|z|·d)^2/12 ·
    x·(4 + x)·exp(-x) · v <= 0.0016·v; a moment wrong by a sub-step would shift it by v·d.
    """
    gap, v, a, alpha, beta, h = arrival
    t = crossing(gap, -v, -a, gap / v * (1 + 1e-15))
    speed = v + a * t
    s, after, contact_force = advance(gap, -v, 0.0, 0.5, -0.5 * a, alpha, beta, h)
    expected = response(speed, alpha, beta, h - t)
    d = longest_substep(alpha, beta)
    assert contact_force > 0.0
    assert s == pytest.approx(expected[0], rel=0.0, abs=0.0127 * speed * min(d, h))
    assert after == pytest.approx(expected[1], rel=0.0, abs=0.0016 * speed)


@QUICK
@given(arrivals(), st.sampled_from([2, 7]))
def test_a_step_in_parts_is_nearly_the_step(arrival, parts):
    """Second order in the sub-step: the errors of the test above, once for each of the two."""
    gap, v, a, alpha, beta, h = arrival
    s, after, _ = advance(gap, -v, 0.0, 0.5, -0.5 * a, alpha, beta, h)
    fingers = run(gap, -v, 0.5, -0.5 * a, alpha, beta, h / parts)
    split, rate, _ = next(islice(fingers, parts - 1, None))
    speed = v + a * h
    d = min(longest_substep(alpha, beta), h)
    assert split == pytest.approx(s, rel=0.0, abs=2.0 * 0.0127 * speed * d)
    assert rate == pytest.approx(after, rel=0.0, abs=2.0 * 0.0016 * speed)


@QUICK
@given(st.floats(0.01, 1.0), SPEEDS, st.floats(-10.0, 10.0), STEPS)
def test_free_flight_in_parts_is_the_step(gap, v, a, h):
    whole = next(run(gap + 1.0, -v, 0.5, 0.5 * a, 200.0, 200.0, h))
    parts = next(islice(run(gap + 1.0, -v, 0.5, 0.5 * a, 200.0, 200.0, h / 7), 6, None))
    assert parts == pytest.approx(whole, rel=0.0, abs=32.0 * EPS)


@pytest.mark.parametrize(("alpha", "beta"), BAUMGARTE)
def test_the_contact_response_is_of_second_order(alpha, beta):
    """Half the sub-step leaves a quarter of the error."""
    v, t = 0.1, 6e-3
    motion = solve_ivp(
        lambda _, z: [z[1], -2.0 * alpha * z[1] - beta * beta * z[0]],
        (0.0, t),
        (0.0, -v),
        method="DOP853",
        rtol=1e-12,
        atol=1e-15,
    )
    errors = []
    for n in (64, 128, 256):
        assert substeps(alpha, beta, t / n) == 1
        s, after, _ = next(islice(run(0.0, -v, 0.5, -20.0, alpha, beta, t / n), n - 1, None))
        errors.append(abs(np.array([beta * s, after]) - [beta, 1.0] * motion.y[:, -1]))
    assert max(errors[0]) < 1e-3 * v
    for coarse, fine in pairwise(errors):
        np.testing.assert_allclose(coarse / fine, 4.0, rtol=0.03)


@QUICK
@given(
    MASSES,
    st.floats(-1e-3, -1e-6),
    st.floats(-1.0, 1.0),
    st.floats(-50.0, 50.0),
    RATES,
    RATES,
)
def test_force_and_contact_force_make_the_momentum(m, gap, v, a, alpha, beta):
    """Eq. (1) over one sub-step in contact, and the position from the mean speed."""
    d = min(1e-3, longest_substep(alpha, beta))
    s, after, contact_force = advance(gap, v, 0.0, m, m * a, alpha, beta, d)
    assume(s < 0.0)
    momentum = (m * a + contact_force) * d
    assert m * (after - v) == pytest.approx(momentum, rel=1e-9, abs=1e-14 * m)
    assert s == pytest.approx(gap + 0.5 * d * (v + after), rel=1e-9, abs=1e-17)


# ------------------------------------------------------------- unilateral and passive


@st.composite
def fingers_at_the_object(draw):
    """Fingers that are near the object or have already gone a little too far, moving."""
    p = Params(
        finger_mass=(draw(MASSES), draw(MASSES)),
        initial_object_position=0.0,
        baumgarte_alpha=draw(st.floats(1.0, 2000.0)),
        baumgarte_beta=draw(st.floats(1.0, 2000.0)),
    )
    gaps, speeds = st.floats(-1e-3, 2e-3), st.floats(-1.0, 1.0)
    position = 0.035 + draw(gaps), -0.035 - draw(gaps)
    return p, State(position, (draw(speeds), draw(speeds)), (0.0, 0.0))


FORCES = st.floats(-100.0, 100.0)
HISTORIES = st.lists(st.tuples(FORCES, FORCES, STEPS), min_size=1, max_size=12)


@QUICK
@given(fingers_at_the_object(), HISTORIES)
def test_the_object_never_pulls(start, history):
    p, x = start
    for force_1, force_2, h in history:
        u = Inputs((force_1, force_2))
        x = rigid.step(p, x, u, h)
        y = rigid.outputs(p, x, u)
        assert y.contact_force[0] >= 0.0 >= y.contact_force[1]
        assert y.contact == (y.gap[0] <= 0.0, y.gap[1] <= 0.0)
        assert y.contact[0] or y.contact_force[0] == 0.0
        assert y.contact[1] or y.contact_force[1] == 0.0


@QUICK
@given(MASSES, st.floats(-1e-3, 0.0), st.floats(-1.0, 1.0), RATES, RATES, STEPS)
def test_contact_stores_no_more_energy_than_it_was_given(m, gap, v, alpha, beta, h):
    """Without an actuator: that of the motion, and that of the depth as of a spring m·beta^2."""

    def storage(s, rate):
        return 0.5 * m * rate**2 + 0.5 * m * (beta * min(s, 0.0)) ** 2

    before = storage(gap, v)
    for s, rate, _ in islice(run(gap, v, m, 0.0, alpha, beta, h), 10):
        after = storage(s, rate)
        assert after <= before * (1.0 + 1e-12) + TINY
        before = after


def departure(fingers, steps):
    """The first of so many steps after which the finger is off the object again."""
    return next((finger for finger in islice(fingers, steps) if finger[0] > 0.0), None)


@QUICK
@given(MASSES, SPEEDS, st.floats(0.0, 50.0), RATES, RATES, STEPS)
def test_a_finger_that_is_drawn_off_took_nothing_from_the_object(m, v, a, alpha, beta, h):
    """It leaves with no more than it came with and what the opening force has done since.

    The contact takes over from the opening force within a sub-step: on the way in, up to
    m·(beta·d·v)^2/8 of the work that takes is missing.
    """
    left = departure(run(0.0, -v, m, m * a, alpha, beta, h), 100)
    assume(left is not None)
    assert left is not None
    s, rate, _ = left
    missing = (beta * min(h, longest_substep(alpha, beta)) * v) ** 2 / 8.0 if a else 0.0
    rounding = 1e-13 * (rate**2 + a * s)
    assert 0.5 * rate**2 - a * s <= 0.5 * v**2 + missing + rounding


def test_contact_is_not_missed_where_the_finger_is_off_again_after_the_step():
    """It comes at 0.1 m/s and is drawn off: its parabola dips into the object and out of it.

    Free flight would keep the energy. Contact takes the speed v down, at 2·alpha, to where the
    opening force takes over, w = a / (2·alpha) = 0.025 m/s; of the energy less than 2·w/v is left.
    Leaving is located to a sub-step.
    """
    gap, v, a, alpha, h = 1e-5, 0.1, 100.0, 2000.0, 5e-3
    s, rate, contact_force = advance(gap, -v, 0.0, 0.5, 0.5 * a, alpha, alpha, h)
    assert 0.5 * rate**2 - a * s < 0.5 * (0.5 * v**2 - a * gap)
    fine, speed, _ = next(islice(run(gap, -v, 0.5, 0.5 * a, alpha, alpha, h / 2000), 1999, None))
    d = longest_substep(alpha, alpha)
    assert s == pytest.approx(fine, rel=0.0, abs=rate * d)
    assert rate == pytest.approx(speed, rel=0.0, abs=a * d)
    assert s > 2.0 * rate * d
    assert contact_force == 0.0


@QUICK
@given(SPEEDS, st.floats(0.0, 50.0), st.floats(0.0, 0.99), st.floats(50.0, 500.0), STEPS)
def test_a_finger_bounces_off_with_no_more_energy_than_it_brought(v, a, ratio, beta, h):
    """Weak damping, pressed all the time: off the object it has its speed and its height."""
    for s, rate, _ in islice(run(0.0, -v, 0.5, -0.5 * a, ratio * beta, beta, h), 60):
        if s >= 0.0:
            assert 0.5 * rate**2 + a * s <= 0.5 * v**2 * (1.0 + 1e-12)


@QUICK
@given(MASSES, SPEEDS, st.floats(0.0, 50.0), st.floats(1.0, 3.0), st.floats(50.0, 500.0), STEPS)
def test_a_finger_that_presses_does_not_bounce(m, v, a, ratio, beta, h):
    """Strong or critical damping, and a force above the 0.05·m·beta·v the response asks for."""
    f = -m * (0.1 * beta * v + a)
    for s, rate, contact_force in islice(run(0.0, -v, m, f, ratio * beta, beta, h), 30):
        assert s <= 1e-15
        assert rate <= v
        assert contact_force > 0.0


@pytest.mark.parametrize("h", [1e-4, 1e-5])
@pytest.mark.parametrize("ratio", [0.1, 0.3, 0.6])
def test_the_rebound_is_that_of_weak_damping(ratio, h):
    """Pressed hard, the contact holds for half a period and returns exp(-pi·alpha/w) of the speed.

    Second order in the sub-step h: half a period of the trapezoidal rule costs pi/12·(beta·h)^2,
    the mean acceleration in the sub-step of leaving (1 + 4·ratio^2)·(beta·h)^2.
    """
    v, a, beta = 0.5, 300.0, 200.0
    left = departure(run(0.0, -v, 0.5, -0.5 * a, ratio * beta, beta, h), ceil(0.02 / h))
    assert left is not None
    s, rate, _ = left
    restitution = exp(-pi * ratio / sqrt(1.0 - ratio**2))
    assert sqrt(rate**2 + 2.0 * a * s) / v == pytest.approx(restitution, rel=3.0 * (beta * h) ** 2)


@QUICK
@given(st.floats(0.0, 0.1), st.floats(0.1, 50.0), RATES, RATES, STEPS)
def test_a_finger_at_the_surface_is_free_to_leave(v, a, alpha, beta, h):
    """The object does not hold it back: from the first instant it flies the parabola."""
    s, rate, contact_force = advance(0.0, v, 0.0, 0.5, 0.5 * a, alpha, beta, h)
    assert s == pytest.approx(v * h + 0.5 * a * h * h, rel=1e-9)
    assert rate == pytest.approx(v + a * h, rel=1e-9)
    assert contact_force == 0.0


@pytest.mark.parametrize("h", [1e-4, 1e-3])
@pytest.mark.parametrize(("alpha", "beta"), [(200.0, 200.0), (20.0, 200.0)])
def test_a_pressed_finger_leaves_when_the_force_turns(alpha, beta, h):
    """10 ms after, it is where a·t^2/2 brings it, but for the sub-step in which it starts."""
    s, v, _ = next(islice(run(1e-3, 0.0, 0.5, -3.43, alpha, beta, h), ceil(3.0 / h), None))
    t, a = 0.01, 6.86
    fingers = run(s, v, 0.5, 3.43, alpha, beta, h)
    s, v, contact_force = next(islice(fingers, round(t / h) - 1, None))
    assert s == pytest.approx(0.5 * a * t * t, rel=0.0, abs=a * t * longest_substep(alpha, beta))
    assert v == pytest.approx(a * t, rel=0.0, abs=a * longest_substep(alpha, beta))
    assert contact_force == 0.0


@pytest.mark.parametrize("h", [1e-4, 1e-3])
@pytest.mark.parametrize("alpha", [0.0, 2.0])
def test_a_bouncing_finger_never_rises_above_where_it_fell_from(alpha, h):
    fall = 1e-3
    fingers = islice(run(fall, 0.0, 0.5, -3.43, alpha, 200.0, h), ceil(1.0 / h))
    assert max(s for s, _, _ in fingers) <= fall * (1.0 + 1e-9)


@pytest.mark.parametrize("h", [1e-4, 5e-3])
@pytest.mark.parametrize(("alpha", "beta"), [(200.0, 200.0), (300.0, 150.0), (500.0, 500.0)])
def test_a_pressed_finger_comes_to_rest(alpha, beta, h):
    """At the surface, and the object bears the whole force."""
    fingers = islice(run(2e-3, -0.1, 0.5, -3.43, alpha, beta, h), ceil(0.8 / h))
    for s, v, contact_force in list(fingers)[-10:]:
        assert abs(s) < 1e-12
        assert abs(v) < 1e-10
        assert contact_force == pytest.approx(3.43, rel=1e-8)


@pytest.mark.parametrize("h", [1e-4, 1e-3])
def test_a_pressed_finger_comes_to_rest_with_weak_damping(h):
    fingers = list(islice(run(1e-3, 0.0, 0.5, -3.43, 20.0, 200.0, h), ceil(3.0 / h)))
    at_rest = [force for s, v, force in fingers if (s, v) == (0.0, 0.0)]
    assert at_rest
    np.testing.assert_allclose(at_rest, 3.43, rtol=1e-8)
    for s, v, contact_force in fingers[-10:]:
        assert abs(s) < 1e-12
        assert abs(v) < 1e-10
        assert contact_force == pytest.approx(3.43, rel=1e-8)


# ------------------------------------------------------------------------- sub-steps


@QUICK
@given(st.floats(0.0, 1e5), st.floats(0.0, 1e5), st.floats(1e-9, 0.1))
def test_sub_steps_resolve_the_contact_and_are_no_more_than_needed(alpha, beta, h):
    """A ratio that is 0.1 but for roundings counts as 0.1."""
    n = substeps(alpha, beta, h)
    ratio = h * max(2.0 * alpha, beta)
    assert n >= 1
    assert ratio <= 0.1 * n or isclose(ratio, 0.1 * n, rel_tol=1e-9)
    assert n == 1 or ratio > 0.1 * (n - 1)


@pytest.mark.parametrize(
    ("alpha", "beta", "h", "n"),
    [(200.0, 200.0, 1e-4, 1), (200.0, 200.0, 1e-3, 4), (200.0, 900.0, 1e-3, 9), (0.0, 0.0, 1.0, 1)],
)
def test_sub_steps_of_round_numbers(alpha, beta, h, n):
    assert substeps(alpha, beta, h) == n


@pytest.mark.parametrize("viscous", [0.0, 1e-6])
@pytest.mark.parametrize(("share", "finite"), [(0.999, True), (1.001, False)])
def test_a_finger_with_too_many_sub_steps_has_no_result(viscous, share, finite):
    side = Side(0.0, 0.5, (0.0, 0.0, viscous, 1.0))
    rates = Rates(0.5 * share * MOST, 1.0)
    after = contact.advance(side, rates, 0.0, 0.0, -1.0, 0.1)
    assert all(map(isfinite, after)) == finite


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
