"""qualify, sweep and identify: what they print and write, and their exit codes."""

import csv
import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.grasp.identification import identification
from grasp_cosim.grasp.identification.fit import Estimate, Fit
from grasp_cosim.grasp.presets import SYSTEM
from support.native_fmus import needs_gcc
from support.native_systems import write_integrator

STEP = ("--set", "experiment.step=1e-3")
HERE = ("--stop", "0.05", *STEP, "--set", "components.plant.isolation=none", "--python")


def test_a_copy_is_qualified(command, fmus):
    code, out, err = command("qualify", fmus / "GripperPlant.fmu", "--as", "plant", *HERE)
    assert (code, err) == (0, "")
    lines = out.splitlines()
    assert lines[0] == (
        "QUALIFIED: GripperPlant.fmu as plant (now GripperPlant.fmu), "
        "0.05 s in steps of 1 ms, sequential"
    )
    assert re.fullmatch(
        r"0 of \d+ signals and 0 of 7 metrics out of band; nothing was touched until t = 0.05 s: "
        r"12 metrics have no value in either run: time_to_contact\[1\], .*",
        lines[1],
    )
    assert "interface: no difference" in lines


@pytest.mark.slow
def test_a_system_file_has_the_candidate_with_its_names_and_values(command, fmus, tmp_path):
    """A heavier finger, and gaps under other names: what the file says of it, and nothing else."""
    text = SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/')
    path = tmp_path / "mine.toml"
    path.write_text(text.replace("object_width = 0.07,", '"finger_mass[2]" = 0.6,'), "utf-8")
    code, out, _ = command("qualify", path, "--as", "plant", *HERE, "--json")
    report = json.loads(out)
    assert (code, report["qualified"]) == (1, False)
    outside = {s["name"] for s in report["signals"] if not s["inside"]}
    assert "plant.position[2]" in outside
    assert "plant.position[1]" not in outside
    path.write_text(text, "utf-8")
    assert command("qualify", path, "--as", "plant", *HERE)[0] == 0
    path.write_text(text.replace("components.plant", "components.gripper"), "utf-8")
    code, _, err = command("qualify", path, "--as", "plant", *HERE)
    assert (code, err.count("\n")) == (2, 1)


def test_a_candidate_that_does_not_fit_is_not_run_nor_drawn(command, fmus):
    Path("page.html").write_text("of an earlier one")
    sensor = fmus / "ProximitySensor.fmu"
    code, out, err = command("qualify", sensor, "--as", "plant", "--python", "-o", "page.html")
    assert (code, err) == (1, "no page page.html: there were no two runs\n")
    assert "not run, the interface does not fit: force[1], " in out
    assert not Path("page.html").exists()


# ------------------------------------------------------------------ sweep

SHORT = ("--case", "0", *STEP, "--stop", "0.02", "--workers", "1")
VARIED = ("--vary", "plant.object_width=0.06,0.07", "--vary", "plant.finger_mass[1]=0.5,0.6")


def rows(path):
    with Path(path).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_a_grid_leaves_its_table_and_a_picture(command):
    code, out, err = command("sweep", *VARIED, *SHORT, "--plot", "--json")
    found = json.loads(out)
    assert (code, found["runs"], found["failed"]) == (0, 4, 0)
    assert found["varied"] == ["plant.object_width", "plant.finger_mass[1]"]
    assert found["units"]["plant.finger_mass[1]"] == "kg"
    counts = [found["metrics"][name]["runs"] for name in ("target_position", "time_difference")]
    assert counts == [4, 0]
    assert "drew sweep.png" in err
    assert Path("sweep.png").stat().st_size > 10_000
    table = rows("sweep.csv")
    assert [(r["plant.object_width [m]"], r["plant.finger_mass[1] [kg]"]) for r in table] == [
        ("0.06", "0.5"), ("0.06", "0.6"), ("0.07", "0.5"), ("0.07", "0.6"),
    ]  # fmt: skip
    Path("rows.csv").write_text("plant.object_width [mm],plant.finger_mass[1]\n60,0.6\n")
    code, out, err = command("sweep", "--table", "rows.csv", *SHORT, "--out", "made/here.csv")
    assert code == 0, err
    assert out.splitlines()[0] == "1 run, 0 failed"
    (row,) = rows("made/here.csv")
    assert {**row, "index": "1"} == table[1]


@needs_gcc
@pytest.mark.slow
@pytest.mark.parametrize(("values", "code"), [("0.035,0.055", 1), ("0.035,1e9", 0)])
def test_where_every_run_fails_the_result_is_negative(command, tmp_path, values, code):
    write_integrator(tmp_path)
    vary = ("--vary", f"a.error_at={values}", "--workers", "1", "--metrics", "mine.py")
    done, out, err = command("sweep", "system.toml", *vary)
    assert done == code, err
    assert "0: " in out


# ------------------------------------------------------------------ identify

TRUE = {"plant.friction.coulomb[1]": 0.6, "plant.friction.coulomb[2]": 1.3}


@pytest.fixture(scope="module")
def recorded(grasp):
    return simulate(grasp.with_values(TRUE), step=1e-3, stop=1.0)


@pytest.mark.parametrize("kind", ["csv", "mf4"])
def test_friction_from_a_log(command, recorded, grasp, kind):
    if kind == "mf4":
        pytest.importorskip("asammdf")
    recorded.to_csv("signals.csv") if kind == "csv" else recorded.to_mdf("signals.mf4")
    code, out, err = command("identify", f"signals.{kind}", "--out", "identified", "--json")
    assert code == 0
    note = "signals.csv: there is no run.json next to it; its values are taken to be in SI units\n"
    assert err == (note if kind == "csv" else "")
    found = json.loads(out)
    estimated = {p["name"]: p["value"] for p in found["parameters"]}
    assert {n: estimated[n] for n in TRUE} == pytest.approx(TRUE, rel=0.01)
    assert found["unit"] == "N"
    assert {row["finger"] for row in found["rows"]} == {1, 2}
    residuals = [float(row["residual"]) for row in rows("identified/residuals.csv")]
    assert residuals == [row["residual"] for row in found["rows"]]
    values = tomllib.loads(Path("identified/values.toml").read_text())["values"]
    assert values == pytest.approx(estimated, rel=1e-5)
    name = "plant.friction.coulomb[2]"
    assert grasp.with_values(values).start(name) == values[name]


@pytest.mark.parametrize(
    ("table", "data"),
    [
        ("", "the published experiments, 40 contact times"),
        ("x_m,case,finger,time\n0.03,2,1,2.1\n0.03,2,2,2.2\n", "times.csv, 2 contact times"),
    ],
)
def test_contact_times_are_known_by_their_columns(command, monkeypatch, table, data):
    def found(_, contacts, *__):
        estimate = Estimate("plant.friction.coulomb[1]", "N", 0.0, None, "at its lower bound")
        return Fit((estimate,), np.linspace(-0.1, 0.1, len(contacts)), 9)

    monkeypatch.setattr(identification, "identify_from_times", found)
    Path("times.csv").write_text(table)
    code, out, _ = command("identify", *(["times.csv"] if table else []), "--fit", "coulomb")
    assert code == 0
    assert out.startswith(data)
    assert "0 N, at its lower bound" in out
    assert ("equal conditions scatter by 0.143 s, which no fit explains" in out) != bool(table)
