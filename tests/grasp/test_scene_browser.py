"""The page of a grasp in a headless Chromium: traces in its colours, fingers that move, playing."""

import pytest
from grasp.test_scene import page_of
from report.javascript import in_browser
from report.runs import CENTRE, TOUCH, WIDTH, grasp_run, position
from report.test_browser import CANVASES

pytestmark = pytest.mark.slow

SCENES = """
const look = () => {
const scene = document.getElementById("fingers"), data = scene.dataset;
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

BLUE, RED = "31,95,168", "192,57,43"


@pytest.fixture(scope="module")
def html():
    return page_of(grasp_run())


def test_the_traces_of_a_grasp_are_drawn_in_the_colours_of_the_fingers(html, tmp_path):
    panels = in_browser(html, CANVASES + "return panels();", tmp_path)
    titles = ["gap in mm", "contact force in N", "velocity in mm/s", "target position in mm"]
    assert [p["title"] for p in panels] == titles
    for panel in panels[:3]:
        assert panel["colors"][BLUE] > 100
        assert panel["colors"][RED] > 100
    gap = panels[0]
    assert (gap["low"], gap["high"]) == pytest.approx((0.0, 0.11 + CENTRE - WIDTH / 2), abs=1e-6)


def test_the_animation_shows_fingers_and_object_where_they_are(html, tmp_path):
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


def test_a_new_contact_glows(html, tmp_path):
    """For a quarter of a second of real time, which slowed down 50 times is 5 ms."""
    times = [TOUCH[1] - 1e-3, TOUCH[1] + 2.5e-3, TOUCH[1] + 5.5e-3]
    scenes = in_browser(html, SCENES % times, tmp_path)
    assert [s["glow"] for s in scenes] == ["0.000,0.000", "0.500,0.000", "0.000,0.000"]


def test_playing_slows_down_around_a_contact_and_ends_at_the_end(html, tmp_path):
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


def test_signals_are_chosen_and_grouped(html, tmp_path):
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
