"""The section on the timing of a paced run: what it says, and that names stay text."""

import re
import sys
from dataclasses import replace

import pytest
from grasp_cosim.realtime.timing import Overrun, Spread
from grasp_cosim.report.page import page_html
from grasp_cosim.report.timing_html import timing_html
from report.runs import grasp_run
from report.test_page import Elements
from report.timings import paced


def rows(html):
    """The texts of the cells of all rows of tables."""
    return [
        [re.sub(r"<[^>]*>", "", cell) for cell in re.findall(r"<td[^>]*>(.*?)</td>", row)]
        for row in re.findall(r"<tr>(.*?)</tr>", html)
    ]


@pytest.fixture
def no_chart(monkeypatch):
    """What is beside the chart, which takes a quarter of a second."""
    monkeypatch.setattr("grasp_cosim.report.timing_html._chart", lambda *_: "")


@pytest.mark.usefixtures("no_chart")
def test_only_a_paced_run_has_the_section():
    run = grasp_run()
    plain, timed = (Elements(page_html(r)) for r in (run, replace(run, timing=paced())))
    assert "timing" not in plain.ids()
    assert "Real time" not in plain.visible
    assert timed.ids().count("timing") == 1
    assert ("a", {"href": "#timing"}) in timed.found


@pytest.mark.usefixtures("no_chart")
def test_a_row_for_each_part_with_the_worst_beyond_the_period_marked():
    timing = paced(steps=3000, hiccups=0)
    plant = Spread(24.04e-6, 31e-6, 90e-6, 1.2345678e-3, 0.125)
    late = Overrun(125, 0.125, 3e-4, "plant", 1.2345678e-3)
    timing = replace(
        timing,
        parts={**timing.parts, "plant": plant},
        overruns=1,
        listed=(late,),
        culprits={"plant": 1},
    )
    html = timing_html(timing, 3.0)
    thin = "\N{NARROW NO-BREAK SPACE}"
    assert ["plant", "24.0", "31.0", "90.0", f"1{thin}234.6", "0.125", "1"] in rows(html)
    assert [row[0] for row in rows(html) if len(row) == 7] == [
        "whole step", "late start", "plant", "sensor_1", "sensor_2", "controller", "exchange",
        "recording", "between steps",
    ]  # fmt: skip
    assert re.findall(r'<td class="n warn">([^<]*)</td>', html) == [f"1{thin}234.6"]
    assert ["0.125", "125", "300.0", "plant", f"1{thin}234.6"] in rows(html)
    assert "The overrun</summary>" in html


@pytest.mark.usefixtures("no_chart")
@pytest.mark.parametrize(
    ("hiccups", "listed", "title", "shown"),
    [
        (12, 1000, "All 12 overruns", 12),
        (50, 1000, "All 50 overruns", 50),
        (60, 1000, "The first 50 of 60 overruns", 50),
        (70, 10, "The first 10 of 70 overruns", 10),
    ],
)
def test_the_first_overruns_are_listed(hiccups, listed, title, shown):
    timing = paced(steps=3000, hiccups=hiccups, listed=listed)
    html = timing_html(timing, 3.0)
    assert f"<summary>{title}</summary>" in html
    assert len([row for row in rows(html) if len(row) == 5]) == shown


@pytest.mark.usefixtures("no_chart")
def test_without_overruns_there_is_no_list_of_them():
    html = timing_html(paced(steps=3000, hiccups=0), 3.0)
    assert "<summary>" not in html
    assert 'class="warn"' not in html


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


@pytest.mark.usefixtures("no_chart")
def test_a_run_that_was_broken_off_in_its_first_step():
    timing = replace(paced(steps=10, hiccups=0), steps=0, parts={}, histograms={})
    assert "All 0 steps" in Elements(timing_html(timing, 0.0)).visible


def test_names_stay_text():
    wicked = ["<b>", "</script><i>", "\"&'", "<!--"]
    timing = replace(
        paced(steps=3000, hiccups=60, components=dict.fromkeys(wicked, 1e-6)),
        granted=("<u>",),
        refused=("<s>",),
    )
    html = timing_html(timing, 3.0)
    page = Elements(html)
    assert not {tag for tag, _ in page.found} & {"b", "i", "u", "s", "script"}
    for name in (*wicked, "<u>", "<s>"):
        assert name in page.visible
