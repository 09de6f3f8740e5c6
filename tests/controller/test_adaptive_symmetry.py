"""The adaptive law from behind the gripper, and with twice the light."""

from dataclasses import replace

import pytest
from grasp_controller import holding, reflectance_ratio
from grasp_controller import impact_reduction as layer_2
from grasp_controller import simultaneous_contact as layer_3
from grasp_controller.adaptive import Params
from hypothesis import given
from hypothesis import strategies as st
from support.approach import ANY_SAMPLES, approach, assert_mirrored, mirrored, pairs, run
from support.marks import examples

LAWS = st.builds(
    Params,
    st.builds(layer_3.Params, st.booleans(), gain=st.floats(-5.0, 5.0)),
    st.builds(layer_2.Params, st.booleans()),
    reflectance=st.builds(
        reflectance_ratio.Params,
        diffusion_exponent=st.floats(0.5, 2.0),
        time_constant=st.floats(1e-6, 0.1),
        weight_exponent=st.floats(0.0, 10.0),
        intensity_noise=st.sampled_from([1e-12, 5e-4, 1.0]),
        prior_deviation=st.floats(0.0, 3.0),
    ),
    hold=st.builds(holding.Params, squeeze=st.floats(1e-6, 10.0), speed=st.floats(1e-4, 1.0)),
)

SURE = replace(Params(), reflectance=reflectance_ratio.Params(intensity_noise=1e-12))
"""Of what it has learnt."""


def dimmed(u, factor):
    xi_1, xi_2 = u.intensity
    return u._replace(intensity=(factor * xi_1, factor * xi_2))


@examples(30)
@given(
    LAWS,
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


def test_the_mirror_image_of_what_is_learnt_is_not_nothing():
    """The property above says something: the estimate of unequal faces is far from 0."""
    x, _ = run(Params(), approach((0.5, 1.0)))[-1]
    assert x.estimate.beta == pytest.approx(-0.69, abs=0.05)


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


@pytest.mark.parametrize("factor", [0.3, 3.0])
def test_noise_is_the_one_thing_that_the_brightness_counts_against(factor):
    """Dark faces with as little more noise as light look the same."""
    samples = approach((0.4, 0.9))
    noise = replace(Params(), reflectance=reflectance_ratio.Params(intensity_noise=5e-3))
    scaled = replace(noise, reflectance=replace(noise.reflectance, intensity_noise=5e-3 * factor))
    dark = [dimmed(u, factor) for u in samples]
    expected, quieter, same = (
        run(p, seen)[-1][0].estimate
        for p, seen in ((noise, samples), (noise, dark), (scaled, dark))
    )
    assert same == pytest.approx(expected, rel=1e-9)
    assert (quieter.deviation < expected.deviation) == (factor > 1.0)
