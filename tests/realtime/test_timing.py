"""The timing of a run as plain data: there and back, and what cannot be of one run is refused."""

import json
import math

import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.realtime.timing import Timing
from report.timings import paced


@pytest.mark.parametrize(("hiccups", "listed"), [(0, 1000), (12, 1000), (12, 5)])
def test_there_and_back(hiccups, listed):
    timing = paced(steps=200, hiccups=hiccups, listed=listed)
    assert Timing.from_dict("here", json.loads(json.dumps(timing.as_dict()))) == timing


def no_plant(d):
    del d["parts"]["plant"]


def no_counts(d):
    d["histograms"]["plant"]["counts"] = []


def nothing_counted(d):
    d["histograms"]["plant"] = {"edges": [1e-6, 2e-6], "counts": [0]}


def falling_edges(d):
    d["histograms"]["plant"]["edges"][0] = 1.0


@pytest.mark.parametrize(
    ("damage", "message"),
    [
        (lambda d: d.update(period=0.0), "period must be > 0"),
        (lambda d: d.update(period=math.inf), "period must be > 0"),
        (lambda d: d.pop("period"), "KeyError: 'period'"),
        (lambda d: d["parts"]["plant"].update(worst=math.nan), "times must be finite"),
        (lambda d: d["overruns"]["listed"][0].update(late="much"), "could not convert"),
        (lambda d: d["overruns"]["listed"][0].update(late=-1.0), "times must be finite"),
        (no_plant, "a histogram of each part"),
        (no_counts, "counts between edges"),
        (nothing_counted, "counts between edges"),
        (falling_edges, "counts between edges"),
        (lambda d: d.update(steps=3), "from those listed to all steps"),
        (lambda d: d["overruns"].update(listed=[]), "a list of overruns"),
        (lambda d: d["overruns"].update(count=3), "from those listed to all steps"),
        (lambda d: d["overruns"].update(culprits={}), "those of all overruns"),
        (lambda d: d["overruns"]["listed"][0].update(culprit="x"), "those of all overruns"),
    ],
)
def test_what_is_damaged_is_refused_in_one_line(damage, message):
    found = paced(steps=200, hiccups=4).as_dict()
    damage(found)
    with pytest.raises(InputError, match=r"^here: is damaged \(") as raised:
        Timing.from_dict("here", found)
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)
