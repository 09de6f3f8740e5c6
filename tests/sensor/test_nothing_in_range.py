"""A gap to nothing: inf and what is above any range; what no gap can be is no touch."""

import re
import sys
from dataclasses import replace
from math import inf

import pytest
from proximity_sensor import channel, electronics, optics, spot
from proximity_sensor.channel import Inputs, Params

NOTHING = [inf, sys.float_info.max, 1e9, 1.1 * optics.FARTHEST]
PRINTED = Params(spot=spot.Spot(True), pattern=spot.Pattern(0.5, period=1e-6))
STEEP = Params(diffusion_exponent=10.0, offset_distance=1e-6, gain=1e6)


def seen(p, gap):
    u = Inputs(gap)
    channel.check_inputs(p, u)
    return channel.outputs(p, channel.initial_state(p, u), u).intensity


@pytest.mark.parametrize("gap", NOTHING)
@pytest.mark.parametrize("p", [Params(), PRINTED, STEEP], ids=["plain", "printed", "steep"])
def test_the_intensity_of_nothing_is_zero(p, gap):
    assert seen(p, gap) == 0.0


def test_far_away_it_is_still_that_of_eq_9():
    p = Params()
    assert seen(p, 1e5) == p.gain / (1e5 + p.offset_distance) ** p.diffusion_exponent > 0.0


@pytest.mark.parametrize("gap", [-1e-9, -0.001, -0.005])
def test_a_gap_a_little_below_zero_is_a_contact(gap):
    assert seen(Params(), gap) == seen(Params(), 0.0)


@pytest.mark.parametrize("gap", [-1.0, -0.005001, -inf, -sys.float_info.max])
def test_what_is_behind_the_element_is_refused_with_the_reason(gap):
    text = (
        f"gap = {gap!r} m: must be from -0.005 m on, where the sensing element is; a ray that hit"
    )
    with pytest.raises(ValueError, match=f"^{re.escape(text)}"):
        channel.check_inputs(Params(), Inputs(gap))


def test_the_bound_is_that_of_the_parameters():
    deep = Params(offset_distance=1.0)
    assert seen(deep, -1.0) == seen(deep, 0.0)


@pytest.mark.parametrize("gap", NOTHING)
def test_the_electronics_take_nothing_as_a_dark_wall(gap):
    """Of a surface that reflects nothing they give the same, sample by sample."""
    stages = Params(
        ambient=electronics.Ambient(True, drift=0.02),
        adc=electronics.Adc(True),
        filter=electronics.Filter(True),
        median=electronics.Median(True),
    )
    dark = replace(stages, reflectance=0.0)
    y = channel.initial_state(dark, Inputs(0.02))
    x = channel.initial_state(stages, Inputs(gap))
    assert x == y
    for _ in range(50):
        x = channel.step(stages, x, Inputs(gap), 1e-4)
        y = channel.step(dark, y, Inputs(0.02), 1e-4)
    assert channel.outputs(stages, x, Inputs(gap)) == channel.outputs(dark, y, Inputs(0.02))
