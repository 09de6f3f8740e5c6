"""The search finds what is known to be best, within limits and budget."""

import math
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError
from grasp_cosim.parallel import Crew
from grasp_cosim.progress import Progress
from grasp_cosim.tuning.problem import Gain, Problem
from grasp_cosim.tuning.search import LEAST, SCALES, Point, Search, Tuning, tune
from support.native_fmus import needs_gcc
from support.tuned import Computed, known_problem

pytestmark = needs_gcc

LIMIT = 18.0
BEST = 1.0 / 9.0


def computed(problem: Problem, budget: int, seed: int = 1) -> tuple[Tuning, list[int]]:
    """What the search finds without runs, and how many points it asked for at once."""
    runs = Computed(problem, Crew(1), Progress("", shown=False))
    runs.points([problem.start])
    Search(runs, {"effort": LIMIT}, budget, seed, LEAST).all()
    return Tuning(
        problem, {"effort": LIMIT}, tuple(runs.known.values()), budget, seed
    ), runs.batches


@pytest.mark.parametrize("seed", range(3))
def test_the_known_best_is_found_and_the_limit_kept(tmp_path: Path, seed: int) -> None:
    found, _ = computed(known_problem(tmp_path), 600, seed)
    tuned = found.tuned
    assert tuned is not None
    effort = tuned.figures["effort"]
    assert effort is not None
    assert effort <= LIMIT
    assert tuned.figures["slowness"] == pytest.approx(BEST, rel=0.01)
    assert tuned.gains == pytest.approx((3.0, 3.0), rel=0.15)  # as flat as it is there


@pytest.mark.slow
def test_the_front_is_the_known_one(tmp_path: Path) -> None:
    """Least 1/(g·u) at an effort e is 2/e; no point is below, and there are some near it."""
    found, _ = computed(known_problem(tmp_path), 1200)
    pairs = [(p.figures["effort"], p.figures["slowness"]) for p in found.front]
    products = [e * s for e, s in pairs if e is not None and s is not None]
    assert len(products) == len(pairs) > 10
    assert all(product >= 2.0 * (1.0 - 1e-12) for product in products)
    for scale in (1.0, *SCALES):
        below = [e for e, s in pairs if e is not None and s is not None and e * s < 2.1]
        assert any(0.7 * scale * LIMIT <= e <= scale * LIMIT for e in below), scale


@pytest.mark.parametrize("budget", [13, 24, 25, 50, 301])
def test_the_budget_is_kept_and_points_are_run_once(tmp_path: Path, budget: int) -> None:
    found, batches = computed(known_problem(tmp_path), budget)
    assert sum(batches) == len(found.points) <= budget
    assert len({p.gains for p in found.points}) == len(found.points)
    assert max(batches) <= LEAST
    assert found.points[0].gains == (1.0, 2.0)


def test_the_seed_decides(tmp_path: Path) -> None:
    problem = known_problem(tmp_path)
    one, again, other = (computed(problem, 100, seed)[0].points for seed in (1, 1, 2))
    assert one == again
    assert one != other


def point(**figures: float | None) -> Point:
    return Point((1.0, 1.0), figures)


def test_a_limit_is_kept_at_its_value_and_broken_where_there_is_none() -> None:
    assert point(a=1.0, b=2.0).keeps({"b": 2.0})
    assert not point(a=1.0, b=math.nextafter(2.0, 3.0)).keeps({"b": 2.0})
    assert point(a=1.0, b=None).broken({"b": 2.0, "a": 1.0}) == ["b"]
    assert not point(a=None, b=1.0).keeps({"b": 2.0})


@pytest.mark.slow
def test_runs_give_the_same_points_on_any_number_of_workers(tmp_path: Path) -> None:
    problem = known_problem(tmp_path, LIMIT, checks=[{"a.u_Boolean": True}])
    one, two = (tune(problem, 30, 1, workers) for workers in (1, 2))
    assert one == two
    formulas, _ = computed(problem, 30)
    assert [p.gains for p in one.points[:13]] == [p.gains for p in formulas.points[:13]]
    for point in one.points:
        g, u = point.gains
        assert point.figures["slowness"] == pytest.approx(1.0 / (g * u), rel=1e-12)
        assert point.figures["effort"] == pytest.approx(g * g + u * u, rel=1e-9)
    (check,) = one.checks
    assert one.tuned is not None
    assert check.name == "{'a.u_Boolean': True}"
    assert (check.start, check.tuned) == (one.start, one.tuned)


def failing(tmp_path: Path, variable: str) -> Problem:
    """The problem with another gain: a run ends early where that is below 0.1."""
    problem = known_problem(tmp_path, None)
    condition = problem.conditions[0]
    near = replace(condition, system=problem.system.with_values({variable: 0.11}))
    gains = (*problem.gains, Gain((variable,), 0.05, 0.2))
    return replace(problem, gains=gains, conditions=(near,))


@pytest.mark.slow
def test_a_run_that_fails_is_a_broken_limit(tmp_path: Path) -> None:
    found = tune(failing(tmp_path, "a.error_at"), 40, 1, 1)
    assert found.limits == {"effort": 5.0}  # as the system's own gains reach it
    failed = [p for p in found.points if p.gains[2] < 0.0999]
    assert 0 < len(failed) < len(found.points)
    for p in failed:
        assert p.figures == {"slowness": None, "effort": None}
        assert p.error is not None
        assert "a: " in p.error
    assert found.tuned is not None
    assert found.tuned not in failed


@pytest.mark.slow
def test_a_run_that_ends_its_process_is_one_too(tmp_path: Path) -> None:
    points = tune(failing(tmp_path, "a.crash_at"), 14, 1, 1).points
    lost = [p for p in points if p.gains[2] < 0.0999]
    assert 0 < len(lost) < len(points)
    assert all("the process of the run ended by signal" in str(p.error) for p in lost)


@pytest.mark.slow
def test_a_limit_of_gains_that_reach_nothing_needs_a_number(tmp_path: Path) -> None:
    problem = replace(known_problem(tmp_path), limits={"sometimes": None})
    big = problem.system.with_values({"a.gain": 8.0})
    wrong = replace(problem, conditions=(replace(problem.conditions[0], system=big),))
    with pytest.raises(InputError, match=r"a run of them has no sometimes; must be a number$"):
        tune(wrong, 20, 1, 1)
    assert tune(problem, 20, 1, 1).limits == {"sometimes": 2.0}  # the greatest of its entries


def test_what_is_asked_for_is_checked_before_any_run(tmp_path: Path) -> None:
    problem = known_problem(tmp_path)
    with pytest.raises(
        InputError, match=r"^budget = 12: must be a whole number 13 to 1000000, for 2 "
    ):
        tune(problem, 12)
    with pytest.raises(InputError, match=r"^seed = -1: must be a whole number from 0$"):
        tune(problem, 60, -1)
