"""The adaptive law: where it is the published one, its symmetry and bounds, changes, the hold."""

import sys
from dataclasses import replace
from math import exp, isfinite, log, sin

import pytest
from grasp_controller import adaptive, holding, reflectance_ratio
from grasp_controller import contact_force as layer_1
from grasp_controller import impact_reduction as layer_2
from grasp_controller import simultaneous_contact as layer_3
from grasp_controller.adaptive import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from support.approach import (
    ANY_SAMPLES,
    H,
    approach,
    assert_mirrored,
    intensity,
    mirrored,
    numbers,
    pairs,
    published,
    relit,
    run,
)
from support.declared import parameters
from support.marks import examples

SAMPLES = ANY_SAMPLES | st.builds(approach, pairs(0.1, 2.0), pairs(0.01, 0.1))

NEVER_HOLDS = holding.Params(squeeze=1e12)


@pytest.mark.parametrize(
    "learnt",
    [
        reflectance_ratio.Params(prior_deviation=0.0),
        reflectance_ratio.Params(limit=0.0),
    ],
)
@examples(30)
@given(SAMPLES, st.floats(1e-5, 1e-2))
def test_nothing_learnt_and_no_hold_is_eq_2(learnt, samples, h):
    p = adaptive.Params(reflectance=learnt, hold=NEVER_HOLDS)
    for (_, y), z in zip(run(p, samples, h), published(p, samples, h), strict=True):
        assert tuple(y)[: len(z)] == z
        assert y.reflectance_ratio == 1.0


@pytest.mark.parametrize("case", [0, 1])
@examples(30)
@given(SAMPLES, st.floats(1e-5, 1e-2))
def test_without_layer_3_it_is_the_published_law(case, samples, h):
    """All but f_s, which is put out though it acts on nothing; it learns nevertheless."""
    p = adaptive.Params(layer_3.Params(enabled=False), layer_2.Params(enabled=case == 1))
    for (_, y), z in zip(run(p, samples, h), published(p, samples, h), strict=True):
        ours = y._asdict()
        for name, value in z._asdict().items():
            assert name == "simultaneous_contact_force" or ours[name] == value


@pytest.mark.parametrize("alpha", [(0.0, 0.0), (0.0, 1.0), (1.0, 0.0)])
def test_a_blind_sensor_teaches_nothing(alpha):
    """Without light on one side it is the published law, which then turns to the other side."""
    dark = approach(alpha)
    p = adaptive.Params(hold=NEVER_HOLDS)
    trace = run(p, dark)
    assert all(y.reflectance_ratio == 1.0 for _, y in trace)
    assert [tuple(y)[:5] for _, y in trace] == [tuple(z) for z in published(p, dark, H)]


def alike(value):
    """The same for both fingers."""
    return value, value


ANY_LAWS = st.builds(
    Params,
    st.builds(layer_3.Params, st.booleans(), gain=st.floats(-5.0, 5.0)),
    st.builds(layer_2.Params, st.booleans()),
    reflectance=st.builds(
        reflectance_ratio.Params,
        diffusion_exponent=st.floats(0.5, 2.0).map(alike),
        time_constant=st.floats(1e-6, 0.1),
        weight_exponent=st.floats(0.0, 10.0),
        intensity_noise=st.sampled_from([1e-12, 5e-4, 1.0]),
        prior_deviation=st.floats(0.0, 3.0),
    ),
    hold=st.builds(holding.Params, squeeze=st.floats(1e-6, 10.0), speed=st.floats(1e-4, 1.0)),
)

SURE = replace(
    Params(),
    reflectance=reflectance_ratio.Params(
        intensity_noise=1e-12, exponent_deviation=0.0, offset_deviation=0.0
    ),
)
"""Of what it has learnt."""


def dimmed(u, factor):
    xi_1, xi_2 = u.intensity
    return u._replace(intensity=(factor * xi_1, factor * xi_2))


@examples(30)
@given(
    ANY_LAWS,
    ANY_SAMPLES | st.builds(approach, pairs(0.1, 2.0), pairs(0.01, 0.1)),
    st.floats(1e-5, 1e-2),
)
def test_the_mirrored_controller_does_exactly_the_mirrored_thing(p, samples, h):
    images = run(p, [mirrored(u) for u in samples], h)
    for (x, y), (x_image, z) in zip(run(p, samples, h), images, strict=True):
        assert_mirrored(y, z)
        assert x_image.estimate.beta == -x.estimate.beta
        assert z.estimated_gap == y.estimated_gap[::-1]
        assert z.hold == y.hold


@examples(10)
@given(pairs(0.2, 2.0), pairs(0.02, 0.1), st.floats(0.1, 10.0))
def test_scaling_both_intensities_changes_no_force(alpha, gaps, factor):
    """But for rounding, above the floor, and for noise: the brighter, the sooner it is believed."""
    samples = approach(alpha, gaps)
    other = run(SURE, [dimmed(u, factor) for u in samples])
    for (x, y), (x_other, z) in zip(run(SURE, samples), other, strict=True):
        assert z.force == pytest.approx(y.force, abs=1e-9)
        assert x_other.estimate.beta == pytest.approx(x.estimate.beta, abs=1e-9)
        assert z.hold == pytest.approx(y.hold, abs=1e-9)


HARD = [0.0, -0.0, 5e-324, 1e-308, 1e-12, 1e-6, 1.0, 1e3, 1e9, 1e154, 1e300, sys.float_info.max]

NUMBERS = st.sampled_from(HARD + [-x for x in HARD]) | st.floats(
    allow_nan=False, allow_infinity=False
)

BOTH = st.tuples(NUMBERS, NUMBERS)

SANE = st.tuples(*[st.floats(-1e3, 1e3)] * 2)
"""m, m/s and V."""

STEPS = st.sampled_from([1e-300, 1e-9, 1e-4, 1e-3, 0.1, 1e3, 1e300]) | st.floats(1e-6, 1.0)

HARD_SAMPLES = st.lists(st.builds(Inputs, BOTH, BOTH, BOTH), min_size=2, max_size=8)


def each(value, parameter):
    """The value, for both fingers where there is one for either."""
    return alike(value) if isinstance(parameter.default, tuple) else value


def at_the_ends(block):
    """A part of the parameters, each at an end of its range or as by default."""
    chosen = {
        p.name: st.sampled_from([each(p.low, p), p.default, each(p.high, p)])
        for p in parameters(block)
    }
    return st.builds(block, **chosen)


LAWS = st.just(Params()) | st.builds(
    Params,
    reflectance=at_the_ends(reflectance_ratio.Params),
    hold=at_the_ends(holding.Params),
)


def assert_bounded(p, x, y):
    learnt, limit = p.reflectance, p.reflectance.limit
    assert abs(x.estimate.beta) <= limit
    assert exp(-limit) <= y.reflectance_ratio <= exp(limit)
    assert 0.0 <= x.estimate.deviation <= learnt.prior_deviation
    assert 0.0 <= y.hold <= 1.0
    most = p.simultaneous_contact.gain
    assert abs(y.simultaneous_contact_force) <= most


def accepted(p, samples, h):
    """Of the steps that raise nothing and give numbers, as an FMU takes them, state and outputs."""
    trace = []
    x = adaptive.initial_state(p, samples[0])
    for u in samples[1:]:
        try:
            after = adaptive.step(p, x, u, h)
            y = adaptive.outputs(p, after, u)
        except (ArithmeticError, ValueError):
            continue
        if all(map(isfinite, numbers(y))):
            x = after
            trace.append((x, y))
    return trace


@examples(30)
@given(LAWS, HARD_SAMPLES, STEPS)
def test_the_estimate_is_bounded_for_any_numbers(p, samples, h):
    for x, y in accepted(p, samples, h):
        assert_bounded(p, x, y)


@examples(30)
@given(LAWS, st.lists(st.builds(Inputs, SANE, SANE, SANE), min_size=2, max_size=8), STEPS)
def test_what_a_gripper_may_measure_gives_numbers(p, samples, h):
    assert len(accepted(p, samples, h)) == len(samples) - 1


@examples(100)
@given(LAWS, st.builds(Inputs, BOTH, BOTH, BOTH))
def test_after_a_sample_of_nonsense_the_approach_goes_on(p, nonsense):
    """It is refused, or its sums are beyond all numbers, and nothing more is learnt."""
    samples = approach((0.5, 1.0), count=40)
    after = accepted(p, [*samples[:20], nonsense, *samples[20:]], H)
    assert len(after) >= len(samples) - 3
    for x, y in after:
        assert_bounded(p, x, y)


@pytest.mark.parametrize("seen", [(1e3, 1e3), (0.5, 0.5), (0.0, 0.0), (-1.0, 0.3)])
def test_a_sensor_that_shows_one_number_teaches_nothing(seen):
    """Saturated, blind, or stuck: the line has no slope, whatever the way."""
    for x, y in run(Params(), [u._replace(intensity=seen) for u in approach((1.0, 1.0))]):
        assert x.estimate == (0.0, 1.0, 1.0)
        assert y.reflectance_ratio == 1.0


@pytest.mark.parametrize("converter", [0.1, 0.2, 0.5])
def test_a_sensor_that_saturates_unlearns_nothing(converter):
    """From there on its line does not move, but for what the low-pass still brings."""

    def saturated(xi):
        return min(xi, converter)

    seen = [relit(u, saturated, saturated) for u in approach((0.5, 1.0), end=1e-3, count=400)]
    trace = [x.estimate for x, _ in run(Params(), seen)]
    first = next(k for k, u in enumerate(seen) if max(u.intensity) == converter)
    before, after = (abs(trace[k].beta - log(0.5)) for k in (first, -1))
    assert before < trace[first].deviation
    assert after < before + 0.03


PARTS = {"reflectance": reflectance_ratio.Params, "hold": holding.Params}

SENSORS = ("diffusion_exponent", "offset_distance", "gain")
"""Calibrations: n does not change, as y would be in another unit; l_0 and K tell other gaps."""

OTHERS = [
    (part, p.name, value)
    for part, block in PARTS.items()
    for p in parameters(block)
    if p.name not in SENSORS
    for value in (max(p.low, 0.3 * p.default), min(p.high, 3.0 * p.default), p.low, p.high)
]


LAYERS = {
    "simultaneous_contact": layer_3.Params, "impact_reduction": layer_2.Params,
    "contact_force": layer_1.Params, **PARTS,
}  # fmt: skip


@pytest.mark.parametrize(
    ("layer", "parameter"), [(layer, p) for layer in LAYERS for p in parameters(LAYERS[layer])]
)
def test_a_value_outside_its_range_is_refused(layer, parameter):
    for number, value in parameter.invalid():
        with pytest.raises(ValueError, match=r"^\w+\.\w+ = ") as caught:
            LAYERS[layer](**{parameter.name: value})
        assert str(caught.value) == (
            f"{layer}.{parameter.name} = {number!r} {parameter.unit}: {parameter.valid}"
        )


def after_half(p):
    """Half an approach, and the samples of the rest."""
    samples = approach((0.5, 1.0))
    x = adaptive.initial_state(p, samples[0])
    for u in samples[1:60]:
        x = adaptive.step(p, x, u, H)
    return x, samples[59:]


def changed(part, name, value):
    return replace(Params(), **{part: replace(getattr(Params(), part), **{name: value})})


@pytest.mark.parametrize(("part", "name", "value"), OTHERS)
def test_no_change_makes_the_force_jump(part, name, value):
    """The new number acts on the virtual force from the next step on, and is felt behind it."""
    x, (u, *rest) = after_half(Params())
    p = changed(part, name, value)
    assert adaptive.outputs(p, x, u).force == adaptive.outputs(Params(), x, u).force
    assert adaptive.outputs(p, x, u).reflectance_ratio == pytest.approx(0.5, abs=0.02)
    for u in rest:
        x = adaptive.step(p, x, u, H)
        assert abs(x.estimate.beta) <= p.reflectance.limit
        assert 0.0 <= x.estimate.deviation <= p.reflectance.prior_deviation


@pytest.mark.parametrize("name", ["prior_deviation", "limit"])
def test_what_is_learnt_can_be_put_aside_and_taken_up_again(name):
    """Both lines go on meanwhile: the end is that of an approach without the change."""
    x, (_, *rest) = after_half(Params())
    z = x
    off = changed("reflectance", name, 0.0)
    for k, u in enumerate(rest):
        x = adaptive.step(Params(), x, u, H)
        z = adaptive.step(off if k < 20 else Params(), z, u, H)
        assert (z.estimate.beta == 0.0) == (k < 20)
    assert z.estimate == pytest.approx(x.estimate, rel=1e-3)


HOLD = holding.Params()


@pytest.mark.parametrize(
    ("press", "closing", "pressed"),
    [
        (0.0, 0.0, 0.0),
        (0.1, 0.0, 0.5),
        (0.1, 5e-4, 0.25),
        (0.1, -5e-4, 0.25),
        (1e3, 0.0, 1.0),
        (0.2, 0.0, 0.8),
        (0.1, 1e-3, 0.1),
        (-5.0, 0.0, 0.0),
    ],
)
def test_half_a_grasp_is_at_p_0_and_at_w_0(press, closing, pressed):
    assert holding.pressed(HOLD, press, closing) == pytest.approx(pressed, abs=1e-7)


EYE, _ = Params().sensors


def line_at(gap, known=True, **more):
    """A finger's line, by which it is at this gap in m by light and by way; 5 mm to the element."""
    n = EYE.n
    y = intensity(gap, 0.57) ** (-1.0 / n)
    point = reflectance_ratio.first_point(EYE, 1e-6, 0.05, y**-n)
    if not known:
        return point
    return point._replace(per_y=(gap + 5e-3) / y, noise_variance=0.0, **more)


def touching(line, lasting=0.3):
    return holding.touching(HOLD, reflectance_ratio.Params(), EYE, line, lasting)


@pytest.mark.parametrize(
    ("gap", "near"),
    [(-1e-3, 1.0), (0.0, 1.0), (1.5e-3, 256 / 257), (3e-3, 0.5), (6e-3, 1 / 257), (0.1, 0.0)],
)
def test_half_a_contact_is_at_l_h(gap, near):
    assert touching(line_at(gap)) == pytest.approx(near, abs=1e-9)


def test_without_a_line_only_time_tells_of_a_contact():
    assert touching(line_at(0.0, known=False), 0.3) == 0.3
    assert touching(line_at(0.1, known=False), 0.3) == 0.3
    half = line_at(6e-3)._replace(noise_variance=reflectance_ratio.Params().prior_deviation ** 2)
    assert touching(half, 0.3) == pytest.approx(0.5 * (1 / 257 + 0.3), abs=1e-9)
    after = holding.lasting(HOLD, 0.0, 1.0, 1e-3)
    assert after == pytest.approx(1e-3 / HOLD.blind_time, rel=2e-3)


def test_the_nearer_one_of_light_and_way_counts():
    """The sensor is stuck at 50 mm, and the finger at the face; or it carries the face along."""
    stuck = line_at(0.05)
    assert touching(stuck._replace(s=stuck.s - 0.05)) == pytest.approx(1.0, abs=1e-9)
    carried = line_at(0.0)
    assert touching(carried._replace(s=carried.s + 0.05)) == pytest.approx(1.0, abs=1e-9)
    assert touching(stuck._replace(s=stuck.s + 0.05)) == pytest.approx(0.0, abs=1e-9)


def test_the_speed_is_low_passed():
    """Towards the new one with the time constant, however many steps it is in."""
    once = holding.filtered(HOLD, 1.0, 0.0, 0.03)
    twice = holding.filtered(HOLD, holding.filtered(HOLD, 1.0, 0.0, 0.015), 0.0, 0.015)
    assert twice == pytest.approx(once, rel=0.2)
    assert 0.1 < once < 0.5
    assert holding.filtered(HOLD, 0.3, 0.3, 0.01) == pytest.approx(0.3, rel=1e-12)


def test_what_is_held_teaches_nothing():
    """A grasp pushed to and fro by 2 mm, its light rising with it by a tenth: no approach."""
    touching = approach((0.5, 1.0), end=0.0)
    *_, last = touching
    carried = [last._replace(velocity=(0.0, 0.0))] * 200
    for k in range(50):
        s, (x_1, x_2), (xi_1, xi_2) = 2e-3 * sin(0.3 * k), last.position, last.intensity
        seen = (xi_1 * (1.0 - 50.0 * s), xi_2 * (1.0 + 50.0 * s))
        carried.append(Inputs((x_1 + s, x_2 + s), (0.0, 0.0), seen))
    changes = []
    for hold in (holding.Params(), holding.Params(squeeze=1e12)):
        trace = run(Params(hold=hold), [*touching, *carried])
        held, after = (trace[k][0].estimate.beta for k in (len(touching) + 200, -1))
        changes.append(abs(after - held))
    with_hold, without = changes
    assert with_hold < 0.02 * without
