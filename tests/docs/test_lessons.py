"""Pages whose commands build on each other: done in order, they give what the pages show."""

import shlex
from pathlib import Path

import pytest
from grasp_cosim import cli
from support.lesson import do
from support.marks import needs_compiler
from support.pages import INDENTED

ROOT = Path(__file__).parents[2]
LESSONS = [
    "README.md",
    "docs/start/first_grasp.md",
    "docs/how_to/change_and_compare.md",
    "docs/how_to/metric.md",
    "docs/how_to/sweep.md",
    "docs/how_to/qualify.md",
    "docs/how_to/friction_and_gains.md",
    "docs/how_to/events_and_faults.md",
    "docs/how_to/python_system.md",
    "docs/explanation/co_simulation.md",
    "docs/results/accuracy.md",
]


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("page", LESSONS)
def test_a_page_does_what_it_shows(page, checkout, capsys):
    pytest.importorskip("matplotlib")
    if page.endswith("sweep.md"):
        pytest.importorskip("zarr")
    do((ROOT / page).read_text("utf-8"), capsys)


@pytest.mark.slow
@needs_compiler
@pytest.mark.parametrize("page", ["docs/how_to/hand.md", "docs/how_to/tandem.md"])
def test_the_commands_at_the_beginning_of_a_page_work(page, checkout):
    pytest.importorskip("matplotlib")
    assert type_indented(page) == ["init", "run", "report"]
    assert (checkout / "results/report.html").is_file()


@pytest.mark.slow
@needs_compiler
def test_the_commands_of_the_page_on_archives_work(checkout):
    assert cli.main(["init", "my_system.toml"]) == 0
    assert type_indented("docs/reference/ssp.md") == ["ssp", "run"]


def type_indented(page):
    """The names of the commands in the indented blocks of a page, which must all end with 0."""
    text = (ROOT / page).read_text("utf-8").replace("\\\n", " ")
    commands = [shlex.split(line) for line in INDENTED.findall(text)]
    for _, *words in commands:
        assert cli.main(words) == 0, words
    return [words[1] for words in commands]
