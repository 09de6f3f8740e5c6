"""The command ssp, and run on an archive."""

import json

import pytest
from grasp_cosim.cli import main
from grasp_cosim.grasp.presets import SYSTEM
from ssp.hand_made import archive, component, fmu, structure, system


@pytest.fixture
def toml(fmus, tmp_path):
    """The grasp as a system file beside links to its FMUs."""
    path = tmp_path / "mine.toml"
    path.write_text(SYSTEM.read_text("utf-8"), encoding="utf-8")
    for file in fmus.glob("*.fmu"):
        (tmp_path / file.name).symlink_to(file)
    return path


def metrics(text):
    report = json.loads(text)
    return {k: v for k, v in report.items() if k not in ("wall_time", "real_time_factor")}


def test_a_system_file_becomes_an_archive_that_runs_the_same(toml, capsys):
    path = toml.with_suffix(".ssp")
    assert main(["ssp", str(toml), "-o", str(path)]) == 0
    said = capsys.readouterr()
    assert said.out.splitlines()[0] == f"{path}: written"
    assert "SSP has no form for the step, 0.0001 s: OSP and OMSimulator read it" in said.err
    runs = []
    for file in (toml, path):
        assert main(["run", str(file), "--step", "1e-3", "--stop", "0.1", "--json"]) == 0
        runs.append(metrics(capsys.readouterr().out))
    assert runs[0] == runs[1]


def test_json(toml, capsys):
    path = toml.with_suffix(".ssp")
    assert main(["ssp", str(toml), "-o", str(path), "--json"]) == 0
    said = capsys.readouterr()
    report = json.loads(said.out)
    assert said.err == ""
    assert report["ssp"] == str(path)
    assert report["entries"][0] == "SystemStructure.ssd"
    assert report["components"] == ["plant", "sensor_1", "sensor_2", "controller"]
    assert report["connections"] == 10
    assert [note.partition(", ")[0] for note in report["notes"]] == [
        "SSP has no form for the step",
        "SSP has no form for the scheme",
    ]


def test_a_wrong_name_is_one_line(toml, capsys):
    assert main(["ssp", str(toml), "-o", str(toml.with_suffix(".zip"))]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.count("\n") == 1
    assert "must be a file named like system.ssp" in said.err


def test_an_archive_without_a_step_says_how_to_give_one(tmp_path, capsys):
    ssd = structure(system("top", component("a", "output y")))
    path = archive(tmp_path, ssd, {"a": fmu("output Real y -", step="")})
    assert main(["run", str(path)]) == 2
    assert "give one: --set experiment.step" in capsys.readouterr().err
    assert main(["run", str(path), "--step", "1e-3"]) == 2  # now it is the FMU that has no code
    said = capsys.readouterr().err
    assert "order of execution: a" in said
    assert "a.fmu has no binary at all" in said
