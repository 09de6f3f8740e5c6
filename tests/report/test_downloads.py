"""What can be saved from a page, in a headless Chromium: pictures as drawn, signals as CSV."""

import base64
import struct
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
from grasp_cosim.recording.load import load_run
from grasp_cosim.report.page import page_html
from report.javascript import in_browser
from report.runs import grasp_run, ring_run, write_run
from report.timings import paced

pytestmark = pytest.mark.slow

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


def test_a_thinned_page_says_so_in_the_name_of_its_csv(tmp_path):
    run = ring_run(["a", "b"], rows=5000)
    ((name, _, data),) = saved(page_html(run, limit=300), ["#csv"], tmp_path)
    assert name == "signals_thinned.csv"
    assert data.count(b"\n") < 110


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
