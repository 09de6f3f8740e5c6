"""Each room of the orchestrator has a card, and a row in the map."""

from pathlib import Path

import pytest
from grasp_cosim.base.higher import groups
from support.imports import graph, read_imports, read_modules

ORCHESTRATOR = Path(__file__).parents[2] / "orchestrator"
ROOMS = sorted(p.parent for p in (ORCHESTRATOR / "grasp_cosim").glob("*/__init__.py"))


@pytest.mark.parametrize("room", ROOMS, ids=lambda p: p.name)
def test_a_card_says_what_comes_in_what_goes_out_and_what_to_read(room):
    lines = (room / "README.md").read_text("utf-8").splitlines()
    assert len(lines) <= 20
    for head in ("**Comes in**: ", "**Goes out**: ", "**Read first**: `"):
        (line,) = [line for line in lines if line.startswith(head)]
    first = line.split("`")[1]
    assert (room / first).exists()


def test_the_map_has_all_rooms_on_a_page():
    text = (ORCHESTRATOR / "README.md").read_text("utf-8")
    assert len(text.splitlines()) <= 60
    rows = [line.split("`")[1].rstrip("/") for line in text.splitlines() if line.startswith("| [`")]
    assert sorted(rows) == [room.name for room in ROOMS]
    imports = graph(read_imports(read_modules(ORCHESTRATOR / "grasp_cosim")), of_rooms=True)
    for i, row in enumerate(rows):
        assert {*imports.get(row, ())} <= {*rows[:i]}, row


def test_a_group_of_metrics_is_a_room_with_metrics_and_a_view():
    assert groups() == ("grasp", "hand")
