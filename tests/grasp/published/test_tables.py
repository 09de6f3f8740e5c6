"""The figures of the paper, as they are in the package."""

import csv
from importlib.resources import files
from pathlib import Path

import pytest
from grasp_cosim.grasp.published.tables import Setting, published_rows

SHARED = Path(__file__).parents[4] / "shared" / "paper"


def found(rows):
    return {(r.condition, r.case, r.finger): r.published for r in rows}


def test_both_experimental_tables_are_there():
    rows = published_rows("experiment")
    assert len(rows) == (6 + 7) * 2 * 3
    figures = found(rows)
    assert figures[0.05, 1, 2] == 4.81
    assert figures["white/brown", 2, None] == 0.19
    settings = {r.condition: r.setting for r in rows}
    assert settings["brown/white"] == Setting(0.03, 0.86, 1.0)
    assert settings[0.03] == settings["white/white"] == Setting(0.03)


def test_white_on_both_sides_is_the_position_row():
    figures = found(published_rows("experiment"))
    for case in (1, 2):
        for finger in (1, 2, None):
            assert figures["white/white", case, finger] == figures[0.03, case, finger]


def test_the_simulated_rows_are_the_other_half():
    rows = published_rows("simulation")
    assert len(rows) == 36
    assert found(rows)[0.03, 1, 1] == 1.15


@pytest.mark.parametrize("name", ["table_position.csv", "table_reflectance.csv"])
def test_a_difference_is_that_of_its_times(name):
    text = files("grasp_cosim.grasp.published").joinpath(name).read_text("utf-8")
    for line in csv.DictReader(text.splitlines()):
        for case in (1, 2):
            first, second, apart = (float(line[f"case{case}_{n}"]) for n in ("t1", "t2", "dt"))
            assert abs(second - first) == pytest.approx(apart, abs=0.011)


@pytest.mark.parametrize("name", ["table_position.csv", "table_reflectance.csv"])
def test_the_table_is_that_of_the_paper(name):
    original = SHARED / name
    if not original.exists():
        pytest.skip(f"NO shared/paper/{name} beside the repository: nothing to compare with")
    packed = files("grasp_cosim.grasp.published").joinpath(name)
    assert packed.read_text("utf-8") == original.read_text("utf-8")
