"""The command line: what it writes, one line per mistake, exit codes."""

import csv
import json
import math
import re
import sys
import zipfile
from pathlib import Path

import pytest
from grasp_cosim import cli, simulate
from grasp_fmus.shipped import blocks
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


def test_csv_holds_every_bit(command, grasp, tmp_path):
    command("run", "--stop", "0.01", "--out", "results")
    result = simulate(grasp, stop=0.01)
    with (tmp_path / "results/signals.csv").open() as file:
        rows = list(csv.reader(file))
    assert rows[0] == ["time", *result]
    assert len(rows) == 102
    for name, column in zip(rows[0][1:], list(zip(*rows[1:], strict=True))[1:], strict=True):
        assert [float(value) for value in column] == result[name].astype(float).tolist()


def test_case_1_is_layer_3_off(command):
    _, one, _ = command("run", "--stop", "0.01", "--case", "1", "--json")
    _, two, _ = command(
        "run", "--stop", "0.01", "--set", "controller.simultaneous_contact.enabled=false", "--json"
    )
    _, three, _ = command("run", "--stop", "0.01", "--json")
    target = [json.loads(text)["target_position"] for text in (one, two, three)]
    assert target[0] == target[1] != target[2]


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


def test_what_is_no_grasp_is_drawn_as_its_signals(command, fmus, tmp_path):
    fmu = fmus / "ProximitySensor.fmu"
    (tmp_path / "sensor.toml").write_text(
        "[experiment]\nstep = 1e-3\nstop = 0.01\n"
        f'[components.sensor]\nfmu = "{fmu}"\nvalues = {{ gap = 0.02 }}\n'
    )
    code, out, err = command("run", "sensor.toml", "--out", "results", "--plot")
    assert (code, err) == (0, "drew results/signals.png\n")
    assert len(out.splitlines()) == 1  # no metrics, and no word about a grasp
    written = sorted(path.name for path in (tmp_path / "results").iterdir())
    assert written == ["run.json", "signals.csv", "signals.png"]


def test_a_vendor_plant_with_one_more_input(command, altered):
    force = "    force: Force = (0.0, 0.0)\n"
    ambient = (
        '    ambient: Annotated[float, Input("temperature", unit="K", nominal=300.0)] = 300.0\n'
    )
    fmu = altered("GripperPlant", "gripper_plant/fingers.py", force, force + ambient)
    code, _, err = command("run", "--stop", "0.01", "--swap", f"plant={fmu}")
    assert code == 2
    assert "input plant.ambient has no source" in err
    assert "--set plant.ambient=VALUE" in err
    options = ["--swap", f"plant={fmu}", "--set", "plant.ambient=290", "--json"]
    assert command("run", "--stop", "0.01", *options)[0] == 0


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
    monkeypatch.setattr("grasp_cosim.cli.commands.run.simulate", lambda *_, **__: math.sqrt(-1.0))
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
def test_build_names_what_it_built(command, tmp_path):
    code, out, _ = command("build", "--out", "here", "--json")
    built = [Path(p) for p in json.loads(out)["fmus"]]
    assert code == 0
    assert [p.name for p in built] == [f"{name}.fmu" for name in blocks()]
    assert all((tmp_path / p).is_file() for p in built)


@pytest.mark.slow
def test_the_built_in_grasp_leaves_nothing_in_the_current_folder(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert cli.main(["run", "--stop", "0.01", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["steps"] == 100
    assert not list(tmp_path.iterdir())


def test_inspect_shows_the_interface(command, fmus):
    fmu = str(fmus / "ProximitySensor.fmu")
    code, out, err = command("inspect", fmu)
    assert (code, err) == (0, "")
    assert re.search(r"^intensity +output +continuous +Real +V +gap +xi, ", out, re.MULTILINE)
    code, out, _ = command("inspect", fmu, "--json")
    assert code == 0
    assert json.loads(out)["variables"][0]["name"] == "gap"


def test_inspect_of_what_is_no_fmu(command, tmp_path):
    text = tmp_path / "notes.fmu"
    text.write_text("not an archive")
    code, out, err = command("inspect", str(text))
    assert (code, out) == (2, "")
    assert err.startswith(f"grasp-cosim: {text}: not a readable FMU: ")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_inspect_finds_nothing_wrong_with_ours(command, fmus):
    code, out, err = command("inspect", "--load", str(fmus / "ProximitySensor.fmu"), "--json")
    assert (code, err) == (0, "")
    found = {f["check"]: f["status"] for f in json.loads(out)["findings"]}
    assert found["trial"] == "ok"
    assert "problem" not in found.values()


def test_inspect_finds_what_is_missing(command, fmus, tmp_path):
    bare = tmp_path / "bare.fmu"
    with zipfile.ZipFile(fmus / "ProximitySensor.fmu") as whole, zipfile.ZipFile(bare, "w") as part:
        for name in whole.namelist():
            if not name.startswith("binaries/linux64"):
                part.writestr(name, whole.read(name))
    code, out, _ = command("inspect", str(bare))
    assert code == 1
    assert re.search(r"^problem +binary +has a binary for win64 only; ", out, re.MULTILINE)
    assert "fix: " in out


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


def test_of_a_very_long_message_the_middle_is_left_out(command, tmp_path):
    (tmp_path / "long.toml").write_text(f"{'x' * 100_000} = 1\n")
    code, _, said = command("run", "long.toml")
    assert code == 2
    assert len(said) < 3000
    assert said.startswith("grasp-cosim: long.toml: unknown entry 'xxx")
    assert said.endswith(
        "; valid: components, connections, events, experiment, faults, "
        "initialisation, input, metrics, presets, realtime, roles\n"
    )
    assert "x" * 100_000 in command("--debug", "run", "long.toml")[2]
