"""The pages of the Python interface: made from the docstrings without a warning, and whole."""

import re
import runpy
from os.path import normpath
from pathlib import Path

import grasp_cosim
import pytest

pytestmark = pytest.mark.slow

SCRIPT = Path(__file__).parents[2] / "docs/api.py"


@pytest.fixture(scope="module")
def api():
    """The names of the script."""
    pytest.importorskip("pdoc", reason="pdoc is not installed")
    return runpy.run_path(str(SCRIPT))


@pytest.fixture(scope="module")
def pages(api, tmp_path_factory):
    folder = tmp_path_factory.mktemp("api")
    written = api["write_pages"](folder)
    return {path.relative_to(folder).as_posix(): path.read_text("utf-8") for path in written}


def section(page, name):
    """The text of a name, without tags."""
    found = re.search(rf'<section id="{re.escape(name)}">(.*?)</section>', page, re.DOTALL)
    assert found, name
    return re.sub(r"<[^>]+>", "", found[1])


def test_every_public_name_is_there_with_its_docstring(pages):
    page = pages["grasp_cosim.html"]
    for name in grasp_cosim.__all__:
        assert f'<section id="{name}">' in page
    assert "Run a system to its stop time" in section(page, "simulate")
    assert "step: float | None = None" in section(page, "simulate")
    for member, text in (("plot", "Draw a grasp as one"), ("to_pandas", "as a DataFrame")):
        method = section(page, "Result").partition(f"{member}(")[2]
        assert text in method


def test_what_a_page_says_is_the_same_each_time_and_leads_somewhere(api, pages):
    files = [f"{name.replace('.', '/')}.html" for name in api["MODULES"]]
    assert {*files, "index.html"} == pages.keys()
    for file in files:
        assert not re.search(r" at 0x[0-9a-f]+", pages[file])
        for link, place in re.findall(r'href="([^":#]*)(?:#([^"]*))?"', pages[file]):
            other = normpath(Path(file).parent / link) if link else file
            assert not place or f'id="{place}"' in pages[other]
    for file in files[1:]:
        assert f'href="{file}"' in pages["grasp_cosim.html"]


def test_a_wrong_annotation_is_an_error(api, monkeypatch, tmp_path):
    monkeypatch.setitem(grasp_cosim.load_run.__annotations__, "folder", "NoSuchType")
    with pytest.raises(UserWarning, match="NoSuchType"):
        api["write_pages"](tmp_path)
    assert not list(tmp_path.iterdir())
