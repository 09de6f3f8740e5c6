"""Distributions: quantiles within their bounds."""

import numpy as np
import pytest
from grasp_cosim.sweep.distributions import Listed, Normal, Uniform, spaced
from hypothesis import given
from hypothesis import strategies as st

MIDDLES = (np.arange(4000) + 0.5) / 4000


@given(st.floats(0.0, 1.0), st.floats(-1e6, 1e6), st.floats(1e-3, 1e6))
def test_uniform_stays_within(u: float, low: float, span: float) -> None:
    found = Uniform(low, low + span)
    assert low <= found.at(u) <= low + span


@given(st.floats(0.0, 1.0), st.integers(1, 50))
def test_a_listed_value_is_one_of_them(u: float, count: int) -> None:
    assert Listed(tuple(range(count))).at(u) in range(count)


def test_listed_values_are_equally_likely() -> None:
    found = [Listed((True, "a", 3.0)).at(u) for u in (np.arange(30) + 0.5) / 30]
    assert found == [True] * 10 + ["a"] * 10 + [3.0] * 10


def test_a_normal_has_its_moments_and_its_bounds() -> None:
    wide = np.array([Normal(2.0, 0.5, -8.0, 12.0).at(u) for u in MIDDLES])
    assert wide.mean() == pytest.approx(2.0, abs=1e-9)
    assert wide.std() == pytest.approx(0.5, rel=2e-3)
    narrow = Normal(2.0, 0.5, 1.9, 2.3)
    assert (narrow.at(0.0), narrow.at(1.0)) == (1.9, 2.3)
    assert all(1.9 <= narrow.at(u) <= 2.3 for u in MIDDLES[::40])


def test_spaces_end_where_they_should() -> None:
    assert spaced(0.0, 1.0, 5, False).values == (0.0, 0.25, 0.5, 0.75, 1.0)
    even = spaced(0.5, 2.0, 3, True).values
    assert (even[0], even[-1]) == (0.5, 2.0)
    assert even[1] == pytest.approx(1.0, abs=1e-15)
