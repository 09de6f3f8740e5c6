"""The loop in C tells of the first value at or above its bound, however it is written."""

import numpy as np
import pytest
from grasp_cosim.exchange.bounds import Bounds
from grasp_cosim.master.engine import make_loop
from grasp_cosim.master.plan import Plan
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples, needs_compiler

pytestmark = needs_compiler

ANY = st.floats(allow_nan=True, allow_infinity=True) | st.sampled_from([0.0, -0.0, 5e-324])


def exceeded(values, bounds):
    """Whether a step in which values stay as they are comes to a bound."""
    bounds.compared = True
    plan = Plan(np.array(values), np.zeros(3), bounds=bounds)
    assert make_loop(plan, "compiled")(np.empty((1, len(values))), 0, 0, 1, 0, 1, 1) == (1, 0, 0)
    return bounds.may_be_exceeded


@examples()
@given(st.lists(st.tuples(ANY, st.floats(0.0, allow_infinity=True), st.booleans()), min_size=1))
def test_a_bound_is_come_to_as_numbers_are_compared(rows):
    values, magnitudes, infinite = (np.array(column) for column in zip(*rows, strict=True))
    bounds = Bounds(len(rows) + 1)
    bounds.put(np.arange(len(rows)), magnitudes, infinite)
    with np.errstate(invalid="ignore"):
        above = (np.abs(values) >= magnitudes) & (np.abs(values) > 0.0)
    above &= ~(np.isinf(values) & np.isinf(magnitudes) & infinite)
    assert exceeded([*values, np.nan], bounds) == bool((above | np.isnan(values)).any())


@pytest.mark.parametrize(
    ("value", "infinite", "found"),
    [(1e308, 0, 0), (np.inf, 0, 1), (-np.inf, 1, 0), (np.nan, 1, 1)],
)
def test_without_a_magnitude_only_what_is_not_finite_is_looked_at(value, infinite, found):
    bounds = Bounds(1)
    bounds.put([0], np.array([np.nan]), [infinite])
    assert exceeded([value], bounds) == bool(found)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_value_at_its_bound_has_come_to_it(sign):
    for value, found in ((2.0, True), (np.nextafter(2.0, 0.0), False)):
        bounds = Bounds(1)
        bounds.put([0], np.array([2.0]), [False])
        assert exceeded([sign * value], bounds) == found


def test_before_any_bound_is_put_and_where_none_is_compared_all_is_looked_at():
    bounds = Bounds(1)
    assert exceeded([0.0], bounds)
    bounds.put([0], np.ones(1), [False])
    assert not exceeded([0.0], bounds)
    bounds.compared = False
    assert bounds.may_be_exceeded
