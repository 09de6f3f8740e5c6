"""The curves of a paced run's timing: what they say at their points, how they look."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from grasp_cosim.realtime.timing import Histogram, Spread
from grasp_cosim.report.timing import curves, decades
from report.timings import PERIOD, paced


def of_times(times, edges):
    """A timing whose only part took these times."""
    counts = np.histogram(times, edges)[0]
    assert counts.sum() == len(times)
    median, p99, p999 = np.quantile(times, (0.5, 0.99, 0.999), method="inverted_cdf").tolist()
    return replace(
        paced(steps=100, hiccups=0),
        parts={"step": Spread(median, p99, p999, max(times), 0.0)},
        histograms={"step": Histogram(tuple(edges), tuple(counts.tolist()))},
    )


def test_a_curve_is_the_share_that_took_at_least_as_long():
    times = [1e-6, 2e-6, 2e-6, 3e-6, 90e-6]
    (curve,) = curves(of_times(times, [1e-6, 1.5e-6, 2.5e-6, 4e-6, 50e-6, 100e-6]))
    assert curve.points == (
        (1e-6, 1.0),
        (1.5e-6, 0.8),
        (2e-6, 0.5),  # the median
        (2.5e-6, 0.4),
        (4e-6, 0.2),  # level from here: no time fell between 4 and 50 us
        (50e-6, 0.2),
        (90e-6, 0.2),  # the worst
    )
    assert curve.marks == {"median": (2e-6, 0.5), "worst": (90e-6, 0.2)}


def test_curves_fall_from_all_steps_to_the_worst_one_through_the_quantiles():
    timing = paced()
    drawn = curves(timing)
    assert drawn[-1].part == "step"
    assert {curve.part for curve in drawn} == set(timing.parts)
    for curve in drawn:
        spread = timing.parts[curve.part]
        assert curve.points[0][1] == 1.0
        assert curve.points[-1] == (spread.worst, 1.0 / timing.steps)
        assert all(a[0] <= b[0] and a[1] >= b[1] for a, b in pairwise(curve.points))
        assert curve.marks["p99"] == (spread.p99, 0.01)
        assert curve.marks["p99.9"] == (spread.p999, 0.001)
        assert set(curve.marks.values()) <= set(curve.points)


def test_an_axis_begins_where_the_clock_is_exact_and_has_a_decade_at_least():
    assert decades([2e-9, 3e-9, PERIOD]) == pytest.approx((1e-7, 1e-2))
    assert decades([1e-9]) == pytest.approx((1e-7, 1e-6))
    assert decades([0.0]) == decades([]) == pytest.approx((1e-7, 1e-6))
