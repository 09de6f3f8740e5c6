"""run: what it prints, writes, draws and says; what drives and paces it; its settings."""

import json
import math
import os
import re
import sys
from pathlib import Path

import pytest
from grasp_cosim import System, load_run, simulate
from grasp_cosim.grasp.presets import SYSTEM
from ssp.hand_made import archive, component, fmu, structure, system
from support.grasps import CASES
from support.marks import slow
from support.native_fmus import TYPES, build, needs_gcc
from support.native_systems import driven

PNG = b"\x89PNG"

METRICS = {
    "time_to_contact", "time_difference", "impact_velocity", "impact_impulse",
    "peak_contact_force", "steady_contact_force", "force_overshoot", "settling_time",
    "force_difference", "object_drift",
    "object_shift", "target_position", "wall_time", "real_time_factor", "steps", "scheme", "step",
}  # fmt: skip


def test_one_json_object(command, grasp):
    code, out, err = command("run", "--stop", "0.2", "--case", "0", "--json")
    metrics = json.loads(out)
    assert (code, err) == (0, "")
    assert set(metrics) >= METRICS
    assert "realtime" not in metrics
    same = simulate(grasp.with_values(CASES[0]), stop=0.2).metrics
    assert metrics["time_to_contact"] == same["time_to_contact"]
    assert metrics["time_to_contact"] == [pytest.approx(0.100, abs=2e-3), None]
    assert metrics["time_difference"] is None
    assert (metrics["steps"], metrics["step"], metrics["scheme"]) == (2000, 1e-4, "sequential")


def test_a_table_with_what_the_plant_tells_of_the_object(command, fmus):
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


def test_with_another_fmu_its_own_values_are_taken_or_said(command, fmus, tmp_path):
    text = SYSTEM.read_text("utf-8").replace("object_width = 0.07", 'object_width = "6 cm"')
    file = tmp_path / "wide.toml"
    file.write_text(re.sub(r'fmu = "', f'fmu = "{fmus.as_posix()}/', text), "utf-8")
    short = ("--step", "1 ms", "--stop", "10 ms", "--set", "plant.finger_mass[1]=400 g", "--json")
    swap = ("--swap", f"plant={fmus / 'GripperPlant.fmu'}")
    widths = {}
    for own in ((), ("--own-values",)):
        code, _, err = command("run", file, *short, *swap, *own, "--out", "made")
        assert code == 0, err
        said = [line for line in err.splitlines() if "the values of the system stay" in line]
        assert [line.partition("stay: ")[2].partition(";")[0] for line in said] == [
            "object_width = 0.06 m (its own is 0.07 m)"
        ] * (not own)
        made = json.loads((tmp_path / "made/run.json").read_text("utf-8"))["components"]["plant"]
        widths[own] = made["values"]
    assert widths == {
        (): {"object_width": 0.06, "initial_object_position": 0.03, "finger_mass[1]": 0.4},
        ("--own-values",): {"finger_mass[1]": 0.4},
    }
    code, _, err = command("run", file, "--own-values")
    assert (code, err) == (2, "grasp-cosim: --own-values: does nothing without --swap\n")


def test_what_is_set_is_in_the_settings_of_the_run(command, fmus, tmp_path):
    """The gaps are taken for mm: the sensors see a thousandth of them."""
    line = (
        f"--swap plant={fmus}/GripperPlant.fmu --case 1 --set plant.initial_object_position=0.05 "
        "--set components.plant.units.gap[1]=mm --set components.plant.units.gap[2]=mm "
        "--set components.plant.isolation=process --scheme jacobi --step 1e-3 --stop 0.01 "
        "--set components.sensor_1.step=2e-3 --out out --every 2"
    )
    code, _, err = command("run", *line.split())
    assert code == 0, err
    run = json.loads((tmp_path / "out/run.json").read_text("utf-8"))
    assert (run["scheme"], run["step"], run["stop"]) == ("jacobi", 1e-3, 0.01)
    plant = run["components"]["plant"]
    assert plant["values"]["initial_object_position"] == 0.05
    assert (plant["isolation"], plant["units"]) == ("process", {"gap[1]": "mm", "gap[2]": "mm"})
    assert run["components"]["sensor_1"]["step"] == 2e-3
    assert run["units"]["plant.gap[1]"] == "mm"
    assert len((tmp_path / "out/signals.csv").read_text().splitlines()) == 7


def test_a_bug_is_one_line_and_exit_3(command, monkeypatch):
    monkeypatch.setattr("grasp_cosim.cli.run.simulate", lambda *_, **__: math.sqrt(-1.0))
    code, out, err = command("run")
    assert (code, out, err.count("\n")) == (3, "", 1)
    assert err.startswith("grasp-cosim: ValueError: ")


# ------------------------------------------------------------------ pictures


@pytest.fixture
def sensor_toml(tmp_path, fmus):
    """A system that is no grasp."""
    (tmp_path / "sensor.toml").write_text(
        "[experiment]\nstep = 1e-3\nstop = 0.02\n"
        f'[components.sensor]\nfmu = "{fmus / "ProximitySensor.fmu"}"\nvalues = {{ gap = 0.02 }}\n'
    )


@pytest.mark.usefixtures("sensor_toml")
@pytest.mark.parametrize(
    ("arguments", "pictures"),
    [
        (["--step", "1e-3", "--stop", "0.02"], ["grasp.png"]),
        slow(["sensor.toml", "--realtime"], ["signals.png", "timing.png"]),
    ],
)
def test_what_there_is_to_draw_is_drawn(arguments, pictures, command, tmp_path):
    code, _, err = command("run", *arguments, "--plot", "--out", "results")
    assert code == 0
    found = sorted(path.name for path in (tmp_path / "results").iterdir())
    assert found == sorted([*pictures, "run.json", "signals.csv"])
    for name in pictures:
        assert (tmp_path / "results" / name).read_bytes().startswith(PNG)
        assert f"drew results/{name}\n" in err


@pytest.mark.usefixtures("sensor_toml")
def test_without_matplotlib_a_run_is_refused_at_once(command, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command("run", "sensor.toml", "--realtime", "--plot", "--out", "results")
    assert code == 2
    assert "matplotlib is not installed" in err
    assert "pip install 'matplotlib>=" in err
    assert not (tmp_path / "results").exists()


# ------------------------------------------------------------------ in real time

PACED = ["run", "--realtime", "--set", "realtime.factor=1000", "--step", "1e-3", "--stop", "0.5"]


def test_the_timing_is_in_the_json_and_in_the_folder(command, tmp_path):
    code, out, err = command(
        *PACED, "--set", "realtime.overrun=continue", "--out", "results", "--json"
    )
    assert (code, err) == (0, "")
    printed = json.loads(out)
    assert printed["realtime"]["steps"] == printed["steps"] == 500
    assert printed["realtime"]["overrun"] == "continue"
    assert load_run(tmp_path / "results").timing.as_dict() == printed["realtime"]


def test_people_are_told_how_it_kept_to_the_clock(command):
    code, out, err = command(*PACED, "--python")
    assert (code, err) == (0, "")
    _, _, told = out.partition("paced at ")
    lines = told.splitlines()
    assert "of real time, asked for 1000: a step every 0.001 ms" in lines[0]
    assert [line[:22].rstrip() for line in lines[1:4]] == [
        "step computes", "start is late by", "overruns",
    ]  # fmt: skip
    assert "the machine is too slow for this system: a step takes " in lines[-1]


@pytest.mark.usefixtures("sensor_toml")
def test_a_run_that_stops_at_an_overrun_fails_and_keeps_what_there_is(command, tmp_path):
    paced = "--realtime --set realtime.factor=1e5 --set realtime.overrun=stop --plot --out results"
    code, out, err = command("run", "sensor.toml", *paced.split())
    assert (code, out) == (3, "")
    *_, kept, error = err.splitlines()
    assert kept == "kept what was recorded, in results"
    assert error.startswith("grasp-cosim: sensor.toml: the step at t = 0 s ended ")
    assert error.endswith("ms; must end within 1e-05 ms")
    timing = load_run(tmp_path / "results").timing
    assert (timing.overruns, timing.steps) == (1, 1)
    assert (tmp_path / "results/timing.png").read_bytes().startswith(PNG)


def test_a_cpu_that_is_not_there_is_a_mistake(command, tmp_path):
    code, out, err = command(*PACED, "--set", "realtime.cpu=65536", "--out", "results")
    assert (code, out) == (2, "")
    assert err.startswith("grasp-cosim: cpu = 65536: no such CPU here; must be from 0 to ")
    assert not (tmp_path / "results").exists()


def test_what_is_refused_is_on_standard_error(command, monkeypatch, caplog):
    monkeypatch.delattr(os, "sched_setaffinity", raising=False)
    code, out, err = command(*PACED, "--set", "realtime.cpu=0", "--python", "--json")
    assert code == 1
    assert "verdict: privileges that the system refused: 1; must be at most 0" in err
    assert json.loads(out)["realtime"]["refused"] == caplog.messages
    assert caplog.messages == ["CPU 0: not possible on this operating system"]


# ------------------------------------------------------------------ columns for inputs

TEXT = "time,a.u_Real\n0,0\n1,10\n"


def last(command, system, *arguments):
    """The last value of the output that is what is driven, and what was said."""
    code, _, err = command("run", system, *arguments, "--out", "out")
    assert code == 0, err
    return float(load_run("out")["a.y_Real"][-1]), err


@needs_gcc
def test_inputs_of_a_system_file(command, tmp_path):
    driven(tmp_path, TEXT)
    value, said = last(command, "driven.toml", "--input", "drive.csv")
    assert value == pytest.approx(9.0)
    assert "drive.csv drives a.u_Real (linear)" in said
    assert json.loads(Path("out/run.json").read_text())["input"]["file"] == "drive.csv"
    held = ("--input", "drive.csv", "--set", "input.interpolation=held")
    assert last(command, "driven.toml", *held)[0] == 0.0


@needs_gcc
@pytest.mark.parametrize(
    ("columns", "more", "said"),
    [
        (None, [], "no source for a.u_Real"),
        ("a.u_Real", ["--set", "a.u_Real=1"], "--set a.u_Real: does nothing, as drive.csv drives"),
        ("a.u_Real,b.w", [], "drive.csv: line 1, column 3, b.w: no component 'b'; valid: a"),
        ("a.u_Raal", [], "column 2, a.u_Raal: no input or tunable parameter 'a.u_Raal'; did"),
    ],
)
def test_columns_that_fit_no_input(command, tmp_path, columns, more, said):
    text = driven(tmp_path, TEXT).read_text("utf-8")
    (tmp_path / "driven.toml").write_text(text.replace("values = { u_Real = 0, ", "values = { "))
    if columns:
        Path("drive.csv").write_text(f"time,{columns}\n0{',7' * (1 + columns.count(','))}\n")
        more = ["--input", "drive.csv", *more]
    code, out, err = command("run", "driven.toml", *more)
    assert (code, out) == (2, "")
    assert said in err.splitlines()[-1]


# ------------------------------------------------------------------ remarks

REMARK = "first.y_Float64 -> second.u_Float64: second.u_Float64 has no unit, taken to be in m"


@pytest.fixture
def two(command, tmp_path):
    """Two parts, of which the second one's input has no unit, and which fails where that is set."""
    build(tmp_path, "first", "3.0", units={"y_Float64": "m"})
    build(tmp_path, "second", "3.0")
    starts = {"Boolean": "false", "String": "''", "Enumeration": "1"}
    others = "\n".join(f"u_{t} = {starts.get(t, '0')}" for t in list(TYPES["3.0"])[1:])
    (tmp_path / "two.toml").write_text(
        'connections = ["first.y_Float64 -> second.u_Float64"]\n'
        "[experiment]\nstep = 0.1\nstop = 1.0\n"
        '[components]\nfirst.fmu = "first.fmu"\nsecond.fmu = "second.fmu"\n'
        f"[components.first.values]\nu_Float64 = 45.0\n{others}\n"
        f"[components.second.values]\n{others}\n"
    )
    return lambda *more: command("run", "two.toml", *more)


@needs_gcc
def test_a_remark_is_made_once_and_before_a_failure(two):
    code, _, err = two()
    assert (code, err.splitlines().count(REMARK), "whole run" in err) == (0, 1, False)
    code, out, err = two("--set", "second.error_at=0.35")
    assert (code, out) == (3, "")
    remark, *_, failure = err.splitlines()
    assert remark == REMARK
    assert failure.startswith("grasp-cosim: second: second.fmu returned error at t = 0.3 s")
    assert "(inputs: u_Float64 = 45, " in failure


TIMES = {
    "--stop 0.1005 --set experiment.start=0.0505": (50, 0.0505, 0.1005),
    "--set experiment.stop=0.1005 --set experiment.start=0.0505": (50, 0.0505, 0.1005),
    "--step 1/30 --set experiment.start=1/3 --stop 2/3": (10, 1 / 3, 2 / 3),
    "--step 7e-4 --stop 0.07 --set components.sensor_1.step=1.4e-3": (100, 0.0, 0.07),
}
"""Options of one call, each of which alone would not fit; steps, start and stop."""


@pytest.mark.parametrize("options", TIMES)
@pytest.mark.parametrize("form", ["toml", "ssp"])
def test_the_times_of_one_call_are_taken_together(command, fmus, tmp_path, form, options):
    text = SYSTEM.read_text().replace("step = 1e-4", "step = 1e-3")
    (tmp_path / "grasp.toml").write_text(text.replace('fmu = "', f'fmu = "{fmus}/'))
    if form == "ssp":
        slow = ["--set", "components.sensor_1.step=2e-3"] if "sensor_1" in options else []
        assert command("ssp", "grasp.toml", "-o", "grasp.ssp", *slow)[0] == 0
    code, _, err = command("run", f"grasp.{form}", *options.split(), "--out", "out")
    assert code == 0, err
    run = load_run("out")
    steps, start, stop = TIMES[options]
    assert (run.metrics["steps"], run.time[0], run.time[-1]) == (steps, start, stop)


def test_a_foreign_archive_gets_them_as_it_is_read(tmp_path):
    """With them it names no step, and no stop that its own start would fit."""
    ssd = structure(system("top", component("a")), '<ssd:DefaultExperiment startTime="5.0"/>')
    path = archive(tmp_path, ssd, {"a": fmu("output Real y")})
    loaded = System.load(path, step="1/30", stop="1/3", start="-1/3")
    assert loaded.total_steps == 20
