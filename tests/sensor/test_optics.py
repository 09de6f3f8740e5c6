"""The proximity sensor, Eq. (9)."""

from math import exp, isnan, log, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import optics
from proximity_sensor.optics import Inputs, Params
from support.declared import parameters
from support.marks import examples

PARAMETERS = parameters(Params)

QUICK = examples(100)

GAPS = st.floats(0.0, 10.0)

SENSORS = st.builds(
    Params,
    reflectance=st.floats(1e-3, 10.0),
    gain=st.floats(1e-6, 1e6),
    diffusion_exponent=st.floats(0.1, 10.0),
    offset_distance=st.floats(1e-6, 1.0),
)


def intensity(p, gap):
    return optics.outputs(p, Inputs(gap)).intensity


@QUICK
@given(SENSORS, GAPS)
def test_the_intensity_is_eq_9(p, gap):
    """The logarithm is at most 14 and n at most 10: the exponential costs 140 roundings."""
    distance = gap + p.offset_distance
    expected = exp(-p.diffusion_exponent * log(distance)) * p.gain * p.reflectance
    assert intensity(p, gap) == pytest.approx(expected, rel=140 * 2.3e-16, abs=0.0)


@QUICK
@given(GAPS, st.floats(0.01, 1.0), st.floats(1.0, 1e6))
def test_the_intensity_is_proportional_to_reflectance_and_gain(gap, reflectance, gain):
    one = intensity(Params(reflectance=1.0, gain=1.0), gap)
    dark = intensity(Params(reflectance=reflectance, gain=1.0), gap)
    loud = intensity(Params(reflectance=1.0, gain=gain), gap)
    assert dark == pytest.approx(reflectance * one, rel=1e-15, abs=0.0)
    assert loud == pytest.approx(gain * one, rel=1e-15, abs=0.0)


@pytest.mark.parametrize("change", [{"reflectance": 0.0}, {"gain": 0.0}])
def test_a_surface_that_reflects_nothing_is_not_seen(change):
    assert intensity(Params(**change), 0.0) == 0.0


@QUICK
@given(SENSORS, st.floats(-10.0, 0.0))
def test_a_gap_below_zero_reads_as_zero(p, gap):
    assert intensity(p, gap) == intensity(p, 0.0)


def test_a_gap_that_is_no_number_is_not_taken_for_contact():
    assert isnan(intensity(Params(), nan))


@pytest.mark.parametrize("parameter", PARAMETERS, ids=lambda p: p.name)
def test_every_range_is_enforced(parameter):
    for number, value in parameter.invalid():
        with pytest.raises(ValueError, match=r"^\w+ = ") as caught:
            Params(**{parameter.name: value})
        assert str(caught.value) == (
            f"{parameter.name} = {number!r} {parameter.unit}: {parameter.valid}"
        )
    for bound in (parameter.low, parameter.high):
        assert getattr(Params(**{parameter.name: bound}), parameter.name) == bound


def test_every_number_has_a_range():
    names = {"reflectance", "gain", "diffusion_exponent", "offset_distance"}
    assert {p.name for p in PARAMETERS} == names
