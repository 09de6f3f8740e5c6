"""Variable tables, the notebook and the site of all pages are made of the sources at hand."""

import copy
import json
import re
import runpy
from pathlib import Path

import grasp_cosim
import pytest
from grasp_cosim.cli.group import MODULE_OF_COMMAND
from grasp_cosim.fmu_export.page import blocks_by_sheet, updated
from grasp_cosim.fmu_export.shipped import SHIPPED

ROOT = Path(__file__).parents[2]
SHEETS = blocks_by_sheet()


@pytest.mark.parametrize(
    ("sheet", "blocks"),
    SHEETS.items(),
    ids=lambda of: of.parent.name if isinstance(of, Path) else "",
)
def test_a_card_follows_the_declarations(sheet, blocks):
    text = sheet.read_text("utf-8")
    assert updated(text, blocks) == text, "run: make tables"


def test_every_block_has_a_card():
    assert set(SHEETS) == {ROOT / room / "README.md" for room in ("plant", "sensor", "controller")}
    assert sum(len(blocks) for blocks in SHEETS.values()) == len(SHIPPED)


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


# The site


@pytest.fixture(scope="module")
def website():
    for package in ("furo", "myst_nb", "sphinx_click", "sphinx_copybutton", "ziamath"):
        pytest.importorskip(package, reason=f"{package} is not installed")
    return pytest.importorskip("website", reason="sphinx is not installed")


@pytest.fixture(scope="module")
def site(website, tmp_path_factory):
    folder = tmp_path_factory.mktemp("site")
    website.main(folder)
    return folder


def html(site, name):
    return (site / name).with_suffix(".html").read_text("utf-8")


@pytest.mark.slow
def test_the_site_has_every_page_every_command_and_every_public_name(website, site):
    for page in website.pages():
        name = "index" if page == Path("README.md") else page
        assert "<h1>" in html(site, name)
    for name in grasp_cosim.__all__:
        page = html(site, f"docs/reference/python/{name}")
        assert f'id="grasp_cosim.{name}"' in page or f'.{name}"' in page
        assert "Example" in page
    for name in MODULE_OF_COMMAND:
        assert f"grasp-cosim {name}" in html(site, f"docs/reference/commands/{name}")


@pytest.mark.slow
def test_every_page_of_the_site_is_in_its_navigation(site):
    index = html(site, "index")
    for page in site.rglob("*.html"):
        name = page.relative_to(site).as_posix()
        if name not in ("genindex.html", "py-modindex.html", "search.html", "docs/playground.html"):
            assert f'href="{name}"' in index or name == "index.html", name


@pytest.mark.slow
def test_the_site_needs_no_network(site):
    """Nothing but a link leads out of it: no script, style, font or picture."""
    for page in site.rglob("*.html"):
        if page.name == "playground.html":
            continue
        text = page.read_text("utf-8")
        loaded = re.findall(r"<(?:script|img|iframe|source)[^>]* src=\"([^\"]*)\"", text)
        loaded += re.findall(r"<link[^>]* href=\"([^\"]*)\"", text)
        assert [address for address in loaded if re.match(r"(https?:)?//", address)] == [], page


@pytest.mark.slow
def test_links_within_the_site_lead_to_files_of_it(site):
    for page in site.rglob("*.html"):
        for link in re.findall(r"<a [^>]*href=\"([^\"#:]+)(?:#[^\"]*)?\"", page.read_text("utf-8")):
            assert (page.parent / link).is_file(), (page, link)


@pytest.mark.slow
def test_equations_notebook_search_and_glossary_are_there(site):
    assert html(site, "plant/README").count('<math xmlns="http://www.w3.org/1998/Math') > 5
    assert (site / "_static/STIXTwoMath-Regular.ttf").stat().st_size > 100_000
    assert "data:image/png;base64" in html(site, "docs/from_python") or list(
        (site / "_images").glob("*.png")
    )
    assert "simultaneous" in (site / "searchindex.js").read_text("utf-8")
    link = re.search(r'class="[^"]*\bword\b[^"]*" href="([^"#]*)#([^"]*)"', html(site, PAGE))
    assert link is not None
    assert f'id="{link[2]}"' in html(site, "docs/reference/glossary")


PAGE = "docs/how_to/hardware"
"""A page that uses words of the glossary."""


@pytest.mark.slow
def test_a_link_that_leads_nowhere_is_an_error(website, tmp_path, monkeypatch):
    copy = website.copy

    def broken(folder):
        copy(folder)
        page = folder / "docs/results/speed.md"
        page.write_text("# Speed\n\n[a](systems.md#nowhere)\n", "utf-8")

    monkeypatch.setattr(website, "copy", broken)
    with pytest.raises(SystemExit, match=r"id not found in doc 'docs/results/systems': 'nowhere'"):
        website.main(tmp_path / "site")
