"""The page in a headless Chromium: it runs without an error, draws, zooms."""

from dataclasses import replace

import pytest
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.page import comparison_html
from grasp_cosim.report.page import page_html
from report.javascript import in_browser
from report.runs import grasp_run, ring_run
from report.timings import paced

pytestmark = pytest.mark.slow

CANVASES = """
const panels = () => [...document.querySelectorAll("#plots .panel")].map((panel) => {
  const canvas = panel.querySelector("canvas"), data = canvas.dataset;
  const pixels = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data;
  const colors = {};
  for (let i = 0; i < pixels.length; i += 4) {
    if (pixels[i + 3] < 250) continue;
    const name = [pixels[i], pixels[i + 1], pixels[i + 2]].join();
    colors[name] = (colors[name] || 0) + 1;
  }
  return { title: panel.querySelector("h3").textContent, low: +data.low, high: +data.high, colors };
});
"""


@pytest.fixture(scope="module")
def html():
    return page_html(grasp_run())


def test_wheel_drag_and_double_click_change_the_time_in_view(html, tmp_path):
    act = """
      const canvas = document.querySelector("#plots canvas"), seen = [];
      const note = async () => { await frame(); seen.push([view.from, view.to]); };
      const at = (t) => {
        const box = canvas.getBoundingClientRect();
        const width = box.width - GUTTER - RIGHT;
        return { clientX: box.left + GUTTER + (t - view.from) / (view.to - view.from) * width,
          clientY: box.top + 50, bubbles: true, cancelable: true, button: 0, pointerId: 1 };
      };
      document.getElementById("plots").setPointerCapture = () => {};
      const send = (kind, type, t, more) => canvas.dispatchEvent(
        new kind(type, { ...at(t), ...more }));
      await note();
      send(WheelEvent, "wheel", 0.5, { deltaY: -Math.log(1.6) / 0.0015 });
      await note();
      send(WheelEvent, "wheel", 0.5, { deltaY: Math.log(1.6) / 0.0015 });
      await note();
      send(PointerEvent, "pointerdown", 1.0);
      send(PointerEvent, "pointermove", 1.2);
      send(PointerEvent, "pointerup", 1.2);
      await note();
      send(PointerEvent, "pointerdown", 1.1, { shiftKey: true });
      send(PointerEvent, "pointermove", 1.15, { shiftKey: true });
      send(PointerEvent, "pointerup", 1.15, { shiftKey: true });
      await note();
      send(PointerEvent, "pointerdown", 1.0);
      send(PointerEvent, "pointerup", 1.0);
      await note();
      seen.push(cursor);
      send(MouseEvent, "dblclick", 1.0);
      await note();
      await sleep(500);
      return [seen, location.hash];
    """
    seen, address = in_browser(html, act, tmp_path)
    expected = [[0, 2], [0.1875, 1.4375], [0, 2], [1, 1.2], [0.95, 1.15], [0.95, 1.15], 1.0, [0, 2]]
    for found, wanted in zip(seen, expected, strict=True):
        assert found == pytest.approx(wanted, abs=2.0 / 700)  # a pixel
    assert address.startswith("#t=0,2&at=")


@pytest.mark.parametrize("size", [(360, 800), (1900, 1000)])
@pytest.mark.parametrize("kind", ["run", "comparison"])
def test_nothing_sticks_out_of_a_narrow_or_wide_window(size, kind, tmp_path):
    run = replace(grasp_run(), timing=paced(steps=50))
    scene = run.view.scene(run)
    html = page_html(run, scene=scene) if kind == "run" else comparison_html(compare(run, run))
    act = """
      const scrolls = [...document.querySelectorAll(".cards, .cards td")].map((e) => e.scrollWidth);
      return [document.documentElement.scrollWidth, innerWidth, Math.max(0, ...scrolls)];
    """
    width, inner, table = in_browser(html, act, tmp_path, size=size)
    assert inner == size[0]
    assert width <= inner
    assert table <= inner - 28  # with the margins of the page


@pytest.mark.parametrize("width", [420, 1101, 1900])
def test_the_chart_of_a_paced_run_fits(width, tmp_path):
    """It takes the width of the page, on a narrow one it scrolls; the page's own rules are kept."""
    html = page_html(replace(grasp_run(), timing=paced(steps=2000)))
    act = """
      const box = (element) => element.getBoundingClientRect(), root = document.documentElement;
      const chart = document.querySelector(".chart"), svg = chart.querySelector("svg");
      const shown = [...svg.querySelectorAll("use, path")].filter((e) => !e.closest("defs"));
      const [a, b] = [box(chart), box(svg)];
      return {
        beyond: root.scrollWidth - innerWidth, width: b.width, ratio: b.width / b.height,
        inside: a.left <= b.left && b.right <= a.right && a.top <= b.top && b.bottom <= a.bottom,
        shown: shown.length, card: getComputedStyle(chart).backgroundColor,
        joins: getComputedStyle(document.querySelector(".diagram .line")).strokeLinejoin,
      };
    """
    found = in_browser(html, act, tmp_path, size=(width, 1200), dark=True)
    assert found["beyond"] <= 0
    assert found["inside"]
    assert found["ratio"] == pytest.approx(12.0 / 8.6, rel=0.01)
    assert found["width"] >= min(width - 100, 1100)
    assert found["width"] >= 840
    assert found["shown"] > 100
    assert found["card"] == "rgb(255, 255, 255)"
    assert found["joins"] == "miter"


def test_any_system_has_traces(tmp_path):
    html = page_html(ring_run(["<b>", "</script>"]).titled("<i>"))
    act = CANVASES + "return [panels(), document.title, document.querySelectorAll('i').length];"
    (panel,), title, italic = in_browser(html, act, tmp_path)
    assert (panel["title"], title, italic) == ("y", "<i>", 0)
    assert sum(panel["colors"].values()) > 500


def test_a_single_recorded_point_is_drawn(tmp_path):
    html = page_html(ring_run(["a"], rows=1))
    (panel,) = in_browser(html, CANVASES + "return panels();", tmp_path)
    assert panel["low"] == panel["high"] == 0.0


def test_an_error_in_the_page_is_not_silent(html, tmp_path):
    broken = html.replace('<script type="text/plain" id="time">', '<script id="time" type="x">!')
    with pytest.raises(AssertionError, match="not correctly encoded"):
        in_browser(broken, "return 1;", tmp_path)
