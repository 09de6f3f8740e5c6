"""The page in a headless Chromium: it runs without an error, draws, zooms, plays."""

from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim.report.page import page_html
from report.javascript import in_browser
from report.runs import CENTRE, TOUCH, WIDTH, grasp_run, position, ring_run
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

SCENES = """
const look = () => {
const scene = document.getElementById("scene"), data = scene.dataset;
const pen = scene.getContext("2d"), ratio = scene.width / scene.clientWidth;
const row = pen.getImageData(0, Math.round(60 * ratio), scene.width, 1).data;
const colored = (r, g, b) => {
  const found = [];
  for (let i = 0; i < scene.width; i++) {
    const [x, y, z, a] = row.slice(4 * i, 4 * i + 4);
    if (a === 255 && x === r && y === g && z === b) found.push(i / ratio);
  }
  return [found[0], found[found.length - 1] + 1 / ratio];
};
const metres = (x) => (x - data.origin) / data.scale;
return { finger1: metres(colored(31, 95, 168)[0]), finger2: metres(colored(192, 57, 43)[1]),
  object: colored(207, 207, 200).map(metres), glow: data.glow, scale: +data.scale,
  gap: document.querySelector('#readings [data-signal="plant.gap[1]"]').textContent };
};
const seen = [];
for (const t of %s) {
  location.hash = `at=${t}`;
  await frame();
  seen.push(look());
}
return seen;
"""

BLUE, RED, DARK_BLUE = "31,95,168", "192,57,43", "107,165,231"


@pytest.fixture(scope="module")
def html() -> str:
    return page_html(grasp_run(), "results")


def test_the_traces_of_a_grasp_are_drawn_in_the_colours_of_the_fingers(
    html: str, tmp_path: Path
) -> None:
    panels = in_browser(html, CANVASES + "return panels();", tmp_path)
    titles = ["gap in mm", "contact force in N", "velocity in mm/s", "target position in mm"]
    assert [p["title"] for p in panels] == titles
    for panel in panels[:3]:
        assert panel["colors"][BLUE] > 100
        assert panel["colors"][RED] > 100
    gap = panels[0]
    assert (gap["low"], gap["high"]) == pytest.approx((0.0, 0.11 + CENTRE - WIDTH / 2), abs=1e-6)


def test_a_zoom_can_be_linked(html: str, tmp_path: Path) -> None:
    """The panels then fit what is in view, between the neighbours of its first and last row."""
    panels = in_browser(
        html, CANVASES + "return panels();", tmp_path, "t=0.9,1.1&show=plant.gap%5B1%5D"
    )
    (gap,) = panels
    speed = (0.11 - CENTRE - WIDTH / 2) / TOUCH[1]
    assert gap["title"] == "gap in mm"
    assert gap["low"] == pytest.approx(0.0, abs=1e-12)
    assert gap["high"] == pytest.approx(0.1 * speed, abs=1.1e-3 * speed)
    assert gap["colors"][BLUE] > 100
    assert RED not in gap["colors"]


def test_dark_colours(html: str, tmp_path: Path) -> None:
    panels = in_browser(html, CANVASES + "return panels();", tmp_path, dark=True)
    assert panels[0]["colors"][DARK_BLUE] > 100
    assert BLUE not in panels[0]["colors"]


def test_wheel_drag_and_double_click_change_the_time_in_view(html: str, tmp_path: Path) -> None:
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


def test_the_animation_shows_fingers_and_object_where_they_are(html: str, tmp_path: Path) -> None:
    times = [0.3, 1.1, 1.9]
    for t, scene in zip(times, in_browser(html, SCENES % times, tmp_path), strict=True):
        pixel = 1.5 / scene["scale"]
        assert scene["finger1"] == pytest.approx(position(1, t), abs=pixel)
        assert scene["finger2"] == pytest.approx(position(2, t), abs=pixel)
        surfaces = [CENTRE - WIDTH / 2, CENTRE + WIDTH / 2]
        assert scene["object"] == pytest.approx(surfaces, abs=pixel)
        number, unit = scene["gap"].replace("−", "-").split()
        assert float(number) == pytest.approx(1e3 * (position(1, t) - CENTRE - WIDTH / 2), abs=1e-3)
        assert unit == "mm"


def test_a_new_contact_glows(html: str, tmp_path: Path) -> None:
    """For a quarter of a second of real time, which slowed down 50 times is 5 ms."""
    times = [TOUCH[1] - 1e-3, TOUCH[1] + 2.5e-3, TOUCH[1] + 5.5e-3]
    scenes = in_browser(html, SCENES % times, tmp_path)
    assert [s["glow"] for s in scenes] == ["0.000,0.000", "0.500,0.000", "0.000,0.000"]


def test_playing_slows_down_around_a_contact_and_ends_at_the_end(html: str, tmp_path: Path) -> None:
    act = """
      const play = document.getElementById("play"), speeds = new Set(), times = [];
      play.click();
      while (playing) {
        await new Promise(requestAnimationFrame);
        speeds.add(document.getElementById("pace").textContent);
        times.push(cursor);
      }
      return [[...speeds], times, play.textContent];
    """
    speeds, times, text = in_browser(html, act, tmp_path, "at=1.1&show=plant.gap%5B2%5D")
    assert speeds == ["1 × real time", "0.02 × real time"]
    assert times == sorted(times)
    assert times[-1] == 2.0
    inside = [t for t in times if TOUCH[2] - 0.015 < t < TOUCH[2] + 0.06]
    assert len(inside) > 200  # 3.75 s at 60 frames a second
    assert text == "Play"


def test_signals_are_chosen_and_grouped(html: str, tmp_path: Path) -> None:
    act = """
      const click = (text) => document.querySelector(`#signals input[${text}]`).click();
      const titles = () => [...document.querySelectorAll("#plots h3")].map((h) => h.textContent);
      const seen = [];
      for (const name of ["plant.gap[1]", "plant.gap[2]", "sensor_1.intensity"]) {
        click(`data-signal="${name}"`);
        await frame();
      }
      seen.push(titles());
      click('data-component="plant"');
      await frame();
      click('data-component="plant"');
      await frame();
      seen.push(titles());
      click('data-signal="controller.target_position"');
      click('data-signal="sensor_1.intensity"');
      await frame();
      seen.push(titles(), !document.getElementById("none").hidden);
      click('data-signal="plant.gap[1]"');
      click('data-signal="plant.position[1]"');
      document.getElementById("by").value = "unit";
      document.getElementById("by").dispatchEvent(new Event("change"));
      await frame();
      seen.push(titles());
      return seen;
    """
    first, second, third, none, by_unit = in_browser(html, act, tmp_path)
    assert first == ["contact force in N", "velocity in mm/s", "target position in mm", "intensity"]
    assert second == ["target position in mm", "intensity"]
    assert (third, none) == ([], True)
    assert by_unit == ["mm"]


@pytest.mark.parametrize("size", [(360, 800), (1900, 1000)])
def test_nothing_sticks_out_of_a_narrow_or_wide_window(
    size: tuple[int, int], html: str, tmp_path: Path
) -> None:
    act = "return [document.documentElement.scrollWidth, innerWidth];"
    width, inner = in_browser(html, act, tmp_path, size=size)
    assert width <= inner


@pytest.mark.parametrize("width", [420, 1101])
def test_the_charts_of_a_paced_run_fit(width: int, tmp_path: Path) -> None:
    """A narrow window, and two narrow columns: nothing sticks out, no label covers another one,
    curves and marks are inside the charts, the table of the parts is not cut.
    """
    html = page_html(replace(grasp_run(), timing=paced(steps=2000)), "results")
    act = """
      const box = (element) => element.getBoundingClientRect(), root = document.documentElement;
      const apart = (a, b) => a.right <= b.left || b.right <= a.left
        || a.bottom <= b.top || b.bottom <= a.top;
      const charts = [...document.querySelectorAll(".chart")];
      return [root.scrollWidth - innerWidth, charts.map((chart) => {
        const place = box(chart), plot = box(chart.querySelector("svg"));
        const texts = [...chart.querySelectorAll("text")].map(box);
        const marks = [...chart.querySelectorAll("circle, rect.late")];
        const drawn = [...chart.querySelectorAll("polyline"), ...marks].map(box);
        return {
          covered: texts.filter((a, i) => !texts.slice(i + 1).every((b) => apart(a, b))).length,
          outside: texts.filter((a) => a.left < place.left || a.right > place.right + 8).length,
          astray: drawn.filter((a) => a.right < plot.left || a.left > plot.right
            || a.bottom < plot.top || a.top > plot.bottom).length,
          curves: chart.querySelectorAll("polyline").length,
          widest: Math.max(0, ...drawn.map((a) => a.width)) / plot.width,
          dots: marks.length,
        };
      }), (([table]) => table.scrollWidth - table.clientWidth)(
        document.querySelectorAll("#timing .scroll"))];
    """
    beyond, (distributions, overruns), cut = in_browser(html, act, tmp_path, size=(width, 1200))
    assert beyond <= 0
    assert cut <= 0
    for chart in (distributions, overruns):
        assert (chart["covered"], chart["outside"], chart["astray"]) == (0, 0, 0)
    assert distributions["curves"] == 9
    assert distributions["dots"] == 9 * 4
    assert 0.3 < distributions["widest"] <= 1.0
    assert overruns["dots"] == 12


def test_any_system_has_traces(tmp_path: Path) -> None:
    html = page_html(ring_run(["<b>", "</script>"]), "<i>")
    act = CANVASES + "return [panels(), document.title, document.querySelectorAll('i').length];"
    (panel,), title, italic = in_browser(html, act, tmp_path)
    assert (panel["title"], title, italic) == ("y", "<i>", 0)
    assert sum(panel["colors"].values()) > 500


def test_a_single_recorded_point_is_drawn(tmp_path: Path) -> None:
    html = page_html(ring_run(["a"], rows=1), "results")
    (panel,) = in_browser(html, CANVASES + "return panels();", tmp_path)
    assert panel["low"] == panel["high"] == 0.0


def test_an_error_in_the_page_is_not_silent(html: str, tmp_path: Path) -> None:
    broken = html.replace('<script type="text/plain" id="time">', '<script id="time" type="x">!')
    with pytest.raises(AssertionError, match="not correctly encoded"):
        in_browser(broken, "return 1;", tmp_path)
