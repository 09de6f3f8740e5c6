"""The command sweep: its table, its summary, and one line per mistake."""

import csv
import json
from pathlib import Path

import pytest

SHORT = ("--case", "0", "--set", "experiment.step=1e-3", "--stop", "0.02", "--workers", "1")
WIDTH = ("--vary", "plant.object_width=0.06,0.07")
MASS = ("--vary", "plant.finger_mass[1]=0.5,0.6")


def rows(path):
    with Path(path).open(encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.mark.slow
def test_a_grid_leaves_its_table_and_a_picture(command):
    code, out, err = command("sweep", *WIDTH, *MASS, *SHORT, "--plot", "--json")
    found = json.loads(out)
    assert (code, found["runs"], found["failed"]) == (0, 4, 0)
    assert found["varied"] == ["plant.object_width", "plant.finger_mass[1]"]
    assert found["units"]["plant.finger_mass[1]"] == "kg"
    assert found["metrics"]["target_position"]["runs"] == 4
    assert found["metrics"]["time_difference"]["runs"] == 0
    assert "drew sweep.png" in err
    assert Path("sweep.png").stat().st_size > 10_000
    table = rows("sweep.csv")
    assert [(r["plant.object_width [m]"], r["plant.finger_mass[1] [kg]"]) for r in table] == [
        ("0.06", "0.5"), ("0.06", "0.6"), ("0.07", "0.5"), ("0.07", "0.6"),
    ]  # fmt: skip
    code, out, _ = command("sweep", "--table", "sweep_in.csv", *SHORT)
    assert code == 2
    Path("rows.csv").write_text("plant.object_width [mm],plant.finger_mass[1]\n60,0.6\n")
    code, out, err = command("sweep", "--table", "rows.csv", *SHORT, "--out", "made/here.csv")
    assert code == 0, err
    assert out.splitlines()[0] == "1 run, 0 failed"
    (row,) = rows("made/here.csv")
    assert {**row, "index": "1"} == table[1]


@pytest.mark.slow
def test_where_every_run_fails_the_result_is_negative(command):
    code, out, _ = command("sweep", "--vary", "plant.object_width=-1,-2", *SHORT)
    assert code == 2  # the first row does not fit
    code, out, _ = command("sweep", "--vary", "plant.finger_mass[1]=1e-9,2e-9", *SHORT)
    assert code in (1, 2)
    assert "the first that failed, 0: " in out or code == 2
