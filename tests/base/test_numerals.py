"""Numbers in tables: usual sizes with their decimals, others with a power of ten."""

import math

import pytest
from grasp_cosim.base.numerals import MOST, NOISE, counted, fixed
from hypothesis import given
from hypothesis import strategies as st


@given(st.floats(0.001, 0.999 * MOST), st.booleans(), st.integers(3, 6), st.integers(0, 12))
def test_usual_sizes_have_their_decimals(size, down, decimals, width):
    value = -size if down else size
    assert fixed(value, decimals, width=width) == f"{value:{width}.{decimals}f}"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (4.6e40, "4.6e+40"), (-4.03977e41, "-4.04e+41"), (1.306e-13, "0.000"), (6.3e-8, "6.3e-08"),
        (4e-4, "0.0004"), (0.0, "0.000"), (0.0006, "0.001"), (math.inf, "inf"), (math.nan, "nan"),
    ],
)  # fmt: skip
def test_others_have_a_power_of_ten(value, text):
    assert fixed(value, 3) == text


@given(st.floats(allow_nan=False))
def test_no_number_is_long_or_looks_like_0(value):
    text = fixed(value, 3)
    assert len(text) <= len("-999999999.999")
    assert (float(text) == 0.0) == (abs(value) < NOISE)


def test_what_is_too_small_may_be_rounded_to_0():
    assert fixed(6.3e-15, 3, sign="+", rounded=True) == "+0.000"
    assert fixed(4.6e40, 3, sign="+", rounded=True) == "+4.6e+40"


@pytest.mark.parametrize(("count", "text"), [(0, "0 faults"), (1, "1 fault"), (2, "2 faults")])
def test_a_noun_agrees_with_its_number(count, text):
    assert counted(count, "fault") == text
