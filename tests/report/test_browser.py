"""Pages in a headless Chromium: they run without an error, draw, zoom, and save what they show."""

import base64
import struct
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.comparison_page import comparison_html
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.report.run_report import page_html
from report.javascript import in_browser
from report.runs import grasp_run, paced, ring_run, write_run
from report.test_page import BY, GAP, two_runs

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
    run = replace(grasp_run(), timing=paced(steps=2000))
    scene = run.view.scene(run)
    html = page_html(run, scene=scene) if kind == "run" else comparison_html(compare(run, run))
    act = """
      const scrolls = [...document.querySelectorAll(".cards, .cards td")].map((e) => e.scrollWidth);
      const chart = document.querySelector(".chart svg")?.getBoundingClientRect();
      const widths = [document.documentElement.scrollWidth, innerWidth, Math.max(0, ...scrolls)];
      return [...widths, chart?.width, chart?.width / chart?.height];
    """
    width, inner, table, chart, ratio = in_browser(html, act, tmp_path, size=size)
    assert inner == size[0]
    assert width <= inner
    assert table <= inner - 28  # with the margins of the page
    if kind == "run":  # on a narrow page the chart scrolls
        assert chart >= 840
        assert ratio == pytest.approx(12.0 / 8.6, rel=0.01)


def test_any_system_has_traces(tmp_path):
    html = page_html(ring_run(["<b>", "</script>"]).titled("<i>"))
    act = CANVASES + "return [panels(), document.title, document.querySelectorAll('i').length];"
    (panel,), title, italic = in_browser(html, act, tmp_path)
    assert (panel["title"], title, italic) == ("y", "<i>", 0)
    assert sum(panel["colors"].values()) > 500


def test_an_error_in_the_page_is_not_silent(html, tmp_path):
    broken = html.replace('<script type="text/plain" id="time">', '<script id="time" type="x">!')
    with pytest.raises(AssertionError, match="not correctly encoded"):
        in_browser(broken, "return 1;", tmp_path)


# ------------------------------------------------------------------------- panels

PANELS = """return panels.map((panel) => ({
  title: panel.heading.textContent,
  names: panel.series.map((one) => one.label || one.name),
  looks: panel.series.map(({ style }) => [style.color, style.dash].join()),
  last: panel.series.map(({ values }) => values[values.length - 1]),
}));"""


def test_many_lines_of_a_unit_are_in_several_panels(tmp_path):
    names = [f"c{k}" for k in range(23)]
    html = page_html(ring_run(names))
    shown = ",".join(f"{name}.y" for name in names)
    found = in_browser(html, PANELS, tmp_path, address=f"show={shown}")
    assert [len(panel["names"]) for panel in found] == [6, 6, 6, 5]
    assert [panel["title"] for panel in found] == [f"y ({k} of 4)" for k in (1, 2, 3, 4)]
    assert all(len(set(panel["looks"])) == len(panel["looks"]) for panel in found)


def test_finger_2_is_dashed_and_presses_with_a_positive_force(tmp_path):
    run = grasp_run()
    panels = in_browser(page_html(run, scene=run.view.scene(run)), PANELS, tmp_path)
    force = next(panel for panel in panels if panel["title"] == "contact force in N")
    assert force["names"] == ["plant.contact_force[1]", "−plant.contact_force[2]"]
    assert force["last"] == [3.4, 3.4]
    for panel in panels[:3]:
        assert panel["looks"] == ["--finger1,0", "--finger2,1"]


@pytest.mark.parametrize("dark", [False, True])
def test_both_runs_their_band_and_their_deviation_are_drawn(dark, tmp_path):
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
    gap, apart, contact, off = in_browser(comparison_html(two_runs()), act, tmp_path, dark=dark)
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


def test_a_row_of_the_table_leads_to_its_worst_moment(tmp_path):
    act = """
      await choose(["plant.contact[1]"]);
      document.querySelector('button[data-show="plant.gap[1]"]').click();
      await frame(); await frame();
      return [view.to - view.from < 0.2, chosen, panels.length];
    """
    assert in_browser(comparison_html(two_runs()), act, tmp_path) == [
        True,
        [GAP, "plant.contact[1]"],
        4,
    ]


# ------------------------------------------------------------------------- downloads

SAVED = """
  const saved = [], read = (blob) => new Promise((done) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result.split(",")[1]);
    reader.readAsDataURL(blob);
  });
  window.offer = async (name, blob) => saved.push([name, blob.type, await read(blob)]);
  const click = async (which) => {
    const before = saved.length;
    document.querySelector(which).click();
    while (saved.length === before) { work(); await sleep(5); }
  };
"""


def saved(html, which, folder):
    """What the buttons save: name, type, content."""
    act = f"{SAVED} for (const one of {which!r}) await click(one); return saved;"
    found = in_browser(html, act, folder)
    return [(name, kind, base64.b64decode(data)) for name, kind, data in found]


def test_the_csv_of_the_page_is_that_of_the_run(tmp_path):
    run = grasp_run(rows=60)
    words = np.array(["=1+1", 'say "no"', "a\nb"] * 20, object)
    run = replace(
        run, signals={**run.signals, "plant.word": words}, units={**run.units, "plant.word": None}
    )
    write_run(tmp_path / "results", run)
    ((name, kind, data),) = saved(page_html(run), ["#csv"], tmp_path)
    assert (name, kind) == ("signals.csv", "text/csv")
    (tmp_path / "results" / "signals.csv").write_bytes(data)
    again, signals = load_run(tmp_path / "results"), dict(run)
    assert list(again) == list(signals)
    np.testing.assert_array_equal(again.time, run.time)
    for signal, column in signals.items():
        np.testing.assert_array_equal(again[signal], column)


def test_each_panel_and_the_scene_are_saved_with_what_they_show(tmp_path):
    run = grasp_run().titled("Before lunch")
    html = page_html(run, scene=run.view.scene(run))
    names = ["gap_in_mm", "contact_force_in_N", "velocity_in_mm_s", "target_position_in_mm"]
    buttons = [f".panel:nth-child({k + 1}) .save" for k in range(len(names))]
    found = saved(html, [*buttons, "[data-canvas]"], tmp_path)
    expected = [*(f"Before_lunch_{name}.png" for name in names), "Before_lunch.png"]
    assert [name for name, _, _ in found] == expected
    for _, kind, data in found:
        width, height = struct.unpack(">II", data[16:24])
        assert kind == "image/png"
        assert width > 700
        assert height > 168 + 3 * 17  # the title, what it is, and the legend above it


def test_drawings_are_saved_as_svg_with_their_rules(tmp_path):
    html = page_html(replace(ring_run(["a", "b"]), timing=paced(steps=200)))
    buttons = ["[data-name=connections]", "[data-name=timing]"]
    for name, kind, data in saved(html, buttons, tmp_path):
        assert name in ("grasp_connections.svg", "grasp_timing.svg")
        assert kind == "image/svg+xml"
        root = ElementTree.fromstring(data)
        assert root.tag == "{http://www.w3.org/2000/svg}svg"
        assert root.get("class") in ("diagram", "chart")
        assert "--paper" in (root[0].text or "")
