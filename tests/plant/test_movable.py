"""Fingers and a box that moves: who pushes alone shifts it, who pushes high topples it."""

from dataclasses import replace
from itertools import islice

import numpy as np
import pytest
from gripper_plant import box as standing
from gripper_plant import contact_laws, movable
from gripper_plant.box import GRAVITY, Box
from gripper_plant.contact_laws import HuntCrossley, KelvinVoigt
from gripper_plant.movable import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

QUICK = examples(25)

NEAR = Params(initial_position=(0.04, -0.04), initial_object_position=0.0)
"""5 mm of gap on either side."""

TALL = replace(NEAR, floor_friction=0.9, contact_height=0.08)
"""It topples before it slides."""


def run(p, x, force, h):
    while True:
        x = movable.step(p, x, Inputs(force), h)
        yield x


def after(p, x, force, h, n):
    return next(islice(run(p, x, force, h), n - 1, None))


def start(p):
    return movable.initial_state(p, Inputs())


def moving(p, position, velocity):
    """Fingers there, at these speeds."""
    x = movable.initial_state(p, Inputs())
    return x._replace(position=position, velocity=velocity)


def stored(p, x):
    """Energy of fingers, box and contacts, J."""
    q, law = standing.shape(p), contact_laws.law(p.kelvin_voigt, p.hunt_crossley)
    right, left = standing.faces(q, x.box)
    kinetic = sum(0.5 * m * v * v for m, v in zip(p.finger_mass, x.velocity, strict=True))
    depths = (right - x.position[0], x.position[1] - left)
    return kinetic + standing.energy(q, x.box) + sum(contact_laws.energy(law, z) for z in depths)


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_one_sided_push_shifts_it(way):
    """And in the end both go as one body, slowed down by the floor."""
    force = (0.0, 0.6) if way > 0.0 else (-0.6, 0.0)
    position = (1.0, -0.036) if way > 0.0 else (0.036, -1.0)
    x = after(NEAR, start(NEAR)._replace(position=position), force, 1e-3, 600)
    y = after(NEAR, x, force, 1e-3, 100)
    a = (0.6 - NEAR.floor_friction * NEAR.object_mass * GRAVITY) / (0.5 + NEAR.object_mass)
    assert way * x.box.x > 0.02
    assert way * (y.box.v - x.box.v) == pytest.approx(0.1 * a, rel=1e-3)
    assert (x.box.tilt, x.toppled) == (0.0, False)


def test_a_push_near_the_top_topples_it_for_good():
    x = start(TALL)
    seen = []
    for force in (0.3, 0.3, -0.3):  # m·g·w/(2·h) = 0.21 N
        x = after(TALL, x, (0.0, force), 1e-3, 400)
        y = movable.outputs(TALL, x, Inputs())
        seen.append((y.toppled, y.tilt > 0.0))
    assert seen[1:] == [(True, True), (True, True)]
    assert y.tilt == pytest.approx(standing.balance(standing.shape(TALL)), rel=0.02)
    assert after(TALL, x, (-3.0, 3.0), 1e-3, 100).box == x.box


@pytest.mark.parametrize("enabled", [False, True], ids=["Kelvin-Voigt", "Hunt-Crossley"])
def test_an_impact_hands_over_the_momentum(enabled):
    """On a smooth floor, and without damping the speeds are those of an elastic collision."""
    p = replace(
        NEAR,
        floor_friction=0.0,
        kelvin_voigt=KelvinVoigt(1e4, 0.0),
        hunt_crossley=HuntCrossley(enabled, 2e5, 1.5, 0.0),
    )
    x = moving(p, (0.04, -0.036), (0.0, 0.1))
    x = after(p, x, (0.0, 0.0), 2e-4, 200)
    m, big = p.object_mass, 0.5
    assert x.contact_force == (0.0, 0.0)
    assert x.box.v == pytest.approx(2.0 * big / (m + big) * 0.1, rel=1e-9)
    assert x.velocity[1] == pytest.approx((big - m) / (m + big) * 0.1, rel=1e-9)


def test_the_order_of_convergence():
    """Second, over a push that comes, shifts the box and presses on."""
    p = replace(NEAR, kelvin_voigt=KelvinVoigt(200.0, 1.0))
    x = moving(p, (0.04, -0.0361), (0.0, 0.1))
    t, force = 0.05, (0.0, 0.5)
    steps = [100, 200, 400, 800]
    fine = after(p, x, force, t / 6400, 6400)
    assert fine.box.x > 1e-3
    errors = [abs(after(p, x, force, t / n, n).box.x - fine.box.x) for n in steps]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.4)


FORCES = st.tuples(st.floats(-8.0, 8.0), st.floats(-8.0, 8.0))
HISTORIES = st.lists(st.tuples(FORCES, st.floats(5e-5, 2e-3)), min_size=5, max_size=12)


@st.composite
def plants(draw):
    """A box that slides or tilts between fingers that are near, in motion."""
    height = draw(st.floats(0.05, 0.2))
    p = Params(
        finger_mass=(draw(st.floats(0.1, 2.0)), draw(st.floats(0.1, 2.0))),
        initial_object_position=0.0,
        object_mass=draw(st.floats(0.02, 1.0)),
        object_height=height,
        contact_height=height * draw(st.floats(0.3, 1.0)),
        floor_friction=draw(st.sampled_from([0.0, 0.3, 0.9])),
        kelvin_voigt=KelvinVoigt(5e3, draw(st.sampled_from([0.0, 15.0]))),
    )
    near, speeds = st.floats(-1e-3, 2e-3), st.floats(-0.3, 0.3)
    box = Box(0.0, 0.0, draw(st.floats(-0.1, 0.1)), 0.0)
    position = (0.035 + draw(near), -0.035 - draw(near))
    return p, moving(p, position, (draw(speeds), draw(speeds)))._replace(box=box)


@QUICK
@given(plants(), HISTORIES)
def test_contacts_push_only_and_nothing_gives_energy(begin, history):
    """Exactly while the box is flat; on its edge but for the midpoint rule's third order."""
    p, x = begin
    for force, h in history:
        before, x = x, movable.step(p, x, Inputs(force), h)
        y = movable.outputs(p, x, Inputs(force))
        assert y.contact_force[0] >= 0.0 >= y.contact_force[1]
        assert min(y.gap) >= 0.0
        moved = zip(force, before.position, x.position, strict=True)
        work = sum(f * (b - a) for f, a, b in moved)
        scale = stored(p, before) + stored(p, x) + abs(work)
        flat = before.box.tilt == x.box.tilt == 0.0
        assert stored(p, x) - stored(p, before) - work <= (1e-9 if flat else 1e-5) * scale
