"""run --step-study: what it prints and writes, its exit codes, its mistakes in one line."""

import json
import re
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from conftest import Run
from grasp_cosim import System
from grasp_cosim.convergence.step_study import StepRun, StepStudy, ask
from grasp_cosim.metrics.metric import Metric


@pytest.fixture
def invented(monkeypatch: pytest.MonkeyPatch) -> list[tuple[System, float]]:
    """In place of the runs, contact times that err by the step; collects what was asked for."""
    asked: list[tuple[System, float]] = []

    def study(
        system: System,
        tolerance: float | None,
        *,
        of: Sequence[str],
        metrics: Sequence[Metric],
        workers: int,
        progress: bool,
    ) -> StepStudy:
        question = ask(system, of, tolerance, metrics)
        asked.append((system, question.tolerance))
        first, second = question.quantities
        steps = [system.step_ns * 2**i for i in range(4)]
        runs = tuple(
            StepRun(
                ns,
                {first: 1.0 + 1e-9 * ns, second: None},
                {"plant.exchange_energy[1]": 1e-6 * ns},
            )
            for ns in steps
        )
        return StepStudy(
            system.name, system.scheme, 3.0, system.step_ns, question.tolerance, question.unit,
            question.quantities, runs,
        )  # fmt: skip

    monkeypatch.setattr("grasp_cosim.cli.step_study.step_study", study)
    return asked


@pytest.mark.slow
def test_the_grasp(command: Run) -> None:
    code, out, err = command(
        "run", "--step-study", "--python", "--step", "3.2e-3", "--stop", "1.92",
        "--tolerance", "5e-6",
    )  # fmt: skip
    assert code == 1
    assert err == ""
    assert "no step here keeps time_to_contact within 0.005 ms; the finest is 0.8 ms" in out
    assert "time_to_contact[1]: limit 1.88694" in out
    assert "time_to_contact[2]: limit 1.89719" in out
    orders = re.findall(r"observed order ([\d.]+)", out)
    assert [float(order) for order in orders] == pytest.approx([1.0, 1.0], abs=0.1)


def test_it_is_told_the_system_as_the_options_change_it(
    command: Run, invented: list[tuple[System, float]]
) -> None:
    command(
        "run", "--step-study", "--set", "plant.object_width=0.06", "--step", "2e-4", "--stop", "1",
        "--scheme", "jacobi", "--case", "1", "--tolerance", "0.002",
    )  # fmt: skip
    ((system, tolerance),) = invented
    assert tolerance == 0.002
    assert (system.step_ns, system.stop_ns, system.scheme) == (200_000, 1_000_000_000, "jacobi")
    assert system.start("plant.object_width") == 0.06
    controller = system.component("controller", "test")
    assert controller.values["simultaneous_contact.enabled"] is False


def test_the_exit_code_says_whether_the_step_is_short_enough(
    command: Run, invented: list[tuple[System, float]]
) -> None:
    code, out, _ = command("run", "--step-study")
    assert (code, invented[0][1]) == (0, 1e-3)
    assert "the system's own, 0.1 ms, does" in out
    code, out, _ = command("run", "--step-study", "--tolerance", "5e-5")
    assert code == 1
    assert "no step here keeps" in out


@pytest.mark.usefixtures("invented")
def test_json_is_all_there_is_on_standard_output(command: Run) -> None:
    code, out, err = command("run", "--step-study", "--python", "--json")
    found: dict[str, Any] = json.loads(out)
    assert (code, err, found["holds"]) == (0, "", True)
    assert found["largest_step"] == 8e-4


@pytest.mark.usefixtures("invented")
def test_files(command: Run, tmp_path: Path) -> None:
    asked = ("--python", "--out", "results", "--plot", "--json")
    code, out, err = command("run", "--step-study", *asked)
    folder = tmp_path / "results"
    assert code == 0
    assert sorted(p.name for p in folder.iterdir()) == ["step_study.json", "step_study.png"]
    assert json.loads((folder / "step_study.json").read_text()) == json.loads(out)
    assert err == "drew results/step_study.png\n"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--tolerance", "1e-3"], "--tolerance 0.001: must come with --step-study"),
        (["--step-study", "--tolerance", "0"], "tolerance = 0.0 s: must be a number greater"),
        (["--step-study", "--tolerance", "nan"], "tolerance = nan s: must be a number greater"),
        (
            ["--step-study", "--stop", "1e-8", "--step", "1e-8"],
            "steps that fit the stop time: only",
        ),
        (["--step-study", "--out", "/proc/none"], "cannot write to /proc"),
    ],
)
def test_a_mistake_is_one_line(command: Run, arguments: list[str], message: str) -> None:
    code, out, err = command("run", *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert err.count("\n") == 1
