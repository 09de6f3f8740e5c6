"""Lifting: the way up, what each fingertip carries, onset and way of slip, and what falls."""

from itertools import islice

import pytest
from gripper_plant import lift
from gripper_plant.box import GRAVITY
from gripper_plant.lift import Height, Lift
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

QUICK = examples(60)

M = 0.2
"""kg."""


def run(p, holds, d, y=lift.REST):
    """Sub-step after sub-step, lifting."""
    while True:
        y, load = lift.carry(M, y, lift.rise(p, y, True, d), holds, d)
        yield y, load


def after(p, holds, d, n, y=lift.REST):
    return next(islice(run(p, holds, d, y), n - 1, None))


@pytest.mark.parametrize("d", [1e-4, 1e-3, 5e-3])
@pytest.mark.parametrize(("speed", "height"), [(0.25, 0.1), (5.0, 0.1)])
def test_the_way_up_is_as_fast_as_its_limits_allow(d, speed, height):
    """Time of a trapezoid or of a triangle, then at rest there."""
    p = Lift(True, acceleration=2.0, speed=speed, height=height)
    top = min(speed, (2.0 * height) ** 0.5)
    duration = height / top + top / 2.0
    y, fastest, before = lift.REST, 0.0, 0.0
    for k in range(1, int(1.2 * duration / d)):
        way, rate = lift.rise(p, y, True, d)
        assert abs(rate - before) <= 2.0 * d * (1.0 + 1e-9)
        y, before, fastest = Height(way, rate, 0.0, 0.0), rate, max(fastest, rate)
        if k == int(0.5 * duration / d):
            half = k
    assert half * d == pytest.approx(0.5 * duration, abs=d)
    assert fastest == pytest.approx(top, abs=2.0 * d)
    assert y.tips == pytest.approx(height, abs=2.0 * d * d)
    assert y.tips_rate == 0.0


def test_a_lift_that_is_turned_off_stops():
    p = Lift(True, acceleration=2.0, speed=10.0, height=1.0)
    y, _ = after(p, (9.0, 9.0), 1e-3, 100)
    for _ in range(100):
        y, load = lift.carry(M, y, lift.rise(p, y, False, 1e-3), (9.0, 9.0), 1e-3)
    assert y.tips_rate == pytest.approx(0.0, abs=1e-12)
    assert y.tips == pytest.approx(0.02, rel=1e-6)  # v^2/a with v = 0.2
    assert load.demand == pytest.approx(M * (GRAVITY - 2.0), rel=1e-6)


@pytest.mark.parametrize("excess", [-1e-6, 1e-6])
def test_it_slips_from_the_weight_on_that_both_fingertips_cannot_hold(excess):
    """m·(g + a) = 2·mu·N is the onset."""
    a = 3.0
    hold = 0.5 * M * (GRAVITY + a) * (1.0 - excess)
    p = Lift(True, acceleration=a, speed=100.0, height=100.0)
    y, load = after(p, (hold, hold), 1e-3, 1000)
    assert load.demand == pytest.approx(M * (GRAVITY + a), rel=1e-9)
    if excess < 0.0:
        assert lift.slip(y) == pytest.approx(0.0, abs=1e-12)
        assert sum(load.tangential) == pytest.approx(M * (GRAVITY + a), rel=1e-9)
    else:
        slipped = 0.5 * (GRAVITY + a - 2.0 * hold / M)
        assert lift.slip(y) == pytest.approx(slipped, rel=1e-6)
        assert slipped > 5e-6


@pytest.mark.parametrize("d", [1e-4, 7e-3])
def test_the_slip_way_is_that_of_constant_friction(d):
    """1/2·(g + a - 2·mu·N/m)·t^2, whatever the step, in the air and on the floor."""
    p = Lift(True, acceleration=3.0, speed=100.0, height=100.0)
    n = round(0.35 / d)
    for hold in (0.55 * M * GRAVITY, 0.6 * M * GRAVITY):
        y, load = after(p, (hold, hold), d, n)
        slipped = 0.5 * (GRAVITY + 3.0 - 2.0 * hold / M) * (n * d) ** 2
        assert lift.slip(y) == pytest.approx(slipped, rel=1e-9)
        assert load.tangential == pytest.approx((hold, hold), rel=1e-12)
    y, load = after(p, (0.4 * M * GRAVITY, 0.0), d, n)  # too little to lift it at all
    assert (y.body, y.body_rate) == (0.0, 0.0)
    assert lift.slip(y) == pytest.approx(0.5 * 3.0 * (n * d) ** 2, rel=1e-9)
    assert lift.floor_force(M, y, load) == pytest.approx(0.6 * M * GRAVITY, rel=1e-12)


def test_a_firmer_grip_ends_the_slip():
    p = Lift(True, acceleration=1.0, speed=100.0, height=100.0)
    y, _ = after(p, (0.6 * M * GRAVITY, 0.3 * M * GRAVITY), 1e-3, 100)
    y, _ = after(p, (2.0 * M * GRAVITY, M * GRAVITY), 1e-3, 100, y)
    caught = lift.slip(y)
    y, load = after(p, (2.0 * M * GRAVITY, M * GRAVITY), 1e-3, 500, y)
    assert lift.slip(y) == pytest.approx(caught, abs=1e-12)
    assert y.body_rate == pytest.approx(y.tips_rate, rel=1e-9)
    assert sum(load.tangential) == pytest.approx(M * (GRAVITY + 1.0), rel=1e-9)


def test_what_is_let_go_falls_to_the_floor_and_stays():
    p = Lift(True, acceleration=2.0, speed=0.2, height=0.05)
    y, _ = after(p, (9.0, 9.0), 1e-3, 600)
    assert y.body == pytest.approx(0.05, abs=1e-9)
    fallen, load = after(p, (0.0, 0.0), 1e-3, 90, y)
    assert fallen.body == pytest.approx(y.body - 0.5 * GRAVITY * 0.09**2, abs=1e-6)
    assert load.tangential == (0.0, 0.0)
    landed, load = after(p, (0.0, 0.0), 1e-3, 200, y)
    assert (landed.body, landed.body_rate) == (0.0, 0.0)
    assert load == lift.NO_LOAD


HOLDS = st.floats(0.0, 10.0)


@QUICK
@given(HOLDS, HOLDS, st.floats(-1.0, 1.0))
def test_the_fingertips_share_the_load_as_far_as_they_can(hold_1, hold_2, share):
    total = share * (hold_1 + hold_2)
    t_1, t_2 = lift.shares(total, (hold_1, hold_2))
    assert t_1 + t_2 == pytest.approx(total, abs=1e-12)
    assert abs(t_1) <= hold_1 + 1e-12
    assert abs(t_2) <= hold_2 + 1e-12
    if 0.5 * abs(total) <= min(hold_1, hold_2):
        assert t_1 == pytest.approx(t_2, abs=1e-12)
    else:
        smaller = min((hold_1, t_1), (hold_2, t_2))
        assert abs(smaller[1]) == pytest.approx(smaller[0], abs=1e-12)


@QUICK
@given(st.lists(st.tuples(HOLDS, HOLDS, st.booleans()), min_size=5, max_size=30))
def test_friction_takes_energy_and_gives_none(history):
    """The gripper's work on the object is what the object gets and what friction takes."""
    p, y, d = Lift(True, acceleration=4.0, speed=0.5, height=0.3), lift.REST, 2e-3
    for hold_1, hold_2, lifting in history:
        tips = lift.rise(p, y, lifting, d)
        before = M * (0.5 * y.body_rate**2 + GRAVITY * y.body)
        after_, load = lift.carry(M, y, tips, (hold_1, hold_2), d)
        energy = M * (0.5 * after_.body_rate**2 + GRAVITY * after_.body)
        work = sum(load.tangential) * (tips[0] - y.tips)
        assert energy - before - work <= 1e-9
        y = after_
