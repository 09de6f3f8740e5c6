"""The wrist's servo: exact without limits, and within them whatever it is told and pushed by."""

from dataclasses import replace
from math import pi

import numpy as np
import pytest
from gripper_plant import tandem, wrist
from gripper_plant.contact_laws import KelvinVoigt
from gripper_plant.tandem import Inputs, Params
from gripper_plant.wrist import Wrist
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm
from support.marks import examples

ROUNDING = 1e-9
"""Of a limit."""

RATIOS = st.sampled_from([0.0, 0.3, 1.0, 1.0000001, 2.0, 10.0])

SERVOS = st.builds(Wrist, st.floats(0.5, 100.0), RATIOS, st.sampled_from([0.0, 1e-3]))

PLACES, SPEEDS, PUSHES = st.floats(-0.1, 0.1), st.floats(-0.5, 0.5), st.floats(-20.0, 20.0)

DURATIONS = st.floats(1e-5, 0.5)


@examples(60)
@given(SERVOS, PLACES, SPEEDS, PLACES, PUSHES, DURATIONS)
def test_without_limits_it_is_exact(p, position, velocity, command, push, d):
    omega = 2.0 * pi * p.bandwidth
    a = np.array([[0.0, 1.0], [-(omega**2), -2.0 * p.damping_ratio * omega]])
    rest = command + p.compliance * push
    expected = expm(a * d) @ [position - rest, velocity] + [rest, 0.0]
    found = wrist.follow(p, wrist.transition(p, d), (position, velocity), command, push, d)
    assert found[0] == pytest.approx(expected[0], abs=1e-10)
    assert found[1] == pytest.approx(expected[1], abs=1e-8)


@examples(60)
@given(SERVOS, PLACES, SPEEDS, PLACES, DURATIONS)
def test_it_comes_no_further_than_by_its_bound(p, position, velocity, command, d):
    """By which a plant knows in which step its fingers may touch."""
    found, _ = wrist.follow(p, wrist.transition(p, d), (position, velocity), command, 0.0, d)
    bound = wrist.acceleration_bound(p, (position, velocity), command)
    assert abs(found - position) <= d * abs(velocity) + 0.5 * d * d * bound + 1e-12


LIMITED = st.builds(
    Wrist,
    st.floats(0.5, 50.0),
    RATIOS,
    st.sampled_from([0.0, 1e-3]),
    speed_limit=st.floats(0.01, 0.3),
    acceleration_limit=st.floats(0.1, 10.0),
)

HISTORIES = st.lists(
    st.tuples(LIMITED, PLACES, PUSHES, st.floats(1e-4, 2e-2)), min_size=5, max_size=20
)
"""Limits that change at run time, too."""


@examples(60)
@given(HISTORIES)
def test_it_stays_within_its_limits(history):
    """One that is faster than its limit, as that has been lowered, brakes as it may."""
    x = (0.0, 0.0)
    for p, command, push, d in history:
        (_, before), x = x, wrist.follow(p, wrist.transition(p, d), x, command, push, d)
        most = p.acceleration_limit
        assert abs(x[1] - before) <= most * d + ROUNDING
        assert abs(x[1]) <= max(p.speed_limit, abs(before) - most * d) + ROUNDING


COMMANDS = st.lists(
    st.tuples(st.floats(-4.0, 2.0), PLACES, st.floats(1e-4, 2e-2)), min_size=5, max_size=12
)
"""F in N, X_c in m, h in s."""


@examples(30)
@given(LIMITED, st.sampled_from([0.0, 0.0123]), COMMANDS)
def test_it_does_in_contact(p, delay, history):
    """Over whole steps of the plant, of however many sub-steps."""
    plant = Params(
        initial_position=(0.04, -0.04),
        initial_object_position=0.0,
        object_fixed=True,
        wrist=replace(p, delay=delay),
    )
    x, before = tandem.initial_state(plant, Inputs()), 0.0
    for force, command, h in history:
        x = tandem.step(plant, x, Inputs(force, command), h)
        speed = tandem.outputs(plant, x, Inputs()).wrist_velocity
        assert abs(speed) <= p.speed_limit + ROUNDING
        assert abs(speed - before) <= p.acceleration_limit * h + ROUNDING
        before = speed


def test_a_way_at_both_limits_takes_its_time():
    """A fast servo sent 0.1 m off: up to 0.2 m/s with 1 m/s^2, and down again, 0.7 s."""
    p = Params(wrist=Wrist(50.0, 1.0, speed_limit=0.2, acceleration_limit=1.0), object_fixed=True)
    x, seen = tandem.initial_state(p, Inputs()), []
    for _ in range(600):
        x = tandem.step(p, x, Inputs(0.0, 0.1), 1e-3)
        seen.append(x.body.wrist)
    assert seen[99] == pytest.approx((0.5 * 0.1**2, 0.1), abs=1e-9)
    assert seen[299] == pytest.approx((0.04, 0.2), abs=1e-9)
    assert seen[490] == pytest.approx((0.0782, 0.2), abs=1e-9)


def test_it_speeds_up_to_its_limit_within_a_step_and_no_further():
    """From 0.1 to 0.2 m/s with 1 m/s^2 over 15 mm, then 20 mm at that."""
    p = Wrist(0.1, 1.0, speed_limit=0.2, acceleration_limit=1.0)
    found = wrist.follow(p, wrist.transition(p, 0.2), (0.0, 0.1), 100.0, 0.0, 0.2)
    assert found == pytest.approx((0.035, 0.2), abs=1e-12)


@pytest.mark.parametrize(("limit", "bound"), [(0.0, 4.0 * pi * pi * 0.5 + 2.0 * pi), (0.3, 0.3)])
def test_its_bound_is_what_a_servo_of_1_hz_wants_at_half_a_metre(limit, bound):
    p = Wrist(1.0, 0.5, acceleration_limit=limit)
    assert wrist.acceleration_bound(p, (0.2, -1.0), -0.3) == pytest.approx(bound, rel=1e-12)


def test_a_wrist_that_gives_way_does_by_its_compliance():
    """By c for each newton of the finger that presses alone."""
    p = Params(
        initial_position=(0.05, -0.11),
        initial_object_position=0.0,
        object_fixed=True,
        kelvin_voigt=KelvinVoigt(1e4, 60.0),
        wrist=Wrist(5.0, 1.0, 1e-3),
    )
    x = tandem.initial_state(p, Inputs())
    for _ in range(300):
        x = tandem.step(p, x, Inputs(-2.0, -0.03), 1e-2)
    y = tandem.outputs(p, x, Inputs())
    assert y.wrist_force == pytest.approx(2.0, abs=1e-6)
    assert y.wrist_position == pytest.approx(-0.03 + 2e-3, abs=1e-8)


@pytest.mark.parametrize("damping_ratio", [0.5, 3.0])
def test_the_plant_follows_the_servo_it_is_given_at_run_time(damping_ratio):
    """The next step is that of the new numbers, from the state as it is."""
    p = Params(object_fixed=True)
    x = tandem.step(p, tandem.initial_state(p, Inputs()), Inputs(0.0, 0.02), 0.05)
    other = replace(p, wrist=Wrist(12.0, damping_ratio))
    expected = wrist.follow(
        other.wrist, wrist.transition(other.wrist, 0.01), x.body.wrist, 0.02, 0.0, 0.01
    )
    assert tandem.step(other, x, Inputs(0.0, 0.02), 0.01).body.wrist == expected
