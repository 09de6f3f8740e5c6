"""The command identify."""

import csv
import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import simulate
from grasp_cosim.grasp.identification import identification
from grasp_cosim.grasp.identification.fit import Estimate, Fit

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
    note = "signals.csv: there is no run.json beside it; its values are taken to be in SI units\n"
    assert err == (note if kind == "csv" else "")
    found = json.loads(out)
    estimated = {p["name"]: p["value"] for p in found["parameters"]}
    assert {n: estimated[n] for n in TRUE} == pytest.approx(TRUE, rel=0.01)
    assert found["unit"] == "N"
    assert {row["finger"] for row in found["rows"]} == {1, 2}
    with Path("identified/residuals.csv").open() as file:
        residuals = [float(row["residual"]) for row in csv.DictReader(file)]
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
