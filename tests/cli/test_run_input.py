"""run --input: columns for inputs of a system file, of an archive and of a swapped FMU."""

import json
import zipfile
from pathlib import Path

import pytest
from grasp_cosim import System, load_run, simulate
from grasp_cosim.comparison.qualify import qualify
from grasp_cosim.ssp.to_archive import write_ssp
from support.native_fmus import build, needs_gcc
from support.stimuli import driven

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


def test_an_fmu_that_is_swapped_in(command, tmp_path):
    """The file has no a.u_Real before, and the new FMU no other source for it."""
    system = driven(tmp_path, "time,a.u_Integer\n0,3\n")
    system.write_text(
        system.read_text()
        .replace("native.fmu", "bare.fmu")
        .replace("[components.a]", "[components.b]\nfmu = 'native.fmu'\nvalues = { u_Real = 1, "
                 "u_Integer = 1, u_Boolean = false, u_Enumeration = 1, u_String = '' }\n"
                 "[components.a]")
        .replace("values = { u_Real = 0, ", "values = { ")
    )  # fmt: skip
    build(tmp_path, "native", "2.0")
    with zipfile.ZipFile("native.fmu") as whole, zipfile.ZipFile("bare.fmu", "w") as bare:
        for name in whole.namelist():
            data = whole.read(name)
            if name == "modelDescription.xml":
                data = data.replace(b'"u_Real" valueReference="100" causality="input"',
                                    b'"u_Real" valueReference="100" causality="local"')  # fmt: skip
                data = data.replace(b'<Real start="0"/>', b"<Real/>", 1)
            bare.writestr(name, data)
    Path("drive.csv").write_text("time,a.u_Integer,a.u_Real\n0,3,7\n", "utf-8")
    code, _, err = command("run", "driven.toml", "--input", "drive.csv")
    assert code == 2
    assert "column 3, a.u_Real: no input 'a.u_Real'" in err
    swap = ("--swap", "a=native.fmu")
    code, _, err = command("run", "driven.toml", "--input", "drive.csv", *swap, "--out", "out")
    assert code == 0, err
    assert last("out") == 7.0


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


@pytest.mark.slow
def test_a_qualification_is_driven_too(tmp_path):
    path = driven(tmp_path, TEXT, more=INPUT)
    build(tmp_path, "other", "2.0", {"u_Real": "N"})
    assert qualify(System.load(path), "a", tmp_path / "other.fmu").qualified
    result = simulate(System.load(path))
    assert result["a.y_Real"][-1] == pytest.approx(9.0)
