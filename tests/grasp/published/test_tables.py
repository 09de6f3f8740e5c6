"""The figures of the paper, as they are in the package."""

from importlib.resources import files
from pathlib import Path

import pytest
from grasp_cosim.grasp.published.tables import Setting, published_rows

SHARED = Path(__file__).parents[4] / "shared" / "paper"


def test_the_rows_of_both_sources_are_there():
    rows = published_rows("experiment")
    figures = {(r.condition, r.case, r.finger): r.published for r in rows}
    assert (len(rows), len(published_rows("simulation"))) == ((6 + 7) * 2 * 3, 36)
    assert (figures[0.05, 1, 2], figures["white/brown", 2, None]) == (4.81, 0.19)
    settings = {r.condition: r.setting for r in rows}
    assert settings["brown/white"] == Setting(0.03, 0.86, 1.0)
    assert settings[0.03] == settings["white/white"] == Setting(0.03)
    for case in (1, 2):  # white on both sides is the position row
        for finger in (1, 2, None):
            assert figures["white/white", case, finger] == figures[0.03, case, finger]


@pytest.mark.parametrize("source", ["simulation", "experiment"])
def test_a_difference_is_that_of_its_times(source):
    rows = published_rows(source)
    for first, second, apart in zip(rows[::3], rows[1::3], rows[2::3], strict=True):
        assert (first.finger, second.finger, apart.finger) == (1, 2, None)
        assert abs(second.published - first.published) == pytest.approx(apart.published, abs=0.011)


@pytest.mark.parametrize("name", ["table_position.csv", "table_reflectance.csv"])
def test_the_table_is_that_of_the_paper(name):
    original = SHARED / name
    if not original.exists():
        pytest.skip(f"NO shared/paper/{name} beside the repository: nothing to compare with")
    packed = files("grasp_cosim.grasp.published").joinpath(name)
    assert packed.read_text("utf-8") == original.read_text("utf-8")
