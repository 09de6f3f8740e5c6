"""The proximity sensor, Eq. (9), the surfaces by name and the striped one."""

from math import exp, isnan, log, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import optics
from proximity_sensor.optics import REFLECTANCE, Inputs, Params, Pattern, Surface, striped
from support.marks import examples

SENSORS = st.builds(
    Params, st.floats(1e-3, 10.0), st.floats(1e-6, 1e6), st.floats(0.1, 10.0), st.floats(1e-6, 1.0)
)
PATTERN = Pattern(True, ratio=0.5, period=0.02, phase=0.003, edge=0.002)


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


@pytest.mark.parametrize(
    ("gap", "factor"),
    [(0.003, 1.0), (0.007, 1.0), (0.008, 0.75), (0.0085, 0.625), (0.009, 0.5), (0.013, 0.5),
     (0.017, 0.5), (0.018, 0.75), (0.019, 1.0), (0.023, 1.0), (-0.002, 0.75)],
)  # fmt: skip
def test_two_stripes_and_their_edges(gap, factor):
    assert striped(PATTERN, gap) == pytest.approx(factor, abs=1e-12)


def test_stripes_repeat_and_nothing_jumps():
    gaps = np.linspace(0.0, 0.1, 5_001)
    factors = np.array([striped(PATTERN, gap) for gap in gaps.tolist()])
    assert np.abs(np.diff(factors)).max() == pytest.approx(0.5 / PATTERN.edge * 2e-5, rel=1e-6)
    assert factors[1000:] == pytest.approx(factors[:-1000], abs=1e-10)
    assert factors[:-1].mean() == pytest.approx(0.75, abs=1e-4)
