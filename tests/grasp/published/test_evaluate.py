"""The published simulation, run again through the FMUs."""

import csv
import json
from pathlib import Path
from typing import Any

import pytest
from conftest import MadeOnce
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.grasp.published.evaluate import evaluate
from support.cases import CASES

pytestmark = pytest.mark.slow


@pytest.fixture(scope="session")
def made(natives: Path, made_once: MadeOnce) -> Path:
    """The folder with what is written, and what is returned beside it. At 0.5 ms."""

    def fill(folder: Path) -> None:
        system = System.load(SYSTEM, natives).with_experiment(step=5e-4)
        report = evaluate(system, folder / "out", workers=2, progress=False)
        (folder / "returned.json").write_text(json.dumps(report))

    return made_once("evaluate", fill)


@pytest.fixture(scope="session")
def out(made: Path) -> Path:
    return made / "out"


@pytest.fixture(scope="session")
def report(made: Path) -> dict[str, Any]:
    found: dict[str, Any] = json.loads((made / "returned.json").read_text())
    return found


def test_contact_times_are_within_a_tenth_of_a_second(report: dict[str, Any]) -> None:
    rows = [r for r in report["rows"] if r["finger"]]
    assert len(rows) == 24
    assert max(abs(r["simulated"] - r["published"]) for r in rows) <= 0.10


@pytest.mark.parametrize("case", [1, 2])
def test_steps_of_a_half_millisecond_will_do(
    grasp: System, report: dict[str, Any], case: int
) -> None:
    """Contact times are within 1 ms of those at 0.1 ms, with which the command runs."""
    fine = simulate(grasp.with_values(CASES[case]), step=1e-4, stop=2.6).metrics
    coarse = {
        r["finger"]: r["simulated"]
        for r in report["rows"]
        if (r["condition"], r["case"]) == (0.03, case) and r["finger"]
    }
    assert [coarse[1], coarse[2]] == pytest.approx(fine["time_to_contact"], abs=1e-3)


def test_time_differences_are_within_3_hundredths_of_a_second(report: dict[str, Any]) -> None:
    rows = [r for r in report["rows"] if not r["finger"]]
    assert len(rows) == 12
    assert max(abs(r["simulated"] - r["published"]) for r in rows) <= 0.03


def test_every_claim_of_the_paper_holds(report: dict[str, Any]) -> None:
    assert len(report["claims"]) == 7
    assert [claim for claim in report["claims"] if not claim["holds"]] == []


def test_the_published_figures_are_those_of_the_paper(report: dict[str, Any]) -> None:
    by_key = {(r["condition"], r["case"], r["finger"]): r["published"] for r in report["rows"]}
    assert by_key[0.03, 1, 1] == 1.15
    assert by_key[0.05, 1, 2] == 2.56
    assert by_key[0.01, 2, None] == 0.03


def test_the_second_column_is_an_earlier_contact(report: dict[str, Any]) -> None:
    rows = [r for r in report["rows"] if r["finger"]]
    assert all(r["simulated_at_0.37_mm"] < r["simulated"] for r in rows)
    assert report["rms"]["contact_times"] == pytest.approx(0.060, abs=0.005)
    assert report["rms"]["contact_times_at_0.37_mm"] == pytest.approx(0.020, abs=0.005)


def test_everything_is_written(report: dict[str, Any], out: Path) -> None:
    names = {path.name for path in out.iterdir()}
    pictures = {"contact_forces.png", "target_position.png", "contact_times.png"}
    assert names == {*pictures, "evaluation.csv", "evaluation.json", "report.md"}
    assert json.loads((out / "evaluation.json").read_text()) == report
    text = (out / "report.md").read_text()
    assert all(f"]({name})" in text for name in pictures)
    assert all((out / name).stat().st_size > 10_000 for name in pictures)
    with (out / "evaluation.csv").open() as file:
        assert len(list(csv.DictReader(file))) == 36
