"""An object that gives: known impacts, never a pull, no energy from nothing, damage remembered."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from gripper_plant import compliant, contact_laws, friction
from gripper_plant.compliant import Inputs, Params
from gripper_plant.contact_laws import HuntCrossley, KelvinVoigt, mean_force
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples

QUICK = examples(60)

M, V = 0.5, 0.2
"""kg and m/s of finger 1, which arrives; finger 2 stays away."""

VOIGT = Params(kelvin_voigt=KelvinVoigt(2000.0, 12.0))
HUNT = Params(hunt_crossley=HuntCrossley(True, 30000.0, 1.5, 2.0))
LAWS = {"Kelvin-Voigt": VOIGT, "Hunt-Crossley": HUNT}


def moving(p, position, velocity):
    """Fingers there, at these speeds."""
    return compliant.initial_state(p, Inputs())._replace(position=position, velocity=velocity)


def arrival(p):
    """Finger 1 at the surface, on its way in."""
    right = p.sides[0].surface
    return moving(p, (right, -0.11), (-V, 0.0))


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


@pytest.mark.parametrize(
    "p", [VOIGT, HUNT, Params(hunt_crossley=HuntCrossley(True, 3e4, 1.5, 0.0))]
)
def test_an_impact_is_that_of_its_equation_until_it_lets_go(p):
    """It lets go where the force would pull, with Kelvin-Voigt before delta = 0, and flies on."""
    k, n, c, lam = p.law

    def force(z):
        return k * max(z[0], 0.0) ** n * (1.0 + lam * z[1]) + c * z[1]

    def pulls(_, z):
        return force(z) if c else z[0]

    pulls.terminal, pulls.direction = True, -1.0
    motion = solve_ivp(
        lambda _, z: [z[1], -force(z) / M], (0.0, 0.2), (0.0, V), "DOP853", events=pulls,
        rtol=1e-11, atol=1e-14, max_step=1e-3, dense_output=True,
    )  # fmt: skip
    end, leaving, h = float(motion.t_events[0][0]), float(motion.y[1, -1]), 2e-5
    states = list(islice(run(p, arrival(p), (0.0, 0.0), h), round(1.2 * end / h)))
    for k, x in enumerate(states[: int(end / h)], 1):
        assert depth(p, x) == pytest.approx(motion.sol(k * h)[0], abs=1e-8)
        assert x.velocity[0] == pytest.approx(-motion.sol(k * h)[1], abs=1e-6)
    assert states[-1].velocity[0] == pytest.approx(-leaving, rel=1e-5)
    assert states[-1].contact_force == (0.0, 0.0)
    gone = next(k for k, x in enumerate(states, 1) if k > 9 and x.contact_force[0] == 0.0)
    assert gone * h == pytest.approx(end, abs=2.1 * h)


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
    assert after(p, x, (-2.0, 2.0), 1e-3, 10)[:4] == x[:4]


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
    return p, moving(p, position, (draw(speeds), draw(speeds)))


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
