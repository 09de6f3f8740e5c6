"""What a finger has felt: first contact and impulse against an event-driven solution, and sums."""

from fractions import Fraction
from math import ceil, pi, sqrt, ulp
from random import Random

import numpy as np
import pytest
from gripper_plant import (
    compliant,
    contact,
    contact_laws,
    delicate,
    friction,
    hand,
    hand_movable,
    movable,
    rigid,
    tandem,
    touch,
)
from gripper_plant.contact import Rates
from gripper_plant.fingers import Side
from gripper_plant.touch import IMPACT_WINDOW
from scipy.integrate import solve_ivp

TOLERANCE = 0.01
"""Of speed and impulse, at every admissible parameter and step."""


def last_speed(v, f, m, rates, seconds):
    """The speed after a finger at the surface with v has been pressed by f for these seconds.

    (C1) in contact, without a pull; scipy stops at each crossing of the surface.
    """
    alpha, beta = rates

    def contact_force(g, w):
        return max(0.0, -m * (2.0 * alpha * w + beta * beta * g) - f)

    def sunk(_, y):
        return [y[1], (f + contact_force(*y)) / m]

    def leaves(_, y):
        return y[0]

    leaves.terminal, leaves.direction = True, 1.0
    t = 0.0
    while True:
        stiff = alpha > beta
        part = solve_ivp(
            sunk, (t, seconds), [-1e-18, v], "Radau" if stiff else "DOP853", events=leaves,
            rtol=1e-8, atol=1e-13 * min(1.0, 1e3 / beta), max_step=np.inf if stiff else 0.3 / beta,
        )  # fmt: skip
        t, v = part.t[-1], part.y[1][-1]
        if part.status == 0:
            return v
        back = 2.0 * v * m / -f if f < 0.0 else np.inf
        if t + back >= seconds:
            return v + f / m * (seconds - t)
        t, v = t + back, v + f / m * back
        if abs(v) < 1e-9:
            return 0.0


def felt(gap, v, f, m, rates, h, until):
    """A finger's touch after steps of h until that moment or just after."""
    side, s, x, clock = Side(0.0, m, friction.NONE), gap, touch.initial(gap <= 0.0), touch.START
    while clock.seconds < until:
        s, v, _, x = contact.advance(side, rates, s, v, f, h, x, clock.seconds)
        clock = touch.later(clock, h)
    return x


def drawn(random, low, high):
    """A number, evenly over the powers of ten."""
    return 10.0 ** random.uniform(low, high)


def check_impact(alpha, beta, m, v, a, gap, h):
    """First contact, its speed and the impulse over IMPACT_WINDOW, in steps of h.

    A bounce at the end of the window may be there or not: the moment is good to a part in 200.
    """
    arrival = sqrt(v * v - 2.0 * a * gap)
    moment = 2.0 * gap / (arrival - v)
    rates = Rates(alpha, beta)
    x = felt(gap, v, m * a, m, rates, h, moment + IMPACT_WINDOW)
    assert x.first_time == pytest.approx(moment, rel=1e-12, abs=1e-15)
    assert x.speed == pytest.approx(arrival, rel=1e-9)
    about = [
        m * (last_speed(-arrival, m * a, m, rates, window) + arrival) - m * a * window
        for window in (0.995 * IMPACT_WINDOW, IMPACT_WINDOW, 1.005 * IMPACT_WINDOW)
    ]
    assert min(about) * (1.0 - TOLERANCE) <= x.impact <= max(about) * (1.0 + TOLERANCE)


@pytest.mark.parametrize("h", [1e-3, 5e-3])
@pytest.mark.parametrize(
    ("alpha", "beta"),
    [(200.0, 200.0), (1e4, 1e4), (1e5, 1e5), (1.0, 1e5), (1e5, 1.0), (20.0, 2000.0), (1.0, 1.0)],
)
def test_an_impact_is_that_of_an_event_driven_solution(alpha, beta, h):
    check_impact(alpha, beta, 0.5, -0.0059, -0.2, 3.3e-5, h)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(20))
def test_impacts_over_all_rates_masses_speeds_and_steps(seed):
    random = Random(seed)
    for _ in range(15):
        alpha, beta, m = drawn(random, 0, 5), drawn(random, 0, 5), drawn(random, -3, 3)
        v, h = -drawn(random, -3, -0.5), random.choice((1e-3, 2e-3, 5e-3))
        a = -drawn(random, -2, 1) if random.random() < 0.8 else 0.0
        check_impact(alpha, beta, m, v, a, random.random() * 3.0 * h * -v, h)


@pytest.mark.parametrize(("alpha", "beta"), [(200.0, 200.0), (20.0, 2000.0), (1.0, 1e4)])
@pytest.mark.parametrize("law", [friction.NONE, friction.coulomb(0.2)], ids=["free", "Coulomb"])
def test_the_impulse_is_the_momentum_that_the_object_gives(alpha, beta, law):
    """Over a second of bounces, also where they let go within a sub-step, and in any steps."""
    for h in (1e-3, 5e-3):
        x, side = touch.initial(False), Side(0.0, 0.5, law)
        s, v, clock = 1e-4, -0.05, touch.START
        rubbed = 0.0
        while clock.seconds < 1.0 - 0.5 * h:
            before = v
            s, v, _, x = contact.advance(side, Rates(alpha, beta), s, v, -1.0, h, x, clock.seconds)
            clock = touch.later(clock, h)
            rubbed += abs(before) > 0.0
        given = x.impulse - 1.0 - 0.5 * (v + 0.05)
        if law is friction.NONE:
            assert given == pytest.approx(0.0, abs=1e-12)
        else:
            assert abs(given) <= 0.2 * 1.0  # the friction's share, at most F_C over the second


def test_the_clock_does_not_drift():
    """A million steps of a third of a millisecond are as exact as one number is."""
    clock, h = touch.START, 1e-3 / 3.0
    for _ in range(1_000_000):
        clock = touch.later(clock, h)
    assert abs(clock.seconds - 1_000_000 * Fraction(h)) <= 0.5 * ulp(clock.seconds)


def test_a_contact_within_a_step_is_not_lost():
    """An elastic touch of 31 us: nothing at either point, and all of it in what was felt."""
    side, rates = Side(0.0, 0.5, friction.NONE), Rates(1.0, 1e5)
    s, v, force, x = contact.advance(side, rates, 5e-6, -0.01, 0.0, 1e-3, touch.initial(False), 7.0)
    assert (s > 0.0, force, x.touched) == (True, 0.0, True)
    assert v == pytest.approx(0.01, rel=2e-3)
    assert (x.first_time, x.speed) == (pytest.approx(7.0005, rel=1e-12), pytest.approx(0.01))
    assert x.impulse == x.impact == pytest.approx(0.5 * (v + 0.01), rel=1e-12)
    *_, x = contact.advance(side, rates, s, v, 0.0, 1e-3, x, 7.001)
    assert (x.touched, x.first_time) == (False, pytest.approx(7.0005, rel=1e-12))


STIFF = contact_laws.KelvinVoigt(5000.0, 10.0)
PLANTS = {
    "rigid": (rigid, {}),
    "compliant": (compliant, {"kelvin_voigt": STIFF}),
    "movable": (movable, {"kelvin_voigt": STIFF}),
    "delicate": (delicate, {"object_mass": 0.5}),
}


@pytest.mark.parametrize("rub", [0.0, 0.1], ids=["smooth", "Coulomb"])
@pytest.mark.parametrize("h", [1e-3, 5e-3])
@pytest.mark.parametrize("name", PLANTS)
def test_every_gripper_tells_the_first_touch_in_closed_form(name, h, rub):
    """Finger 1 falls on with (u - F_C)/m from rest; finger 2 is not pushed."""
    block, more = PLANTS[name]
    law = friction.Params(coulomb=(rub, rub))
    p = block.Params(initial_position=(0.0753, -0.11), friction=law, finger_mass=(0.4, 0.5), **more)
    x, u = block.initial_state(p, block.Inputs()), block.Inputs((-0.5, 0.0))
    a, gap = (0.5 - rub) / 0.4, 0.0753 - 0.065
    moment = sqrt(2.0 * gap / a)
    for _ in range(ceil((moment + 0.03) / h)):
        x = block.step(p, x, u, h)
    y = block.outputs(p, x, u)
    assert y.first_contact_time == (pytest.approx(moment, rel=1e-9), -1.0)
    assert y.impact_velocity == (pytest.approx(a * moment, rel=1e-9), 0.0)
    assert (y.touched[1], y.contact_impulse[1], y.impact_impulse[1]) == (False, 0.0, 0.0)
    assert y.contact_impulse[0] >= y.impact_impulse[0] > 0.0


@pytest.mark.parametrize("name", PLANTS)
def test_the_impulses_are_those_of_equation_1(name):
    """m·(v - v_0) = the impulse of u + that of f_c, of a grasp by both fingers."""
    block, more = PLANTS[name]
    p = block.Params(initial_position=(0.07, -0.01), **more)
    x, u = block.initial_state(p, block.Inputs()), block.Inputs((-0.8, 1.1))
    steps, touched_, impulses = 300, [], []
    for _ in range(steps):
        x = block.step(p, x, u, 1e-3)
        y = block.outputs(p, x, u)
        touched_.append(y.touched)
        impulses.append(y.contact_impulse)
    for j, m in enumerate(p.finger_mass):
        push = u.force[j] * steps * 1e-3
        assert m * y.velocity[j] == pytest.approx(push + y.contact_impulse[j], abs=1e-11)
    assert y.impact_impulse[0] > 0.0 > y.impact_impulse[1]
    first = next(k for k, one in enumerate(touched_) if one[0])
    assert first * 1e-3 <= y.first_contact_time[0] <= (first + 1) * 1e-3
    after = y.first_contact_time[0] + IMPACT_WINDOW
    row = int(after / 1e-3) - 1
    assert impulses[row][0] <= y.impact_impulse[0] <= impulses[row + 1][0]


def test_an_impact_on_a_moving_box_has_the_speed_relative_to_it():
    """Finger 2 shoves a smooth box to finger 1, which comes the other way."""
    p = movable.Params(
        initial_position=(0.075, -0.0355), initial_object_position=0.0, floor_friction=0.0,
        object_mass=0.5, kelvin_voigt=contact_laws.KelvinVoigt(1e5, 0.0),
    )  # fmt: skip
    x = movable.initial_state(p, movable.Inputs())._replace(velocity=(-0.05, 0.1))
    for _ in range(300):
        x = movable.step(p, x, movable.Inputs((0.0, 0.0)), 1e-3)
    y = movable.outputs(p, x, movable.Inputs())
    assert y.impact_velocity == (pytest.approx(0.15, rel=1e-6), pytest.approx(0.1, rel=1e-9))
    lasted = pi / sqrt(1e5 / 0.25)  # of the blow, in which the box gains half of its speed
    moved = 0.1 * (y.first_contact_time[0] - 0.005) - 0.05 * lasted
    assert 0.04 - 0.05 * y.first_contact_time[0] == pytest.approx(moved, abs=1e-6)


def test_fingers_in_tandem_meet_a_fixed_object_in_closed_form():
    """The right finger by the drive, on a wrist that stands still."""
    p = tandem.Params(
        object_fixed=True,
        initial_position=(0.08, -0.05),
        initial_object_position=0.015,
        moving_mass=1.2,
    )
    x = tandem.initial_state(p, tandem.Inputs())
    u = tandem.Inputs(-0.3, 0.015)
    a, gap = 0.3 / 1.2, 0.08 - 0.05
    moment = sqrt(2.0 * gap / a)
    for _ in range(ceil(moment / 5e-3) + 1):
        x = tandem.step(p, x, u, 5e-3)
    y = tandem.outputs(p, x, u)
    assert y.first_contact_time == (
        pytest.approx(moment, rel=1e-9),
        pytest.approx(moment, rel=1e-9),
    )
    assert y.impact_velocity == (pytest.approx(a * moment, rel=1e-9),) * 2


@pytest.mark.parametrize("block", [hand, hand_movable])
def test_fingers_of_a_hand_meet_their_faces_in_closed_form(block):
    """Each by its own force, along its own ray, on a prism that is turned."""
    forces = (-0.5, -0.55, -0.6)
    p = block.Params(initial_object_angle=0.2, initial_object_position=(0.003, -0.002))
    x, u = block.initial_state(p, block.Inputs()), block.Inputs(forces)
    moments = [sqrt(2.0 * 0.5 * (0.11 - s) / -f) for s, f in zip(p.surfaces, forces, strict=True)]
    first = min(moments)
    count = 3 if block is hand else 1  # the first one moves the object
    for _ in range(ceil((max(moments) if block is hand else first) / 5e-3)):
        x = block.step(p, x, u, 5e-3)
    y = block.outputs(p, x, u)
    by_time = sorted(range(3), key=lambda k: moments[k])[:count]
    for k in by_time:
        assert y.first_contact_time[k] == pytest.approx(moments[k], rel=1e-9)
        assert y.impact_velocity[k] == pytest.approx(-forces[k] / 0.5 * moments[k], rel=1e-9)


def test_the_impulses_on_a_hand_are_those_of_its_equation():
    p = hand_movable.Params(initial_object_angle=0.1)
    x, u = hand_movable.initial_state(p, hand_movable.Inputs()), hand_movable.Inputs((-2.0,) * 3)
    for _ in range(400):
        x = hand_movable.step(p, x, u, 1e-3)
    y = hand_movable.outputs(p, x, u)
    for k in range(3):
        momentum = 0.5 * y.velocity[k]
        assert momentum == pytest.approx(y.contact_impulse[k] - 2.0 * 0.4, abs=1e-11)


@pytest.mark.parametrize("block", [rigid, compliant, movable, delicate])
def test_an_object_of_no_width_is_touched(block):
    """A point between the fingers: contact in closed form, and what they press with."""
    p = block.Params(object_width=0.0, initial_position=(0.05, 0.01))
    x, u = block.initial_state(p, block.Inputs()), block.Inputs((-0.5, 0.5))
    for _ in range(3000):
        x = block.step(p, x, u, 1e-3)
    y = block.outputs(p, x, u)
    moment = sqrt(2.0 * 0.02 / 1.0)
    assert y.first_contact_time == (pytest.approx(moment, rel=1e-9),) * 2
    for j, side in enumerate((1.0, -1.0)):  # Eq. (1) over 3 s
        pressed = side * (y.contact_impulse[j] - 0.5 * y.velocity[j])
        assert pressed == pytest.approx(1.5, rel=1e-9)
