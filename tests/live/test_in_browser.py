"""The live page in Chromium: it draws what comes, and a slider changes the run."""

import json
from importlib.resources import files

import pytest
from browser import Browser, chromium
from live.clients import followed
from report.javascript import run_node

NAME = "sensor_2.reflectance"

needs_chromium = pytest.mark.skipif(chromium() is None, reason="chromium is not installed")


@needs_chromium
@pytest.mark.slow
def test_the_page_follows_a_run_and_a_slider_changes_it(grasp):
    system = grasp.natively().with_experiment(step=1e-3)

    def act(page):
        with Browser(1400, 1000) as browser:
            browser.open(page.address)
            browser.wait_for("document.documentElement.dataset.ready && recording.last > 0.2")
            before = browser.evaluate("recording.last")
            later = browser.wait_for(f"recording.last > {before} + 0.2 && recording.last")
            drawn = browser.evaluate(
                "[...document.querySelectorAll('.panel canvas')].map((c) => c.dataset.high)"
            )
            pixels = browser.evaluate(
                "(() => { const c = document.querySelector('.panel canvas');"
                "return c.getContext('2d').getImageData(0, 0, c.width, c.height).data"
                ".some((v) => v > 0); })()"
            )
            browser.evaluate(
                f"(() => {{ const {{ slider }} = parameters.get('{NAME}'); slider.value = 0;"
                "slider.dispatchEvent(new Event('input'));"
                "slider.dispatchEvent(new Event('change')); })()"
            )
            line = browser.wait_for("document.getElementById('lines').textContent")
            browser.evaluate(f"parameters.get('{NAME}').ask(-1)")
            refused = browser.evaluate(f"parameters.get('{NAME}').refusal.textContent")
            box = browser.evaluate(f"parameters.get('{NAME}').box.value")
            state = browser.evaluate("document.getElementById('run-state').textContent")
            wide = browser.evaluate("document.documentElement.scrollWidth - innerWidth")
            return drawn, pixels, line, refused, box, state, wide, later - before, browser.errors

    result, (drawn, pixels, line, refused, box, state, wide, more, errors) = followed(system, act)
    assert errors == []
    assert more > 0.2
    assert len(drawn) >= 3
    assert float(drawn[0]) > 0.0
    assert pixels
    assert line.endswith(f"{NAME} = 0")
    assert line in result.log
    assert result.settings["events"][0]["set"] == {NAME: 0}
    assert refused == f"set: {NAME}: reflectance = -1: must be a finite number from 0 to 10"
    assert (box, state, wide) == ("0", "running", 0)


@needs_chromium
@pytest.mark.slow
@pytest.mark.parametrize("dark", [False, True])
def test_on_a_phone_nothing_is_wider_than_the_screen(grasp, dark):
    def act(page):
        with Browser(390, 844, dark) as browser:
            browser.open(page.address)
            browser.wait_for("document.documentElement.dataset.ready && recording.last > 0.1")
            browser.evaluate(
                "document.querySelectorAll('#parameters details').forEach((d) => d.open = true)"
            )
            paper = browser.evaluate("getComputedStyle(document.body).backgroundColor")
            return browser.evaluate("document.documentElement.scrollWidth"), paper, browser.errors

    _, (width, paper, errors) = followed(grasp.natively(), act, step=1e-3)
    assert (width, errors) == (390, [])
    assert paper == ("rgb(21, 23, 26)" if dark else "rgb(251, 251, 249)")


def test_a_slider_covers_its_range_and_keeps_the_value_that_it_shows(tmp_path):
    entries = [
        {"low": 0.0, "high": 10.0, "value": 1.0}, {"low": 0.0, "high": 1e6, "value": 98.0},
        {"low": -1e7, "high": 1e7, "value": 0.0}, {"low": -0.35, "high": 0.35, "value": 0.1},
        {"low": 1e-6, "high": 1e3, "value": 1e-3}, {"low": 1.0, "high": 32.0, "value": 12},
    ]  # fmt: skip
    script = (files("grasp_cosim.live") / "page" / "parameters.js").read_text("utf-8")
    body = (
        "const clamp = (v, low, high) => Math.min(Math.max(v, low), high);\n"
        + script.split("class Parameter")[0].replace('"use strict";', "")
        + "output(input.map((entry) => { const scale = new Scale(entry);"
        "const places = [0, 1, 250, 500, 750, 999, 1000];"
        "return { values: places.map((p) => scale.value(p)), place: scale.place(entry.value),"
        "back: scale.value(scale.place(entry.value)) }; }));"
    )
    for entry, scale in zip(entries, run_node((), body, entries, tmp_path), strict=True):
        values = scale["values"]
        assert (values[0], values[-1]) == (entry["low"], entry["high"])
        assert values == sorted(values)
        assert len(set(values)) >= len(values) - 1  # a step may be less than the digits
        assert 0.0 <= scale["place"] <= 1000.0
        assert scale["back"] == pytest.approx(entry["value"], rel=1e-2, abs=1e-9)
        assert json.dumps(values)
