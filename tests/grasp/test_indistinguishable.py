"""What no law can tell: pairs of situations that differ, and give the same samples.

Each pair is made of the plant's and the sensors' blocks. Where a law has the same samples from the
start on, it does the same; what is to be done differs. So each is a limit of any such law, found
here as one of ours, and not a fault of it.
"""

from collections.abc import Callable
from itertools import pairwise
from math import log

import pytest
from grasp_controller import adaptive, series
from grasp_controller.adaptive import Inputs
from gripper_plant import rigid
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import optics
from support.approach import numbers, run
from support.examples import examples

N, L_0 = 1.1506, 0.005

H = 0.01
"""s, between two samples."""

ROUNDING = 1e-12
"""In which samples that should be the same may differ, relative to them."""

Path = Callable[[int], float]
"""A number at each sample."""


def light(alpha, gap):
    """xi in V, of the sensor's block."""
    return optics.outputs(optics.Params(reflectance=alpha), optics.Inputs(gap)).intensity


def samples(gap, alpha, way, count):
    """What the controller gets: positions and speeds by way, light by gap and reflectance."""
    seen = []
    for k in range(count):
        x_1, x_2 = (f(k) for f in way)
        v_1, v_2 = ((f(k + 1) - f(k)) / H for f in way)
        xi_1, xi_2 = (light(a(k), g(k)) for a, g in zip(alpha, gap, strict=True))
        seen.append(Inputs((x_1, x_2), (v_1, v_2), (xi_1, xi_2)))
    return seen


def assert_same_to_any_law(a, b):
    """The samples are the same, and so is what both of our laws make of them."""
    assert len(a) == len(b)
    for one, other in zip(a, b, strict=True):
        assert numbers(other) == pytest.approx(numbers(one), rel=ROUNDING, abs=ROUNDING)
    for (_, y), (_, z) in zip(
        run(adaptive.Params(), a, H), run(adaptive.Params(), b, H), strict=True
    ):
        assert numbers(z) == pytest.approx(numbers(y), rel=1e-6, abs=1e-6)
    p = series.Params()
    x, z_ = series.initial_state(p, a[0]), series.initial_state(p, b[0])
    for one, other in zip(a, b, strict=True):
        x, z_ = series.step(p, x, one, H), series.step(p, z_, other, H)
        forces = series.outputs(p, x, one).force
        assert series.outputs(p, z_, other).force == pytest.approx(forces, abs=1e-6)


def still(x):
    return lambda _: x


def even(start, speed):
    """start + speed·t."""
    return lambda k: start + speed * k * H


# ------------------------------------------------------------------------------ at rest


@examples(20)
@given(st.floats(0.3, 3.0), st.floats(0.02, 0.05))
def test_at_rest_a_brighter_face_further_away_looks_the_same(c, distance):
    """(alpha·c, lambda·c^(1/n)), lambda = l + l_0, is the same light for every c."""
    far = distance * c ** (1.0 / N)
    assert light(c, far - L_0) == pytest.approx(light(1.0, distance - L_0), rel=ROUNDING)


def test_at_rest_no_law_knows_which_finger_is_nearer():
    """White on both sides, or black and nearer on the right: a second of the plant's samples."""
    black = 0.57
    width = 0.07
    gap = 0.11 - 0.5 * width
    nearer = (gap + L_0) * black ** (1.0 / N) - L_0
    wider = width + gap - nearer  # black is nearer, white is where it was
    middle = rigid.Params(object_width=width, initial_object_position=0.0)
    off = rigid.Params(object_width=wider, initial_object_position=0.5 * (wider - width))
    pair = []
    for plant, alpha in ((middle, 1.0), (off, black)):
        x = rigid.initial_state(plant, rigid.Inputs())
        seen = []
        for _ in range(100):
            x = rigid.step(plant, x, rigid.Inputs(), H)
            y = rigid.outputs(plant, x, rigid.Inputs())
            xi = (light(alpha, y.gap[0]), light(1.0, y.gap[1]))
            seen.append(Inputs(y.position, y.velocity, xi))
        pair.append((seen, y.gap))
    (a, gaps), (b, other_gaps) = pair
    assert_same_to_any_law(a, b)
    assert gaps[0] - gaps[1] == pytest.approx(0.0, abs=1e-15)
    assert other_gaps[0] - other_gaps[1] < -0.02
    assert run(adaptive.Params(), b, H)[-1][1].reflectance_ratio == 1.0


# ---------------------------------------------------------------------- in even motion


@pytest.mark.parametrize("w", [0.005, -0.005])
def test_at_even_speed_a_face_that_comes_nearer_is_a_face_of_another_brightness(w):
    """Closing at v, towards a face that moves by w: lambda is (v + w)/v times that of one at rest.

    So is alpha^(1/n), for the same light. The gaps are not the same, nor is the moment of contact.
    """
    v, way = 0.02, 0.06
    c = (v + w) / v
    closing = (even(0.1, -v), even(-0.1, v))
    distance = even(way, -v)
    count = 250

    def scaled(k):
        return c * distance(k) - L_0

    def plain(k):
        return distance(k) - L_0

    other = still(c**N)
    a = samples((plain, plain), (still(1.0), still(1.0)), closing, count)
    b = samples((scaled, plain), (other, still(1.0)), closing, count)
    assert_same_to_any_law(a, b)
    assert run(adaptive.Params(), b, H)[-1][1].reflectance_ratio == pytest.approx(1.0, abs=1e-3)
    assert abs(scaled(count) - plain(count)) > 1e-3


def test_another_speed_of_the_finger_tells_them_apart():
    """It is impossible at the one speed v only: quicker by dv, the light is another."""
    v, w, way = 0.02, 0.005, 0.06
    face = ((v + w) / v) ** N
    for dv, same in ((0.0, True), (0.01, False)):
        at_rest = [light(1.0, even(way, -v - dv)(k) - L_0) for k in range(100)]
        comes = [light(face, even(way * (v + w) / v, -v - w - dv)(k) - L_0) for k in range(100)]
        assert (comes == pytest.approx(at_rest, rel=ROUNDING)) == same


@pytest.mark.parametrize("nearer", [2e-3, 5e-3])
def test_a_pattern_along_the_approach_explains_any_light(nearer):
    """A white face, and a painted one that is nearer: its reflectance goes with the gap."""
    closing = (even(0.1, -0.02), even(-0.1, 0.02))
    count = 200

    def gap(k):
        return 0.055 - 0.02 * k * H

    def painted(k):
        return float(((gap(k) - nearer + L_0) / (gap(k) + L_0)) ** N)

    def near(k):
        return gap(k) - nearer

    a = samples((gap, gap), (still(1.0), still(1.0)), closing, count)
    b = samples((near, gap), (painted, still(1.0)), closing, count)
    assert_same_to_any_law(a, b)
    assert 0.5 < painted(count - 1) < painted(0) < 1.0


# ------------------------------------------------------------------ time to contact alone


def rates(seen):
    """xi'/xi of both fingers, all that a law of the time to contact has."""
    return [
        (
            log(after.intensity[0] / before.intensity[0]) / H,
            log(after.intensity[1] / before.intensity[1]) / H,
        )
        for before, after in pairwise(seen)
    ]


@pytest.mark.parametrize("c", [0.6, 1.5])
def test_equal_times_to_contact_do_not_make_equal_gaps(c):
    """One finger c times as far away and c times as fast: all rates are the same, on both sides.

    When the one arrives at lambda = l_0, the other has the gap (c - 1)·l_0 to go, or has hit.
    """
    v, way, count = 0.02, 0.06, 250

    def plain(k):
        return way - v * k * H - L_0

    def further(k):
        return c * (way - v * k * H) - L_0

    white = (still(1.0), still(1.0))
    a = samples((plain, plain), white, (even(0.1, -v), even(-0.1, v)), count)
    b = samples((plain, further), white, (even(0.1, -v), even(-0.1, c * v)), count)
    for one, other in zip(rates(a), rates(b), strict=True):
        assert other == pytest.approx(one, rel=1e-9)
        assert other[0] == pytest.approx(other[1], rel=1e-9)
    at_contact = (way - L_0) / (v * H)
    left = c * (way - v * at_contact * H) - L_0
    assert left == pytest.approx((c - 1.0) * L_0, abs=1e-12)


def test_with_the_way_it_can_be_told():
    """The adaptive law, which has the encoders as well, finds equal faces in both."""
    v, way, count = 0.02, 0.06, 250
    further = (lambda k: way - v * k * H - L_0, lambda k: 1.5 * (way - v * k * H) - L_0)
    seen = samples(further, (still(1.0), still(1.0)), (even(0.1, -v), even(-0.1, 1.5 * v)), count)
    assert run(adaptive.Params(), seen, H)[-1][1].reflectance_ratio == pytest.approx(1.0, abs=0.02)
