"""The timing of a paced run: its curves, its figure, its section of the page, in words."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.realtime.timing import Histogram, Overrun, Spread, Timing
from grasp_cosim.report import timing as drawn
from grasp_cosim.report.caption import Caption
from grasp_cosim.report.plot import RED
from grasp_cosim.report.terminal import timing_lines
from grasp_cosim.report.timing import curves, decades, draw_timing, duration, kept, looks
from grasp_cosim.report.timing_html import timing_html
from matplotlib.colors import same_color
from report.runs import PERIOD, paced
from report.test_page import Elements
from support.marks import slow


def test_a_curve_is_the_share_that_took_at_least_as_long():
    """Of 1, 2, 2, 3 and 90 us."""
    bars = Histogram((1e-6, 1.5e-6, 2.5e-6, 4e-6, 50e-6, 100e-6), (1, 2, 1, 0, 1))
    spread = Spread(2e-6, 90e-6, 90e-6, 90e-6, 0.0)
    timing = replace(paced(steps=100), parts={"step": spread}, histograms={"step": bars})
    (curve,) = curves(timing)
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


def test_an_axis_begins_where_the_clock_is_exact_and_has_a_decade_at_least():
    assert decades([2e-9, 3e-9, PERIOD]) == pytest.approx((1e-7, 1e-2))
    assert decades([1e-9]) == pytest.approx((1e-7, 1e-6))
    assert decades([0.0]) == decades([]) == pytest.approx((1e-7, 1e-6))


PARTS = {
    "step": Spread(50e-6, 60e-6, 0.5e-3, 2e-3, 0.7),
    "start": Spread(3e-6, 4e-6, 5e-6, 1.2345678e-3, 0.125),
    "plant": Spread(24.04e-6, 31e-6, 90e-6, 1.9e-3, 0.7),
    "<sensor>": Spread(6e-6, 7e-6, 8e-6, 9e-6, 1.0),
}
LISTED = (
    Overrun(125, 0.125, 3e-4, "start", 1.2345678e-3),
    Overrun(700, 0.7, 1e-3, "plant", 1.9e-3),
    Overrun(701, 0.701, 1e-5, "backlog", 1e-4),
)
NONE_LATE = Timing(
    1.0, PERIOD, "catch-up", ("<u>",), (), 3000, 1.0, 0, (), {}, PARTS, histograms={}
)
LATE = replace(
    NONE_LATE, overruns=5, listed=LISTED, culprits={"backlog": 2, "start": 1, "plant": 1, "<a>": 1}
)
SOME = replace(LATE, overruns=3, culprits={"plant": 1, "start": 1, "backlog": 1}, granted=())
SLOW = replace(SOME, parts={**PARTS, "step": Spread(2e-3, 2e-3, 3e-3, 4e-3, 0.7)})


BROKEN_OFF = replace(NONE_LATE, steps=0, parts={})
"""Of a run that was interrupted in its first step."""


SAID = Caption("a run", "from 2026")


def figure_of(timing, monkeypatch):
    """What would be saved of a run of 3 s."""
    figures = []
    monkeypatch.setattr(drawn, "save", lambda figure, path: figures.append(figure))
    draw_timing(timing, 3.0, Path(), SAID)
    return figures[0]


def points(line):
    """The points of a line."""
    x, y = (np.asarray(data, float).tolist() for data in line.get_data())
    return [list(point) for point in zip(x, y, strict=True)]


@pytest.mark.parametrize(
    "timing",
    [
        paced(steps=3000, hiccups=0),
        slow(paced(steps=3000, hiccups=300, listed=100)),
        slow(paced(steps=3000, components={rf"_$\no_formula_{k}$": 1e-6 for k in range(20)})),
        BROKEN_OFF,
    ],
    ids=["none", "unlisted", "many", "nothing"],
)
def test_any_timing_can_be_drawn(timing, tmp_path):
    draw_timing(timing, 3.0, tmp_path / "timing.png", SAID)
    assert [p.name for p in tmp_path.iterdir()] == ["timing.png"]
    head = (tmp_path / "timing.png").read_bytes()[:24]
    assert head.startswith(b"\x89PNG")
    assert int.from_bytes(head[16:20]) == 1560


def test_every_part_has_a_curve_and_the_period_is_a_red_line(monkeypatch):
    timing = paced(steps=3000)
    above = figure_of(timing, monkeypatch).axes[0]
    lines = {str(line.get_label()): line for line in above.lines}
    for part, spread in timing.parts.items():
        assert same_color(lines[part].get_color(), looks(timing)[part].color)
        assert points(lines[part])[-1] == [spread.worst, 1.0 / timing.steps]
    limits = [line for line in above.lines if same_color(line.get_color(), RED)]
    assert [points(line) for line in limits] == [[[PERIOD, 0.0], [PERIOD, 1.0]]]
    assert above.get_xlim()[1] > PERIOD


def test_overruns_are_in_the_colours_of_their_culprits(monkeypatch):
    late = replace(paced(steps=100), overruns=5, listed=LISTED, culprits=LATE.culprits)
    below = figure_of(late, monkeypatch).axes[1]
    lines = {str(line.get_label()): line for line in below.lines}
    assert list(lines) == ["2 × backlog", "1 × late start", "1 × plant"]
    for line, overrun in zip(lines.values(), (LISTED[2], LISTED[0], LISTED[1]), strict=True):
        assert points(line) == [[overrun.time, overrun.late]]
        assert same_color(line.get_color(), looks(late)[overrun.culprit].color)
    assert below.get_xlim() == (0.0, 3.0)
    assert below.get_title(loc="right") == "grey: 2 more, counted only"
    below = figure_of(paced(steps=100, hiccups=0), monkeypatch).axes[1]
    assert [text.get_text() for text in below.texts] == ["no overruns"]


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


@pytest.mark.parametrize(
    "timing",
    [NONE_LATE, LATE, SOME, SLOW, BROKEN_OFF],
    ids=["0", "5", "3", "slow", "broken off"],
)
def test_in_words_and_on_the_page(timing, monkeypatch, snapshot):
    """Names stay text; what is beyond the period is marked."""
    monkeypatch.setattr("grasp_cosim.report.timing_html._chart", lambda *_: "")
    assert kept(timing) == snapshot
    assert timing_lines(timing) == snapshot
    html = timing_html(timing, 3.0)
    assert not {tag for tag, _ in Elements(html).found} & {"sensor", "u", "a"}
    assert html.replace("<tr>", "\n<tr>").replace("<h3>", "\n<h3>") == snapshot


@pytest.mark.parametrize(
    ("hiccups", "listed", "title", "shown"),
    [
        (12, 1000, "All 12 overruns", 12),
        (50, 1000, "All 50 overruns", 50),
        (60, 1000, "The first 50 of 60 overruns", 50),
        (70, 10, "The first 10 of 70 overruns", 10),
    ],
)
def test_the_first_overruns_are_listed(hiccups, listed, title, shown, monkeypatch):
    monkeypatch.setattr("grasp_cosim.report.timing_html._chart", lambda *_: "")
    timing = paced(steps=3000, hiccups=hiccups, listed=listed)
    html = timing_html(timing, 3.0)
    assert f"<summary>{title}</summary>" in html
    table = html[html.index("<summary>") :]
    assert table.count("<tr>") == shown + 1


def test_without_matplotlib_a_line_says_what_the_chart_needs(monkeypatch):
    timing = paced(steps=3000)
    drawn = timing_html(timing, 3.0)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    html = timing_html(timing, 3.0)
    assert (drawn.count('class="chart"'), html.count("<svg")) == (1, 0)
    assert "No chart: matplotlib is not installed" in html
    assert "pip install &#x27;matplotlib&gt;=" in html
    assert html[html.index('<div class="paced">') :] == drawn[drawn.index('<div class="paced">') :]
    assert html.partition("</p>")[0] == drawn.partition("</p>")[0]
