"""The command line: what it writes, one line per mistake, exit codes."""

import json
import math
import re
import sys
from pathlib import Path

import pytest
from grasp_cosim import cli, simulate
from support.cases import CASES

METRICS = {
    "time_to_contact", "time_difference", "impact_velocity", "impact_impulse",
    "peak_contact_force", "steady_contact_force", "force_overshoot", "settling_time",
    "force_difference", "object_drift",
    "object_shift", "target_position", "wall_time", "real_time_factor", "steps", "scheme", "step",
}  # fmt: skip


def test_run_prints_one_json_object(command, grasp):
    code, out, err = command("run", "--stop", "0.2", "--case", "0", "--json")
    metrics = json.loads(out)
    assert (code, err) == (0, "")
    assert set(metrics) >= METRICS
    same = simulate(grasp.with_values(CASES[0]), stop=0.2).metrics
    assert metrics["time_to_contact"] == same["time_to_contact"]
    assert metrics["time_to_contact"][0] == pytest.approx(0.100, abs=2e-3)
    assert metrics["time_to_contact"][1] is None
    assert metrics["time_difference"] is None
    assert (metrics["steps"], metrics["step"], metrics["scheme"]) == (2000, 1e-4, "sequential")


def test_run_prints_a_table_with_what_the_plant_tells_of_the_object(command, fmus):
    plant = f"plant={fmus / 'GripperPlantCompliant.fmu'}"
    arguments = ("--stop", "0.2", "--case", "0", "--step", "1e-3")
    code, out, _ = command("run", *arguments, "--swap", plant)
    assert code == 0
    table = {line[:22].rstrip(): line[22:] for line in out.splitlines()[1:]}
    assert list(table)[-3:] == ["object drift", "object squeezed by", "object damaged"]
    assert table["object damaged"] == "      no"
    assert re.fullmatch(r"   0\.100      none s", table["time to contact"])
    assert re.fullmatch(r" 5\d\d\.\d{3}      none mm/s", table["impact velocity"])
    assert "object damaged" not in command("run", *arguments)[1]


def test_run_takes_all_options(command, grasp):
    plant = grasp.component("plant", "test").fmu
    code, out, _ = command(
        "run", "--case", "1", "--set", "plant.initial_object_position=0.05", "--swap",
        f"plant={plant}", "--step", "1e-3", "--stop", "0.1", "--scheme", "jacobi", "--json",
    )  # fmt: skip
    metrics = json.loads(out)
    assert code == 0
    assert (metrics["steps"], metrics["step"], metrics["scheme"]) == (100, 1e-3, "jacobi")


def test_run_writes_signals_metrics_and_a_picture(command, tmp_path):
    code, _, err = command("run", "--stop", "0.01", "--out", "results", "--plot")
    assert code == 0
    assert sorted(p.name for p in (tmp_path / "results").iterdir()) == [
        "grasp.png", "run.json", "signals.csv",
    ]  # fmt: skip
    assert "drew results/grasp.png" in err
    assert (tmp_path / "results/grasp.png").read_bytes().startswith(b"\x89PNG")
    report = json.loads((tmp_path / "results/run.json").read_text())
    assert report["units"]["plant.gap[1]"] == "m"
    assert report["components"]["plant"]["values"]["object_width"] == 0.07


WRONG = [
    (["--set", "plant.object_width=0.5"], "object_width = 0.5 m .* must fit between"),
    (
        ["--set", "plant.finger_mass[1]=-0.5"],
        r"'-0.5': must be a finite number from 0.001 to 1000 kg",
    ),
    (["--set", "plant.finger_mass[2]=nan"], "'nan': must be a finite number"),
    (["--set", "sensor_1.reflectance=inf"], "'inf': must be a finite number"),
    (["--set", "plant.mass=1"], r"no input or parameter 'mass'; did you mean finger_mass\[1\]"),
    (["--set", "plnt.mass=1"], "no component 'plnt'; did you mean plant"),
    (["--set", "plant.object_width"], "must be PLACE=VALUE"),
    (["--swap", "plant=missing.fmu"], "missing.fmu: no such FMU file"),
    (["--swap", "plant"], "must be COMPONENT=FMU"),
    (["--swap", "hand=x.fmu"], "no component 'hand'; valid: plant"),
    (["--step", "0"], "step = 0.0 s: must be a number greater than 0"),
    (["--step", "-1e-3"], "step = -0.001 s: must be a number greater than 0"),
    (["--step", "nan"], "step = nan s: must be a number greater than 0"),
    (["--step", "7e-4"], "does not divide stop = 3 s; stop could be 3.0002 s"),
    (["--step", "fast"], "'fast' is not a valid float"),
    (["--stop", "1e9"], "do not fit into memory; must have a longer step"),
    (["--case", "3"], "3 is not in the range 0<=x<=2"),
    (["--scheme", "euler"], "'euler' is not one of 'sequential', 'jacobi'"),
    (["missing.toml"], "missing.toml: no such system file"),
    (["--fast"], "No such option"),
    (["--step", "1e300"], "must be a number greater than 0, at most 1e\\+09"),
    (["--set", "sensor_1.gap=0.01"], "sensor_1.gap has two sources, the connection and a value"),
]


@pytest.mark.parametrize(("arguments", "message"), WRONG)
def test_wrong_input_is_one_line_and_exit_2(command, tmp_path, arguments, message):
    code, out, err = command("run", *arguments, "--out", "results", "--json")
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("grasp-cosim: ")
    assert re.search(message, err), err
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("command_", ["run", "build", "evaluate"])
@pytest.mark.parametrize("out", ["file", "file/below", "/proc/nowhere"])
def test_a_folder_that_cannot_be_written_is_found_at_once(command, tmp_path, command_, out):
    (tmp_path / "file").touch()
    code, _, err = command(command_, "--out", out)
    assert code == 2
    assert err.startswith(f"grasp-cosim: {out}: ")
    assert len(err.splitlines()) == 1


def test_no_arguments_show_the_help(command):
    code, out, err = command()
    assert (code, out) == (2, "")
    assert "Usage: grasp-cosim" in err


@pytest.mark.parametrize("line", ["--debug run --step 0", "run --step 0 --debug"])
def test_debug_shows_the_traceback(command, line):
    code, _, err = command(*line.split())
    assert code == 2
    assert "Traceback" in err


def test_a_bug_is_one_line_and_exit_3(command, monkeypatch):
    monkeypatch.setattr("grasp_cosim.cli.run.simulate", lambda *_, **__: math.sqrt(-1.0))
    code, out, err = command("run")
    assert (code, out) == (3, "")
    assert err.startswith("grasp-cosim: ValueError: ")
    assert len(err.splitlines()) == 1


def test_no_matplotlib_is_one_line(command, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command("run", "--stop", "0.01", "--plot")
    assert code == 2
    assert "pip install 'matplotlib>=" in err


@pytest.mark.parametrize("name", ["build", "run", "evaluate"])
def test_help_has_an_example(command, name):
    code, out, _ = command(name, "--help")
    assert code == 0
    assert f"Example: grasp-cosim {name}" in out


@pytest.mark.slow
def test_the_built_in_grasp_leaves_nothing_in_the_current_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "--stop", "0.01", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 100
    assert not list(tmp_path.iterdir())


def test_a_missing_file_without_a_name_is_told(command, monkeypatch):
    said = "grasp-cosim: no licenses/LICENSE among its metadata; install it with pip"
    missing = FileNotFoundError(said)
    monkeypatch.setattr("grasp_fmus.page.licences", lambda *_: (_ for _ in ()).throw(missing))
    monkeypatch.setenv("XDG_CACHE_HOME", str(Path("empty").absolute()))
    code, _, err = command("build")
    assert code == 2
    assert said in err


def test_a_folder_is_no_fmu(command, tmp_path):
    code, out, err = command("inspect", str(tmp_path))
    assert (code, out) == (2, "")
    assert err == f"grasp-cosim: {tmp_path}: is a folder; must be an FMU, a file\n"
