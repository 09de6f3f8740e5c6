"""The timing of a paced run in words."""

from dataclasses import replace

import pytest
from grasp_cosim.realtime.timing import Overrun
from grasp_cosim.report.timing import culprits, duration, kept
from report.timings import PERIOD, paced


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
def test_durations(seconds, text):
    assert duration(seconds) == text


def test_in_words():
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
    assert [name for name, _ in culprits(timing)][:2] == ["backlog", "plant"]
    assert kept(timing) == (
        "40 of 100 steps (40 %) ended after their period of 1 ms. The worst of the first 2 was "
        "2 ms late; to blame: plant (4), late start (3), sensor_1 (2), 1 other, "
        "backlog (30)."
    )
