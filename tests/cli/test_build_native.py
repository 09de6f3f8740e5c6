"""build --native: what it writes, says, refuses, and with which exit code."""

import json
import sys
from pathlib import Path

import c_compilers
import pytest
from c_compilers import CompilerError
from grasp_cosim.interface.read import describe
from grasp_fmus.native.targets import here
from support.kinds import TRANSLATED
from support.marks import needs_zig
from support.native_fmus import needs_gcc

ROOT = Path(__file__).parents[2]
SPRING = ROOT / "docs/spring_plant.py"

pytestmark = needs_gcc


@pytest.mark.slow
def test_builds_all(command):
    code, out, err = command("build", "--native")
    assert (code, err) == (0, "")
    assert {*out.splitlines()} == {f"fmus/native/{name}.fmu: new" for name in TRANSLATED}
    code, out, err = command("build", "--native")
    assert (code, err) == (0, "")
    assert {line.partition(": ")[2] for line in out.splitlines()} == {"unchanged"}


def test_json_names_files_and_notes(command, natives):
    code, out, err = command("build", "--native", "--json", "--out", natives)
    report = json.loads(out)
    assert (code, err) == (0, "")
    assert report["notes"] == []
    assert report["fmus"] == [*report["built"]]
    assert {Path(fmu).parent for fmu in report["fmus"]} == {natives}


def test_one_by_name_and_one_of_ones_own(command):
    assert command("build", "--native", "ProximitySensor") == (
        0, "fmus/native/ProximitySensor.fmu: new\n", "",
    )  # fmt: skip
    code, out, err = command("build", "--native", SPRING, "--fmi", "3", "--out", "mine")
    assert (code, out, err) == (0, "mine/SpringPlant.fmu: new\n", "")
    found = describe(Path("mine/SpringPlant.fmu"))
    assert (found.version, found.python, found.sources) == ("3.0", False, True)


def test_what_is_built_is_said_before_the_compiler_runs(command, monkeypatch):
    def ended(*_):
        raise CompilerError("out of patience")

    monkeypatch.setattr("grasp_cosim.base.progress.EVERY", 0.0)
    monkeypatch.setattr("grasp_fmus.build.build_native", ended)
    line = f"building for {here().tuple}, 00:00\ngrasp-cosim: out of patience\n"
    assert command("build", "--native") == (3, "", line)


def test_no_compiler_is_one_line_with_its_fix(command, monkeypatch, tmp_path):
    monkeypatch.setattr(c_compilers, "find_zig", lambda: None)
    code, _, err = command("build", "--native", "--target", "win64")
    assert (code, err.count("\n")) == (2, 1)
    fix = f"must be zig; {sys.executable} -m pip install ziglang\n"
    assert err == f"grasp-cosim: build: no C compiler for x86_64-windows-gnu: {fix}"
    monkeypatch.setenv("PATH", str(tmp_path))
    code, _, err = command("build", "--native")
    assert (code, err.count("\n")) == (2, 1)
    assert err.endswith(f"{sys.executable} -m pip install ziglang\n")


@pytest.mark.slow
def test_c_alone(command):
    code, out, err = command("build", "--native", "--c-only", "one", "GraspController")
    assert (code, err) == (0, "")
    assert "one/GraspController.h: written" in out.splitlines()
    code, out, _ = command("build", "--native", "--c-only", "own", SPRING, "--json")
    assert "own/main.c" in json.loads(out)["files"]
    code, out, err = command("build", "--native", "--c-only", "all")
    assert (code, err) == (0, "")
    assert {path.parent.name for path in Path("all").glob("*/main.c")} == {*TRANSLATED}
    for path in Path("one").iterdir():
        assert path.read_bytes() == (Path("all/GraspController") / path.name).read_bytes()
    assert not Path("fmus").exists()


@needs_zig
@pytest.mark.platforms
def test_for_others(command):
    """The first time in a folder for what is kept, the libraries of zig are made."""
    targets = "linux64,win64,darwin64,aarch64-linux"
    code, out, err = command("build", "--native", "GraspController", "--target", targets)
    assert (code, out) == (0, "fmus/native/GraspController.fmu: new\n")
    assert err.startswith("FMI 2.0 has one folder for both, linux64: x86_64-linux is there, ")
    assert err.count("\n") == 1
    found = describe(Path("fmus/native/GraspController.fmu"))
    assert found.platforms == ("aarch64-linux", "darwin64", "linux64", "win64")
    code, out, err = command("inspect", "fmus/native/GraspController.fmu")
    assert code == 0
    assert "there is: aarch64-linux, darwin64, linux64, win64; this machine: linux64" in out
    code, out, err = command(
        "build", "--native", "GraspController", "--target", "aarch64-linux", "--fmi", "3"
    )
    assert (code, err) == (0, "")
    found = describe(Path("fmus/native/GraspController.fmu"))
    assert found.platforms == ("aarch64-linux", "x86_64-linux")


def test_inspect_says_that_it_needs_no_python(command, natives):
    fmu = natives / "GripperPlant.fmu"
    code, out, _ = command("inspect", "--load", fmu)
    assert code == 0
    assert "problem " not in out
    assert "native, needs no Python" in out
    assert "sources             yes, in C" in out
    code, out, _ = command("inspect", fmu)
    assert "platforms           linux64; this machine: linux64" in out
    assert "Python              not needed" in out
    assert json.loads(command("inspect", fmu, "--json")[1])["sources"] is True
