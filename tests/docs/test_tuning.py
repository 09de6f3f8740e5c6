"""What docs/tuning.md says is what its command gives, and its picture what that draws."""

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from grasp_cosim import System
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.grasp.tuning import (
    default_conditions,
    default_gains,
    default_limits,
    defaults,
    grasp_time,
)
from grasp_cosim.parallel import Crew
from grasp_cosim.progress import Progress
from grasp_cosim.tuning.problem import Problem
from grasp_cosim.tuning.search import Runs
from support.campaign import only_whole
from support.pictures import assert_same_picture

DOCS = Path(__file__).parents[2] / "docs"
PAGE = (DOCS / "tuning.md").read_text("utf-8")
(OUTPUT,) = re.findall(r"```\n(least .*?)\n```", PAGE, re.DOTALL)
COMMANDS = re.findall(r"^    grasp-cosim (tune .*)$", PAGE, re.MULTILINE)

Run = Callable[..., tuple[int, str, str]]


def numbers(title: str) -> list[float]:
    """The numbers of a row of the output: published, tuned, limit or bounds."""
    (row,) = re.findall(rf"^{re.escape(title)} .*$", OUTPUT, re.MULTILINE)
    return [float(x) for x in re.findall(r"(?<= )-?[\d.]+(?= |$)", row)]


@pytest.mark.slow
def test_both_sets_of_gains_reach_what_the_page_says(natives: Path) -> None:
    system = System.load(SYSTEM, natives).with_experiment(defaults()["step"], defaults()["stop"])
    conditions = default_conditions(system)
    problem = Problem(
        default_gains(system), "grasp_time", default_limits(), conditions, (), (grasp_time,)
    )
    gains = [numbers(gain.name)[:2] for gain in problem.gains]
    assert problem.start == tuple(published for published, _ in gains)
    with Crew(1) as crew:
        runs = Runs(problem, crew, Progress("", shown=False))
        both = runs.points([problem.start, tuple(tuned for _, tuned in gains)])
    for name in problem.names:
        metric = problem.metric(name)
        reached = [float(f"{metric.factor * (p.figures[name] or 0.0):.3f}") for p in both]
        assert reached == numbers(metric.title)[:2], name
    assert both[1].keeps({name: both[0].figures[name] or 0.0 for name in problem.limits})


@pytest.mark.slow
@pytest.mark.campaign
@only_whole("takes more than a minute")
def test_the_command_prints_and_draws_what_is_on_the_page(command: Run, tmp_path: Path) -> None:
    """The search is the same to the bit."""
    _, out, _ = command(*COMMANDS[0].split())
    assert out.rstrip("\n") == OUTPUT
    assert_same_picture(tmp_path / "tuned/tuning.png", DOCS / "tuning.png", "make pictures")


@pytest.mark.parametrize("line", COMMANDS)
def test_every_command_is_one_that_there_is(
    command: Run, line: str, tmp_path: Path, fmus: Path
) -> None:
    """With a budget that is too small, which is said once all else is right."""
    shutil.copy(SYSTEM, tmp_path / "my_system.toml")
    for name in ("GripperPlant", "ProximitySensor", "GraspController"):
        shutil.copy(fmus / f"{name}.fmu", tmp_path)
    code, _, err = command(*line.split(), "--budget", "1", "--python")
    assert code == 2
    (said,) = err.splitlines()
    assert said.startswith("grasp-cosim: budget = 1: must be ")
