"""The published simulation, run again through the FMUs."""

import json

import pytest
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.grasp.published.compared import compared
from grasp_cosim.grasp.published.evaluation import as_report
from support.cases import CASES

pytestmark = pytest.mark.slow


@pytest.fixture(scope="session")
def report(natives, made_once):
    """What evaluate() returns, but of steps of 0.5 ms."""

    def fill(folder):
        system = System.load(SYSTEM, natives).with_experiment(step=5e-4)
        evidence = compared(system, "simulation", workers=2, progress=False)
        (folder / "report.json").write_text(json.dumps(as_report(evidence, "simulation")))

    return json.loads((made_once("evaluate", fill) / "report.json").read_text())


def test_contact_times_are_within_a_tenth_of_a_second(report):
    rows = [r for r in report["rows"] if r["finger"]]
    assert len(rows) == 24
    assert max(abs(r["simulated"] - r["published"]) for r in rows) <= 0.10


@pytest.mark.parametrize("case", [1, 2])
def test_steps_of_a_half_millisecond_will_do(grasp, report, case):
    """Contact times are within 1 ms of those at 0.1 ms, with which the command runs."""
    fine = simulate(grasp.with_values(CASES[case]), step=1e-4, stop=2.6).metrics
    coarse = {
        r["finger"]: r["simulated"]
        for r in report["rows"]
        if (r["condition"], r["case"]) == (0.03, case) and r["finger"]
    }
    assert [coarse[1], coarse[2]] == pytest.approx(fine["time_to_contact"], abs=1e-3)


def test_time_differences_are_within_3_hundredths_of_a_second(report):
    rows = [r for r in report["rows"] if not r["finger"]]
    assert len(rows) == 12
    assert max(abs(r["simulated"] - r["published"]) for r in rows) <= 0.03


def test_every_claim_of_the_paper_holds(report):
    assert len(report["claims"]) == 7
    assert [claim for claim in report["claims"] if not claim["holds"]] == []


def test_the_published_figures_are_those_of_the_paper(report):
    by_key = {(r["condition"], r["case"], r["finger"]): r["published"] for r in report["rows"]}
    assert by_key[0.03, 1, 1] == 1.15
    assert by_key[0.05, 1, 2] == 2.56
    assert by_key[0.01, 2, None] == 0.03


def test_the_second_column_is_an_earlier_contact(report):
    rows = [r for r in report["rows"] if r["finger"]]
    assert all(r["simulated_at_0.37_mm"] < r["simulated"] for r in rows)
    assert report["rms"]["contact_times"] == pytest.approx(0.060, abs=0.005)
    assert report["rms"]["contact_times_at_0.37_mm"] == pytest.approx(0.020, abs=0.005)
