"""Orders and limits of results over steps, where the answer is known."""

import math
from itertools import accumulate

import pytest
from grasp_cosim.convergence.extrapolation import converge
from hypothesis import given
from hypothesis import strategies as st
from support.examples import examples

STEPS = [0.1 * 2.0**i for i in range(6)]


@examples()
@given(
    limit=st.floats(-10.0, 10.0),
    scale=st.floats(0.1, 10.0),
    order=st.integers(1, 3),
    ratios=st.lists(st.floats(1.5, 4.0), min_size=2, max_size=6),
)
def test_a_power_of_the_step_is_found_for_any_ratios(
    limit: float, scale: float, order: int, ratios: list[float]
) -> None:
    steps = list(accumulate(ratios, lambda h, r: h * r, initial=0.1))
    found = converge(steps, [limit + scale * h**order for h in steps])
    assert found.limit == pytest.approx(limit, abs=1e-8 * scale * steps[-1] ** order)
    assert found.orders[:2] == (None, None)
    assert found.orders[2:] == pytest.approx([order] * (len(steps) - 2), abs=1e-5)
    assert found.order == pytest.approx(order, abs=1e-5)
    assert (found.settled, found.remark) == (len(steps), "")


def test_the_uncertainty_covers_what_the_extrapolation_leaves() -> None:
    found = converge(STEPS, [1.0 + 0.3 * h + 0.02 * h**2 for h in STEPS])
    assert found.limit is not None
    assert found.uncertainty is not None
    assert 0.0 < abs(found.limit - 1.0) < found.uncertainty < 10.0 * abs(found.limit - 1.0)


def test_steps_that_are_too_long_do_not_count_for_the_order() -> None:
    results = [1.0 + 0.3 * h for h in STEPS]
    results[-1] += 50.0
    found = converge(STEPS, results)
    assert found.order == pytest.approx(1.0)
    assert found.settled == len(STEPS) - 1


@pytest.mark.parametrize(
    "results",
    [
        [1.0, 1.2, 1.1, 1.3, 0.9, 1.1],
        [1.0] * 6,
        [1.0 + math.sqrt(h) for h in STEPS],
        [1.0 + 0.1 * math.log(h) for h in STEPS],
    ],
)
def test_without_an_order_the_finest_stands_for_the_limit(results: list[float]) -> None:
    found = converge(STEPS, list(results))
    assert (found.limit, found.order, found.settled) == (results[0], None, 0)
    assert found.uncertainty == max(abs(results[1] - results[0]), abs(results[2] - results[1]))
    assert "show no whole order" in found.remark


def test_errors_below_the_uncertainty_tell_no_order() -> None:
    """An order of 1.19, taken for 1, leaves a limit that the finest error does not rise above."""
    found = converge([1.0, 4.0, 16.0], [0.0, 1.0, 1.0 + 4.0**1.19])
    assert found.orders[2] == pytest.approx(1.19)
    assert found.limit == pytest.approx(-1.0 / 3.0)
    assert (found.settled, found.order) == (3, None)
    assert "fewer than three errors" in found.remark


def test_a_missing_result_among_the_finest_leaves_no_limit() -> None:
    found = converge(STEPS, [1.0, None, 1.2, 1.4, 1.8, 2.6])
    assert (found.limit, found.uncertainty, found.order) == (None, None, None)
    assert found.errors == (None,) * 6
    assert not found.within(0, math.inf)
    assert "no result" in found.remark


def test_a_missing_result_beyond_the_finest_is_no_error() -> None:
    results = [1.0 + 0.3 * h for h in STEPS]
    found = converge(STEPS, [*results[:4], None, results[5]])
    assert found.errors[4] is None
    assert found.settled == 4
    assert found.order == pytest.approx(1.0)
    assert [found.within(i, 0.2) for i in range(6)] == [True] * 3 + [False] * 3


def test_within_asks_for_room_for_the_uncertainty() -> None:
    found = converge(STEPS, [1.0 + 0.3 * h + 0.02 * h**2 for h in STEPS])
    error, uncertainty = found.errors[1], found.uncertainty
    assert error is not None
    assert uncertainty is not None
    assert found.within(1, abs(error) + uncertainty)
    assert not found.within(1, abs(error) + 0.9 * uncertainty)
