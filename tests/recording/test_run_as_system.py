"""A run.json as a system: the run again, with the same bits; and what it refuses."""

import json
import shutil

import pytest
from grasp_cosim import InputError, System, cli, load_run, simulate


def same_bits(one, two):
    return list(one) == list(two) and all(one[n].tobytes() == two[n].tobytes() for n in one)


@pytest.fixture
def recorded(grasp, tmp_path):
    """A short run with much in its settings, in a folder."""
    system = grasp.with_settings(
        {
            "plant.initial_object_position": 0.02, "experiment.scheme": "jacobi",
            "components.controller.step": "2e-3", "realtime.factor": 3.0,
        }
    )  # fmt: skip
    system = system.with_record("plant.*", "!plant.velocity*", "sensor_1.reflectance")
    result = simulate(system, step=1e-3, stop=0.05)
    result.save(tmp_path / "run")
    return result, tmp_path / "run" / "run.json"


def test_a_run_json_is_the_system_that_ran(recorded):
    result, file = recorded
    system = System.load(file)
    again = simulate(system)
    assert same_bits(result, again)
    assert again.settings | {"changed": {}} == result.settings | {"changed": {}}


def test_a_trigger_and_limits_of_metrics_are_in_it(grasp, tmp_path):
    system = grasp.with_experiment(step=1e-2, stop=2.5)
    system = system.with_record(trigger="plant.contact[1] == true", before=0.05, after=0.1)
    system = system.with_settings(
        {
            "verdict.metrics.time_difference.high": 0.05,
            "verdict.metrics.peak_contact_force[1].low": 1,
        }
    )
    result = simulate(system)
    result.save(tmp_path / "run")
    again = simulate(System.load(tmp_path / "run" / "run.json"))
    assert again.verdict == result.verdict
    assert len(again.verdict) == 3
    [window], [found] = result.windows, again.windows
    load_run(tmp_path / "run").save(tmp_path / "copy")
    for folder in ("run", "copy"):
        of_window = System.load(tmp_path / folder / window.subfolder / "run.json")
        assert same_bits(window, simulate(of_window).windows[0])
    assert window.time.tolist() == found.time.tolist()
    assert same_bits(window, found)


def test_the_command_runs_it(recorded, tmp_path):
    result, file = recorded
    assert cli.main(["run", str(file), "--out", str(tmp_path / "again")]) == 0
    assert same_bits(result, load_run(tmp_path / "again"))


def test_events_faults_limits_and_stimuli_are_in_it(grasp, tmp_path):
    table = tmp_path / "drive.csv"
    table.write_text("time,sensor_2.reflectance\n0,1\n0.02,0.5\n")
    file = tmp_path / "grasp.toml"
    assert cli.main(["init", str(file)]) == 0
    text = file.read_text()
    file.write_text(
        text
        + '\n[[events]]\nat = 0.01\nset = { "sensor_1.reflectance" = 0.7 }\n'
        + '\n[[faults]]\nconnection = "plant.gap[1] -> sensor_1.gap"\nkind = "noise"\n'
        + "standard_deviation = 1e-4\nseed = 5\nfrom = 0.01\n"
        + '\n[[limits]]\nwhen = "plant.gap[1] < 1e-9"\nthen = "warn"\n'
    )
    out = tmp_path / "run"
    options = ["--step", "1/3000", "--stop", "0.04", "--input", str(table)]
    assert cli.main(["run", str(file), *options, "--out", str(out)]) == 0
    run = load_run(out)
    assert same_bits(run, simulate(System.load(out / "run.json")))
    table.unlink()
    with pytest.raises(InputError, match=r"input\.file = 'drive\.csv': is not there; must be the"):
        System.load(out / "run.json")


def test_paths_go_along_with_a_run_that_is_saved_elsewhere(recorded, tmp_path):
    result, file = recorded
    load_run(file.parent).save(tmp_path / "deep" / "copy")
    again = System.load(tmp_path / "deep" / "copy" / "run.json")
    assert same_bits(result, simulate(again))


def test_an_fmu_that_is_another_one_or_missing_is_refused(recorded, tmp_path):
    _, file = recorded
    run = json.loads(file.read_text())
    fmu, ran = run["components"]["plant"]["fmu"], run["fmus"]["plant"]
    path = (file.parent / ran["path"]).resolve()
    for change, reason in (
        ({"sha256": "0" * 64}, r"GripperPlant\.fmu': .* is not the FMU that ran; must be the FMU"),
        ({"path": "nowhere/it.fmu"}, r"GripperPlant\.fmu': is not there; must be the FMU that"),
    ):  # fmt: skip
        damaged = {**run, "fmus": {**run["fmus"], "plant": {**ran, **change}}}
        file.write_text(json.dumps(damaged))
        with pytest.raises(InputError, match=reason):
            System.load(file)
    shutil.copy(path, file.parent / fmu)
    assert System.load(file).by_name["plant"].fmu == file.parent / fmu


def test_what_a_run_json_cannot_say_is_refused(recorded):
    _, file = recorded
    run = json.loads(file.read_text())
    with pytest.raises(InputError, match=r"only an \.ssp may have variants"):
        System.load(file, variant="other")
    file.write_text(json.dumps({**run, "units": {**run["units"], "grip": "N"}}))
    with pytest.raises(InputError, match="grip: outputs of the system itself are not in a run"):
        System.load(file)
    file.write_text(json.dumps({**run, "roles": {"plant": "plant"}, "realtime": {"factor": 2}}))
    with pytest.raises(InputError, match=r"realtime: reads as .* not as it ran; must be the file"):
        System.load(file)
