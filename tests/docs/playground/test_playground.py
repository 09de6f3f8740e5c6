"""The page of the playground as a file, what is in it, and its numbers: those of run --json."""

import json
import random
import re
import shlex
import zlib
from pathlib import Path

import pytest
from grasp_cosim import cli
from grasp_cosim.base.errors import InputError
from playground import wasm
from playground.page import page_system, playground_html
from playground.wasm import LAWS, PLANTS, shipped
from report.javascript import in_browser
from support import marks
from support.marks import needs_zig
from support.native_fmus import needs_gcc

# The page of the playground as a file, and what is in it.

DOCS = Path(__file__).parents[3] / "docs"


def test_the_page_in_docs_is_of_the_sources_at_hand():
    """Else: make playground."""
    assert playground_html() == (DOCS / "playground.html").read_text("utf-8")


def test_it_is_one_small_file_that_asks_for_no_other():
    html = playground_html()
    assert len(html) < 250_000
    asking = r"""https?:|\b(src|href)=["'](?!data:)|\bfetch\(|@import|url\((?!#)"""
    assert not re.search(asking, html)


@pytest.mark.slow
def test_the_wasm_is_made_from_the_sources_at_hand():
    """It says which it is of, so that this needs no zig. Else: make playground."""
    assert wasm.made_from(zlib.decompress(shipped())) == wasm.hash_at_hand()


@pytest.mark.platforms
@needs_zig
def test_zig_makes_the_same_wasm_again(tmp_path, monkeypatch):
    """Bit for bit, of the sources at hand."""
    monkeypatch.setattr(wasm, "WASM", tmp_path / "play.wasm.z")
    wasm.main()
    assert zlib.decompress((tmp_path / "play.wasm.z").read_bytes()) == zlib.decompress(shipped())


def test_another_zig_is_refused(monkeypatch):
    monkeypatch.setattr(wasm, "version", lambda _: "0.13.0")
    with pytest.raises(InputError, match=r"^ziglang: 0\.13\.0; must be 0\.17\.1, .* pip install"):
        wasm.made()


def test_each_control_is_of_a_variable_and_begins_within_its_ends():
    system = page_system()
    starts = {
        f"{component}.{name}": start
        for component, model in [
            *(("plant", PLANTS[plant]) for plant in ("movable", "soft", "fixed")),
            *system["components"].items(),
        ]
        for name, _, causality, _, start, _ in system["models"][model]
        if causality == "parameter"
    } | system["values"]
    controls = [control for group in system["groups"] for control in group["controls"]]
    assert len({c["name"] for c in controls}) == len(controls)
    for control in controls:
        first, *others = (starts[name] for name in control["variables"])
        assert control["low"] <= first * control["per"] <= control["high"], control["name"]
        assert all(v == (-first if control.get("mirrored") else first) for v in others)


def test_each_grasp_is_of_a_page_that_there_is():
    presets = page_system()["presets"]
    assert len({preset["page"] for preset in presets}) > 3
    for preset in presets:
        assert (DOCS.parent / preset["page"]).is_file()
    for what in ("name", "at"):
        assert len({preset[what] for preset in presets}) == len(presets)


# The numbers of the page are those of `run --json`, for the same settings, to 1e-9, of a number
# above 1 as a share of it: rounding grows where a finger bounces in the noise.


@pytest.fixture
def built(tmp_path, fmus, monkeypatch):
    """The FMUs are where the commands of the page have them."""
    (tmp_path / "here/fmus").mkdir(parents=True)
    (tmp_path / "here/fmus/build").symlink_to(fmus)
    monkeypatch.chdir(tmp_path / "here")


VISIT = """
const seen = [];
for (const at of %s) {
  location.hash = at || "case=2";
  await frame();
  seen.push({ command: command(), metrics: JSON.parse(state.metrics),
    said: find("message").textContent, preset: find("preset").selectedOptions[0].textContent });
}
return seen;
"""


def visited(addresses, folder):
    """What the page shows at these addresses."""
    found = in_browser(playground_html(), VISIT % json.dumps(addresses), folder, "at=0")
    assert len(found) == len(addresses)
    return found


def assert_equal_to_a_run(page, capsys):
    """Run the command that the page shows, in C; each of its metrics is the page's."""
    assert page["said"] == ""
    name, *words = shlex.split(page["command"])
    assert name == "grasp-cosim"
    assert cli.main([*words, "--json", "--native"]) == 0, page["command"]
    run = json.loads(capsys.readouterr().out)
    metrics = {k: v for k, v in page["metrics"].items() if v != [None, None] or k in run}
    assert set(metrics) == set(run) & set(page["metrics"]), page["command"]
    for metric, value in metrics.items():
        pairs = zip(*(v if isinstance(v, list) else [v] for v in (value, run[metric])), strict=True)
        for shown, expected in pairs:
            both = shown is not None and expected is not None
            near = both and abs(shown - expected) <= 1e-9 * max(1.0, abs(expected))
            assert near or shown is expected, (page["command"], metric, shown, expected)


@needs_gcc
@pytest.mark.slow
@pytest.mark.usefixtures("built")
def test_of_each_grasp_of_the_documentation(tmp_path, capsys):
    presets = page_system()["presets"]
    pages = visited([preset["at"] for preset in presets], tmp_path)
    assert [page["preset"] for page in pages] == [preset["name"] for preset in presets]
    for page in pages:
        assert_equal_to_a_run(page, capsys)


def drawn(choose):
    """An address with settings of all kinds, in steps of 1 to 5 ms."""
    system = page_system()
    plant, law = choose.choice([*PLANTS]), choose.choice([*LAWS])
    there = {
        f"{component}.{name}"
        for component, model in {
            **system["components"], "plant": PLANTS[plant], "controller": LAWS[law],
        }.items()
        for name, *_ in system["models"][model]
    }  # fmt: skip
    parts = [
        f"plant={plant}", f"controller={law}", f"case={choose.choice([0, 1, 2, 2])}",
        f"step={choose.choice([0.001, 0.002, 0.005])}", f"stop={choose.choice([1, 2.5, 4])}",
        f"plant.initial_object_position={choose.randint(-30, 30) / 1000}",
    ]  # fmt: skip
    controls = [c for group in system["groups"] for c in group["controls"] if c["name"] != "width"]
    for control in choose.sample(controls, 4):
        low, high = (control[end] / control["per"] for end in ("low", "high"))
        value = round(choose.uniform(low, high), 4)
        if control["variables"][0] in there and control["name"] != "position":
            parts.append(f"{control['variables'][0]}={value}")
    return "&".join(parts)


@needs_gcc
@pytest.mark.slow
@pytest.mark.usefixtures("built")
@pytest.mark.campaign
def test_of_settings_drawn_at_random(tmp_path, capsys):
    addresses = [drawn(random.Random(seed)) for seed in marks.seeds(300)]
    for page in visited(addresses, tmp_path):
        assert_equal_to_a_run(page, capsys)
