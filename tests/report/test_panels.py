"""The panels of a page, in a headless Chromium: how many lines, signs, dashes, units."""

from dataclasses import replace

import pytest
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.page import comparison_html
from grasp_cosim.report.page import page_html
from report.javascript import in_browser
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
