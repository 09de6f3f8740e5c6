"""What is made of the sources is of them: variable tables, the notebook, the site of all pages."""

import copy
import json
import re
import runpy
from pathlib import Path

import grasp_cosim
import pytest
from grasp_cosim.fmu_export.page import blocks_by_card, updated
from grasp_cosim.fmu_export.shipped import SHIPPED

ROOT = Path(__file__).parents[2]
CARDS = blocks_by_card()


@pytest.mark.parametrize(
    ("card", "blocks"), CARDS.items(), ids=lambda of: of.parent.name if isinstance(of, Path) else ""
)
def test_a_card_follows_the_declarations(card, blocks):
    text = card.read_text("utf-8")
    assert updated(text, blocks) == text, "run: make cards"


def test_every_block_has_a_card():
    assert set(CARDS) == {ROOT / room / "README.md" for room in ("plant", "sensor", "controller")}
    assert sum(len(blocks) for blocks in CARDS.values()) == len(SHIPPED)


DOCS = Path(__file__).parents[2] / "docs"
NOTEBOOK = json.loads((DOCS / "from_python.ipynb").read_text("utf-8"))
CODE = [cell for cell in NOTEBOOK["cells"] if cell["cell_type"] == "code"]


def without_outputs():
    blank = copy.deepcopy(NOTEBOOK)
    for cell in blank["cells"]:
        if cell["cell_type"] == "code":
            cell |= {"outputs": [], "execution_count": None}
    return blank


def texts(cell):
    """What a cell prints and shows, but for how long it took and where lines break."""
    found = ["".join(o.get("text") or o["data"]["text/plain"]) for o in cell["outputs"]]
    return [" ".join(re.sub(r"took \S+ s", "took", text).split()) for text in found]


@pytest.mark.slow
def test_without_jupyter_it_gives_what_it_shows(checkout):
    pytest.importorskip("matplotlib")
    pytest.importorskip("pandas")
    done = runpy.run_path(str(DOCS / "notebook.py"))["executed"](without_outputs())
    ran = [cell for cell in done["cells"] if cell["cell_type"] == "code"]
    assert [texts(cell) for cell in ran] == [texts(cell) for cell in CODE]
    kinds = [sorted(o["data"]) for cell in ran for o in cell["outputs"] if "data" in o]
    assert ["image/png", "text/plain"] in kinds
    assert kinds.count(["text/html", "text/plain"]) == 3


@pytest.mark.slow
def test_a_cell_that_fails_stops_it(checkout):
    broken = {"cells": [{"cell_type": "code", "source": ["1 / 0"]}]}
    with pytest.raises(ZeroDivisionError):
        runpy.run_path(str(DOCS / "notebook.py"))["executed"](broken)


@pytest.mark.slow
def test_it_is_a_valid_notebook_of_a_modest_size():
    nbformat = pytest.importorskip("nbformat", reason="nbformat is not installed")
    nbformat.validate(nbformat.from_dict(NOTEBOOK))
    assert (DOCS / "from_python.ipynb").stat().st_size < 500_000
    assert all(cell["outputs"] for cell in CODE)


@pytest.fixture(scope="module")
def website():
    pytest.importorskip("mkdocstrings", reason="mkdocstrings is not installed")
    return pytest.importorskip("website", reason="mkdocs is not installed")


@pytest.mark.slow
def test_every_page_and_every_public_name_is_there(website, tmp_path):
    website.main(tmp_path / "site")
    for page in website.pages():
        there = page.with_name("index.html" if page.name == "README.md" else f"{page.stem}.html")
        assert (tmp_path / "site" / there).is_file()
    names = (tmp_path / "site/api/grasp_cosim.html").read_text("utf-8")
    assert {*grasp_cosim.__all__} <= {*re.findall(r'id="grasp_cosim\.(\w+)"', names)}
    assert "<math" in (tmp_path / "site/plant/index.html").read_text("utf-8")


@pytest.mark.slow
def test_a_link_that_leads_nowhere_is_an_error(website, tmp_path, monkeypatch):
    copy = website.copy

    def broken(folder):
        copy(folder)
        (folder / "README.md").write_text("[a](docs/guide.md#nowhere)\n", "utf-8")

    monkeypatch.setattr(website, "copy", broken)
    with pytest.raises(SystemExit, match="does not contain an anchor '#nowhere'"):
        website.main(tmp_path / "site")
