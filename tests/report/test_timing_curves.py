"""The curves of a paced run's timing: what they say at their points, and what is said in words."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from grasp_cosim.realtime.timing import Histogram, Overrun, Spread, Timing
from grasp_cosim.report.timing_curves import (
    Curve,
    axes,
    culprits,
    curves,
    decades,
    duration,
    kept,
    late_decades,
    looks,
    place,
    unlisted,
)
from report.timings import PERIOD, paced


def of_times(times: list[float], edges: list[float]) -> Timing:
    """A timing whose only part took these times."""
    counts = np.histogram(times, edges)[0]
    assert counts.sum() == len(times)
    median, p99, p999 = np.quantile(times, (0.5, 0.99, 0.999), method="inverted_cdf").tolist()
    return replace(
        paced(steps=100, hiccups=0),
        parts={"step": Spread(median, p99, p999, max(times), 0.0)},
        histograms={"step": Histogram(tuple(edges), tuple(counts.tolist()))},
    )


def test_a_curve_is_the_share_that_took_at_least_as_long() -> None:
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


def test_curves_fall_from_all_steps_to_the_worst_one_through_the_quantiles() -> None:
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


@pytest.mark.parametrize(
    ("steps", "marks"),
    [
        (1000, ["median", "p99", "p99.9", "worst"]),
        (999, ["median", "p99", "worst"]),
        (49, ["median", "worst"]),  # 49 * (1 / 49) < 1
        (2, ["median", "worst"]),
        (1, ["worst"]),
    ],
)
def test_a_quantile_that_is_the_worst_step_is_no_mark_of_its_own(
    steps: int, marks: list[str]
) -> None:
    timing = of_times([1e-6] * (steps - 1) + [2e-6], [1e-6, 1.5e-6, 3e-6])
    assert list(curves(timing)[0].marks) == marks


def test_the_axes_hold_all_curves_and_the_period() -> None:
    timing = paced()
    span = axes(curves(timing), PERIOD)
    assert (span.left, span.right, span.bottom) == pytest.approx((1e-7, 1e-2, 1e-5))
    assert axes([], PERIOD) == pytest.approx((1e-3, 1e-2, 0.01))
    slow = Curve("step", ((0.0, 1.0), (2e-3, 0.5), (30.0, 0.25)), {})
    assert axes([slow], PERIOD) == pytest.approx((1e-3, 100.0, 0.01))
    fast = Curve("step", ((2e-9, 1.0), (3e-9, 0.1)), {})
    assert axes([fast], PERIOD) == pytest.approx((1e-7, 1e-2, 0.01))


def test_places_on_a_logarithmic_axis() -> None:
    assert decades(1e-6, 1e-3) == pytest.approx([1e-6, 1e-5, 1e-4, 1e-3])
    assert place(1e-4, 1e-6, 1e-2) == pytest.approx(0.5)
    assert [place(t, 1e-6, 1e-2) for t in (0.0, 1e-9, 1e-6, 1.0)] == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("seconds", "text"),
    [
        (0.0, "0 s"),
        (4.2e-8, "42 ns"),
        (9.994e-7, "999 ns"),
        (9.996e-7, "1 µs"),
        (41.23e-6, "41.2 µs"),
        (1.1e-3, "1.1 ms"),
        (1.0, "1 s"),
        (86400.0, "86400 s"),
        (10.0**-5, "10 µs"),
    ],
)
def test_durations(seconds: float, text: str) -> None:
    assert duration(seconds) == text


def test_every_part_and_culprit_looks_different() -> None:
    timing = paced(components={f"c{k}": 1e-6 for k in range(20)}, hiccups=0)
    timing = replace(timing, culprits={"backlog": 1, "slow": 2})
    look = looks(timing)
    assert {*timing.parts, "backlog", "slow"} <= set(look)
    assert len(set(look.values())) == len(look)


def test_in_words() -> None:
    assert kept(paced(steps=2000, hiccups=0)) == (
        "All 2\N{NARROW NO-BREAK SPACE}000 steps ended within their period of 1 ms."
    )
    late = tuple(Overrun(k, k * PERIOD, late, "plant", 2e-3) for k, late in ((3, 1e-4), (7, 2e-3)))
    timing = replace(paced(steps=100, hiccups=0), overruns=2, listed=late, culprits={"plant": 2})
    assert kept(timing) == (
        "2 of 100 steps (2 %) ended after their period of 1 ms. "
        "The worst was 2 ms late; to blame: plant (2)."
    )
    more = {"between": 1, "plant": 4, "start": 3, "sensor_1": 2, "backlog": 30}
    timing = replace(timing, overruns=40, culprits=more)
    assert unlisted(timing) == 38
    assert [name for name, _ in culprits(timing)][:2] == ["backlog", "plant"]
    assert kept(timing) == (
        "40 of 100 steps (40 %) ended after their period of 1 ms. The worst of the first 2 was "
        "2 ms late; to blame: plant (4), late start (3), sensor_1 (2), 1 other, "
        "backlog (30)."
    )


def test_how_late_is_on_an_axis_of_a_decade_at_least() -> None:
    def overruns(*lates: float) -> list[Overrun]:
        return [Overrun(0, 0.0, late, "plant", late) for late in lates]

    assert late_decades(overruns(2e-4)) == pytest.approx((1e-4, 1e-3))
    assert late_decades(overruns(2e-5, 4.96e-3)) == pytest.approx((1e-5, 1e-2))
    assert late_decades(overruns(1e-9)) == pytest.approx((1e-7, 1e-6))
