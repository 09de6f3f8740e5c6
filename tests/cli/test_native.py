"""--native and --python: which FMUs are built and run, what is said of it, and the same bytes."""

import json
import shutil
import sys
import zipfile
from pathlib import Path

import pytest
from grasp_cosim import System
from grasp_cosim.base import c_compilers
from grasp_cosim.base.c_compilers import CompilerError
from grasp_cosim.fmu_export import package
from grasp_cosim.fmu_export.build import build_block, planned
from grasp_cosim.fmu_export.native.targets import this_target
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.inspection.block_templates import TEMPLATE_FOLDER
from grasp_cosim.interface.obstacles import this_platform
from grasp_cosim.interface.read import describe
from support.kinds import TRANSLATED
from support.marks import needs_compiler, needs_zig, slow

pytestmark = needs_compiler

SPRING = TEMPLATE_FOLDER / "spring_plant.py"
SHORT = ("--step", "1e-3", "--stop", "0.3")
SWAP = ("--swap", "plant=fmus/build/SpringPlant.fmu", *SHORT)


def ran(folder):
    """The FMUs that a recorded run names, by component."""
    return json.loads(Path(folder, "run.json").read_text())["fmus"]


def recorded(command, folder, *arguments):
    code, _, err = command("run", "--out", folder, *arguments)
    assert code == 0, err
    return Path(folder, "signals.csv").read_bytes()


# ------------------------------------------------------------------ build --native


@pytest.mark.slow
def test_builds_all(command):
    code, out, err = command("build", "--native")
    assert (code, err) == (0, "")
    assert {*out.splitlines()} == {f"fmus/native/{name}.fmu: new" for name in TRANSLATED}
    report = json.loads(command("build", "--native", "--json")[1])
    assert (report["notes"], report["fmus"]) == ([], [*report["built"]])
    assert {one["status"] for one in report["built"].values()} == {"unchanged"}


def test_one_by_name_and_one_of_ones_own(command):
    one = (0, "fmus/native/ProximitySensor.fmu: new\n", "")
    assert command("build", "--native", "ProximitySensor") == one
    own = command("build", "--native", SPRING, "--fmi", "3", "--out", "mine")
    assert own == (0, "mine/SpringPlant.fmu: new\n", "")
    found = describe(Path("mine/SpringPlant.fmu"))
    assert (found.version, found.python, found.sources) == ("3.0", False, True)


def test_what_is_built_is_said_before_the_compiler_runs(command, monkeypatch):
    def ended(*_):
        raise CompilerError("out of patience")

    monkeypatch.setattr("grasp_cosim.base.progress.EVERY", 0.0)
    monkeypatch.setattr("grasp_cosim.fmu_export.build.build_native", ended)
    line = f"building for {this_target().tuple}, 00:00\ngrasp-cosim: out of patience\n"
    assert command("build", "--native") == (3, "", line)


@pytest.mark.slow
def test_c_alone(command):
    code, out, err = command("build", "--native", "--c-only", "one", "GraspController")
    assert (code, err) == (0, "")
    assert "one/GraspController.h: written" in out.splitlines()
    code, out, _ = command("build", "--native", "--c-only", "own", SPRING, "--json")
    assert "own/main.c" in json.loads(out)["files"]
    assert command("build", "--native", "--c-only", "all")[::2] == (0, "")
    assert {path.parent.name for path in Path("all").glob("*/main.c")} == {*TRANSLATED}
    for path in Path("one").iterdir():
        assert path.read_bytes() == (Path("all/GraspController") / path.name).read_bytes()
    assert not Path("fmus").exists()
    code, out, _ = command(
        "build", "--native", "--c-only", "tool", "GraspController", "--a2l", "--json"
    )
    assert {*json.loads(out)["files"]} == {str(path) for path in Path("tool").iterdir()}
    assert Path("tool/GraspController.a2l").is_file()


@needs_zig
@pytest.mark.platforms
def test_for_others(command):
    """The first time in a folder for what is kept, the libraries of zig are made."""
    ours, fmu = ("build", "--native", "GraspController"), "fmus/native/GraspController.fmu"
    code, out, err = command(*ours, "--target", "linux64,win64,darwin64,aarch64-linux")
    assert (code, out, err.count("\n")) == (0, f"{fmu}: new\n", 1)
    assert err.startswith("FMI 2.0 has one folder for both, linux64: x86_64-linux is there, ")
    platforms = ("aarch64-linux", "darwin64", "linux64", "win64")
    assert describe(Path(fmu)).platforms == platforms
    assert f"there is: {', '.join(platforms)}; this machine: linux64" in command("inspect", fmu)[1]
    assert command(*ours, "--target", "aarch64-linux", "--fmi", "3")[::2] == (0, "")
    assert describe(Path(fmu)).platforms == ("aarch64-linux", "x86_64-linux")


# ------------------------------------------------------------------ the same bytes


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("preset", ["case_0", "case_1", "case_2", "bench"])
def test_a_run_has_the_same_bytes(command, preset, scheme):
    asked = ("--preset", preset, "--scheme", scheme, "--step", "1e-3")
    python = recorded(command, "python", *asked, "--python")
    assert recorded(command, "native", *asked, "--native") == python
    assert all("native_twin_of" in fmu for fmu in ran("native").values())


# ------------------------------------------------------------------ which run


@pytest.mark.parametrize(
    ("file", "option", "native"),
    [
        (False, (), True),
        (False, ("--python",), False),
        (True, (), True),
        (True, ("--python",), False),
        (True, ("--native",), True),
    ],
    ids=str,
)
def test_which_fmus_run_where_nothing_is_said_of_it(command, fmus, file, option, native):
    """Native ones, of a file as of the built-in grasp."""
    system = (system_file(Path("a_system"), fmus / "GripperPlant.fmu", fmus),) if file else ()
    assert command("run", *system, *SHORT, *option, "--out", "a")[::2] == (0, "")
    assert ran("a").keys() == {"plant", "sensor_1", "sensor_2", "controller"}
    assert {"pythonfmu" not in fmu["tool"] for fmu in ran("a").values()} == {native}
    assert not Path("fmus").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "sweep --vary plant.finger_mass[1]=0.5,0.6 --workers 1",
        "qualify plant.fmu --as plant --set components.plant.isolation=none",
    ],
)
def test_a_command_of_many_runs_takes_native_ones(command, fmus, line):
    shutil.copy(fmus / "GripperPlant.fmu", "plant.fmu")
    results = []
    for i, option in enumerate(((), ("--native",), ("--python",))):
        out = ("--out", f"out_{i}.csv") if line.startswith("sweep") else ()
        code, out, err = command(*line.split(), *SHORT, *option, *out, "--json")
        assert (code, err) == (0, "")
        results.append(json.loads(out))
        results[-1].pop("table", None)
    assert results[0] == results[1] == results[2]
    assert not Path("fmus").exists()


def system_file(folder, plant, fmus):
    """The built-in grasp with FMUs by their paths, whose names are not ours."""
    folder.mkdir(parents=True)
    text = SYSTEM.read_text("utf-8")
    for name in ("GripperPlant", "ProximitySensor", "GraspController"):
        shutil.copy(
            plant if "Plant" in name else fmus / f"{name}.fmu", folder / f"their_{name}.fmu"
        )
        text = text.replace(f'"{name}.fmu"', f'"their_{name}.fmu"')
    path = folder / "theirs.toml"
    path.write_text(text, "utf-8")
    return path


def test_one_of_other_sources_stays_as_it_is(command, altered):
    heavy = altered("GripperPlant", "gripper_plant/fingers.py", "= (0.5, 0.5)", "= (0.5, 0.6)")
    asked = ("--swap", f"plant={heavy}", *SHORT, "--native")
    code, _, err = command("run", *asked, "--out", "a")
    assert code == 0
    assert err == (
        "no native FMU runs as plant (GripperPlant.fmu is of other sources than our GripperPlant); "
        "`grasp-cosim build` makes those of our blocks again\n"
    )
    assert {name for name, fmu in ran("a").items() if "native_twin_of" not in fmu} == {"plant"}


OF_SAMPLES = (
    "plant lacks contact_impulse, first_contact_time, impact_velocity, touched, impact_impulse: "
    "metrics have contacts as the samples show them\n"
)
"""The note on a plant that does not tell contacts between two samples."""


def test_a_block_of_ones_own(command, tmp_path):
    """Its twin is one that the user has built, of the same source."""
    shutil.copy(SPRING, tmp_path)
    source = tmp_path / SPRING.name
    build_block(source, Path("fmus/build"))
    python = recorded(command, "a", *SWAP)
    without = "no native FMU runs as plant (SpringPlant.fmu has no native twin)\n"
    assert command("run", *SWAP, "--native")[2] == without + OF_SAMPLES
    build_block(source, Path("fmus/native"), planned())
    assert recorded(command, "b", *SWAP, "--native") == python
    assert "native_twin_of" in ran("b")["plant"]
    source.write_text(source.read_text("utf-8") + "\n# another\n", "utf-8")
    build_block(source, Path("fmus/build"))
    assert (
        command("run", *SWAP)[2]
        == (
            "no native FMU runs as plant (fmus/native/SpringPlant.fmu is not the twin of this "
            "SpringPlant.fmu, or not for this machine)\n"
        )
        + OF_SAMPLES
    )


@pytest.mark.parametrize("wrong", ["processor", "damaged"])
def test_a_twin_that_does_not_run_here_is_left_alone(command, tmp_path, wrong):
    """One may have been built for another machine, with --target."""
    build_block(SPRING, Path("fmus/build"))
    twin = build_block(SPRING, Path("fmus/native"), planned()).path
    if wrong == "damaged":
        twin.write_bytes(twin.read_bytes()[:-100])
    else:
        rewritten(twin, for_another)
    code, _, err = command("run", *SWAP, "--native")
    assert code == 0
    assert "as plant (fmus/native/SpringPlant.fmu is not the twin" in err


def rewritten(fmu, change, to=None):
    """The FMU with each of its files, by name and content, changed."""
    with zipfile.ZipFile(fmu) as archive:
        files = [change(name, archive.read(name)) for name in archive.namelist()]
    with zipfile.ZipFile(to or fmu, "w") as archive:
        for name, data in files:
            archive.writestr(name, data)


def for_another(name, data):
    """A library as it would be for another processor."""
    changed = data[:18] + (243).to_bytes(2, "little") + data[20:]
    return name, changed if name.endswith(".so") else data


# ------------------------------------------------------------------ without a compiler


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_native_is_refused_in_one_line(command):
    code, out, err = command("run", *SHORT, "--native")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert err.startswith("grasp-cosim: native FMUs cannot be built: no C compiler: ")
    assert err.endswith(f"{sys.executable} -m pip install ziglang\n")
    code, _, err = command("build", "--native")
    assert (code, err.count("\n")) == (2, 1)
    assert err.endswith(f"{sys.executable} -m pip install ziglang\n")


def test_without_zig_there_is_nothing_for_others(command, monkeypatch):
    monkeypatch.setattr(c_compilers, "find_zig", lambda: None)
    code, _, err = command("build", "--native", "--target", "win64")
    fix = f"must be zig; {sys.executable} -m pip install ziglang\n"
    assert (code, err) == (2, f"grasp-cosim: build: no C compiler for x86_64-windows-gnu: {fix}")


@pytest.mark.slow
@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_a_sweep_takes_python_and_says_why(command):
    vary = ("--vary", "plant.object_width=0.06,0.07")
    code, out, err = command("sweep", *vary, *SHORT, "--workers", "1", "--json")
    assert (code, json.loads(out)["failed"], err.count("\n")) == (0, 0, 1)
    assert err.startswith("FMUs run in Python, which takes longer: no C compiler: ")


# ------------------------------------------------------------------ without pythonfmu's binary

LACKS = f"has a binary for linux64 (RISC-V), win64 only; this machine: {this_platform('2.0')}"


@pytest.fixture
def other_machine(command, fmus, monkeypatch, tmp_path):
    """The command where FMUs of the built-in grasp are for another processor; their folder."""
    folder = tmp_path / "foreign"
    folder.mkdir()
    for name in ("GripperPlant.fmu", "ProximitySensor.fmu", "GraspController.fmu"):
        rewritten(fmus / name, for_another, folder / name)
    system = System.load(SYSTEM, folder)
    monkeypatch.setattr("grasp_cosim.grasp.system.as_named", lambda: system)
    return folder


def test_the_native_twins_run(other_machine, command, monkeypatch, grasp):
    foreign = recorded(command, "foreign_run", *SHORT)
    assert all("native_twin_of" in component for component in ran("foreign_run").values())
    assert command("run", *SHORT, "--native")[::2] == (0, "")
    monkeypatch.setattr("grasp_cosim.grasp.system.as_named", lambda: grasp)
    assert foreign == recorded(command, "python", *SHORT, "--python")


@pytest.mark.parametrize("line", ["run --python", slow("run"), slow("evaluate")])
def test_where_they_cannot_one_line_says_why(other_machine, command, request, line):
    python = "--python" in line
    if not python:
        request.getfixturevalue("no_compiler")
    code, out, err = command(*line.split())
    assert (code, out, err.count("\n")) == (2, "", 1)
    said = "its native twin must run" if python else "no C compiler"
    assert err.startswith(f"grasp-cosim: plant: {other_machine}/GripperPlant.fmu {LACKS}; {said}")
    assert err.endswith("must run\n" if python else "pip install ziglang\n")


@pytest.mark.slow
def test_build_makes_native_ones_too(command, tmp_path, monkeypatch):
    folder = tmp_path / "pythonfmu"
    shutil.copytree(package.package_folder("pythonfmu"), folder)
    binary = folder / "resources/binaries/linux64/libpythonfmu-export.so"
    binary.write_bytes(for_another(binary.name, binary.read_bytes())[1])
    find = package.package_folder
    monkeypatch.setattr(
        package, "package_folder", lambda name: folder if name == "pythonfmu" else find(name)
    )
    shutil.copy(SPRING, ".")
    code, out, err = command("build", SPRING.name)
    assert (code, out) == (0, "fmus/build/SpringPlant.fmu: new\nfmus/native/SpringPlant.fmu: new\n")
    assert err == f"built native FMUs, too: fmus/build/SpringPlant.fmu {LACKS}\n"
    code, _, err = command("run", *SWAP)
    assert (code, err) == (0, OF_SAMPLES)
