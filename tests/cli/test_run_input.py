"""run --input: columns for inputs of a system file, of an archive and of a swapped FMU."""

import json
from pathlib import Path

import pytest
from grasp_cosim import System, load_run
from grasp_cosim.ssp.to_archive import write_ssp
from support.native_fmus import needs_gcc
from support.native_systems import driven

pytestmark = needs_gcc
TEXT = "time,a.u_Real\n0,0\n1,10\n"
INPUT = '[input]\nfile = "drive.csv"\n'


def last(folder):
    return float(load_run(folder)["a.y_Real"][-1])


def test_inputs_of_a_system_file(command, tmp_path):
    driven(tmp_path, TEXT)
    code, _, err = command("run", "driven.toml", "--input", "drive.csv", "--out", "out")
    assert code == 0, err
    assert "drive.csv drives a.u_Real (linear)" in err
    assert last("out") == pytest.approx(9.0)
    assert json.loads(Path("out/run.json").read_text())["input"]["file"] == "drive.csv"
    held = ("--input", "drive.csv", "--set", "input.interpolation=held")
    assert command("run", "driven.toml", *held, "--out", "out")[0] == 0
    assert last("out") == 0.0


def test_what_is_wrong_is_one_line(command, tmp_path):
    driven(tmp_path, TEXT)
    for more, said in (
        ([], "input a.u_Real has no source"),
        (["--input", "none.csv"], "none.csv: no such input file"),
        (
            ["--input", "drive.csv", "--set", "a.u_Real=1"],
            "--set a.u_Real: does nothing, as drive.csv drives it",
        ),
        (["--input", "wrong.csv"], "wrong.csv: line 1, column 3, b.w: no component 'b'; valid: a"),
    ):
        Path("wrong.csv").write_text("time,a.u_Real,b.w\n0,1,1\n", "utf-8")
        code, out, err = command("run", "driven.toml", *more)
        assert (code, out) == (2, "")
        assert said in err.splitlines()[-1]


def test_a_misspelt_column_of_an_input_without_a_source(command, tmp_path):
    text = driven(tmp_path, TEXT).read_text("utf-8")
    (tmp_path / "driven.toml").write_text(text.replace("values = { u_Real = 0, ", "values = { "))
    for column, said in (
        (
            "a.u_Raal",
            "drive.csv: line 1, column 2, a.u_Raal: no input 'a.u_Raal'; did you mean a.u",
        ),
        ("b.u_Real", "drive.csv: line 1, column 2, b.u_Real: no component 'b'; valid: a"),
    ):
        Path("drive.csv").write_text(f"time,{column}\n0,7\n", "utf-8")
        code, _, err = command("run", "driven.toml", "--input", "drive.csv")
        assert code == 2
        assert said in err


def test_an_archive_whose_input_would_keep_its_start_value(command, tmp_path):
    system = System.load(driven(tmp_path, TEXT, more=INPUT))
    write_ssp(system, tmp_path / "a.ssp")
    assert command("run", "a.ssp", "--out", "out")[0] == 0
    assert last("out") == pytest.approx(9.0)
    Path("drive.csv").write_text("time,a.u_Real\n0,5\n", "utf-8")
    assert command("run", "a.ssp", "--input", "drive.csv", "--out", "out")[0] == 0
    assert last("out") == 5.0
