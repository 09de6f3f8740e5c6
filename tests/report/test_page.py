"""The page of a run as text: whole, by itself, and nothing in a name gets out of its place."""

import json
import re
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.comparison.bands import Bands, Given
from grasp_cosim.comparison.compare import compare
from grasp_cosim.comparison.comparison_page import comparison_html
from grasp_cosim.metrics.metric import Metric
from grasp_cosim.recording.read_back import load_run
from grasp_cosim.report.run_report import page_html, write_report
from grasp_cosim.report.traces_page import Scene, Zoom
from grasp_cosim.report.wording import about, caption, changes
from report.runs import grasp_run, paced, ring_run, write_run
from report.test_embed import unpacked

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


@pytest.mark.slow
def test_the_report_of_a_result_is_that_of_its_folder(tmp_path, monkeypatch):
    """Saved or not; a folder may be given as a text."""
    monkeypatch.chdir(tmp_path)
    run = grasp_run()
    run.save("saved")
    page = write_report("saved")[0]
    assert (page, page.exists()) == (Path("saved/report.html"), True)
    assert write_report(load_run("saved"))[0] == page
    other = write_report(replace(run, origin=load_run("saved").origin))[0]
    assert other == Path("report.html")
    assert other.read_text("utf-8") == page.read_text("utf-8")
    assert write_report(run, "own.html", "Ours")[0] == Path("own.html")
    assert "<title>Ours" in Path("own.html").read_text("utf-8")


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


SCENE = Scene(
    title="Scene",
    html='<p id="stage"></p>',
    style="#stage { color: red; }",
    scripts="const startScene = () => ({ draw() {}, toggle() {} });",
    state={"moments": [0.5], "text": "</script>"},
    first_signals=["plant.gap[2]"],
    colors={"plant.gap[2]": "--c3"},
    marks=[(0.5, "--c1")],
    zooms=[Zoom("<Half>", 0.25, 0.75, "f1")],
)


METRICS = (
    Metric("a", lambda _: [0.5, 2.0, None], unit="m", entries=("x", "y", "z"), factor=1e3,
           shown_unit="mm", description="<A>"),
    Metric("b", lambda _: True),
    Metric("c_d", lambda _: [0.125, 0.25], unit="s", entries=("left", "right")),
    Metric("e", lambda _: [1.5, 2.5]),
    Metric("lacking", lambda run: run["plant.nothing"][0], group="own"),
)  # fmt: skip
"""One with other entries has a row for each; one without, or a list, is across all."""


def rich_run():
    """A grasp with a bit of all that a page shows."""
    run = grasp_run(rows=201)
    settings = {**run.settings, "metrics": []}
    parts = dict(settings["components"])
    solver = {"relative_tolerance": 1e-5}
    more = {"step": 2e-3, "isolation": "process", "rename": {"u": "v"}, "solver": solver}
    parts["sensor_1"] = {**parts["sensor_1"], **more}
    settings["components"] = parts
    first, *others = settings["connections"]
    settings["connections"] = [{**first, "factor": 2.0, "offset": 0.5}, *others]
    log = ("t = 0.25 s: a.u = 1", "b: 3 steps rejected, first at t = 0.7 s", "t = 1e-3 s: fault")
    origin = {**run.origin, "command": ["grasp-cosim", "run", "my file.toml"]}
    return replace(
        run, settings=settings, more_metrics=METRICS, log=log, complete=False, origin=origin
    )


BY, GAP = 1e-3, "plant.gap[1]"
"""m by which the gap of B is wider, and nothing else is."""


def two_runs():
    run = grasp_run()
    still = {
        n: 0.0 * c if "velocity" in n else c for n, c in run.items()
    }  # without rounding errors
    run = replace(run, signals=still)
    rows = {name: column[::2] for name, column in {**run, GAP: run[GAP] + BY}.items()}
    settings = {**run.settings, "scheme": "jacobi"}
    other = replace(run, settings=settings, time=run.time[::2], signals=rows)
    given = {GAP: Given(absolute=2e-4), "plant.contact*": Given(absolute=np.inf)}
    return compare(run.titled("<First>"), other, bands=Bands(signals=given))


PAGES = {
    "run": lambda: page_html(rich_run(), scene=SCENE),
    "unfinished": lambda: page_html(replace(ring_run(["a"]), wall_time=None)),
    "comparison": lambda: comparison_html(two_runs()),
}


@pytest.mark.parametrize("name", PAGES)
def test_what_a_page_says(name, snapshot):
    """All that is on it, and what its scripts get, but for the values of signals."""
    html = PAGES[name]()
    body = html[html.index("<nav>") : html.index("<footer>")].replace("<tr>", "\n<tr>")
    assert re.sub(r"\d{4}-\d\d-\d\d · grasp-cosim [^<]*", "", body).splitlines() == snapshot
    state = json.loads(Elements(html).texts["page"])
    del state["about"]
    assert {**state, "signals": state["signals"][:2]} == snapshot


def test_a_long_comparison_is_thinned_and_hostile_notes_stay_text():
    found = replace(two_runs(), notes=("<script>alert(1)</script>",))
    whole, thinned = (comparison_html(found, max_values=n) for n in (10**9, 20_000))
    assert "this page keeps the lowest and the highest value" in thinned
    assert len(thinned) < len(whole)
    assert "<script>alert(1)" not in whole


def test_a_title_is_the_one_asked_for_else_that_of_the_run_else_what_it_is(tmp_path):
    run = grasp_run()
    assert caption(run).title == "grasp, case 2, GraspController"
    assert caption(ring_run(["a"])).title == "grasp"
    write_run(tmp_path / "results", run.titled("Before lunch"))
    kept = load_run(tmp_path / "results")
    assert caption(kept).title == "Before lunch"
    assert caption(kept, "After").title == caption(kept.titled("After")).title == "After"


def test_a_change_has_its_unit():
    changed = {"step": 2e-3, "plant.width": 0.06, "scheme": "jacobi"}
    assert changes(changed, {"plant.width": "m"}) == (
        "step = 0.002 s, plant.width = 0.06 m, scheme = jacobi"
    )


def test_many_changes_are_counted():
    assert changes({}) == "as in the system file"
    assert changes({"a": True, "b": 0.1, "c": "x.fmu"}) == "a = true, b = 0.1, c = x.fmu"
    assert changes({f"v{k}": k for k in range(8)}).endswith("v5 = 5, 2 more")


@pytest.mark.parametrize("epoch", ["today", "1e9", "-1" + 30 * "0"])
def test_a_date_that_is_none(epoch, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", epoch)
    with pytest.raises(InputError, match=rf"^SOURCE_DATE_EPOCH={epoch}: must be the seconds"):
        about({})
