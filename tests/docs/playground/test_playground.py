"""The page of the playground as a file, and what is in it."""

import re
import zlib
from pathlib import Path

import pytest
from grasp_cosim.base.errors import InputError
from playground import wasm
from playground.page import playground_html
from playground.system import PLANTS, page_system, shipped
from support.marks import needs_zig

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
    assert {"README.md", "docs/limits.md", "docs/guide.md"} == {
        preset["page"] for preset in presets
    }
    for preset in presets:
        assert (DOCS.parent / preset["page"]).is_file()
    for what in ("name", "at"):
        assert len({preset[what] for preset in presets}) == len(presets)
