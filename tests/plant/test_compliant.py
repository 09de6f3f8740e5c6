"""An object that gives: known impacts, never a pull, no energy from nothing, damage remembered."""

from dataclasses import replace
from itertools import islice
from math import cos, exp, sin, sqrt

import numpy as np
import pytest
from gripper_plant import compliant, contact_laws, friction
from gripper_plant.compliant import Inputs, Params, State
from gripper_plant.contact_laws import HuntCrossley, KelvinVoigt, mean_force
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.gripper import assert_ranges_are_checked, swapped
from support.marks import examples

QUICK = examples(60)

M, V = 0.5, 0.2
"""kg and m/s of finger 1, which arrives; finger 2 stays away."""

VOIGT = Params(kelvin_voigt=KelvinVoigt(2000.0, 12.0))
HUNT = Params(hunt_crossley=HuntCrossley(True, 30000.0, 1.5, 2.0))
LAWS = {"Kelvin-Voigt": VOIGT, "Hunt-Crossley": HUNT}


def arrival(p):
    """Finger 1 at the surface, on its way in."""
    right = p.sides[0].surface
    return State((right, -0.11), (-V, 0.0), (0.0, 0.0), False)


def run(p, x, force, h):
    """Step after step, the force held."""
    while True:
        x = compliant.step(p, x, Inputs(force), h)
        yield x


def after(p, x, force, h, n):
    return next(islice(run(p, x, force, h), n - 1, None))


def depth(p, x):
    return p.sides[0].surface - x.position[0]


def stored(p, x):
    """Energy of the motion and of both sides of the object, J."""
    law = contact_laws.law(p.kelvin_voigt, p.hunt_crossley)
    right, left = (side.surface for side in p.sides)
    gaps = (x.position[0] - right, -x.position[1] - left)
    kinetic = sum(0.5 * m * v * v for m, v in zip(p.finger_mass, x.velocity, strict=True))
    return kinetic + sum(contact_laws.energy(law, -gap) for gap in gaps)


# ------------------------------------------------------------------------ known impacts


def test_an_impact_on_kelvin_voigt_is_the_damped_oscillator_until_it_lets_go():
    """It lets go where k·delta + c·delta' = 0, which is before delta = 0, and flies on."""
    k, c = VOIGT.kelvin_voigt.stiffness, VOIGT.kelvin_voigt.damping
    sigma = 0.5 * c / M
    w = sqrt(k / M - sigma**2)

    def solution(t):
        delta = V / w * exp(-sigma * t) * sin(w * t)
        return delta, V * exp(-sigma * t) * cos(w * t) - sigma * delta

    h, left = 1e-5, 0.0
    for n, x in enumerate(islice(run(VOIGT, arrival(VOIGT), (0.0, 0.0), h), 8000), 1):
        delta, rate = solution(n * h)
        if k * delta + c * rate < 0.0:
            left = left or n * h
        if not left:
            assert depth(VOIGT, x) == pytest.approx(delta, abs=1e-6 * V / w)
            assert x.velocity[0] == pytest.approx(-rate, abs=1e-6 * V)
    _, rate = solution(left)
    assert 0.04 < left < 0.05
    assert x.velocity[0] == pytest.approx(-rate, rel=1e-5)
    assert x.contact_force == (0.0, 0.0)
    assert depth(VOIGT, x) < 0.0


@pytest.mark.parametrize("damping", [0.0, 0.5, 2.0])
def test_an_impact_on_hunt_crossley_is_that_of_its_equation(damping):
    p = Params(hunt_crossley=HuntCrossley(True, 30000.0, 1.5, damping))

    def slope(_, z):
        delta, rate = max(z[0], 0.0), z[1]
        return [rate, -30000.0 * delta**1.5 * (1.0 + damping * rate) / M]

    def out(_, z):
        return z[0]

    out.terminal, out.direction = True, -1.0  # type: ignore[attr-defined]
    motion = solve_ivp(
        slope, (0.0, 0.2), (0.0, V), method="DOP853", events=out, rtol=1e-11, atol=1e-14,
        max_step=1e-3,
    )  # fmt: skip
    end, leaving = float(motion.t_events[0][0]), float(motion.y[1, -1])
    states = list(islice(run(p, arrival(p), (0.0, 0.0), 2e-5), round(1.2 * end / 2e-5)))
    deepest = max(depth(p, x) for x in states)
    assert deepest == pytest.approx(float(motion.y[0].max()), rel=1e-3)
    assert states[-1].velocity[0] == pytest.approx(-leaving, rel=1e-5)
    gone = next(n for n, x in enumerate(states, 1) if depth(p, x) < 0.0)
    assert gone * 2e-5 == pytest.approx(end, abs=3e-5)


@pytest.mark.parametrize("name", LAWS)
def test_the_order_of_convergence(name):
    """Second, from before the contact into it: half the step, a quarter of the error.

    The object is so narrow that no step is divided.
    """
    p, t = replace(LAWS[name], object_width=0.02), 0.03
    start = arrival(p)._replace(position=(p.sides[0].surface + 0.00137, -0.11))
    steps = [150, 300, 600, 1200]
    fine = after(p, start, (-0.5, 0.0), t / 19200, 19200)
    errors = [
        abs(after(p, start, (-0.5, 0.0), t / n, n).position[0] - fine.position[0]) for n in steps
    ]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.3)


# ------------------------------------------------------------------------------ at rest


@pytest.mark.parametrize("name", LAWS)
def test_a_pressed_object_gives_what_its_law_says(name):
    p, force = replace(LAWS[name], initial_position=(0.066, -0.006)), 3.43
    x = after(p, compliant.initial_state(p, Inputs()), (-force, force), 2e-3, 1500)
    y = compliant.outputs(p, x, Inputs())
    one = force / 2000.0 if name == "Kelvin-Voigt" else (force / 30000.0) ** (2.0 / 3.0)
    assert y.squeeze == pytest.approx(2.0 * one, rel=1e-9)
    assert y.contact_force == pytest.approx((force, -force), rel=1e-9)
    assert y.gap == (0.0, 0.0)
    assert y.contact == (True, True)
    assert y.object_position == 0.03


def test_the_gap_is_the_distance_until_the_finger_touches():
    y = compliant.outputs(VOIGT, compliant.initial_state(VOIGT, Inputs()), Inputs())
    assert y.gap == pytest.approx((0.045, 0.105))
    assert (y.contact, y.squeeze, y.damaged) == ((False, False), 0.0, False)


def test_damage_is_remembered():
    p = Params(
        initial_position=(0.066, -0.006),
        squeeze_limit=0.003,
        kelvin_voigt=KelvinVoigt(1000.0, 100.0),
    )
    x = compliant.initial_state(p, Inputs())
    seen = []
    for force in (1.4, 1.6, 0.2, -1.0):  # on each of two sides of 1 kN/m
        x = after(p, x, (-force, force), 1e-3, 1000)
        y = compliant.outputs(p, x, Inputs())
        seen.append((y.squeeze > 0.003, y.damaged))
    assert seen == [(False, False), (True, True), (False, True), (False, True)]


@pytest.mark.parametrize("name", LAWS)
def test_fingers_with_friction_stick_in_the_object(name):
    p = Params(
        kelvin_voigt=LAWS[name].kelvin_voigt,
        hunt_crossley=LAWS[name].hunt_crossley,
        friction=friction.Params((0.2, 0.2), (0.3, 0.3)),
    )
    x = after(p, compliant.initial_state(p, Inputs()), (-2.0, 2.0), 1e-3, 1500)
    assert x.velocity == (0.0, 0.0)
    assert np.abs(x.contact_force) == pytest.approx([2.0, 2.0], abs=0.3)
    assert after(p, x, (-2.0, 2.0), 1e-3, 10) == x


# ---------------------------------------------------------------- for any motion at all

FORCES = st.tuples(st.floats(-20.0, 20.0), st.floats(-20.0, 20.0))
HISTORIES = st.lists(st.tuples(FORCES, st.floats(1e-5, 3e-3)), min_size=5, max_size=15)


@st.composite
def plants(draw):
    """Fingers near the object or in it, moving."""
    near = st.floats(-3e-3, 2e-3)
    p = Params(
        finger_mass=(draw(st.floats(0.05, 5.0)), draw(st.floats(0.05, 5.0))),
        initial_object_position=0.0,
        kelvin_voigt=KelvinVoigt(draw(st.floats(10.0, 1e4)), draw(st.floats(0.0, 50.0))),
        hunt_crossley=HuntCrossley(
            draw(st.booleans()), 2e4, draw(st.floats(1.0, 2.0)), draw(st.floats(0.0, 3.0))
        ),
    )
    speeds = st.floats(-0.5, 0.5)
    position = (0.035 + draw(near), -0.035 - draw(near))
    return p, State(position, (draw(speeds), draw(speeds)), (0.0, 0.0), False)


@QUICK
@given(plants(), HISTORIES)
def test_the_object_never_pulls_and_gives_no_more_than_it_was_given(start, history):
    p, x = start
    for force, h in history:
        before, x = x, compliant.step(p, x, Inputs(force), h)
        y = compliant.outputs(p, x, Inputs(force))
        assert y.contact_force[0] >= 0.0 >= y.contact_force[1]
        assert min(y.gap) >= 0.0
        moved = zip(force, before.position, x.position, strict=True)
        work = sum(f * (b - a) for f, a, b in moved)
        scale = stored(p, before) + stored(p, x) + abs(work)
        assert stored(p, x) - stored(p, before) - work <= 1e-9 * scale


@QUICK
@given(plants(), HISTORIES)
def test_the_mirrored_gripper_does_exactly_the_mirrored_thing(start, history):
    p, x = start
    q = Params(
        p.finger_mass[::-1],
        initial_object_position=-p.initial_object_position,
        kelvin_voigt=p.kelvin_voigt,
        hunt_crossley=p.hunt_crossley,
    )

    def image(x):
        return State(swapped(x.position), swapped(x.velocity), swapped(x.contact_force), x.damaged)

    z = image(x)
    for force, h in history:
        x = compliant.step(p, x, Inputs(force), h)
        z = compliant.step(q, z, Inputs(swapped(force)), h)
        assert z == image(x)


@QUICK
@given(st.floats(-1e-3, 5e-3), st.floats(-1e-3, 5e-3), st.floats(1e-5, 1e-3), st.booleans())
def test_the_held_force_does_the_work_of_the_spring(before, after, d, hunt):
    """Without damping to the last digits, whatever the way; with damping more, and never back."""
    p = HuntCrossley(hunt, 3e4, 1.5, 0.0)
    law = contact_laws.law(KelvinVoigt(2e3, 0.0), p)
    stored = contact_laws.energy(law, after) - contact_laws.energy(law, before)
    work = mean_force(law, before, after, d) * (after - before)
    assert work == pytest.approx(stored, rel=1e-9, abs=1e-15)
    damped = contact_laws.law(KelvinVoigt(2e3, 5.0), HuntCrossley(hunt, 3e4, 1.5, 2.0))
    assert mean_force(damped, before, after, d) * (after - before) >= stored - 1e-15


# ----------------------------------------------------------------------------- parameters


def test_values_outside_their_ranges_are_refused():
    assert_ranges_are_checked(Params, but=("initial_position", "object_width"))
    assert_ranges_are_checked(KelvinVoigt, "kelvin_voigt.")
    assert_ranges_are_checked(HuntCrossley, "hunt_crossley.")


def test_an_object_that_does_not_fit_is_refused():
    with pytest.raises(ValueError, match="must fit between the fingertips"):
        Params(object_width=0.5)
