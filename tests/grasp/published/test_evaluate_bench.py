"""The published experiments on the bench preset."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.grasp.presets import SYSTEM, with_preset
from grasp_cosim.grasp.published.compared import close, compared
from grasp_cosim.grasp.published.evaluation import as_report
from support.cases import CASES

QUIET = {f"sensor_{j}.noise.enabled": False for j in (1, 2)}
"""Then contact times are those that the fit left, not those of one draw of the noise."""


@pytest.fixture(scope="session")
def bench(natives):
    return with_preset(System.load(SYSTEM, natives), "bench")


@pytest.fixture(scope="session")
def report(bench, made_once):
    """What evaluate(bench=True) returns, but without noise and of steps of 2 ms."""

    def fill(folder):
        quiet = bench.with_values(QUIET).with_experiment(step=2e-3)
        evidence = compared(quiet, "experiment", workers=2, progress=False)
        (folder / "report.json").write_text(json.dumps(as_report(evidence, "experiment")))

    made = made_once("evaluate_bench", fill)
    return json.loads((made / "report.json").read_text())


def test_the_preset_has_every_stage_on_and_a_seed_for_each_sensor(bench):
    for stage in ("ambient", "noise", "adc", "filter", "median"):
        for j in (1, 2):
            assert bench.start(f"sensor_{j}.{stage}.enabled") == 1.0
    assert bench.start("sensor_1.noise.seed") != bench.start("sensor_2.noise.seed")
    assert bench.step_ns == 100_000


def test_the_preset_has_friction(bench):
    assert bench.start("plant.friction.coulomb[2]") == pytest.approx(1.338, abs=0.001)
    assert bench.start("plant.friction.viscous[1]") == pytest.approx(35.77, abs=0.01)


def test_a_system_that_the_preset_does_not_fit_is_refused(grasp):
    plant = replace(grasp.components[0], values={"force[1]": 0.0, "force[2]": 0.0})
    other = replace(grasp, name="other.toml", components=(plant,), connections=())
    with pytest.raises(
        InputError, match=r"\[presets.bench\].* sensor_1.*: no component 'sensor_1'"
    ):
        with_preset(other, "bench")


def test_run_takes_the_preset_too(command):
    code, _, _ = command("run", "--preset", "bench", "--stop", "0.01", "--out", "results", "--json")
    assert code == 0
    values = json.loads(Path("results/run.json").read_text())["components"]["plant"]["values"]
    assert values["friction.coulomb[2]"] == pytest.approx(1.34, abs=0.01)


@pytest.mark.slow
def test_noise_hardly_moves_a_contact_at_the_steps_of_the_bench(bench):
    values = {**CASES[2], "plant.initial_object_position": 0.05}
    noisy, quiet = (
        close(bench.with_values({**values, **more}), after=0.0).metrics["time_to_contact"]
        for more in ({}, QUIET)
    )
    assert noisy != quiet
    assert noisy == pytest.approx(quiet, abs=0.01)


@pytest.mark.slow
def test_every_claim_holds_but_that_of_brown_and_white(report):
    """With these reflectances the fingers touch some ms further apart than in any published row."""
    assert len(report["claims"]) == 7
    (failing,) = (claim["text"] for claim in report["claims"] if not claim["holds"])
    assert failing.startswith("Brown and white")


@pytest.mark.slow
def test_contact_times_are_as_near_as_the_fit_left_them(report):
    assert report["rms"]["contact_times"] == pytest.approx(0.277, abs=0.002)
    assert report["rms"]["contact_times"] < 0.35


@pytest.mark.slow
def test_every_published_figure_has_its_row(report):
    assert len(report["rows"]) == (6 + 7) * 2 * 3
    assert len(report["runs"]) == 12 * len(CASES)
    for row in report["rows"]:
        assert row["difference"] == row["simulated"] - row["published"]


@pytest.mark.slow
def test_every_number_has_a_unit(report):
    units = report["units"]
    named = [*report["rows"], *report["runs"]]
    assert {name for entry in named for name in entry} - {"table", "finger", "case"} <= set(units)
    assert (units["rms"], units["simulated"], units["condition"]) == ("s", "s", "m")
    assert (units["time_to_contact"], units["peak_contact_force"]) == ("s", "N")
