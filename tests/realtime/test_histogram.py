"""The histograms against the numbers themselves."""

import math

import numpy as np
import pytest
from grasp_cosim.realtime.histogram import BINS, RESOLUTION, Histograms, bins_of, lower_edge
from hypothesis import given
from hypothesis import strategies as st

times = st.one_of(st.integers(0, 300), st.integers(0, 2**53), st.integers(10**5, 10**7))


@given(st.lists(times, min_size=1, max_size=300), st.sampled_from([1, 7, 100]))
def test_quantiles_are_those_of_numpy_within_the_resolution(values: list[int], cut: int) -> None:
    histograms = Histograms(1)
    for first in range(0, len(values), cut):
        piece = np.array(values[first : first + cut], float)[:, np.newaxis]
        histograms.add(piece, np.arange(first, first + len(piece)))
    spread = histograms.spread(0)
    assert spread is not None
    for found, q in zip(spread[:3], (0.5, 0.99, 0.999), strict=True):
        exact = float(np.quantile(np.array(values, float), q, method="inverted_cdf"))
        assert exact <= found <= exact * (1 + RESOLUTION)
    assert (spread.worst, spread.worst_at) == (max(values), values.index(max(values)))
    (median,) = histograms.medians()
    assert min(median, spread.worst) == spread.median


@given(st.lists(times, min_size=1, max_size=100))
def test_the_bars_hold_all_values(values: list[int]) -> None:
    histograms = Histograms(2)
    column = np.array(values, float)
    histograms.add(np.column_stack((np.zeros(len(values)), column)), np.arange(len(values)))
    edges, counts = histograms.bars(1)
    assert len(edges) == len(counts) + 1
    assert sum(counts) == len(values)
    assert counts[0] > 0 < counts[-1]
    assert np.histogram(column, [*edges[:-1], math.nextafter(edges[-1], 0)])[0].tolist() == counts
    assert histograms.bars(0) == ([0.0, 1.0], [len(values)])


def test_every_bin_begins_where_its_values_begin() -> None:
    numbers = np.array([0, 1, 2, 128, 129, 130, 5000, 53 * 128])
    edges = np.array([lower_edge(int(n)) for n in numbers])
    assert bins_of(edges).tolist() == numbers.tolist()
    assert bins_of(np.nextafter(edges[1:], 0.0)).tolist() == (numbers[1:] - 1).tolist()
    assert int(bins_of(np.array([2.0**63 - 1024]))[0]) == BINS - 1


def test_some_may_be_left_out() -> None:
    histograms = Histograms(2)
    taken = np.array([[True, False], [True, True], [False, False]])
    histograms.add(np.array([[1.0, 9.0], [2.0, 3.0], [8.0, 8.0]]), np.array([5, 6, 7]), taken)
    first, second = histograms.spread(0), histograms.spread(1)
    assert first is not None
    assert second is not None
    assert (first.worst, first.worst_at, first.median) == (2, 6, 1)
    assert (second.worst, second.worst_at) == (3, 6)
    assert [sum(histograms.bars(i)[1]) for i in range(2)] == [2, 1]


def test_an_empty_one_has_no_spread() -> None:
    histograms = Histograms(1)
    assert histograms.spread(0) is None
    assert (histograms.worst(0), histograms.bars(0)) == (0, ([], []))
    histograms.add(np.zeros((1, 1)), np.zeros(1, np.int64))
    assert histograms.spread(0) == (0, 0, 0, 0, 0)


@pytest.mark.parametrize("count", [10, 10_000])
def test_the_memory_does_not_grow(count: int) -> None:
    histograms = Histograms(1)
    histograms.add(np.arange(float(count))[:, np.newaxis], np.arange(count))
    assert sum(a.nbytes for a in vars(histograms).values() if isinstance(a, np.ndarray)) < 2e5
