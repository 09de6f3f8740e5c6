"""Fingers in tandem on a wrist against a solution in continuous time; energy, order, symmetry.

The inputs are held over whole steps, so both have the same; forces of the plant are those of its
last sub-step.
"""

from dataclasses import replace
from functools import cache
from math import nan, pi

import numpy as np
import pytest
from gripper_plant import box as standing
from gripper_plant import contact_laws, tandem
from gripper_plant.box import Box
from gripper_plant.contact_laws import HuntCrossley, KelvinVoigt
from gripper_plant.drive import Drive, Kind
from gripper_plant.tandem import Inputs, Params
from gripper_plant.wrist import Wrist
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples
from support.tandem_continuous import Gripper, solve

FINE = 1e-4
"""s, between the points at which the reference is taken."""

STOP = 0.36
"""s."""

CHANGES = (
    (0.0, -0.6, 0.0),
    (0.1, 0.4, 0.003),
    (0.16, -1.5, 0.006),
    (0.26, 1.2, 0.002),
    (0.3, -2.0, 0.004),
)
"""From when on F in N and X_c in m are held: it closes with some 0.1 m/s, lets go and grasps anew.
"""

NEAR = Gripper(x_init=(0.05, -0.05), x_m=0.004)
"""11 and 19 mm of gap."""

FREE = replace(NEAR, m=0.05)

CASES = {
    "fixed": NEAR,
    "free": FREE,
    "both limits": replace(NEAR, v_max=0.05, a_max=0.8),
    "delay": replace(FREE, tau=0.0137),
    "underdamped": replace(FREE, zeta=0.5),
    "overdamped": replace(NEAR, zeta=3.0),
    "compliance": replace(NEAR, compliance=1e-3),
    "compliance, free": replace(FREE, compliance=1e-3),
    "friction of the drive": replace(NEAR, f_c=0.3, x_m=0.002),
    "force limit": replace(NEAR, f_max=1.0),
    "speed servo": replace(FREE, omega_d=2.0 * pi * 10.0, f_max=1.0, f_c=0.3),
    "all at once": Gripper(
        0.8, (0.05, -0.05), 0.07, 0.004, 0.04, 0.5, 5e3, 15.0, 8.0, 0.7, 2e-4, 0.0123, 0.06, 1.5,
        2.0 * pi * 15.0, 1.5, 0.2,
    ),
}  # fmt: skip


QUICK = ["free", "both limits", "compliance, free", "speed servo", "all at once"]


def plant_of(g):
    """The parameters of the plant for those of the reference."""
    servo = Kind.SPEED if g.omega_d else Kind.FORCE
    return Params(
        moving_mass=g.M,
        initial_position=g.x_init,
        object_width=g.W,
        initial_object_position=g.x_m,
        object_fixed=g.m is None,
        object_mass=g.m or 0.05,
        floor_friction=g.mu,
        kelvin_voigt=KelvinVoigt(g.k, g.c),
        wrist=Wrist(g.f, g.zeta, g.compliance, g.tau, g.v_max, g.a_max),
        drive=Drive(servo, g.omega_d / (2.0 * pi) or 10.0, g.f_max, g.f_c),
    )


@cache
def reference(g, changes=CHANGES, stop=STOP):
    return solve(g, changes, np.arange(round(stop / FINE) + 1) * FINE)


def touches(p, x, u, j, h):
    """The moment within a step at which a finger touches, of the plant itself."""
    early, late = 0.0, h
    while late - early > 1e-6:
        middle = 0.5 * (early + late)
        if tandem.outputs(p, tandem.step(p, x, u, middle), u).contact[j]:
            late = middle
        else:
            early = middle
    return late


def run(g, h, changes=CHANGES, stop=STOP):
    """The motions and pushes at each point, and the moments of the first contacts."""
    p = plant_of(g)
    x = tandem.initial_state(p, Inputs())
    first, rows, pending = [nan, nan], [(*x.body.wrist, *x.body.opening, g.x_m, 0.0, 0.0, 0.0)], 0
    for k in range(round(stop / h)):
        while pending + 1 < len(changes) and changes[pending + 1][0] <= (k + 0.5) * h:
            pending += 1
        u = Inputs(*changes[pending][1:])
        before, x = x, tandem.step(p, x, u, h)
        y = tandem.outputs(p, x, u)
        for j in (0, 1):
            if y.contact[j] and np.isnan(first[j]):
                first[j] = k * h + touches(p, before, u, j, h)
        f_1, f_2 = y.contact_force
        rows.append((*x.body.wrist, *x.body.opening, y.object_position, x.body.box.v, f_1, -f_2))
    return np.array(rows), first


def as_the_reference(g, h, changes=CHANGES, stop=STOP, *, moment, place, force, late=1e-3):
    """Contacts within a moment in s, places in m, forces within a share of the highest one.

    The plant's force is the mean over its last sub-step, `late` at most in s. Where the moment is
    None contacts may come and go within a step, of which its end does not tell.
    """
    expected = reference(g, changes, stop)
    rows, first = run(g, h, changes, stop)
    if moment is not None:
        times = np.array(expected.contact_time, float)
        assert first == pytest.approx(times, abs=moment, nan_ok=True)
    every, back = round(h / FINE), round(late / FINE)
    states = expected.states[::every]
    assert rows[:, [0, 2, 4]] == pytest.approx(states[:, [0, 2, 4]], abs=place)
    allowed = force * expected.forces.max()
    for k in range(1, len(rows)):
        lately = expected.forces[max(0, k * every - back) : k * every + 1]
        assert np.all(rows[k, 6:] >= lately.min(0) - allowed), k * h
        assert np.all(rows[k, 6:] <= lately.max(0) + allowed), k * h


@pytest.mark.parametrize("h", [1e-3, 2e-2])
@pytest.mark.parametrize("case", QUICK)
def test_it_goes_as_in_continuous_time(case, h):
    as_the_reference(CASES[case], h, moment=1e-4, place=5e-6, force=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("h", [1e-4, 1e-3, 5e-3, 2e-2])
@pytest.mark.parametrize("case", CASES)
def test_it_does_with_every_part_and_in_any_step(case, h):
    """A delay joins steps shorter than a sixtieth of it: by 10 um."""
    as_the_reference(CASES[case], h, moment=1e-4, place=1.2e-5, force=0.01)


@st.composite
def grippers(draw):
    """Of any numbers, with some of the parts."""
    some = st.sampled_from
    servo = draw(some([0.0, 0.0, 30.0, 120.0]))
    return Gripper(
        M=draw(st.floats(0.3, 3.0)),
        x_init=(0.05, -0.05),
        x_m=draw(st.floats(-0.01, 0.01)),
        m=draw(st.none() | st.floats(0.02, 0.5)),
        mu=draw(some([0.0, 0.3, 0.6])),
        k=draw(st.floats(1e3, 3e4)),
        c=draw(st.floats(10.0, 60.0)),
        f=draw(st.floats(1.0, 30.0)),
        zeta=draw(st.floats(0.5, 3.0)),
        compliance=draw(some([0.0, 1e-4, 1e-3])),
        tau=draw(some([0.0, 0.0123, 0.05])),
        v_max=draw(some([0.0, 0.05, 0.2])),
        a_max=draw(some([0.0, 0.5, 5.0])),
        omega_d=servo,
        f_max=draw(st.floats(3.0, 10.0)) if servo else draw(some([0.0, 1.0])),
        f_c=draw(some([0.0, 0.3])),
    )


@st.composite
def inputs(draw):
    """Changes each some 60 ms."""
    force, place = st.floats(-2.0, 0.5), st.floats(-0.01, 0.01)
    later = [(0.06 * k, draw(force), draw(place)) for k in range(1, 6)]
    return ((0.0, -1.0, 0.0), *later)


@pytest.mark.slow
@examples(60)
@given(grippers(), inputs(), st.sampled_from([1e-3, 5e-3, 2e-2]))
def test_any_gripper_goes_as_in_continuous_time(g, changes, h):
    as_the_reference(g, h, changes, moment=None, place=1e-4, force=0.02, late=5e-3)


def in_motion(p, half, closing, box=0.0, tilted=0.0):
    """The fingers at half an opening in m, closing, the box sliding, both in m/s; it leans."""
    x = tandem.initial_state(p, Inputs())
    body = x.body._replace(
        opening=(half, -closing), box=Box(x.body.box.x, tilted, box, 0.0), reference=-closing
    )
    return x._replace(body=body)


def after(p, x, u, h, n):
    for _ in range(n):
        x = tandem.step(p, x, u, h)
    return x


SOFT = Params(
    initial_position=(0.05, -0.05),
    initial_object_position=0.0,
    kelvin_voigt=KelvinVoigt(200.0, 0.5),
    wrist=Wrist(compliance=1e-3),
)


def places(x):
    return np.array([x.body.box.x, x.body.opening[0], x.body.wrist[0]])


@pytest.mark.parametrize("motor", [Drive(), Drive(Kind.SPEED, 10.0, 5.0, 0.2)])
def test_the_order_of_convergence(motor):
    """Second, over a push that comes, shifts the box and presses on, the wrist giving way.

    It is first where a damped wall, met fast, has a box slide at once: mu·g for a part of a
    sub-step.
    """
    p = replace(SOFT, drive=motor)
    x, u, t = in_motion(p, 0.0361, 0.1), Inputs(-1.0, 0.005), 0.05
    steps = [100, 200, 400, 800]
    fine = places(after(p, x, u, t / 6400, 6400))
    assert fine[0] > 1e-3
    errors = [np.abs(places(after(p, x, u, t / n, n)) - fine).max() for n in steps]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.1)


def stored(p, x):
    """Energy of fingers, box and contacts, J."""
    (middle, _), (half, closing), box = x.body.wrist, x.body.opening, x.body.box
    right, left = standing.faces(p.shape, box)
    depths = right - middle - half, middle - half - left
    moving = 0.5 * p.moving_mass * closing * closing + standing.energy(p.shape, box)
    return moving + sum(contact_laws.energy(p.law, depth) for depth in depths)


@st.composite
def plants(draw):
    """A box between fingers that are near, all in motion."""
    height = draw(st.floats(0.05, 0.2))
    p = Params(
        moving_mass=draw(st.floats(0.2, 3.0)),
        initial_position=(0.05, -0.05),
        initial_object_position=0.0,
        object_fixed=draw(st.booleans()),
        object_mass=draw(st.floats(0.02, 1.0)),
        object_height=height,
        contact_height=height * draw(st.floats(0.3, 1.0)),
        floor_friction=draw(st.sampled_from([0.0, 0.3, 0.9])),
        kelvin_voigt=KelvinVoigt(5e3, draw(st.sampled_from([0.0, 15.0]))),
        hunt_crossley=HuntCrossley(draw(st.booleans()), 1e5),
        wrist=Wrist(
            draw(st.floats(0.5, 50.0)),
            draw(st.floats(0.0, 3.0)),
            draw(st.sampled_from([0.0, 1e-3])),
            speed_limit=draw(st.sampled_from([0.0, 0.05])),
            acceleration_limit=draw(st.sampled_from([0.0, 1.0])),
        ),
        drive=Drive(friction=draw(st.sampled_from([0.0, 0.5]))),
    )
    slides = 0.0 if p.object_fixed else draw(st.floats(-0.1, 0.1))
    return p, in_motion(p, draw(st.floats(0.0345, 0.036)), draw(st.floats(-0.2, 0.3)), slides)


HISTORIES = st.lists(
    st.tuples(st.floats(-8.0, 8.0), st.floats(-0.02, 0.02), st.floats(5e-6, 3e-5)),
    min_size=10,
    max_size=30,
)
"""F in N, X_c in m, and steps in s that are one sub-step."""


@examples(40)
@given(plants(), HISTORIES)
def test_contacts_push_only_and_nothing_gives_energy(begin, history):
    """All that comes in is the work of the drive and that of the wrist against the contacts; on its
    edge the box is exact but for the midpoint rule's third order.
    """
    p, x = begin
    for force, command, h in history:
        before, x = x, tandem.step(p, x, Inputs(force, command), h)
        y = tandem.outputs(p, x, Inputs())
        assert y.contact_force[0] >= 0.0 >= y.contact_force[1]
        assert min(y.gap) >= 0.0
        assert y.wrist_force == sum(y.contact_force)
        closed = x.body.opening[0] - before.body.opening[0]
        carried = x.body.wrist[0] - before.body.wrist[0]
        work = force * closed - y.wrist_force * carried
        scale = (
            stored(p, before) + stored(p, x) + abs(force * closed) + abs(y.wrist_force * carried)
        )
        flat = before.body.box.tilt == x.body.box.tilt == 0.0
        assert stored(p, x) - stored(p, before) - work <= (1e-9 if flat else 1e-5) * scale + 1e-15


def mirrored(p):
    right, left = p.initial_position
    return replace(
        p,
        initial_position=(-left, -right),
        initial_object_position=-p.initial_object_position,
    )


STEPS = st.lists(
    st.tuples(st.floats(-4.0, 1.0), st.floats(-0.03, 0.03), st.floats(1e-4, 2e-2)),
    min_size=3,
    max_size=8,
)


@examples(30)
@given(grippers(), STEPS, st.floats(0.05, 0.3), st.floats(-0.004, 0.006))
def test_the_mirrored_gripper_does_exactly_the_mirrored_thing(g, history, height, off):
    """A high push included, which topples the box."""
    p = plant_of(replace(g, x_init=(0.05 + off, -0.05), mu=min(1.0, 2.0 * g.mu)))
    p = replace(p, object_height=height, contact_height=0.9 * height)
    image = mirrored(p)
    x, z = tandem.initial_state(p, Inputs()), tandem.initial_state(image, Inputs())
    for force, command, h in history:
        x = tandem.step(p, x, Inputs(force, command), h)
        z = tandem.step(image, z, Inputs(force, -command), h)
        y, seen = tandem.outputs(p, x, Inputs()), tandem.outputs(image, z, Inputs())
        assert seen.position == tuple(-v for v in y.position[::-1])
        assert seen.velocity == tuple(-v for v in y.velocity[::-1])
        assert seen.contact_force == tuple(-v for v in y.contact_force[::-1])
        assert (seen.gap, seen.contact) == (y.gap[::-1], y.contact[::-1])
        assert (seen.object_position, seen.tilt) == (-y.object_position, -y.tilt)
        assert (seen.wrist_position, seen.wrist_velocity) == (-y.wrist_position, -y.wrist_velocity)
        assert (seen.wrist_force, seen.toppled) == (-y.wrist_force, y.toppled)


@pytest.mark.parametrize("case", ["all at once", "compliance, free"])
def test_the_mirrored_grasp_has_the_mirrored_bits(case):
    """From free flight into a grasp, both fingers pressing."""
    g = CASES[case]
    image = replace(g, x_m=-g.x_m)
    rows, _ = run(g, 5e-3)
    seen, _ = run(image, 5e-3, tuple((t, f, -x) for t, f, x in CHANGES))
    assert rows[:, 6:].min(1).max() > 0.5
    assert np.array_equal(seen[:, [0, 1, 4, 5]], -rows[:, [0, 1, 4, 5]])
    assert np.array_equal(seen[:, [2, 3]], rows[:, [2, 3]])
    assert np.array_equal(seen[:, 6:], rows[:, :5:-1])


@pytest.mark.parametrize(("force", "speed"), [(-3.0, 0.0), (0.0, 0.3), (0.0, -0.3)])
def test_one_long_step_meets_the_contact_that_short_ones_do(force, speed):
    """Whether the drive brings a finger there, or the wrist that swings and is told nothing new."""
    p = replace(plant_of(NEAR), wrist=Wrist(1.0, 0.0))
    x = tandem.initial_state(p, Inputs())
    x = x._replace(body=x.body._replace(wrist=(0.0, speed)))
    u = Inputs(force, 0.0)
    fine = after(p, x, u, 2e-4, 600).body
    assert fine.opening[1] > 0.05
    assert tandem.step(p, x, u, 0.12).body.opening == pytest.approx(fine.opening, abs=2e-3)


def test_at_the_start_all_rests_where_it_was_put():
    """The wrist in the middle of the fingertips, and as it was told."""
    p = Params(initial_position=(0.12, -0.1), wrist=Wrist(delay=0.05))
    x = tandem.initial_state(p, Inputs(0.0, 7.0))
    y = tandem.outputs(p, after(p, x, Inputs(0.0, 7.0), 0.01, 5), Inputs())
    assert y.position == pytest.approx((0.12, -0.1), abs=1e-15)
    assert y.wrist_position == pytest.approx(0.01, abs=1e-15)
    assert y.velocity == (0.0, 0.0)


def test_a_push_near_the_top_topples_the_box_for_good():
    p = Params(
        initial_position=(0.05, -0.05),
        initial_object_position=0.0,
        floor_friction=0.9,
        contact_height=0.08,
    )
    x = after(p, tandem.initial_state(p, Inputs()), Inputs(0.0, 0.12), 5e-3, 60)
    y = tandem.outputs(p, x, Inputs())
    assert (y.toppled, y.tilt > 0.0) == (True, True)
    assert (x.body.box.v, x.body.box.w) == (0.0, 0.0)
    assert after(p, x, Inputs(-1.0, -0.1), 5e-3, 20).body.box == x.body.box


def test_a_step_that_would_need_too_many_sub_steps_is_refused():
    stiff = replace(SOFT, kelvin_voigt=KelvinVoigt(1e7, 1e5))
    x = in_motion(stiff, 0.034, 0.1)
    y = tandem.outputs(stiff, tandem.step(stiff, x, Inputs(), 1.0), Inputs())
    assert np.isnan(y.position).all()
    fine = tandem.step(stiff, x, Inputs(), 1e-6)
    assert np.isfinite(tandem.outputs(stiff, fine, Inputs()).position).all()
