"""The analogue-to-digital converter against its definition."""

import pytest
from hypothesis import given
from hypothesis import strategies as st
from proximity_sensor import converter
from proximity_sensor.converter import Params
from support.marks import examples

QUICK = examples(200)

CONVERTERS = st.builds(
    lambda bits, low, span: Params(True, bits, (low, low + span)),
    st.integers(1, 24),
    st.floats(-20.0, 5.0),
    st.floats(0.1, 20.0),
)


def levels(p):
    """Lowest and highest level, and the step between them."""
    low, high = p.range
    step = (high - low) / 2.0**p.bits
    return low, high - step, step


@QUICK
@given(CONVERTERS, st.floats(0.0, 1.0))
def test_within_the_range_it_is_half_a_step_off_at_most(p, part):
    lowest, highest, step = levels(p)
    v = lowest + part * (highest - lowest)
    assert abs(converter.converted(p, v) - v) <= 0.5 * step * (1.0 + 1e-6)


@QUICK
@given(CONVERTERS, st.floats(-50.0, 50.0))
def test_it_gives_one_of_its_levels(p, v):
    lowest, _, step = levels(p)
    code = (converter.converted(p, v) - lowest) / step
    assert code == pytest.approx(round(code), abs=1e-6)
    assert -0.5 < code < 2.0**p.bits - 0.5


@QUICK
@given(CONVERTERS, st.floats(0.0, 1e6))
def test_it_saturates(p, beyond):
    lowest, highest, step = levels(p)
    assert converter.converted(p, lowest - beyond) == lowest
    assert converter.converted(p, highest + 0.5 * step + beyond) == pytest.approx(highest, abs=1e-9)


def test_sixteen_bits_have_a_level_at_zero():
    assert converter.converted(Params(True), 1e-6) == 0.0


@pytest.mark.parametrize("ends", [(5.0, 5.0), (5.0, -5.0)])
def test_a_range_without_an_inside_is_refused(ends):
    with pytest.raises(ValueError, match="the second must be above the first") as caught:
        Params(range=ends)
    assert str(caught.value).startswith(f"adc.range = {ends[0]}, {ends[1]} V: ")
