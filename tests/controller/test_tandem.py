"""The law of a gripper in tandem: its way to the middle, its bounds, its grip, and its symmetry."""

from dataclasses import replace
from functools import partial
from math import isfinite, log

import numpy as np
import pytest
from grasp_controller import holding, reflectance_ratio, tandem, wrist_guidance
from grasp_controller import impact_reduction as layer_2
from grasp_controller.tandem import Inputs, Params, SimultaneousContact
from grasp_controller.wrist_guidance import Wrist
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from support.approach import ANY_SAMPLES, H, N, approach, intensity, mirrored, numbers, pairs
from support.marks import examples

SURE = Params(
    reflectance=reflectance_ratio.Params(
        intensity_noise=1e-12, exponent_deviation=0.0, offset_deviation=0.0
    )
)
"""Of what it has learnt."""

UNLEARNT = Params(reflectance=reflectance_ratio.Params(prior_deviation=0.0))
"""Of which faces are alike."""


def run(p, samples, h=H):
    """From the first sample on, the state and outputs at each."""
    x = tandem.initial_state(p, samples[0])
    trace = [(x, tandem.outputs(p, x, samples[0]))]
    for u in samples[1:]:
        x = tandem.step(p, x, u, h)
        trace.append((x, tandem.outputs(p, x, u)))
    return trace


# The way to the middle


def seen_off(off, gap, n=N):
    """At rest, white faces at 35 mm on both sides of 0, the wrist beside it by so much."""
    gaps = gap + off, gap - off
    xi = tuple(intensity(g, 1.0, n) for g in gaps)
    return Inputs((0.035 + gaps[0], -0.035 - gaps[1]), (0.0, 0.0), xi)


@examples(40)
@given(st.floats(0.01, 0.1), st.floats(-0.6, 0.6), st.floats(0.8, 1.5))
def test_the_target_is_the_middle_to_first_order(gap, share, n):
    """By Eq. (9) d·tanh(rho)/n = e·(1 - c·(e/d)^2) with |c| < 1 + n^2: second order is none."""
    learning = reflectance_ratio.Params(
        diffusion_exponent=(n, n),
        gain=(0.0024 * 0.1 ** (n - N),) * 2,
        prior_deviation=0.0,
        intensity_noise=1e-12,
    )
    off = share * gap
    u = seen_off(off, gap, n)
    y = tandem.outputs(p := Params(reflectance=learning), tandem.initial_state(p, u), u)
    assert abs(y.target_position) <= (1.0 + n * n) * share**2 * abs(off) + 1e-12


@examples(20)
@given(pairs(0.3, 1.2), pairs(0.04, 0.09))
def test_it_is_whatever_the_colours(alpha, gaps):
    """Once they are learnt, and while the fingers still are far off the middle."""
    samples = approach(alpha, gaps, count=200)[:160]
    x, y = run(SURE, samples)[-1]
    middle = 0.5 * sum(samples[-1].position)
    d = 0.5 * (sum(map(abs, samples[-1].position)) - 0.07) + 5e-3
    assert y.reflectance_ratio == pytest.approx(alpha[0] / alpha[1], rel=0.02)
    assert abs(y.target_position) <= 0.02 * d + 2.5 * abs(middle) * (middle / d) ** 2
    assert y.estimated_gap == pytest.approx(
        [0.2 * g + 0.8 * 5e-3 + 0.0 * x.hold for g in gaps], rel=0.05
    )


def test_far_off_the_middle_the_target_is_drawn_in():
    """To d·tanh(rho)/n, here of rho = 0.5 at white faces."""
    u = Inputs((0.16, -0.14), (0.0, 0.0), (0.06, 0.02))
    d = 0.5 * sum((0.0024 / xi) ** (1.0 / N) for xi in u.intensity)
    y = tandem.outputs(SURE, tandem.initial_state(SURE, u), u)
    assert y.target_position == pytest.approx(0.01 + d * np.tanh(0.5) / N, abs=1e-9)


def placed(samples):
    """As a gripper has them at the start: the right fingertip is not left of the left one."""
    first, *rest = samples
    left, right = sorted(first.position)
    return [first._replace(position=(right, left)), *rest]


@examples(60)
@given(ANY_SAMPLES.map(placed), st.floats(1e-5, 0.5), st.floats(0.01, 100.0))
def test_the_wrist_is_sent_no_further_than_the_fingertips_were(samples, h, speed_limit):
    """By no samples, and no faster than it may."""
    right, left = samples[0].position
    p = Params(wrist=Wrist(speed_limit=speed_limit))
    before = 0.5 * (left + right)
    for _, y in run(p, samples, h):
        assert left <= y.target_position <= right
        assert left - 1e-15 <= y.wrist_command <= right + 1e-15
        assert abs(y.wrist_command - before) <= speed_limit * h * (1.0 + 1e-9) + 1e-15
        before = y.wrist_command


@pytest.mark.parametrize("seen", [(0.0, 0.05), (0.05, 0.0)])
def test_a_dead_sensor_sends_it_nowhere(seen):
    """As it tells nothing of a middle."""
    trace = run(Params(), [Inputs(intensity=seen)] * 2000)
    assert abs(trace[-1][1].wrist_command) < 1e-3


@pytest.mark.parametrize("dark", [0.1, 0.01])
def test_dark_faces_are_no_further_than_the_fingers_are_apart(dark):
    """Though they seem to be, by their light: d is half the opening at most, and l_0."""
    u = Inputs(intensity=(0.03 * dark, 0.01 * dark))
    y = tandem.outputs(SURE, tandem.initial_state(SURE, u), u)
    assert y.target_position == pytest.approx(0.115 * np.tanh(0.5) / N, rel=1e-6)


# How the wrist is sent there


@examples(60)
@given(
    st.floats(-0.3, 0.3),
    st.floats(0.0, 1.0),
    st.floats(1e-3, 1.0),
    st.integers(2, 20),
    st.floats(0.01, 1.0),
)
def test_a_held_target_is_approached_exactly(target, free, h, parts, speed_limit):
    """In any number of steps, at the speed limit, below it, and past where it ends."""
    p = Wrist(speed_limit=speed_limit)
    whole = wrist_guidance.move(p, 0.02, target, free, h)
    command = 0.02
    for _ in range(parts):
        command = wrist_guidance.move(p, command, target, free, h / parts)
    assert command == pytest.approx(whole, abs=1e-14)
    assert (command - 0.02) * (target - 0.02) >= 0.0


def test_it_is_the_solution_of_its_equation():
    """X_c' = clip(g·(1 - h')·(T - X_c), ±v_max), across the end of the clip."""
    p, target, free = Wrist(10.0, 0.03, 0.2), 0.1, 0.7

    def rate(_, x):
        return np.clip(p.gain * free * (target - x), -p.speed_limit, p.speed_limit)

    exact = solve_ivp(rate, (0.0, 0.5), [0.0], rtol=1e-10, atol=1e-13, max_step=1e-3)
    assert wrist_guidance.move(p, 0.0, target, free, 0.5) == pytest.approx(exact.y[0, -1], abs=1e-7)
    assert 1e-3 < target - exact.y[0, -1] < 0.05


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_a_slower_wrist_is_led_more_slowly(delay):
    """Its own lag and that of its command may take up its way to go 1/g, and no more."""
    for hz in (2.0, 3.0, 5.0):
        assert 0.5 < Wrist(hz, delay).gain * (1.0 / (np.pi * hz) + delay) <= 1.0
    gains = [Wrist(hz, delay).gain for hz in (0.5, 2.0, 5.0, 20.0, 1000.0)]
    assert gains == sorted(gains)
    assert Wrist(5.0, 0.1).gain < Wrist(5.0, delay).gain


@pytest.mark.parametrize(
    ("hold", "rho", "agreed"),
    [(1.0, 0.0, 1.0), (1.0, 0.05, 0.75), (0.5, -0.05, 0.375), (1.0, 0.1, 0.0), (1.0, -1.0, 0.0)],
)
def test_a_grasp_is_one_as_far_as_both_sensors_agree(hold, rho, agreed):
    assert wrist_guidance.agreed(hold, rho) == pytest.approx(agreed, abs=1e-12)


@pytest.mark.parametrize(
    ("closing", "moving", "alike"),
    [(0.0, 0.0, 1.0), (0.1, 0.0, 1.0), (0.0, 0.1, 0.0), (-0.3, 0.1, 0.5), (0.3, -0.3, 0.1)],
)
def test_points_count_as_far_as_the_wrist_is_slower_than_the_grip(closing, moving, alike):
    assert wrist_guidance.steadiness(closing, moving) == pytest.approx(alike, abs=1e-12)


def test_half_a_grasp_is_half_of_the_force_on_each_finger():
    """P = -F/2 and the rate of x_1 - x_2, low-passed: P_0 at rest, and at half of w_0."""
    u = Inputs((0.035, -0.035), (0.0, 0.0), (0.4, 0.4))
    x = tandem.initial_state(Params(), u)._replace(virtual=(0.035 - 0.1 / 98.0, 0.0))
    # Both lines say that the finger is at its face
    at_face = x.line_1._replace(per_y=5e-3 / x.line_1.y, noise_variance=0.0)
    x = x._replace(line_1=at_face, line_2=at_face)
    assert tandem.step(Params(), x, u, 0.02).hold == pytest.approx(0.5, abs=1e-9)
    closing = u._replace(velocity=(-1e-3, 1e-3))
    x = x._replace(virtual=(x.virtual[0], -1e-3))
    assert tandem.step(Params(), x, closing, 0.02).hold == pytest.approx(0.4, abs=1e-9)


def test_while_the_wrist_moves_nothing_is_learnt():
    samples = approach((0.5, 1.0))
    carried = [u._replace(velocity=tuple(v + 1.0 for v in u.velocity)) for u in samples]
    still, moving = (run(Params(), s)[-1][0] for s in (samples, carried))
    assert moving.line_1.weight < 0.01 * still.line_1.weight
    assert moving.line_2.weight < 0.01 * still.line_2.weight


def grasped(rho):
    """At rest on the object, pressed, with so much more light on the right."""
    u = Inputs((0.035, -0.035), (0.0, 0.0), (1.0 + rho, 1.0 - rho))
    return [u] * 300


@pytest.mark.parametrize(("rho", "crept"), [(0.0, 0.0), (0.003, 1e-6), (-0.01, 1.5e-5)])
def test_in_a_grasp_it_hardly_creeps(rho, crept):
    """Within 2 s, by a part of the 14 and 46 um that the light says."""
    trace = run(UNLEARNT, grasped(rho))
    held, end = (trace[k][1] for k in (100, -1))
    assert held.grip_force < -2.0
    assert abs(end.wrist_command - held.wrist_command) <= crept


@pytest.mark.parametrize("rho", [0.2, -0.2])
def test_where_a_finger_presses_alone_it_goes_on(rho):
    """To where more light is."""
    assert run(UNLEARNT, grasped(rho))[-1][1].wrist_command * rho > 1e-4


# The grip


def exactly(p, half, rate, pull, f, h):
    """w_v and its rate, from M·w_v'' + D·w_v' + pull·K·w_v = f."""
    q = p.impact_reduction

    def slope(_, w):
        return [w[1], (f - q.damping * w[1] - pull * q.stiffness * w[0]) / q.mass]

    return solve_ivp(slope, (0.0, h), [half, rate], rtol=1e-11, atol=1e-14).y[:, -1]


@examples(20)
@given(pairs(0.01, 1.0), pairs(0.01, 1.0), st.floats(1e-3, 0.3), st.floats(0.0, 10.0))
def test_the_grip_waits_as_in_its_equation(before, xi, h, patience):
    """Over two steps, the light as it was and as it is; no ratio is learnt."""
    p = replace(UNLEARNT, simultaneous_contact=SimultaneousContact(patience=patience))
    first, then = Inputs(intensity=before), Inputs(intensity=xi)
    x = tandem.step(p, tandem.initial_state(p, first), then, h)
    rho = (xi[0] - xi[1]) / (xi[0] + xi[1])
    f = 0.5 * 0.6 / h * (log(xi[0] / before[0]) + log(xi[1] / before[1]))
    pull = max(1e-6, (1.0 - rho**2) ** patience)
    assert x.virtual == pytest.approx(exactly(p, 0.11, 0.0, pull, f, h), abs=1e-7)
    again = tandem.step(p, x, then, h)
    assert again.virtual == pytest.approx(exactly(p, *x.virtual, pull, 0.0, h), abs=1e-7)


def test_layer_1_is_that_of_both_fingers():
    """F = -2·D_i·(w' - w_v') - 2·K_i·(w - w_v); a motion of both alike has no part in it."""
    x = tandem.initial_state(Params(), Inputs((0.11, -0.11)))._replace(virtual=(0.05, -0.02))
    force = partial(tandem.outputs, Params(), x)
    u = Inputs((0.12, -0.06), (0.03, 0.13), (0.1, 0.1))
    expected = -2.0 * 14.0 * (-0.05 + 0.02) - 2.0 * 98.0 * (0.09 - 0.05)
    assert force(u).grip_force == pytest.approx(expected, abs=1e-12)
    shifted = u._replace(position=(0.13, -0.05), velocity=(0.05, 0.15))
    assert force(shifted).grip_force == pytest.approx(expected, abs=1e-12)


# Changes at run time, symmetry, hard numbers


def half_way(p):
    samples = approach((0.5, 1.0), (0.09, 0.05))
    x = tandem.initial_state(p, samples[0])
    for u in samples[1:60]:
        x = tandem.step(p, x, u, H)
    return x, samples[60:]


def test_layer_3_goes_off_and_on_without_a_jump():
    """Off, the wrist stays where it was sent; on again it goes on from there, and has learnt."""
    p, off = Params(), Params(SimultaneousContact(enabled=False))
    x, rest = half_way(p)
    z = x
    for k, u in enumerate(rest):
        now = off if k < 20 else p
        assert tandem.outputs(now, z, u).grip_force == tandem.outputs(p, z, u).grip_force
        before, z = z, tandem.step(now, z, u, H)
        x = tandem.step(p, x, u, H)
        most = 0.0 if k < 20 else p.wrist.speed_limit * H
        assert abs(z.wrist_command - before.wrist_command) <= most * (1.0 + 1e-12)
        assert z.line_1.mean_s == pytest.approx(x.line_1.mean_s, abs=1e-3)
        assert z.estimate.beta == pytest.approx(x.estimate.beta, abs=0.05)


def test_layer_2_goes_off_to_closed_and_on_again_from_there():
    """Off, w_v is 0 as in Case 0; on again it is at rest there, so nothing jumps."""
    p, off = Params(), Params(impact_reduction=layer_2.Params(enabled=False))
    x, (u, v, *_) = half_way(p)
    closed = tandem.step(off, x, u, H)
    assert closed.virtual == (0.0, 0.0)
    assert tandem.outputs(off, closed, v) == tandem.outputs(p, closed, v)
    assert abs(tandem.step(p, closed, v, H).virtual[0]) < 1e-4
    assert tandem.initial_state(off, u).virtual == (0.0, 0.0)


LAWS = st.builds(
    Params,
    st.builds(SimultaneousContact, st.booleans(), st.floats(0.0, 20.0)),
    st.builds(layer_2.Params, st.booleans()),
    reflectance=st.builds(
        reflectance_ratio.Params,
        diffusion_exponent=st.floats(0.5, 2.0).map(lambda n: (n, n)),
        time_constant=st.floats(1e-6, 0.1),
        prior_deviation=st.floats(0.0, 3.0),
    ),
    hold=st.builds(holding.Params, squeeze=st.floats(1e-6, 10.0)),
    wrist=st.builds(Wrist, st.floats(0.5, 100.0), st.floats(0.0, 0.2), st.floats(0.01, 1.0)),
)


@examples(30)
@given(
    LAWS,
    ANY_SAMPLES.map(placed) | st.builds(approach, pairs(0.1, 2.0), pairs(0.01, 0.1)),
    st.floats(1e-5, 1e-1),
)
def test_the_mirrored_controller_does_exactly_the_mirrored_thing(p, samples, h):
    images = run(p, [mirrored(u) for u in samples], h)
    for (x, y), (image, z) in zip(run(p, samples, h), images, strict=True):
        assert (z.grip_force, z.virtual_opening) == (y.grip_force, y.virtual_opening)
        assert (z.wrist_command, z.target_position) == (-y.wrist_command, -y.target_position)
        f_1, f_2 = y.impact_reduction_force
        assert z.impact_reduction_force == (-f_2, -f_1)
        assert image.estimate.beta == -x.estimate.beta
        assert (z.estimated_gap, z.hold) == (y.estimated_gap[::-1], y.hold)


SANE = st.tuples(*[st.floats(-1e3, 1e3)] * 2)
"""m, m/s and V."""


@examples(30)
@given(
    LAWS,
    st.lists(st.builds(Inputs, SANE, SANE, SANE), min_size=2, max_size=8),
    st.floats(1e-6, 1.0),
)
def test_what_a_gripper_may_measure_gives_numbers(p, samples, h):
    for _, y in run(p, placed(samples), h):
        assert all(map(isfinite, numbers(y)))
        assert 0.0 <= y.hold <= 1.0


@examples(10)
@given(pairs(0.2, 2.0), pairs(0.02, 0.1), st.floats(0.1, 10.0))
def test_a_brighter_lamp_changes_no_force(alpha, gaps, factor):
    """All faces brighter by as much; the gaps are told by the slopes, once there are any."""
    samples = approach(alpha, gaps)
    lit = [u._replace(intensity=tuple(factor * xi for xi in u.intensity)) for u in samples]
    for (_, y), (_, z) in zip(run(SURE, samples)[20:], run(SURE, lit)[20:], strict=True):
        assert z.grip_force == pytest.approx(y.grip_force, abs=1e-2)
        assert z.estimated_gap == pytest.approx(y.estimated_gap, abs=1e-3)


def test_without_patience_the_grip_does_not_wait():
    """And a wrist far off the middle never holds it up for ever: a millionth of K_a1 pulls."""
    u = Inputs(intensity=(0.0, 0.05))
    hasty, patient = (
        replace(Params(), simultaneous_contact=SimultaneousContact(patience=p)) for p in (0.0, 4.0)
    )
    closing = [run(p, [u] * 50)[-1][1].virtual_opening for p in (hasty, patient)]
    assert closing[0] < 0.07
    assert 0.1099 < closing[1] < 0.11
