"""The page of a run as text: whole, by itself, and nothing in a name gets out of its place."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from grasp_cosim.metrics.metric import Metric
from grasp_cosim.report.page import Scene, Zoom, page_html
from report.runs import grasp_run, ring_run
from report.test_embed import unpacked
from report.timings import paced

EMPTY = {"meta", "link", "input", "br"}


class Elements(HTMLParser):
    """Collects elements and texts; an element that is not closed in its place is an error."""

    def __init__(self, html):
        super().__init__()
        self.open = []
        self.found = []
        self.texts = {}
        self.visible = ""
        self.feed(html)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))
        if tag not in EMPTY:
            self.open.append(tag)

    def handle_startendtag(self, tag, attrs):
        self.found.append((tag, dict(attrs)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open[-1:] == ["script"]:
            self.texts[str(self.found[-1][1].get("id"))] = data
        elif self.open[-1:] != ["style"]:
            self.visible += data

    def ids(self):
        return [str(a["id"]) for _, a in self.found if "id" in a]


@pytest.mark.parametrize(
    "run",
    [grasp_run(), ring_run(["a", "b"]), replace(grasp_run(), timing=paced(steps=2000))],
    ids=["grasp", "ring", "paced"],
)
def test_the_page_is_whole_and_needs_nothing_from_outside(run):
    html = page_html(run)
    page = Elements(html)
    for tag, attributes in page.found:
        for name in ("src", "href", "xlink:href", "action", "data", "srcset"):
            value = attributes.get(name)
            assert value is None or value.startswith("#") or value == "data:,", (tag, value)
        assert tag not in ("iframe", "object", "embed", "img", "base")
    addresses = set(re.findall(r"https?://[^\s\"'<>)]*", html))
    names = {"http://www.w3.org/2000/svg", "http://www.w3.org/1999/xlink"}
    assert addresses <= names  # from which nothing is loaded
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)
    assert len(page.ids()) == len(set(page.ids()))
    targets = {str(a["href"])[1:] for _, a in page.found if str(a.get("href")).startswith("#")}
    assert targets <= set(page.ids())
    assert not re.search(r"\$\w", Elements(html).visible)


def test_the_data_in_the_page_are_those_of_the_run_to_the_bit():
    run = grasp_run()
    page = Elements(page_html(run))
    state = json.loads(page.texts["page"])
    assert state["rows"] == len(run.time)
    assert unpacked(page.texts["time"]).tobytes() == run.time.tobytes()
    assert [s["name"] for s in state["signals"]] == list(run.signals)
    for signal in state["signals"]:
        values = run.signals[signal["name"]]
        assert unpacked(page.texts[signal["id"]]).tobytes() == values.astype(float).tobytes()
        assert signal["unit"] == run.units[signal["name"]]
        assert signal["steps"] == (values.dtype == bool)


def test_names_stay_text():
    wicked = ["<b>", "</script><script>alert(1)</script>", "\"&'", "<!--"]
    html = page_html(ring_run(wicked).titled("<i>run</i> & $title"))
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


def test_metrics_and_settings_are_there():
    text = Elements(page_html(grasp_run())).visible
    for expected in (
        "2 s in 2\N{NARROW NO-BREAK SPACE}000 steps of 1 ms, sequential",
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


def test_a_run_that_was_broken_off_says_so():
    run = grasp_run()
    broken = replace(run, complete=False)
    assert "not complete" in Elements(page_html(broken)).visible


SCENE = Scene(
    title="Scene",
    html='<p id="stage"></p>',
    style="#stage { color: red; }",
    scripts="const startScene = () => ({ draw() {}, toggle() {} });",
    state={"moments": [0.5], "text": "</script>"},
    shown=["plant.gap[2]"],
    colors={"plant.gap[2]": "--c3"},
    marks=[(0.5, "--c1")],
    zooms=[Zoom("<Half>", 0.25, 0.75, "f1")],
)


def test_a_scene_has_its_section_scripts_colours_buttons_and_marks():
    html = page_html(grasp_run(), scene=SCENE)
    page = Elements(html)
    assert {"scene", "stage"} <= set(page.ids())
    assert page.found.index(("section", {"id": "scene"})) < page.found.index(
        ("section", {"id": "traces"})
    )
    assert ("a", {"href": "#scene"}) in page.found
    assert SCENE.style in html
    assert (
        html.index("function connect()") > html.index(SCENE.scripts) > html.index("function show")
    )
    state = json.loads(page.texts["page"])
    assert state["scene"] == SCENE.state
    assert (state["shown"], state["colors"]) == (SCENE.shown, SCENE.colors)
    assert state["marks"] == [{"t": 0.5, "color": "--c1"}, {"t": 0.5, "color": "--fault"}]
    button = {"type": "button", "class": "f1", "data-from": "0.25", "data-to": "0.75"}
    assert ("button", button) in page.found
    assert "<Half>" in page.visible


def test_without_a_scene_the_page_does_without():
    page = Elements(page_html(grasp_run()))
    assert "scene" not in page.ids()
    state = json.loads(page.texts["page"])
    assert (state["scene"], state["colors"]) == (None, {})
    ends = {c["from"] for c in grasp_run().settings["connections"]}
    assert len(state["shown"]) == 6
    assert set(state["shown"]) <= ends  # the connected ones


def test_metrics_stand_in_the_columns_of_their_entries():
    """One with other entries has a row for each; one without, or a list, is across all."""
    found = [
        Metric("a", lambda _: [0.5, 2.0, None], unit="m", entries=("x", "y", "z"), factor=1e3,
               shown_unit="mm"),
        Metric("b", lambda _: True),
        Metric("c_d", lambda _: [0.125, 0.25], unit="s", entries=("left", "right")),
        Metric("e", lambda _: [1.5, 2.5]),
    ]  # fmt: skip
    html = page_html(replace(ring_run(["a"]), more_metrics=tuple(found)))
    table = html[html.index('id="metrics"') : html.index('id="connections"')]
    heads = re.findall(r'<th class="n"><span class="key(\d)">(.*?)</span>', table)
    assert heads == [("1", "x"), ("2", "y"), ("3", "z")]
    cells = [re.findall(r"<td([^>]*)>(.*?)</td>", row) for row in table.split("<tr>")[2:]]
    assert [[text for _, text in row] for row in cells] == [
        ["a", "500.0000", "2000.0000", "none", "mm"],
        ["b", "yes", ""],
        ["c d, left", "0.1250", "s"],
        ["c d, right", "0.2500", "s"],
        ["e", "1.5000, 2.5000", ""],
    ]
    assert cells[1][1][0] == ' class="both" colspan="3"'


def test_lines_of_the_log_with_a_time_are_marked():
    run = grasp_run()
    log = ["t = 0.25 s: a.u = 1", "b: 3 steps rejected, first at t = 0.7 s", "t = 1e-3 s: fault"]
    logged = replace(run, log=tuple(log))
    page = Elements(page_html(logged))
    marks = [(m["color"], m["t"]) for m in json.loads(page.texts["page"])["marks"]]
    assert marks == [("--fault", 0.25), ("--fault", 0.001)]
