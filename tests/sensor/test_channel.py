"""One channel of the sensor: the stages in series, their sampling, their parameters."""

from dataclasses import replace
from itertools import pairwise
from math import sin
from random import Random

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import channel, electronics, noise, optics, spot
from proximity_sensor.channel import Inputs, Params
from scipy import signal
from support.declared import parameters
from support.marks import examples

QUICK = examples(60)

GAPS = st.floats(0.0, 0.2)

STAGES = {
    "ambient": electronics.Ambient(True, drift=0.02),
    "noise": noise.Noise(True),
    "adc": electronics.Adc(True, 8, (0.0, 1.0)),
    "filter": electronics.Filter(True),
    "median": electronics.Median(True),
}


ON = Params(**{**STAGES, "adc": electronics.Adc(True), "noise": noise.Noise(True, seed=7)})
"""Everything but the spot."""


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


@QUICK
@given(
    st.builds(optics.Params, st.floats(0.0, 10.0), st.floats(0.0, 1e3), st.floats(0.1, 5.0)),
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
        face=spot.Face(100.0),
        pattern=spot.Pattern(ratio=0.1),
        ambient=electronics.Ambient(offset=1.0, drift=1.0),
        noise=noise.Noise(standard_deviation=1.0),
        adc=electronics.Adc(bits=1),
        filter=electronics.Filter(cutoff=5e5),
        sampling=electronics.Sampling(1.0),
    )
    assert run(p, APPROACH, 1e-4) == run(Params(), APPROACH, 1e-4)


def test_a_spot_alone_needs_no_sampling():
    p = Params(spot=spot.Spot(True), pattern=spot.Pattern(0.5))
    places = [gap + p.offset_distance for gap in APPROACH]
    factors = [spot.brightness(p.spot, p.face, p.pattern, 1.1506, z_0) for z_0 in places]
    expected = light(APPROACH, p) * factors
    assert run(p, APPROACH, 1e-2) == pytest.approx(expected, rel=1e-13)
    assert run(p, [-0.1], 1e-2) == run(p, [0.0], 1e-2)


def normals(seed, count):
    """Numbers from the start of a stream, and the state after them; see test_noise.py."""
    numbers, s = [], noise.stream(float(seed))
    for _ in range(count):
        number, s = noise.normal(s)
        numbers.append(number)
    return numbers, s


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
        xi += p.noise.standard_deviation * np.array(normals(p.noise.seed, len(xi))[0])
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
        replace(
            ON, adc=electronics.Adc(True, 12, (0.0, 1.2)), sampling=electronics.Sampling(25_000.0)
        ),
        replace(ON, filter=electronics.Filter(True, 1500.0), reflectance=0.57),
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


@pytest.mark.parametrize(("surface", "alpha"), optics.REFLECTANCE.items())
def test_a_surface_by_name_wins_over_the_reflectance(surface, alpha):
    named = Params(surface=surface, reflectance=0.1)
    assert run(named, [0.02], 1e-3) == run(Params(reflectance=alpha), [0.02], 1e-3)


def test_the_drift_is_not_compensated():
    values = run(only("ambient"), [0.05] * 101, 1e-3)
    assert values[0] == pytest.approx(light([0.05], ON)[0], abs=1e-15)
    assert values[100] - values[0] == pytest.approx(0.02 * 0.1, abs=1e-15)


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
    p = replace(
        ON, filter=electronics.Filter(True, 0.2 * rate), sampling=electronics.Sampling(rate)
    )
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
    p = replace(only(stage), noise=noise.Noise(True, seed=3))
    for steps in (20, 40):
        x = channel.initial_state(p, Inputs(0.05))
        for _ in range(steps):
            x = channel.step(p, x, Inputs(0.05), 4e-3 / steps)
        numbers, s = normals(3, 100 + 40 + 1)
        assert (x.chain.number, x.chain.deviation, x.chain.generator) == (40.0, numbers[-1], s)


GROUPS = {
    "": optics.Params, "spot.": spot.Spot, "face.": spot.Face, "pattern.": spot.Pattern,
    "ambient.": electronics.Ambient,
    "noise.": noise.Noise, "adc.": electronics.Adc, "filter.": electronics.Filter,
    "sampling.": electronics.Sampling,
}  # fmt: skip


@pytest.mark.parametrize(
    ("group", "parameter"), [(group, p) for group in GROUPS for p in parameters(GROUPS[group])]
)
def test_a_value_outside_its_range_is_refused(group, parameter):
    unit = f" {parameter.unit}" if parameter.unit else ""
    for number, value in parameter.invalid():
        with pytest.raises(ValueError, match=parameter.name) as caught:
            GROUPS[group](**{parameter.name: value})
        assert str(caught.value) == (
            f"{group}{parameter.name} = {number!r}{unit}: {parameter.valid}"
        )


def test_the_filter_must_fit_the_sampling():
    for cutoff in (500.0, 5e4):
        with pytest.raises(ValueError, match=r"below half of sampling\.rate") as caught:
            Params(filter=electronics.Filter(True, cutoff), sampling=electronics.Sampling(1000.0))
        assert str(caught.value) == (
            f"filter.cutoff = {cutoff!r} Hz: must be below half of sampling.rate, 500"
        )
    assert Params(
        filter=electronics.Filter(True, 499.0), sampling=electronics.Sampling(1000.0)
    ).sampled
