"""The box on the floor: it sticks, slides, tilts, falls back; each by its equation."""

from itertools import islice
from math import atan2, cos, sin

import numpy as np
import pytest
from gripper_plant.box import GRAVITY, Box, Pushes, Shape, advance, balance, centre, energy, faces
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.marks import examples

QUICK = examples(60)

UPRIGHT = Shape(b=0.035, a=0.05, m=0.05, mu=0.3, h=0.05)
"""70 mm wide, 100 mm high, 50 g, pushed at its middle: it slides long before it would tilt."""

ROUGH = UPRIGHT._replace(mu=0.9, h=0.08)
"""On a rough floor, pushed near its top, it topples before it slides."""

WEIGHT = UPRIGHT.m * GRAVITY
REST = Box(0.0, 0.0, 0.0, 0.0)
NOTHING = Pushes(0.0, 0.0)


def run(q, box, push, d):
    while True:
        box = advance(q, box, push, d)
        yield box


def after(q, box, push, d, n):
    return next(islice(run(q, box, push, d), n - 1, None))


@st.composite
def shapes(draw):
    b, a, share = (draw(st.floats(low, high)) for low, high in ((0.01, 0.1), (0.02, 0.1), (0, 1)))
    return Shape(b, a, draw(st.floats(0.02, 2.0)), draw(st.floats(0.0, 1.0)), 2.0 * a * share)


@st.composite
def boxes(draw):
    """Flat or tilted, anywhere short of its balance, moving."""
    q = draw(shapes())
    tilt = draw(st.sampled_from([0.0, draw(st.floats(-0.9, 0.9))])) * balance(q)
    w = draw(st.floats(-3.0, 3.0)) if tilt else 0.0
    return q, Box(draw(st.floats(-0.1, 0.1)), tilt, draw(st.floats(-0.5, 0.5)), w)


STEPS = st.floats(1e-5, 5e-4)


@pytest.mark.parametrize(
    ("push", "share"), [((0.2999, 0.0), 0.0), ((0.0, 0.2999), 0.0), ((99.0, 99.0), 0.0),
                        ((0.4, 0.0), 0.1), ((0.0, 0.4), -0.1)],
)  # fmt: skip
def test_what_the_floor_does_not_hold_shifts_it(push, share):
    box = after(UPRIGHT, REST, Pushes(push[0] * WEIGHT, push[1] * WEIGHT), 1e-3, 100)
    assert box.x == pytest.approx(0.5 * share * GRAVITY * 0.1**2, rel=1e-9)
    assert (box.tilt, box == REST) == (0.0, share == 0.0)


def test_it_tilts_where_the_push_exceeds_m_g_w_over_2h():
    threshold = WEIGHT * 2.0 * ROUGH.b / (2.0 * ROUGH.h)
    assert threshold < ROUGH.mu * WEIGHT
    for way in (1.0, -1.0):
        below, above = (
            Pushes(f, 0.0) if way > 0.0 else Pushes(0.0, f)
            for f in (0.9999 * threshold, 1.0001 * threshold)
        )
        assert after(ROUGH, REST, below, 1e-4, 500) == REST
        assert way * after(ROUGH, REST, above, 1e-4, 500).tilt > 0.0


def test_tilting_under_a_constant_push_is_that_of_the_equation():
    """On an edge that sticks: 4/3·m·r^2·theta'' = Q - m·g·X."""
    push = 0.25

    def slope(_, z):
        x = ROUGH.b * cos(z[0]) - ROUGH.a * sin(z[0])
        arm = (ROUGH.h - 2.0 * ROUGH.b * sin(z[0])) / cos(z[0]) ** 2
        inertia = 4.0 / 3.0 * ROUGH.m * (ROUGH.a**2 + ROUGH.b**2)
        return [z[1], (push * arm - ROUGH.m * GRAVITY * x) / inertia]

    motion = solve_ivp(slope, (0.0, 0.15), (0.0, 0.0), method="DOP853", rtol=1e-11, atol=1e-14)
    box = after(ROUGH, REST, Pushes(push, 0.0), 1e-4, 1500)
    assert box.tilt == pytest.approx(float(motion.y[0, -1]), rel=1e-5)
    assert box.w == pytest.approx(float(motion.y[1, -1]), rel=1e-5)
    assert (box.x, box.v) == (0.0, 0.0)
    assert 0.05 < box.tilt < balance(ROUGH)


def test_on_a_smooth_floor_the_centre_is_shifted_by_pushes_alone():
    """No friction: the centre stays above where it was while the box falls back."""
    q = UPRIGHT._replace(mu=0.0)
    tilted = Box(0.0, 0.3, 0.0, 0.0)
    box = after(q, tilted, NOTHING, 1e-4, 400)
    assert 0.0 < box.tilt < 0.29
    assert box.v != 0.0
    assert centre(q, box) == pytest.approx(centre(q, tilted), abs=1e-8)


def fall(q, tilt):
    """When a box left alone on an edge that sticks lands, in s, and how fast it turns, rad/s.

    Of 4/3·m·r^2·theta'' = -m·g·X, by an integrator that finds the moment.
    """

    def slope(_, z):
        x = q.b * cos(z[0]) - q.a * sin(z[0])
        return [z[1], -GRAVITY * x / (4.0 / 3.0 * (q.a**2 + q.b**2))]

    def flat(_, z):
        return z[0]

    flat.terminal = True  # type: ignore[attr-defined]
    motion = solve_ivp(slope, (0.0, 1.0), (tilt, 0.0), events=flat, rtol=1e-11, atol=1e-13)
    return float(motion.t_events[0][0]), float(motion.y_events[0][0][1])


@pytest.mark.parametrize("side", [1.0, -1.0])
def test_it_lands_when_it_should_and_slides_on_as_far_as_the_impulse_of_the_floor_lets_it(side):
    """The floor stops m·b·|w| upright; by friction it takes mu times as much off m·a·|w| forward.
    With what is left the box slides, back from its edge, until friction has stopped it.
    """
    q, d = ROUGH._replace(mu=0.5), 1e-4
    moment, w = fall(q, 0.3)
    states = list(islice(run(q, Box(0.01, side * 0.3, 0.0, 0.0), NOTHING, d), 3000))
    flat = next(k for k, box in enumerate(states, 1) if box.tilt == 0.0)
    assert (flat - 1) * d - 1e-6 <= moment <= flat * d + 1e-6
    assert all(box.x == 0.01 for box in states[: flat - 1])
    speed = (q.a - q.mu * q.b) * abs(w)
    assert speed == pytest.approx(0.184, abs=1e-3)
    slid = speed**2 / (2.0 * q.mu * GRAVITY)
    assert states[-1].x == pytest.approx(0.01 - side * slid, abs=1e-4 * slid)
    after_landing = speed - q.mu * GRAVITY * (flat * d - moment)
    assert states[flat - 1].v == pytest.approx(-side * after_landing, rel=1e-4)
    assert (states[-1].v, states[-1].tilt, states[-1].w) == (0.0, 0.0, 0.0)


def test_the_balance_is_where_the_centre_is_above_the_edge():
    assert balance(UPRIGHT) == pytest.approx(atan2(0.035, 0.05))
    for share, rises in ((0.999, False), (1.001, True)):
        box = Box(0.0, share * balance(UPRIGHT), 0.0, 0.0)
        assert (advance(UPRIGHT, box, NOTHING, 1e-3).tilt > box.tilt) is rises
    over = Box(0.0, balance(UPRIGHT), 0.0, 0.0)
    assert centre(UPRIGHT, over) == pytest.approx(0.035)


def test_the_faces_at_the_height_of_the_fingertips():
    """Corners turned about the edge, and the height h found on the lines between them."""
    for tilt in (-0.4, 0.0, 0.3):
        q, side = ROUGH, 1.0 if tilt >= 0.0 else -1.0
        edge = side * q.b

        def turned(x, z, edge=edge, tilt=tilt):
            arm = x - edge
            return np.array(
                [edge + arm * cos(tilt) + z * sin(tilt), z * cos(tilt) - arm * sin(tilt)]
            )

        found = []
        for x in (q.b, -q.b):
            low, high = turned(x, 0.0), turned(x, 2.0 * q.a)
            share = (q.h - low[1]) / (high[1] - low[1])
            found.append(float(low[0] + share * (high[0] - low[0])))
        assert faces(q, Box(0.0, tilt, 0.0, 0.0)) == pytest.approx(tuple(found), rel=1e-12)
        middle = turned(0.0, q.a)
        assert centre(q, Box(0.0, tilt, 0.0, 0.0)) == pytest.approx(middle[0], abs=1e-15)


@QUICK
@given(boxes(), STEPS)
def test_left_alone_it_never_gains_energy(start, d):
    """Flat not at all; on its edge what the midpoint rule errs by in a sub-step, third order."""
    q, box = start
    for _ in range(30):
        before, box = box, advance(q, box, NOTHING, d)
        fast = abs(before.w) + abs(before.v) / q.b + (GRAVITY / q.b) ** 0.5
        slack = 0.0 if before.tilt == box.tilt == 0.0 else (fast * d) ** 3
        assume(abs(box.tilt) < balance(q))
        scale = q.m * GRAVITY * q.b + energy(q, before)
        assert energy(q, box) - energy(q, before) <= (slack + 1e-14) * scale


def test_the_order_of_convergence():
    """Second, from flat and sliding through a tilt on an edge that slides."""
    q = Shape(b=0.03, a=0.06, m=0.1, mu=0.1, h=0.11)
    start, push, t = Box(0.0, 0.0, 1.0, 0.0), Pushes(0.6, 0.0), 0.04
    steps = [50, 100, 200, 400]
    fine = np.array(after(q, start, push, t / 12800, 12800))
    assert fine[1] > 0.02
    assert fine[2] != 0.0
    errors = [float(np.abs(np.array(after(q, start, push, t / n, n)) - fine).max()) for n in steps]
    order, _ = np.polyfit(np.log(steps), -np.log(errors), 1)
    assert order == pytest.approx(2.0, abs=0.2)
