"""Commands on a machine for which pythonfmu has no binary: they run the native twins."""

import json
import shutil
import zipfile
from pathlib import Path

import pytest
from grasp_cosim import System, simulate
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.interface.obstacles import this_platform
from grasp_fmus import package
from grasp_fmus.build import build_block
from support.marks import needs_compiler

HERE = this_platform("2.0")
LACKS = f"has a binary for linux64 (RISC-V), win64 only; this machine: {HERE}"
SHORT = ("--step", "1e-3", "--stop", "0.3")
SPRING = Path(__file__).parents[2] / "docs/spring_plant.py"


def for_another(binary):
    """A library as it would be for another processor."""
    return binary[:18] + (243).to_bytes(2, "little") + binary[20:]


@pytest.fixture
def foreign(fmus, tmp_path):
    """The FMUs of the grasp, and one that has no twin, as if pythonfmu's binary were for another
    processor than this.
    """
    folder = tmp_path / "foreign"
    folder.mkdir()
    for name in ("GripperPlant", "ProximitySensor", "GraspController", "SpringPlant"):
        file = f"{name}.fmu"
        own = name == "SpringPlant"
        built = build_block(SPRING, tmp_path / "own").path if own else fmus / file
        with zipfile.ZipFile(built) as whole, zipfile.ZipFile(folder / file, "w") as made:
            for member in whole.namelist():
                data = whole.read(member)
                made.writestr(member, for_another(data) if member.endswith(".so") else data)
    return folder


@pytest.fixture
def other_machine(command, foreign, monkeypatch, tmp_path):
    """Runs a command line where the FMUs of the built-in grasp are those."""
    system = System.load(SYSTEM, foreign)
    monkeypatch.setattr("grasp_cosim.grasp.system.as_named", lambda: system)
    return command


@needs_compiler
def test_run_takes_the_native_twins(other_machine, grasp, foreign):
    code, out, err = other_machine("run", *SHORT, "--json", "--out", "run")
    assert (code, err) == (0, "")
    assert json.loads(out)["steps"] == 300
    ran = json.loads(Path("run/run.json").read_text())["fmus"]
    assert all("native_twin_of" in component for component in ran.values())
    simulate(grasp, step=1e-3, stop=0.3).to_csv(Path("python.csv"))
    assert Path("run/signals.csv").read_bytes() == Path("python.csv").read_bytes()


@needs_compiler
def test_nothing_is_said_where_they_were_asked_for(other_machine):
    assert other_machine("run", "--step", "1e-3", "--stop", "0.01", "--native")[::2] == (0, "")


def test_python_is_refused(other_machine, foreign):
    assert other_machine("run", *SHORT, "--python") == (
        2,
        "",
        f"grasp-cosim: plant: {foreign}/GripperPlant.fmu {LACKS}; its native twin must run\n",
    )


@pytest.mark.usefixtures("no_compiler")
@pytest.mark.parametrize("arguments", [("run",), ("evaluate",)])
def test_without_a_compiler_one_line_says_what_brings_one(other_machine, foreign, arguments):
    code, out, err = other_machine(*arguments)
    assert (code, out) == (2, "")
    assert err.startswith(f"grasp-cosim: plant: {foreign}/GripperPlant.fmu {LACKS}; no C compiler")
    assert err.endswith("pip install ziglang\n")
    assert err.count("\n") == 1


@needs_compiler
@pytest.mark.slow
def test_build_makes_native_ones_too(command, tmp_path, monkeypatch):
    folder = tmp_path / "pythonfmu"
    shutil.copytree(package.package_folder("pythonfmu"), folder)
    binary = folder / "resources/binaries/linux64/libpythonfmu-export.so"
    binary.write_bytes(for_another(binary.read_bytes()))
    find = package.package_folder
    monkeypatch.setattr(
        package, "package_folder", lambda name: folder if name == "pythonfmu" else find(name)
    )
    shutil.copy(SPRING, ".")
    code, out, err = command("build", SPRING.name)
    assert (code, out) == (0, "fmus/build/SpringPlant.fmu: new\nfmus/native/SpringPlant.fmu: new\n")
    assert err == f"built native FMUs, too: fmus/build/SpringPlant.fmu {LACKS}\n"
    swap = ("--swap", "plant=fmus/build/SpringPlant.fmu", *SHORT)
    code, _, err = command("run", *swap)
    assert code == 0
    assert err == ""
