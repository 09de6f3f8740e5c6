"""The figure of a paced run's timing, however the run went: one must always come out."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.realtime.timing import Overrun
from grasp_cosim.report import timing as drawn
from grasp_cosim.report.caption import Caption
from grasp_cosim.report.plot import RED
from grasp_cosim.report.timing import draw_timing, looks
from matplotlib.colors import same_color
from report.timings import PERIOD, paced
from support.marks import slow

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


def broken_off():
    """Of a run that was interrupted in its first step."""
    return replace(paced(steps=10, hiccups=0), steps=0, parts={}, histograms={})


@pytest.mark.parametrize(
    "timing",
    [
        paced(steps=3000, hiccups=0),
        slow(paced(steps=3000, hiccups=300, listed=100)),
        slow(paced(steps=3000, components={rf"_$\no_formula_{k}$": 1e-6 for k in range(20)})),
        broken_off(),
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
    moments = {"plant": (0.5, 3e-4), "start": (1.5, 2e-3), "backlog": (2.5, 1e-3)}
    timing = replace(
        paced(steps=3000, hiccups=0),
        overruns=5,
        culprits={"plant": 3, "start": 1, "backlog": 1},
        listed=tuple(Overrun(0, t, late, name, late) for name, (t, late) in moments.items()),
    )
    below = figure_of(timing, monkeypatch).axes[1]
    lines = {str(line.get_label()): line for line in below.lines}
    assert list(lines) == ["3 × plant", "1 × late start", "1 × backlog"]
    for line, name in zip(lines.values(), moments, strict=True):
        assert points(line) == [list(moments[name])]
        assert same_color(line.get_color(), looks(timing)[name].color)
    assert below.get_xlim() == (0.0, 3.0)
    assert below.get_title(loc="right") == "grey: 2 more, counted only"


def test_the_axes_hold_all_curves_and_the_period(monkeypatch):
    above = figure_of(paced(), monkeypatch).axes[0]
    assert above.get_xlim() == pytest.approx((1e-7, 1e-2))
    assert above.get_ylim() == pytest.approx((1e-5, 1.5))


def test_without_overruns_it_says_so(monkeypatch):
    below = figure_of(paced(steps=3000, hiccups=0), monkeypatch).axes[1]
    assert [text.get_text() for text in below.texts] == ["no overruns"]
