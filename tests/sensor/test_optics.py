"""The proximity sensor, Eq. (9) and the surfaces by name."""

from math import exp, isnan, log, nan

import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import optics
from proximity_sensor.optics import REFLECTANCE, Inputs, Params, Surface
from support.marks import examples

SENSORS = st.builds(
    Params, st.floats(1e-3, 10.0), st.floats(1e-6, 1e6), st.floats(0.1, 10.0), st.floats(1e-6, 1.0)
)


def intensity(p, gap):
    return optics.outputs(p, Inputs(gap)).intensity


@examples(100)
@given(SENSORS, st.floats(-1.0, 10.0))
def test_the_intensity_is_eq_9(p, gap):
    """The logarithm is at most 14 and n at most 10: the exponential costs 140 roundings."""
    distance = max(gap, 0.0) + p.offset_distance
    expected = exp(-p.diffusion_exponent * log(distance)) * p.gain * p.reflectance
    assert intensity(p, gap) == pytest.approx(expected, rel=140 * 2.3e-16, abs=0.0)


def test_nothing_is_seen_of_what_reflects_nothing_and_no_number_is_no_contact():
    assert intensity(Params(reflectance=0.0), 0.0) == 0.0
    assert isnan(intensity(Params(), nan))


def test_the_published_surfaces():
    found = {surface.name.lower(): alpha for surface, alpha in REFLECTANCE.items()}
    assert found == {"white": 1.0, "blue": 0.93, "red": 0.92, "brown": 0.86, "black": 0.57}
    assert Params().reflectance == REFLECTANCE[Surface.WHITE]
