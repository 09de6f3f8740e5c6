"""The picture and the page of a gripper in tandem: its arm is where the wrist was recorded."""

import pytest
from grasp_cosim import simulate, tandem_system
from grasp_cosim.report.run_report import page_html
from grasp_cosim.tandem.view import draw_tandem
from report.javascript import in_browser

SCENE = """
const data = document.getElementById("fingers").dataset;
const seen = [];
for (const t of %s) {
  location.hash = `at=${t}`;
  await frame();
  seen.push([(data.wrist - data.origin) / data.scale, +data.finger1, +data.finger2]);
}
return seen;
"""


@pytest.fixture(scope="module")
def run():
    return simulate(tandem_system(native=False), stop=2.2)


def test_the_page_is_that_of_a_gripper_on_an_arm(run):
    assert run.view.stem == "tandem"
    html = page_html(run, scene=run.view.scene(run))
    for said in ("<h2>Gripper in tandem</h2>", "class Tandem extends Grasp", "Both contacts"):
        assert said in html


def test_a_grasp_has_no_arm(grasp):
    assert simulate(grasp, stop=0.01).view.stem == "grasp"


def test_the_picture_has_the_wrist(run):
    pytest.importorskip("matplotlib")
    target = next(axes for axes in draw_tandem(run).axes if axes.get_ylabel() == "position in mm")
    lines = {line.get_label(): line for line in target.get_lines()}
    assert {"wrist", "target", "centre of the object"} <= {*lines}
    assert lines["wrist"].get_ydata()[-1] == pytest.approx(1e3 * run["plant.wrist_position"][-1])


@pytest.mark.slow
def test_the_arm_is_where_the_wrist_was(run, tmp_path):
    times = [0.0, 0.3, 1.0, 2.0]
    html = page_html(run, scene=run.view.scene(run))
    seen = in_browser(html, SCENE % times, tmp_path)
    for t, (wrist, right, left) in zip(times, seen, strict=True):
        row = run.time.searchsorted(t)
        assert wrist == pytest.approx(run["plant.wrist_position"][row], abs=1e-5)
        assert [right, left] == pytest.approx(
            [run[f"plant.position[{j}]"][row] for j in (1, 2)], abs=1e-5
        )
