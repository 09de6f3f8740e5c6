"""The grip force in newtons: the limit and the lift, how they come and go, the least pull."""

from dataclasses import replace
from math import exp

import pytest
from grasp_controller import adaptive, grip, hand, impedance, series, tandem
from grasp_controller import contact_force as layer_1
from grasp_controller import impact_reduction as layer_2
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.approach import ANY_SAMPLES, approach, assert_mirrored, mirrored
from support.marks import examples

T, RELEASE_TIME = 0.4, 0.05
"""s, of the lift and of its end, as in the card."""


@pytest.mark.parametrize(
    ("asked", "squeeze", "brake", "share", "pressed"),
    [
        (2.0, 3.43, 0.0, 0.0, 2.0),  # limited
        (2.0, 3.43, 0.0, 1.0, 2.0),
        (2.0, 1.0, 0.0, 0.0, 1.0),  # not lifted yet, by half, in full
        (2.0, 1.0, 0.0, 0.5, 1.5),
        (2.0, 1.0, 0.0, 1.0, 2.0),
        (2.0, 3.0, 0.5, 1.0, 2.0),  # closing: no more than F with the damping
        (2.0, 1.5, 0.2, 0.0, 1.5),
        (2.0, 3.0, -0.5, 1.0, 2.5),  # pushed open: F and the damping
        (2.0, -1.0, 0.0, 0.0, -1.0),  # pulled apart, as the published law does
    ],
)
def test_the_limit_and_the_lift(asked, squeeze, brake, share, pressed):
    after = squeeze + grip.change(asked, squeeze, brake, share)
    assert after == pytest.approx(pressed, abs=1e-12)


@given(st.floats(0.1, 50.0), st.floats(-50.0, 50.0), st.floats(-50.0, 50.0), st.floats(0.0, 1.0))
def test_fingers_that_close_never_push_with_more(asked, squeeze, brake, share):
    after = squeeze + grip.change(asked, squeeze, brake, share)
    assert after <= asked + max(0.0, -brake) + 1e-9


@pytest.mark.parametrize("h", [1e-4, 5e-3])
@pytest.mark.parametrize("squeeze", [0.05, 0.1, 0.5, 3.0])
def test_the_share_obeys_g2(squeeze, h):
    """Against scipy, from 0.3, for a contact that is none, half one, and one."""
    c = squeeze**2 / (squeeze**2 + 0.1**2)
    leak = 8.0 * (1.0 - min(1.0, 2.0 * c)) ** 2
    solved = solve_ivp(
        lambda _, g: (c * (1.0 - g) - leak * g) / T, (0.0, 1.0), [0.3], rtol=1e-10, atol=1e-12
    )
    x = grip.State(0.3, 0.0)
    for _ in range(round(1.0 / h)):
        x = grip.advance(x, squeeze, 0.0, 1.0, h)
    assert x.share == pytest.approx(solved.y[0, -1], abs=1e-8)


def test_in_a_grasp_nothing_of_the_other_force_is_left():
    """Of 0.5 N, where h is 0.96."""
    x = grip.AT_REST
    for _ in range(20000):
        x = grip.advance(x, 0.5, 0.0, 1.0, 1e-3)
    assert x.share == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize(("closing", "rate"), [(0.0, 1.0), (0.0, -1.0), (0.2, 0.0), (-0.2, 0.0)])
def test_an_object_that_is_lost_is_let_go(closing, rate):
    """With a light that changes, or fingers that move: below 1 % within six times 50 ms."""
    x, lit = grip.State(1.0, 0.0), 0.0
    for _ in range(400):
        lit = grip.light_rate(1e-6, lit, 0.5 * exp(rate * 1e-3), 0.5, 1e-3)
        x = grip.advance(x, 5.0, closing, grip.quiet(lit), 1e-3)
    assert x.share < 0.01 + exp(-0.3 / RELEASE_TIME)


def traced(block, p, samples, h):
    x, trace = block.initial_state(p, samples[0]), []
    for u in samples:
        x = block.step(p, x, u, h)
        trace.append(block.outputs(p, x, u))
    return trace


@examples(20)
@given(ANY_SAMPLES, st.floats(1e-5, 1e-2), st.floats(0.1, 20.0))
def test_the_mirrored_controller_grips_as_the_mirror_image(samples, h, force):
    p = series.Params(contact_force=layer_1.Params(grip_force=force))
    images = traced(series, p, [mirrored(u) for u in samples], h)
    for y, z in zip(traced(series, p, samples, h), images, strict=True):
        assert_mirrored(y, z)


@pytest.mark.parametrize("force", [0.5, 2.0, 10.0])
@pytest.mark.parametrize("block", [series, adaptive, tandem])
def test_fingers_at_rest_on_an_object_press_with_it(block, force):
    """Held by its two faces at 35 mm, which give 1.07 V; the drive of a tandem by twice as much."""
    touching = approach((1.0, 1.0), end=0.0)
    still = touching[-1]._replace(velocity=(0.0, 0.0))
    p = replace(block.Params(), contact_force=layer_1.Params(grip_force=force))
    *_, y = traced(block, p, [*touching, *[still] * 600], 1e-2)
    if block is tandem:
        assert y.grip_force == pytest.approx(-2.0 * force, abs=2e-4)
    else:
        assert y.force == pytest.approx((-force, force), abs=1e-4)


def test_each_finger_of_a_hand_presses_with_its_share():
    weights = (0.8786, 0.8786, 1.2427)
    p = hand.Params(weights, contact_force=layer_1.Params(grip_force=5.0))
    u = hand.Inputs((0.035,) * 3, (0.0,) * 3, (1.0,) * 3)
    *_, y = traced(hand, p, [u] * 800, 1e-2)
    assert y.force == pytest.approx([-5.0 * n for n in weights], rel=1e-3)


@pytest.mark.parametrize("opening", [1.0, -1.0])
def test_the_least_pull_ends_as_far_beyond_the_target(opening):
    """least_pull/K_a1, 10 mm, without a finger; and further out it is not felt."""
    p = layer_2.Params()
    a = impedance.transition(p.mass, p.damping, p.stiffness, 1e-3)
    x_v = (0.05 * opening, 0.0)
    for _ in range(20000):
        f = layer_2.with_least_pull(0.25, p.stiffness, 0.0, opening, opening * x_v[0])
        x_v = layer_2.follow(p, a, x_v, (0.0, 0.0), (0.0, 0.0), f)
    assert x_v[0] == pytest.approx(-0.01 * opening, rel=1e-6)
    assert layer_2.with_least_pull(0.25, 25.0, 0.3, opening, 0.0101) == 0.3
    assert layer_2.with_least_pull(0.25, 25.0, 0.3, opening, 0.004) == pytest.approx(
        0.3 - 0.15 * opening
    )
    assert layer_2.with_least_pull(0.0, 25.0, -0.0, opening, -1.0).hex() == "-0x0.0p+0"
