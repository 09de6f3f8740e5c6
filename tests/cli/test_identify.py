"""The command identify."""

import csv
import json
import re
import tomllib
from pathlib import Path

import pytest
from conftest import Run
from grasp_cosim import System, simulate
from grasp_cosim.grasp.identification.fit import Estimate, Fit
from grasp_cosim.recording.result import Result

TRUE = {"plant.friction.coulomb[1]": 0.6, "plant.friction.coulomb[2]": 1.3}


@pytest.fixture(scope="module")
def recorded(grasp: System) -> Result:
    return simulate(grasp.with_values(TRUE), step=1e-3, stop=1.0)


@pytest.mark.parametrize("kind", ["csv", "mf4"])
def test_friction_from_a_log(command: Run, recorded: Result, kind: str) -> None:
    if kind == "mf4":
        pytest.importorskip("asammdf")
    recorded.to_csv("signals.csv") if kind == "csv" else recorded.to_mdf("signals.mf4")
    code, out, err = command(
        "identify", "--log", f"signals.{kind}", "--out", "identified", "--json"
    )
    assert code == 0
    note = "signals.csv: there is no run.json beside it; its values are taken to be in SI units\n"
    assert err == (note if kind == "csv" else "")
    found = json.loads(out)
    assert found == json.loads(Path("identified/identification.json").read_text())
    values = {p["name"]: p["value"] for p in found["parameters"]}
    assert {n: values[n] for n in TRUE} == pytest.approx(TRUE, rel=0.01)
    assert found["unit"] == "N"
    assert "95 %" in found["assumptions"]
    assert {row["finger"] for row in found["rows"]} == {1, 2}
    with Path("identified/residuals.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(found["rows"])


def test_the_values_fit_into_a_system(command: Run, recorded: Result, grasp: System) -> None:
    recorded.to_csv("signals.csv")
    code, out, _ = command(
        "identify", "--log", "signals.csv", "--fit", "coulomb", "--out", "identified"
    )
    assert code == 0
    assert re.search(r"plant\.friction\.coulomb\[1\] +0\.6\d* N, \[0\.\d+, 0\.\d+\]", out)
    values = tomllib.loads(Path("identified/values.toml").read_text())["values"]
    assert values == pytest.approx(TRUE, rel=0.01)
    assert grasp.with_values(values).start("plant.friction.coulomb[2]") == values[list(TRUE)[1]]


@pytest.mark.slow
def test_contact_times_have_a_residual_for_every_row(
    command: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    import numpy as np

    estimate = Estimate("plant.friction.coulomb[1]", "N", 0.0, None, "at its lower bound")
    monkeypatch.setattr(
        "grasp_cosim.cli.commands.identify.identify_from_times",
        lambda *_, **__: Fit((estimate,), np.linspace(-0.1, 0.1, 40), 9),
    )
    code, out, _ = command("identify", "--fit", "coulomb")
    assert code == 0
    assert "the published experiments, 40 contact times" in out
    assert "0 N, at its lower bound" in out
    assert "equal conditions scatter by 0.143 s, which no fit explains" in out
    assert len(re.findall(r"^  condition .* residual -?0\.\d{3}$", out, re.MULTILINE)) == 40


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--log", "a.csv", "--times", "b.csv"), "--log a.csv: must not come with --times"),
        (("--log", "a.csv"), "a.csv: no such log; must be a .csv or .mf4 file"),
        (
            ("--log", "a.csv", "--fit", "ratio"),
            "--log a.csv: --fit ratio: cannot be fitted; valid: c",
        ),
        (("--fit", "mass"), "identify: --fit mass: cannot be fitted; valid: coulomb"),
        (("--times", "b.csv"), "b.csv: No such file or directory; must be a table"),
        (("--set", "plant.nothing=1"), "--set plant.nothing: "),
        (("--set", "plant"), "--set 'plant': must be PLACE=VALUE"),
        (("--out", "/proc/nowhere"), "/proc/nowhere: cannot write"),
    ],
)
def test_wrong_input_is_one_line(
    command: Run, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    code, out, err = command("identify", *arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"grasp-cosim: {message}")
    assert len(err.splitlines()) == 1
    assert list(tmp_path.iterdir()) == []


def test_ctrl_c_is_130(command: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object, **__: object) -> Fit:
        raise KeyboardInterrupt

    monkeypatch.setattr("grasp_cosim.cli.commands.identify.identify_from_times", interrupted)
    code, out, err = command("identify")
    assert (code, out, err.split()) == (130, "", ["grasp-cosim:", "interrupted"])
