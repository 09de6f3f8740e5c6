"""Pages whose commands build on each other: done in order, they give what the pages show."""

from pathlib import Path

import pytest
from support.lesson import do
from support.marks import needs_compiler

ROOT = Path(__file__).parents[2]
LESSONS = [
    "README.md",
    "docs/start/first_grasp.md",
    "docs/how_to/change_and_compare.md",
    "docs/how_to/metric.md",
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
    do((ROOT / page).read_text("utf-8"), capsys)
