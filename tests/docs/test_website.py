"""The site of all pages and of the Python interface is made without a warning, and whole."""

import re

import grasp_cosim
import pytest

website = pytest.importorskip("website", reason="mkdocs is not installed")
pytest.importorskip("mkdocstrings", reason="mkdocstrings is not installed")

pytestmark = pytest.mark.slow


def test_every_page_and_every_public_name_is_there(tmp_path):
    website.main(tmp_path / "site")
    for page in website.pages():
        there = page.with_name("index.html" if page.name == "README.md" else f"{page.stem}.html")
        assert (tmp_path / "site" / there).is_file()
    names = (tmp_path / "site/api/grasp_cosim.html").read_text("utf-8")
    assert {*grasp_cosim.__all__} - {*re.findall(r'id="grasp_cosim\.(\w+)"', names)} == {"simulate"}
    called = (tmp_path / "site/api/grasp_cosim.master.simulation.html").read_text("utf-8")
    assert 'id="grasp_cosim.master.simulation.Simulate.__call__"' in called
    assert "<math" in (tmp_path / "site/plant/index.html").read_text("utf-8")


def test_a_link_that_leads_nowhere_is_an_error(tmp_path, monkeypatch):
    copy = website.copy

    def broken(folder):
        copy(folder)
        (folder / "README.md").write_text("[a](docs/guide.md#nowhere)\n", "utf-8")

    monkeypatch.setattr(website, "copy", broken)
    with pytest.raises(SystemExit, match="does not contain an anchor '#nowhere'"):
        website.main(tmp_path / "site")
