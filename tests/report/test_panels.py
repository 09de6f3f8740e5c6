"""The panels of a page, in a headless Chromium: how many lines, signs, dashes, units."""

from dataclasses import replace

import pytest
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.page import comparison_html
from grasp_cosim.report.page import page_html
from report.javascript import in_browser, run_node
from report.runs import grasp_run, ring_run

PANELS = """return panels.map((panel) => ({
  title: panel.heading.textContent,
  names: panel.series.map((one) => one.label || one.name),
  looks: panel.series.map(({ style }) => [style.color, style.dash].join()),
  last: panel.series.map(({ values }) => values[values.length - 1]),
}));"""


@pytest.mark.slow
def test_many_lines_of_a_unit_are_in_several_panels(tmp_path):
    names = [f"c{k}" for k in range(23)]
    html = page_html(ring_run(names))
    shown = ",".join(f"{name}.y" for name in names)
    found = in_browser(html, PANELS, tmp_path, address=f"show={shown}")
    assert [len(panel["names"]) for panel in found] == [6, 6, 6, 5]
    assert [panel["title"] for panel in found] == [f"y ({k} of 4)" for k in (1, 2, 3, 4)]
    assert all(len(set(panel["looks"])) == len(panel["looks"]) for panel in found)


@pytest.mark.slow
def test_finger_2_is_dashed_and_presses_with_a_positive_force(tmp_path):
    run = grasp_run()
    panels = in_browser(page_html(run, scene=run.view.scene(run)), PANELS, tmp_path)
    force = next(panel for panel in panels if panel["title"] == "contact force in N")
    assert force["names"] == ["plant.contact_force[1]", "−plant.contact_force[2]"]
    assert force["last"] == [3.4, 3.4]
    for panel in panels[:3]:
        assert panel["looks"] == ["--finger1,0", "--finger2,1"]


@pytest.mark.slow
def test_so_it_is_in_a_comparison(tmp_path):
    run = grasp_run()
    name = "plant.contact_force[2]"
    weaker = replace(run, signals={**run.signals, name: 0.5 * run.signals[name]})
    html = comparison_html(compare(run, weaker))
    act = f"await choose(['{name}']); await frame(); {PANELS}"
    force, apart = in_browser(html, act, tmp_path)
    assert force["names"] == [f"A −{name}", f"B −{name}"]
    assert force["last"] == [3.4, 1.7]
    assert apart["last"][0] == pytest.approx(1.7)


@pytest.mark.slow
@pytest.mark.parametrize("width", [360, 1200])
def test_what_is_far_away_says_how_far(width, tmp_path):
    act = """
      const said = [], pen = CanvasRenderingContext2D.prototype, write = pen.fillText;
      pen.fillText = function (text, ...more) { said.push(text); write.call(this, text, ...more); };
      const all = {};
      for (const t of [0, 1.5]) { said.length = 0; seek(t); await frame(); all[t] = [...said]; }
      return all;
    """
    run = grasp_run()
    html = page_html(run, scene=run.view.scene(run))
    said = in_browser(html, act, tmp_path, size=(width, 800))
    of, away = ("", "") if width < 500 else ("contact of ", " away")
    far = {f"{gap} mm{away}" for gap in ("65.0", "85.0")}
    assert far <= {*said["0"]}
    assert not far & {*said["1.5"]}
    assert f"{of}finger 1, 2 mm wide" in said["0"]


@pytest.mark.parametrize(
    ("unit", "largest", "factor", "shown"),
    [
        ("m", 0.1, 1e3, "mm"),
        ("m", 5.0, 1e3, "mm"),
        ("m/s", 2e-3, 1e3, "mm/s"),
        ("N", 0.02, 1.0, "N"),
        ("N", 530.0, 1.0, "N"),
        ("s", 2e-3, 1e3, "ms"),
        ("m", 2e-7, 1e9, "nm"),
        ("m", 5e4, 1e-3, "km"),
        ("V", 0.02, 1e3, "mV"),
    ],
)
def test_units_are_alike(unit, largest, factor, shown, tmp_path):
    body = "output(scaled(input.unit, input.largest));"
    found = run_node(["traces.js"], body, {"unit": unit, "largest": largest}, tmp_path)
    assert found == {"factor": pytest.approx(factor), "unit": shown}
