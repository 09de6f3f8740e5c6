"""The timing of a paced run: its curves, its figure, its section of the page, in words."""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.realtime.timing import Histogram, Overrun, Spread, Timing
from grasp_cosim.report import timing_chart
from grasp_cosim.report.plot import RED
from grasp_cosim.report.terminal import timing_lines
from grasp_cosim.report.timing_chart import (
    decade_limits,
    exceedance,
    part_styles,
    timing_html,
)
from grasp_cosim.report.timing_words import duration, part_label, timing_sentence
from grasp_cosim.report.wording import Caption
from matplotlib.colors import same_color
from report.runs import PERIOD, paced
from report.test_page import Elements


def test_a_tail_is_the_share_that_took_at_least_as_long():
    """Of 1, 2, 2, 3 and 90 us."""
    bars = Histogram((1e-6, 1.5e-6, 2.5e-6, 4e-6, 50e-6, 100e-6), (1, 2, 1, 0, 1))
    assert exceedance(Spread(2e-6, 90e-6, 90e-6, 90e-6, 0.0), bars) == [
        (1e-6, 1.0),
        (1.5e-6, 0.8),
        (2e-6, 0.5),  # the median
        (2.5e-6, 0.4),
        (4e-6, 0.2),  # level from here: no time fell between 4 and 50 us
        (50e-6, 0.2),
        (90e-6, 0.2),  # the worst
    ]


def test_an_axis_begins_where_the_clock_is_exact_and_has_a_decade_at_least():
    assert decade_limits([2e-9, 3e-9, PERIOD]) == pytest.approx((1e-7, 1e-2))
    assert (
        decade_limits([0.0])
        == decade_limits([])
        == decade_limits([1e-9])
        == pytest.approx((1e-7, 1e-6))
    )


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


@pytest.mark.parametrize(
    "timing",
    [paced(steps=3000, components={rf"_$\no_{k}$": 1e-6 for k in range(20)}), BROKEN_OFF],
    ids=["many", "nothing"],
)
def test_any_timing_can_be_drawn(timing, tmp_path):
    path = tmp_path / "timing.png"
    timing_chart.draw_timing(timing, 3.0, path, Caption("a run", "from 2026"))
    assert path.read_bytes().startswith(b"\x89PNG")


def test_curves_of_parts_a_red_period_and_overruns_in_the_colours_of_their_culprits(monkeypatch):
    def figure_of(timing):
        figures = []
        monkeypatch.setattr(timing_chart, "save_figure", lambda figure, _: figures.append(figure))
        timing_chart.draw_timing(timing, 3.0, Path(), Caption("a run", "from 2026"))
        return figures[0].axes

    def points(line):
        return np.column_stack(line.get_data()).tolist()

    timing = replace(paced(steps=3000), overruns=5, listed=LISTED, culprits=LATE.culprits)
    above, below = figure_of(timing)
    lines = {line.get_label().partition(":")[0].strip(): line for line in above.lines}
    for part, spread in timing.parts.items():
        line = lines[part_label(part)]
        assert same_color(line.get_color(), part_styles(timing)[part][0])
        assert points(line)[-1] == [spread.worst, 1.0 / timing.steps]
    limits = [line for line in above.lines if same_color(line.get_color(), RED)]
    assert [points(line) for line in limits] == [[[PERIOD, 0.0], [PERIOD, 1.0]]]
    names = ["2 × backlog", "1 × late start", "1 × plant", "1 × <a>"]
    assert [line.get_label() for line in below.lines] == names
    for line, overrun in zip(below.lines, (LISTED[2], LISTED[0], LISTED[1]), strict=False):
        assert points(line) == [[overrun.time, overrun.late]]
        assert same_color(line.get_color(), part_styles(timing)[overrun.culprit][0])
    assert below.get_xlim() == (0.0, 3.0)
    assert below.get_title(loc="right") == "grey: 2 more, counted only"
    below = figure_of(paced(steps=100, hiccups=0))[1]
    assert [text.get_text() for text in below.texts] == ["no overruns"]


def test_durations():
    times = (0.0, 4.2e-8, 9.994e-7, 9.996e-7, 41.23e-6, 1.1e-3, 1.0, 86400.0)
    texts = "0 s, 42 ns, 999 ns, 1 µs, 41.2 µs, 1.1 ms, 1 s, 86400 s"
    assert ", ".join(map(duration, times)) == texts


@pytest.mark.parametrize(
    "timing",
    [NONE_LATE, LATE, SOME, SLOW, BROKEN_OFF],
    ids=["0", "5", "3", "slow", "broken off"],
)
def test_in_words_and_on_the_page(timing, monkeypatch, snapshot):
    """Names stay text; what is beyond the period is marked."""
    monkeypatch.setattr(timing_chart, "_chart_html", lambda *_: "")
    assert timing_sentence(timing) == snapshot
    assert timing_lines(timing) == snapshot
    html = timing_html(timing, 3.0)
    assert not {tag for tag, _ in Elements(html).found} & {"sensor", "u", "a"}
    assert html.replace("<tr>", "\n<tr>").replace("<h3>", "\n<h3>") == snapshot


def test_without_matplotlib_a_line_says_what_the_chart_needs(monkeypatch):
    timing = paced(steps=3000, hiccups=60)
    html = timing_html(timing, 3.0)
    assert html.count('class="chart"') == 1
    assert "<summary>The first 50 of 60 overruns</summary>" in html
    assert html.partition("<summary>")[2].count("<tr>") == 51
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    bare = timing_html(timing, 3.0)
    assert "No chart: matplotlib is not installed" in bare
    assert "pip install &#x27;matplotlib&gt;=" in bare
    assert bare.partition('<div class="paced">')[2] == html.partition('<div class="paced">')[2]
