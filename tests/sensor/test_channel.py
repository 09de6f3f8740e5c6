"""One channel of the sensor: the stages in series, their sampling, their parameters."""

from dataclasses import replace
from itertools import pairwise
from math import sin
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import (
    ambient_light,
    channel,
    clock,
    converter,
    gaussian_noise,
    low_pass,
    mrg32k3a,
    optics,
    sliding_median,
    stripes,
)
from proximity_sensor.channel import Inputs, Params
from scipy import signal
from support.declared import parameters
from support.marks import examples

QUICK = examples(60)

GAPS = st.floats(0.0, 0.2)

ON = Params(
    ambient=ambient_light.Params(True, drift=0.02),
    noise=gaussian_noise.Params(True, seed=7),
    adc=converter.Params(True),
    filter=low_pass.Params(True),
    median=sliding_median.Params(True),
)
"""Everything but the stripes."""

STAGES = {
    "ambient": ambient_light.Params(True, drift=0.02),
    "noise": gaussian_noise.Params(True),
    "adc": converter.Params(True, 8, (0.0, 1.0)),
    "filter": low_pass.Params(True),
    "median": sliding_median.Params(True),
}


def only(stage, **others):
    return Params(**{stage: STAGES[stage]}, **others)


def without(p, *stages):
    return replace(p, **{stage: type(getattr(p, stage))() for stage in stages})


def run(p, gaps, h):
    """The output at each of the gaps, h seconds apart, before the next step."""
    x = channel.initial_state(p, Inputs(gaps[0]))
    seen = []
    for gap in gaps:
        seen.append(channel.outputs(p, x, Inputs(gap)).intensity)
        x = channel.step(p, x, Inputs(gap), h)
    return seen


def light(gaps, p):
    """Eq. (9)."""
    return p.gain * p.reflectance / (np.array(gaps) + p.offset_distance) ** p.diffusion_exponent


APPROACH = [0.06 + 0.055 * sin(0.02 * k) for k in range(600)]
"""From near to far and back, a gap for each sample."""


# -------------------------------------------------------------------------- all stages off


@QUICK
@given(
    st.builds(
        optics.Params,
        st.floats(0.0, 10.0),
        st.floats(0.0, 1e3),
        st.floats(0.1, 5.0),
        st.floats(1e-6, 1.0),
    ),
    st.floats(-1.0, 10.0),
    GAPS,
)
def test_off_it_is_the_optics(eye, gap, before):
    """Bit for bit, and whatever was before."""
    p = Params(eye.reflectance, eye.gain, eye.diffusion_exponent, eye.offset_distance)
    x = channel.initial_state(p, Inputs(before))
    assert channel.step(p, x, Inputs(before), 1e-3) is x
    assert channel.outputs(p, x, Inputs(gap)) == optics.outputs(eye, Inputs(gap))


def test_parameters_of_a_stage_that_is_off_do_nothing():
    p = Params(
        pattern=stripes.Params(ratio=0.1),
        ambient=ambient_light.Params(offset=1.0, drift=1.0),
        noise=gaussian_noise.Params(standard_deviation=1.0),
        adc=converter.Params(bits=1),
        filter=low_pass.Params(cutoff=5e5),
        sampling=clock.Params(1.0),
    )
    assert run(p, APPROACH, 1e-4) == run(Params(), APPROACH, 1e-4)


def test_stripes_alone_need_no_sampling():
    p = Params(pattern=stripes.Params(True))
    factors = [stripes.factor(p.pattern, gap) for gap in APPROACH]
    expected = light(APPROACH, p) * factors
    assert run(p, APPROACH, 1e-2) == pytest.approx(expected, rel=1e-13)
    assert run(p, [-0.1], 1e-2) == run(p, [0.0], 1e-2)


# ------------------------------------------------------------------- the chain, with numpy


def uniforms(seed, count):
    """MRG32k3a once more, in whole numbers, from the start of the stream."""
    x_1, x_2, x_3, y_1, y_2, y_3 = map(int, mrg32k3a.stream(float(seed)))
    m_1, m_2 = 2**32 - 209, 2**32 - 22853
    numbers = []
    for _ in range(count):
        x_1, x_2, x_3 = x_2, x_3, (1403580 * x_2 - 810728 * x_1) % m_1
        y_1, y_2, y_3 = y_2, y_3, (527612 * y_3 - 1370589 * y_1) % m_2
        numbers.append(((x_3 - y_3) % m_1 or m_1) / (m_1 + 1))
    return numbers


def conditioned(p, gaps):
    """The whole chain over a sample per gap, and 100 samples of the first gap before them."""
    before = 100
    xi = light([gaps[0]] * before + gaps, p)
    t = np.maximum(np.arange(-before, len(gaps)), 0) / p.sampling.rate
    steady = light(gaps[:1], p)[0]
    if p.ambient.enabled:
        xi += p.ambient.offset + p.ambient.drift * t
        steady += p.ambient.offset
    if p.noise.enabled:
        u = np.array(uniforms(p.noise.seed, 2 * len(xi)))
        normal = np.sqrt(-2.0 * np.log(u[::2])) * np.cos(2.0 * np.pi * u[1::2])
        xi += p.noise.standard_deviation * normal
    if p.adc.enabled:
        low, high = p.adc.range
        scale = 2**p.adc.bits / (high - low)

        def rounded(v):
            return np.clip(np.floor((v - low) * scale + 0.5), 0, 2**p.adc.bits - 1) / scale + low

        xi, steady = rounded(xi), rounded(steady)
    if p.filter.enabled:
        sections = signal.butter(5, p.filter.cutoff, fs=p.sampling.rate, output="sos")
        xi, _ = signal.sosfilt(sections, xi, zi=steady * signal.sosfilt_zi(sections))
    if p.median.enabled:
        padded = np.concatenate([[steady] * 9, xi])
        xi = np.median(np.lib.stride_tricks.sliding_window_view(padded, 10), axis=1)
    if p.ambient.enabled:
        xi -= p.ambient.offset
    return xi[before:]


@pytest.mark.parametrize(
    "p",
    [
        *(only(stage) for stage in STAGES),
        ON,
        replace(ON, adc=converter.Params(True, 12, (0.0, 1.2)), sampling=clock.Params(25_000.0)),
        replace(ON, filter=low_pass.Params(True, 1500.0), reflectance=0.57),
        without(ON, "adc"),
        without(ON, "ambient"),
        without(ON, "filter"),
        without(ON, "noise", "median"),
    ],
    ids=lambda p: "+".join(stage for stage in STAGES if getattr(p, stage).enabled),
)
def test_the_chain_is_numpys(p):
    values = run(p, APPROACH, 1.0 / p.sampling.rate)
    np.testing.assert_allclose(values, conditioned(p, APPROACH), rtol=0.0, atol=2e-13)


def test_the_drift_is_not_compensated():
    values = run(only("ambient"), [0.05] * 101, 1e-3)
    assert values[0] == pytest.approx(light([0.05], ON)[0], abs=1e-15)
    assert values[100] - values[0] == pytest.approx(0.02 * 0.1, abs=1e-15)


# ------------------------------------------------------------------------------- the start


@QUICK
@given(GAPS, st.sampled_from([*STAGES, "all"]))
def test_it_starts_settled(gap, stage):
    """No transient: the first millisecond is as the first value, noise and drift apart."""
    p = without(ON if stage == "all" else only(stage), "noise", "ambient")
    values = run(p, [gap] * 10, 1e-4)
    assert values == pytest.approx([values[0]] * 10, abs=1e-13)
    expected = light([gap], p)[0]
    if not p.adc.enabled:
        assert values[0] == pytest.approx(expected, abs=1e-13)
    elif p.adc.range[1] > expected:
        assert abs(values[0] - expected) < 1.01 * (p.adc.range[1] - p.adc.range[0]) / 2**p.adc.bits


# ---------------------------------------------------------------------------- the sampling


def chains(p, gaps, steps):
    """The state after each of the gaps, which is held over steps that add up to its time."""
    x = channel.initial_state(p, Inputs(gaps[0]))
    states = []
    for gap, split in zip(gaps, steps, strict=True):
        for h in split:
            x = channel.step(p, x, Inputs(gap), h)
        states.append(x)
    return states


def split(rng, start, end):
    times = [start, *sorted(rng.uniform(start, end) for _ in range(rng.randrange(6))), end]
    return [b - a for a, b in pairwise(times) if b > a]


@QUICK
@given(
    st.lists(GAPS, min_size=1, max_size=8),
    st.integers(0, 2**32),
    st.sampled_from([1e4, 3e3, 44_100.0, 999.7]),
)
def test_any_split_of_the_same_time_gives_the_same_bits(gaps, seed, rate):
    p = replace(ON, filter=low_pass.Params(True, 0.2 * rate), sampling=clock.Params(rate))
    rng, h = Random(seed), 1.3e-3
    pieces = [split(rng, k * h, (k + 1) * h) for k in range(len(gaps))]
    once = chains(p, gaps, [[h]] * len(gaps))
    for whole, parts in zip(once, chains(p, gaps, pieces), strict=True):
        assert parts.chain == whole.chain
        assert parts.wait == pytest.approx(whole.wait, abs=1e-9)


def test_a_sample_that_is_due_sees_the_gap_of_its_moment():
    p = only("adc")
    x = channel.initial_state(p, Inputs(0.05))
    near, far = (channel.outputs(p, x, Inputs(gap)).intensity for gap in (0.001, 0.1))
    assert near > far
    x = channel.step(p, x, Inputs(0.05), 0.5e-4)
    near, far = (channel.outputs(p, x, Inputs(gap)).intensity for gap in (0.001, 0.1))
    assert near == far


@pytest.mark.parametrize("stage", STAGES)
def test_the_seed_alone_decides_on_the_noise(stage):
    """Not the step, and not what the other stages do."""
    p = replace(only(stage), noise=gaussian_noise.Params(True, seed=3))
    for steps in (20, 40):
        x = channel.initial_state(p, Inputs(0.05))
        for _ in range(steps):
            x = channel.step(p, x, Inputs(0.05), 4e-3 / steps)
        s = mrg32k3a.stream(3.0)
        for _ in range(100 + 40 + 1):
            deviation, s = gaussian_noise.normal(s)
        assert (x.chain.number, x.chain.deviation, x.chain.generator) == (40.0, deviation, s)


# -------------------------------------------------------------------------- the parameters

PARAMETERS = [
    (stage, p)
    for stage, block in {
        "pattern": stripes.Params,
        "ambient": ambient_light.Params,
        "noise": gaussian_noise.Params,
        "adc": converter.Params,
        "filter": low_pass.Params,
        "sampling": clock.Params,
    }.items()
    for p in parameters(block)
]


@pytest.mark.parametrize(("stage", "parameter"), PARAMETERS)
def test_a_value_outside_its_range_is_refused(stage, parameter):
    block = type(getattr(Params(), stage))
    unit = f" {parameter.unit}" if parameter.unit else ""
    for number, value in parameter.invalid():
        with pytest.raises(ValueError, match=r"^\w+\.\w+ = ") as caught:
            block(**{parameter.name: value})
        assert str(caught.value) == (
            f"{stage}.{parameter.name} = {number!r}{unit}: {parameter.valid}"
        )


def test_the_filter_must_fit_the_sampling():
    for cutoff in (500.0, 5e4):
        with pytest.raises(ValueError, match=r"below half of sampling\.rate") as caught:
            Params(filter=low_pass.Params(True, cutoff), sampling=clock.Params(1000.0))
        assert str(caught.value) == (
            f"filter.cutoff = {cutoff!r} Hz: must be below half of sampling.rate, 500"
        )
    assert Params(filter=low_pass.Params(True, 499.0), sampling=clock.Params(1000.0)).sampled
