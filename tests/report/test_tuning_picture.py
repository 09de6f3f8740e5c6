"""The picture of a tuning: every point, both sets of gains, the limit."""

from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.parallel import Crew
from grasp_cosim.progress import Progress
from grasp_cosim.report.tuning import check_drawable, draw_tuning
from grasp_cosim.tuning.search import Point, Search, Tuning
from support.native_fmus import needs_gcc
from support.tuned import Computed, known_problem


@pytest.fixture
def found(tmp_path: Path) -> Tuning:
    """A search by formulas, and a point that has no figures."""
    runs = Computed(known_problem(tmp_path), Crew(1), Progress("", shown=False))
    runs.points([runs.problem.start])
    Search(runs, {"effort": 18.0}, 60, 1, 12).all()
    nothing = Point((1.0, 1.0), {"slowness": None, "effort": None}, "it ran away")
    return Tuning(runs.problem, {"effort": 18.0}, (*runs.known.values(), nothing), 60, 1)


@needs_gcc
def test_it_has_all_points_the_front_the_limit_and_both_sets_of_gains(
    found: Tuning, tmp_path: Path
) -> None:
    figure = draw_tuning(found, tmp_path / "tuning.png", "published")
    assert (tmp_path / "tuning.png").read_bytes().startswith(b"\x89PNG")
    (axes,) = figure.axes
    (dots,) = axes.collections
    places = np.asarray(dots.get_offsets())
    assert len(places) == len(found.points) - 1
    legend = axes.get_legend()
    assert legend is not None
    labels = [text.get_text() for text in legend.get_texts()]
    assert found.tuned is not None
    assert labels[:2] == ["keeps the other limits", "Pareto front of these"]
    assert labels[2] == "published: 5, 0.5"
    assert labels[3].startswith("tuned: 1")
    assert labels[4:] == ["limit: 18"]
    said = " ".join(" ".join(text.get_text() for text in figure.texts).split())
    assert said.startswith("system, tuned: slowness against effort")
    assert "the worst of: as it is" in said
    beyond = int(said.partition("seed 1; ")[2].split()[0])
    (low, right), (bottom, top) = axes.get_xlim(), axes.get_ylim()
    shown = [low <= x <= right and bottom <= y <= top for x, y in places]
    assert beyond == len(found.points) - sum(shown) >= 1
    steps = next(line for line in axes.lines if line.get_label() == "Pareto front of these")
    assert len(np.asarray(steps.get_xdata())) == len(found.front)
    assert axes.get_xlabel() == "effort, worst case"
    assert axes.get_ylabel() == "slowness, worst case, in s"


def test_without_a_limit_there_is_no_other_axis() -> None:
    with pytest.raises(InputError, match=r"^--plot: no limit; must have one"):
        check_drawable({})
