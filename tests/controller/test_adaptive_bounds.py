"""Whatever is measured, and however long a step is: what is learnt stays a number, and bounded."""

import sys
from dataclasses import fields
from math import exp, isfinite, log

import pytest
from grasp_controller import adaptive, holding, reflectance_ratio
from grasp_controller.adaptive import Inputs, Params
from hypothesis import given
from hypothesis import strategies as st
from support.approach import H, approach, numbers, relit, run
from support.declared import parameters
from support.marks import examples

HARD = [0.0, -0.0, 5e-324, 1e-308, 1e-12, 1e-6, 1.0, 1e3, 1e9, 1e154, 1e300, sys.float_info.max]

NUMBERS = st.sampled_from(HARD + [-x for x in HARD]) | st.floats(
    allow_nan=False, allow_infinity=False
)

BOTH = st.tuples(NUMBERS, NUMBERS)

SANE = st.tuples(*[st.floats(-1e3, 1e3)] * 2)
"""m, m/s and V."""

STEPS = st.sampled_from([1e-300, 1e-9, 1e-4, 1e-3, 0.1, 1e3, 1e300]) | st.floats(1e-6, 1.0)

SAMPLES = st.lists(st.builds(Inputs, BOTH, BOTH, BOTH), min_size=2, max_size=8)


def at_the_ends(block):
    """A part of the parameters, each at an end of its range or as by default."""
    chosen = {p.name: st.sampled_from([p.low, p.default, p.high]) for p in parameters(block)}
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
@given(LAWS, SAMPLES, STEPS)
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


def test_every_parameter_of_what_is_learnt_has_a_range():
    """So that the ends above are all of them."""
    for block in (reflectance_ratio.Params, holding.Params):
        assert {p.name for p in parameters(block)} == {field.name for field in fields(block)}
