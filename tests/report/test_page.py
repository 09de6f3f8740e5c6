"""The page of a run as text: whole, by itself, and nothing in a name gets out of its place."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.errors import InputError
from grasp_cosim.recording.load import Run
from grasp_cosim.report.page import page_html, write_page
from report.runs import grasp_run, ring_run
from report.test_embed import unpacked
from report.timings import paced

EMPTY = {"meta", "link", "input", "br"}


class Elements(HTMLParser):
    """Collects elements and texts; an element that is not closed in its place is an error."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.found: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self.visible = ""
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open[-1:] == ["script"]:
            self.texts[str(self.found[-1][1].get("id"))] = data
        elif self.open[-1:] != ["style"]:
            self.visible += data

    def ids(self) -> list[str]:
        return [str(a["id"]) for _, a in self.found if "id" in a]


@pytest.mark.parametrize(
    "run",
    [grasp_run(), ring_run(["a", "b"]), replace(grasp_run(), timing=paced(steps=2000))],
    ids=["grasp", "ring", "paced"],
)
def test_the_page_is_whole_and_needs_nothing_from_outside(run: Run) -> None:
    html = page_html(run, "results")
    page = Elements(html)
    for tag, attributes in page.found:
        for name in ("src", "href", "action", "data", "srcset"):
            value = attributes.get(name)
            assert value is None or value.startswith("#") or value == "data:,", (tag, value)
        assert tag not in ("iframe", "object", "embed", "img", "base")
    addresses = set(re.findall(r"https?://[^\s\"'<>)]*", html))
    assert addresses == {"http://www.w3.org/2000/svg"}  # a name, which nothing is loaded from
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)
    assert len(page.ids()) == len(set(page.ids()))
    targets = {str(a["href"])[1:] for _, a in page.found if str(a.get("href")).startswith("#")}
    assert targets <= set(page.ids())
    assert not re.search(r"\$\w", Elements(html).visible)


def test_the_data_in_the_page_are_those_of_the_run_to_the_bit() -> None:
    run = grasp_run()
    page = Elements(page_html(run, "results"))
    state = json.loads(page.texts["page"])
    assert state["rows"] == len(run.time)
    assert unpacked(page.texts["time"]).tobytes() == run.time.tobytes()
    assert [s["name"] for s in state["signals"]] == list(run.signals)
    for signal in state["signals"]:
        values = run.signals[signal["name"]]
        assert unpacked(page.texts[signal["id"]]).tobytes() == values.astype(float).tobytes()
        assert signal["unit"] == run.units[signal["name"]]
        assert signal["steps"] == (values.dtype == bool)


def test_a_long_run_is_thinned_and_the_page_says_so() -> None:
    run = grasp_run()
    html = page_html(run, "results", limit=len(run.time) * len(run.signals) // 2)
    state = json.loads(Elements(html).texts["page"])
    assert state["rows"] < len(run.time) / 2 + 2
    assert "of each 5, the lowest and the highest value" in Elements(html).visible
    assert "to the last bit" not in html
    assert "to the last bit" in page_html(run, "results")


def test_names_stay_text() -> None:
    wicked = ["<b>", "</script><script>alert(1)</script>", "\"&'", "<!--"]
    html = page_html(ring_run(wicked), "<i>run</i> & $title")
    page = Elements(html)
    tags = {tag for tag, _ in page.found}
    assert not tags & {"b", "i"}
    assert html.count("<script") == html.count("</script>") == 3 + 1 + len(wicked)
    state = json.loads(page.texts["page"])
    assert [s["name"] for s in state["signals"]] == [f"{name}.y" for name in wicked]
    for name in [*wicked, "<i>run</i> & $title"]:
        assert name in page.visible
    boxes = [a["data-signal"] for t, a in page.found if t == "input" and "data-signal" in a]
    assert boxes == [f"{name}.y" for name in wicked]


def test_metrics_and_settings_are_there() -> None:
    text = Elements(page_html(grasp_run(), "results")).visible
    for expected in (
        "2 s in 2\N{NARROW NO-BREAK SPACE}000 steps of 1 ms, sequential",
        "impact velocity65.0000nonemm/s",
        "GripperPlant.fmu",
        "object_width = 0.07",
        "at = 0.5, set = (sensor_1.reflectance = 0.6)",
        "kind = bias, value = 0.1",
        "sensor_1.intensity → controller.intensity[1], bias",
        "t = 0.5 s: sensor_1.reflectance = 0.6",
        "sensor_2: count = 3, first = 0.25",
        "loops = iterate",
    ):
        assert expected in text
    assert "not complete" not in text


def test_metrics_of_the_object_are_in_degrees_and_words() -> None:
    run = grasp_run()
    more = {"object_tilt": 0.5, "toppled": False, "squeeze": 0.006, "damaged": True}
    text = Elements(page_html(replace(run, settings={**run.settings, **more}), "r")).visible
    for expected in (
        "object tilt28.6479deg", "object toppledno", "object squeezed by6.0000mm",
        "object damagedyes",
    ):  # fmt: skip
        assert expected in text


def test_a_run_that_was_broken_off_says_so() -> None:
    run = grasp_run()
    broken = replace(run, settings={**run.settings, "complete": False})
    assert "not complete" in Elements(page_html(broken, "results")).visible


def test_metrics_without_a_label_are_shown_as_they_are() -> None:
    run = ring_run(["a"])
    more = replace(run, settings={**run.settings, "margin_left": 0.125, "bands": {"low": 1}})
    text = Elements(page_html(more, "results")).visible
    assert "margin left0.1250" in text
    assert "bandslow = 1" in text


def test_a_system_that_is_no_grasp_has_no_animation() -> None:
    html = page_html(ring_run(["a", "b"]), "results")
    page = Elements(html)
    assert "scene" not in page.ids()
    assert json.loads(page.texts["page"])["grasp"] is None
    assert "There are no metrics" in page.visible
    assert "scene" in Elements(page_html(grasp_run(), "results")).ids()


def test_contacts_begin_where_the_metrics_say_and_again_after_each_release() -> None:
    run = grasp_run()
    contact = run.signals["plant.contact[1]"].copy()
    contact[1500:1600] = False
    again = replace(run, signals={**run.signals, "plant.contact[1]": contact})
    page = Elements(page_html(again, "results"))
    found = [(c["finger"], c["t"]) for c in json.loads(page.texts["page"])["grasp"]["contacts"]]
    assert [finger for finger, _ in found] == [1, 2, 1]
    np.testing.assert_allclose([t for _, t in found], [1.0, 1.2, 1.6], atol=1e-9)


def test_contacts_and_lines_of_the_log_with_a_time_are_marked() -> None:
    run = grasp_run()
    log = ["t = 0.25 s: a.u = 1", "b: 3 steps rejected, first at t = 0.7 s", "t = 1e-3 s: fault"]
    logged = replace(run, settings={**run.settings, "log": log})
    page = Elements(page_html(logged, "results"))
    marks = [(m["color"], m["t"]) for m in json.loads(page.texts["page"])["marks"]]
    assert [color for color, _ in marks] == ["--finger1", "--finger2", "--fault", "--fault"]
    np.testing.assert_allclose([t for _, t in marks], [1.0, 1.2, 0.25, 0.001], atol=1e-9)


def test_the_actuator_force_comes_from_the_connections() -> None:
    def actuators(factor: float | None, unit: str | None) -> object:
        run = grasp_run()
        connections = [
            {**w, "factor": factor} if w["to"] == "plant.force[1]" else w
            for w in run.settings["connections"]
        ]
        units = {**run.units, "controller.force[1]": unit}
        changed = replace(run, units=units, settings={**run.settings, "connections": connections})
        return json.loads(Elements(page_html(changed, "r")).texts["page"])["grasp"]["actuator"]

    both = {"1": "controller.force[1]", "2": "controller.force[2]"}
    second = {"2": "controller.force[2]"}
    assert actuators(None, "N") == both
    assert actuators(1.0, "N") == both
    assert actuators(-1.0, "N") == second
    assert actuators(None, "kN") == second


def test_an_older_run_folder_is_refused_in_one_line() -> None:
    run = ring_run(["a"])
    settings = {k: v for k, v in run.settings.items() if k != "connections"}
    with pytest.raises(
        InputError, match=r"^run.json of r: no entry 'connections'; must be"
    ) as raised:
        page_html(replace(run, settings=settings), "r")
    assert "\n" not in str(raised.value)


def test_the_page_is_written_in_one_piece(tmp_path: Path) -> None:
    path = tmp_path / "page.html"
    write_page(ring_run(["a"]), "r", path)
    assert path.read_text("utf-8") == page_html(ring_run(["a"]), "r")
    assert list(tmp_path.iterdir()) == [path]
