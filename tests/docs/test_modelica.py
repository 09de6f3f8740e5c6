"""The page on Modelica: its commands, with the two versions of rumoca in folders of their names."""

import re
from pathlib import Path

import pytest
from support.foreign_tools import python_with
from support.lesson import do
from support.marks import needs_compiler

PAGE = (Path(__file__).parents[2] / "docs/how_to/modelica.md").read_text("utf-8")


def put(folder, version):
    """An environment with that version of rumoca, as the page has it made."""
    folder.parent.mkdir(exist_ok=True)
    folder.symlink_to(Path(python_with("rumoca", version)).parents[1])


@pytest.mark.interop
@needs_compiler
def test_the_page_does_what_it_shows(checkout, capsys):
    versions = re.findall(r"^    (\S+)/bin/pip install rumoca==(\S+)$", PAGE, re.M)
    assert versions == [(f".venv/rumoca-{v}", v) for v in ("0.9.13", "0.10.2")]
    for folder, version in versions:
        put(checkout / folder, version)
    do(PAGE, capsys)
    assert (checkout / "plant_3.fmu").is_file()


@pytest.mark.interop
def test_the_version_that_simulates_exports_nothing(checkout, capsys):
    """Where it does, the page needs one version only."""
    put(checkout / ".venv/rumoca-0.9.13", "0.10.2")
    with pytest.raises(AssertionError, match="FMI targets require the `fmi` feature"):
        do(PAGE, capsys)
