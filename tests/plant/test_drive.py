"""The drive of a gripper in tandem: a force with its limit and friction, or a speed servo."""

from dataclasses import replace
from math import exp, pi

import pytest
from gripper_plant import drive, tandem
from gripper_plant.drive import Drive, Kind
from gripper_plant.tandem import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

ALONE = Params(initial_position=(10.0, -10.0), object_fixed=True)
"""The object is far away."""

SERVO = Drive(Kind.SPEED, 10.0, 20.0, 0.0)


def after(p, force, h, n, x=None):
    x = x or tandem.initial_state(p, Inputs())
    for _ in range(n):
        x = tandem.step(p, x, Inputs(force), h)
    return x


@pytest.mark.parametrize(
    ("motor", "force", "net"),
    [
        (Drive(), -3.0, -3.0),
        (Drive(force_limit=2.0), -3.0, -2.0),
        (Drive(force_limit=0.5), 5.0, 0.5),
        (Drive(friction=0.5), -3.0, -2.5),
        (Drive(force_limit=2.0, friction=0.5), -3.0, -1.5),
        (Drive(friction=0.5), -0.5, 0.0),
    ],
)
def test_what_moves_the_fingers(motor, force, net):
    p = replace(ALONE, drive=motor, moving_mass=2.0)
    half, speed = after(p, force, 0.1, 4).body.opening
    assert speed == pytest.approx(0.4 * net / 2.0, abs=1e-12)
    assert half == pytest.approx(10.0 + 0.5 * 0.4**2 * net / 2.0, abs=1e-12)


def test_friction_stops_it_and_holds_it():
    """Slowed by friction from 0.2 m/s within 0.4 s over 40 mm, exactly."""
    p = replace(ALONE, drive=Drive(friction=0.5))
    moving = tandem.initial_state(p, Inputs())
    moving = moving._replace(body=moving.body._replace(opening=(10.0, -0.2)))
    assert after(p, 0.0, 0.07, 20, moving).body.opening == (pytest.approx(10.0 - 0.04), 0.0)


@pytest.mark.parametrize("h", [1e-3, 0.02, 0.2])
def test_the_speed_servo_lags_by_its_bandwidth(h):
    """Of the ramp F·t/M, w' = (F/M)·(t - (1 - e^(-omega_d·t))/omega_d)."""
    omega = 2.0 * pi * SERVO.bandwidth
    p = replace(ALONE, drive=SERVO, moving_mass=0.5)
    speed = after(p, -0.4, h, round(0.4 / h)).body.opening[1]
    assert speed == pytest.approx(-0.8 * (0.4 - (1.0 - exp(-omega * 0.4)) / omega), rel=1e-4)


def test_friction_hardly_holds_the_speed_servo_up():
    """It works against 15 N, once its reference is ahead by as much."""
    smooth, rough = (replace(ALONE, drive=replace(SERVO, friction=f)) for f in (0.0, 15.0))
    speeds = [after(p, -0.5, 1e-3, 1000).body.opening[1] for p in (smooth, rough)]
    ahead = 15.0 / (2.0 * pi * SERVO.bandwidth)
    assert speeds[1] == pytest.approx(speeds[0] + ahead, abs=1e-3)


@pytest.mark.parametrize("force", [-0.2, -0.5])
def test_a_grasp_by_the_servo_ends_with_its_limit_less_friction(force):
    """Whatever the force is that it is told, where they arrive slowly; both fingers share it."""
    p = Params(
        initial_position=(0.0355, -0.0355),
        initial_object_position=0.0,
        object_fixed=True,
        drive=replace(SERVO, friction=12.0),
    )
    y = tandem.outputs(p, after(p, force, 0.01, 200), Inputs())
    assert y.contact_force == pytest.approx((4.0, -4.0), abs=0.1)


FORCES = st.lists(st.tuples(st.floats(-30.0, 30.0), st.floats(1e-3, 0.05)), max_size=20)


@examples(30)
@given(st.floats(1.0, 50.0), st.floats(0.5, 20.0), st.floats(0.0, 10.0), FORCES)
def test_the_reference_runs_no_further_ahead_than_the_limit_makes_use_of(hz, most, rub, history):
    """So the motor turns round at once, and never has more than its limit."""
    p = replace(ALONE, drive=Drive(Kind.SPEED, hz, most, rub), moving_mass=0.8)
    x = tandem.initial_state(p, Inputs())
    for force, h in history:
        before, x = x.body.opening[1], tandem.step(p, x, Inputs(force), h)
        speed = x.body.opening[1]
        assert abs(x.body.reference - speed) <= most / (0.8 * p.drive.omega) * (1.0 + 1e-12)
        assert abs(speed - before) <= h * (most + rub) / 0.8 * (1.0 + 1e-9)


def test_a_servo_that_is_switched_on_in_motion_takes_the_speed_over():
    p = replace(ALONE, drive=Drive())
    x = after(p, -1.0, 0.1, 4)
    servo = replace(p, drive=SERVO)
    assert after(servo, 0.0, 1e-3, 300, x).body.opening[1] == pytest.approx(-0.4, abs=1e-12)


def test_a_speed_servo_needs_a_limit():
    with pytest.raises(ValueError, match=r"^drive.force_limit = 0.0 N: must be above 0 with"):
        Drive(Kind.SPEED)
    assert drive.limited(Drive(), 1e9) == 1e9
