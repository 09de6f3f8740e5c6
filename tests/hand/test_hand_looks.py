"""The picture and the page of a hand: every finger where it is, around an object of its shape."""

import math

import numpy as np
import pytest
from grasp_cosim import hand_system, simulate
from grasp_cosim.hand.metrics import directions, is_disc
from grasp_cosim.hand.view import _prism, draw_hand
from grasp_cosim.report.run_report import page_html
from report.javascript import in_browser

SCENE = """
const data = document.getElementById("fingers").dataset;
const canvas = document.getElementById("fingers"), pen = canvas.getContext("2d");
location.hash = "at=%s";
await frame();
const ratio = canvas.width / canvas.clientWidth;
const colored = (r, g, b) => {
  const found = pen.getImageData(0, 0, canvas.width, canvas.height).data;
  let n = 0, x = 0, y = 0;
  for (let i = 0; i < found.length; i += 4) {
    if (found[i] === r && found[i + 1] === g && found[i + 2] === b && found[i + 3] === 255) {
      n += 1;
      x += (i / 4) %% canvas.width;
      y += Math.floor(i / 4 / canvas.width);
    }
  }
  return [x / n / ratio - canvas.clientWidth / 2, canvas.clientHeight / 2 - y / n / ratio];
};
return { fingers: [colored(31, 95, 168), colored(192, 57, 43), colored(46, 139, 87)],
  scale: +data.scale, tips: [1, 2, 3].map((j) => +data[`finger${j}`]) };
"""


@pytest.fixture(scope="module")
def hand():
    return simulate(hand_system(native=False), stop=2.2)


def test_the_page_shows_the_hand(hand):
    html = page_html(hand, scene=hand.view.scene(hand))
    for said in ("<h2>Hand</h2>", "class Hand extends Grasp", "All contacts", "seen from above"):
        assert said in html


def test_a_disc_is_told_from_a_prism():
    system = hand_system(angles=(10, 130, 250), native=False).with_values({"plant.shape": "disc"})
    run = simulate(system, stop=0.01)
    assert is_disc(run.by_role)
    assert directions(run.by_role) == pytest.approx([math.radians(a) for a in (10, 130, 250)])


def test_the_faces_of_a_prism_make_its_outline():
    """A regular triangle: its corners are twice as far out as its faces."""
    e = np.exp(1j * np.radians([0.0, 120.0, 240.0]))
    corners = _prism(0.035 * e, e, 0.1)
    assert sorted(np.round(abs(corners), 12)) == pytest.approx([0.07] * 3)


def test_it_is_drawn(hand, tmp_path):
    pytest.importorskip("matplotlib")
    figure = draw_hand(hand, tmp_path / "hand.png")
    assert (tmp_path / "hand.png").read_bytes().startswith(b"\x89PNG")
    gaps, *_ = figure.axes
    assert [line.get_label() for line in gaps.lines] == ["finger 1", "finger 2", "finger 3"]
    assert len({(line.get_color(), str(line.get_linestyle())) for line in gaps.lines}) == 3


@pytest.mark.slow
def test_fingers_and_object_are_where_they_are(hand, tmp_path):
    html = page_html(hand, scene=hand.view.scene(hand))
    found = in_browser(html, SCENE % "1.0", tmp_path)
    row = int(np.searchsorted(hand.time, 1.0))
    for k, (x, y) in enumerate(found["fingers"]):
        s = float(hand[f"plant.position[{k + 1}]"][row])
        assert found["tips"][k] == pytest.approx(s, abs=1e-6)
        assert math.atan2(y, x) == pytest.approx(
            math.remainder(math.radians(120.0 * k), 2.0 * math.pi), abs=0.05
        )
        assert math.hypot(x, y) == pytest.approx(found["scale"] * s + 23.0, abs=4.0)
