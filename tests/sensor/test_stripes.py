"""The striped surface."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import stripes
from proximity_sensor.stripes import Params
from support.marks import examples

QUICK = examples(100)

PATTERN = Params(True, ratio=0.5, period=0.02, phase=0.003, edge=0.002)


@pytest.mark.parametrize(
    ("gap", "factor"),
    [(0.003, 1.0), (0.007, 1.0), (0.008, 0.75), (0.0085, 0.625), (0.009, 0.5), (0.013, 0.5),
     (0.017, 0.5), (0.018, 0.75), (0.019, 1.0), (0.023, 1.0), (-0.002, 0.75)],
)  # fmt: skip
def test_two_stripes_and_their_edges(gap, factor):
    assert stripes.factor(PATTERN, gap) == pytest.approx(factor, abs=1e-12)


@QUICK
@given(st.floats(0.0, 0.1), st.integers(-4, 4))
def test_it_repeats(gap, periods):
    again = stripes.factor(PATTERN, gap + periods * PATTERN.period)
    assert again == pytest.approx(stripes.factor(PATTERN, gap), abs=1e-10)


@QUICK
@given(st.floats(0.0, 2.0), st.floats(1e-3, 1.0), st.floats(1e-6, 1.0), st.floats(0.0, 1.0))
def test_it_stays_between_the_two(ratio, period, edge, gap):
    factor = stripes.factor(Params(True, ratio, period, 0.0, edge), gap)
    assert min(1.0, ratio) <= factor <= max(1.0, ratio)


def test_both_stripes_take_the_same_room():
    gaps = np.linspace(0.0, 0.2, 20_000, endpoint=False)
    mean = np.mean([stripes.factor(PATTERN, float(gap)) for gap in gaps])
    assert mean == pytest.approx(0.75, abs=1e-4)


def test_nothing_jumps():
    gaps = np.linspace(0.0, 0.1, 50_001)
    factors = np.array([stripes.factor(PATTERN, float(gap)) for gap in gaps])
    steepest = 0.5 / PATTERN.edge
    assert np.abs(np.diff(factors)).max() == pytest.approx(steepest * 2e-6, rel=1e-6)
