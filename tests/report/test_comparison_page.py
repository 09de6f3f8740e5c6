"""The page of two runs: what differs at the top, A solid and B dashed, the band, the deviation."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim.comparison.bands import Bands, Given
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.page import comparison_html
from report.javascript import in_browser
from report.runs import grasp_run, write_run

GAP = "plant.gap[1]"
BY = 1e-3
"""m by which the gap of B is wider, and nothing else is."""
BANDS = Bands(signals={GAP: Given(absolute=2e-4), "plant.contact*": Given(absolute=np.inf)})


@pytest.fixture
def found(tmp_path):
    run = grasp_run()
    write_run(tmp_path / "a", run)
    settings = {**run.settings, "scheme": "jacobi"}
    wider = {**run.signals, GAP: run[GAP] + BY}
    every = slice(None, None, 2)
    rows = {name: column[every] for name, column in wider.items()}
    write_run(tmp_path / "b", replace(run, settings=settings, time=run.time[every], signals=rows))
    return compare(tmp_path / "a", tmp_path / "b", bands=BANDS)


def test_what_differs_is_at_the_top_and_metrics_are_side_by_side(found):
    html = comparison_html(found)
    top, _, rest = html.partition('<section id="traces">')
    assert "The settings differ in" in top
    assert "<td>scheme</td>" in top
    assert '<td class="w">sequential</td><td class="w">jacobi</td>' in top
    assert "DIFFERENT: 1 of 16 signals" in top
    assert '<th class="n">A</th><th class="n">B</th><th class="n">B − A</th>' in rest
    assert "time to contact, finger 1 in s</td>" in rest
    assert f'data-show="{GAP}"' in rest


def test_a_long_run_is_thinned_and_the_page_says_so(found):
    html = comparison_html(found, limit=20_000)
    assert "this page keeps the lowest and the highest value" in html
    assert len(html) < len(comparison_html(found))


def test_hostile_names_stay_text(tmp_path, found):
    hostile = replace(found, notes=("<script>alert(1)</script>",))
    assert "<script>alert(1)" not in comparison_html(hostile)


@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_both_runs_their_band_and_their_deviation_are_drawn(found, dark, tmp_path):
    act = """
      await choose(["plant.gap[1]", "plant.contact[1]"]);
      await frame();
      const texts = (panel, what) => [...panel.querySelectorAll(what)].map((e) => e.textContent);
      return panels.map((panel) => ({
        title: panel.heading.textContent,
        names: panel.series.map((one) => one.label),
        dashes: panel.series.map((one) => one.style.dash),
        readings: texts(panel.root, "output"),
        tube: panel.series.map((one) => Boolean(one.tube)),
        low: +panel.canvas.dataset.low, high: +panel.canvas.dataset.high }));
    """
    gap, apart, contact, off = in_browser(comparison_html(found), act, tmp_path, dark=dark)
    start = float(grasp_run()[GAP][0])
    assert gap["names"] == [f"A {GAP}", f"B {GAP}"]
    assert gap["dashes"] == [0, 1]
    assert gap["tube"] == [True, False]
    assert gap["title"] == "gap in mm"
    assert gap["readings"] == [f"{1e3 * start:.3f} mm", f"{1e3 * (start + BY):.3f} mm"]
    assert apart["names"] == [GAP, "its band"]
    assert apart["high"] == pytest.approx(BY)
    assert apart["readings"][1] == "0.2000 mm"
    assert contact["tube"] == [False, False]
    assert off["names"] == ["plant.contact[1]"]


@pytest.mark.slow
def test_a_row_of_the_table_leads_to_its_worst_moment(found, tmp_path):
    act = """
      await choose(["plant.contact[1]"]);
      document.querySelector('button[data-show="plant.gap[1]"]').click();
      await frame(); await frame();
      return [view.to - view.from < 0.2, chosen, panels.length];
    """
    assert in_browser(comparison_html(found), act, tmp_path) == [
        True,
        [GAP, "plant.contact[1]"],
        4,
    ]


@pytest.mark.slow
@pytest.mark.parametrize("size", [(500, 800), (1900, 1000)])
def test_nothing_sticks_out(size, found, tmp_path):
    act = "return [document.documentElement.scrollWidth, innerWidth];"
    width, window = in_browser(comparison_html(found), act, tmp_path, size=size)
    assert width <= window
