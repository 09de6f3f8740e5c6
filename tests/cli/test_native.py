"""--native and --python: which FMUs a command runs, what it says of them, and the same bytes."""

import json
import os
import shutil
import zipfile
from pathlib import Path

import pytest
from grasp_cosim.grasp.presets import SYSTEM
from grasp_fmus import build as builds
from grasp_fmus.build import build_block, planned, shipped_twins
from grasp_fmus.native.targets import here
from grasp_fmus.shipped import together
from support.marks import needs_compiler

pytestmark = needs_compiler

SPRING = Path(__file__).parents[2] / "docs/spring_plant.py"
SHORT = ("--step", "1e-3", "--stop", "0.3")
HERE = ("--set", "components.plant.isolation=none")


def ran(folder):
    """The FMUs that a recorded run names, by component."""
    return json.loads(Path(folder, "run.json").read_text())["fmus"]


def recorded(command, folder, *arguments):
    code, _, err = command("run", "--out", folder, *arguments)
    assert code == 0, err
    return Path(folder, "signals.csv").read_bytes()


# ------------------------------------------------------------------ the same bytes


@pytest.mark.slow
@pytest.mark.parametrize("scheme", ["sequential", "jacobi"])
@pytest.mark.parametrize("case", ["0", "1", "2"])
def test_a_run_has_the_same_bytes(command, case, scheme):
    asked = ("--case", case, "--scheme", scheme, "--step", "1e-3")
    python = recorded(command, "python", *asked, "--python")
    assert recorded(command, "native", *asked, "--native") == python
    assert all("native_twin_of" in fmu for fmu in ran("native").values())


@pytest.mark.slow
def test_at_the_published_step_with_all_electronics(command):
    asked = ("--preset", "bench", "--stop", "0.5")
    assert recorded(command, "a", *asked, "--python") == recorded(command, "b", *asked)


# ------------------------------------------------------------------ what each command does


@pytest.mark.parametrize(
    ("file", "option", "native"),
    [
        (False, (), True),
        (False, ("--native",), True),
        (False, ("--python",), False),
        (True, (), False),
        (True, ("--native",), True),
        (True, ("--python",), False),
    ],
    ids=str,
)
def test_which_fmus_run_where_nothing_is_said_of_it(command, fmus, file, option, native):
    """Those that a file names; of the built-in grasp, of which nobody named any, native ones."""
    system = (system_file(Path("a_system"), fmus / "GripperPlant.fmu", fmus),) if file else ()
    assert command("run", *system, *SHORT, *option, "--out", "a")[::2] == (0, "")
    assert ran("a").keys() == {"plant", "sensor_1", "sensor_2", "controller"}
    assert {"pythonfmu" not in fmu["tool"] for fmu in ran("a").values()} == {native}


@pytest.mark.slow
@pytest.mark.parametrize(
    "arguments",
    [
        ("sweep", "--vary", "plant.finger_mass[1]=0.5,0.6", *SHORT, "--workers", "1"),
        ("qualify", "plant.fmu", "--as", "plant", *SHORT, *HERE),
    ],
    ids=lambda arguments: arguments[0],
)  # fmt: skip
def test_a_command_of_many_runs_takes_native_ones(command, fmus, arguments):
    shutil.copy(fmus / "GripperPlant.fmu", "plant.fmu")
    first, second, third = (
        command(*arguments, *option, "--json", *folder(arguments, i))
        for i, option in enumerate(((), ("--native",), ("--python",)))
    )
    assert [first[2], second[2], third[2]] == ["", "", ""]
    assert first[0] == second[0] == third[0] == 0
    results = [json.loads(out) for _, out, _ in (first, second, third)]
    for result in results:
        result.pop("table", None)
    assert results[0] == results[1] == results[2]
    assert not Path("fmus").exists()


def folder(arguments, number):
    return ("--out", f"out_{number}.csv") if arguments[0] == "sweep" else ()


def test_a_log_needs_no_fmu_to_run(command):
    assert command("run", *SHORT, "--case", "0", "--out", "run")[0] == 0
    code, _, err = command("identify", "run/signals.csv", "--fit", "coulomb")
    assert (code, err) == (0, "")


# ------------------------------------------------------------------ without a compiler


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_native_is_refused_in_one_line(command):
    code, out, err = command("run", *SHORT, "--native")
    assert (code, out) == (2, "")
    assert err.startswith("grasp-cosim: native FMUs cannot be built: no C compiler: ")
    assert err.count("\n") == 1
    assert "pip install ziglang" in err


@pytest.mark.slow
@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_a_sweep_takes_python_and_says_why(command):
    vary = ("--vary", "plant.object_width=0.06,0.07")
    code, out, err = command("sweep", *vary, *SHORT, "--workers", "1", "--json")
    assert (code, json.loads(out)["failed"]) == (0, 0)
    assert err.startswith("FMUs run in Python, which takes longer: no C compiler: ")
    assert err.count("\n") == 1


@pytest.mark.slow
def test_where_nothing_can_be_kept_they_are_compiled_for_this_process(
    command, monkeypatch, tmp_path
):
    (tmp_path / "file").touch()
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    shipped_twins.cache_clear()
    code, _, err = command("run", *SHORT, "--native")
    assert (code, err.count("\n")) == (0, 1)
    assert err.startswith(f"{tmp_path}/file/grasp-cosim: cannot be written to, so each process")
    shipped_twins.cache_clear()
    builds._until_the_end.clear()


# ------------------------------------------------------------------ whose FMUs, and where


def system_file(folder, plant, fmus):
    """The built-in grasp with FMUs by their paths, whose names are not ours."""
    folder.mkdir(parents=True)
    text = SYSTEM.read_text("utf-8")
    for name, fmu in (
        ("GripperPlant", plant),
        ("ProximitySensor", None),
        ("GraspController", None),
    ):
        other = folder / f"their_{name}.fmu"
        shutil.copy(fmu or fmus / f"{name}.fmu", other)
        text = text.replace(f'"{name}.fmu"', f'"{other.name}"')
    path = folder / "theirs.toml"
    path.write_text(text, "utf-8")
    return path


def test_it_is_the_content_that_counts_not_the_name(command, fmus):
    system = system_file(Path("deep/down"), fmus / "GripperPlantMovable.fmu", fmus)
    asked = (system, *SHORT, "--case", "0")
    assert recorded(command, "a", *asked) == recorded(command, "b", *asked, "--native")
    assert not any("native_twin_of" in fmu for fmu in ran("a").values())
    assert all("native_twin_of" in fmu for fmu in ran("b").values())


def test_one_of_other_sources_stays_as_it_is(command, altered):
    heavy = altered("GripperPlant", "gripper_plant/fingers.py", "= (0.5, 0.5)", "= (0.5, 0.6)")
    asked = ("--swap", f"plant={heavy}", *SHORT, "--native")
    code, _, err = command("run", *asked, "--out", "a")
    assert code == 0
    assert err == "no native FMU runs as plant (GripperPlant.fmu has no native twin)\n"
    assert "native_twin_of" not in ran("a")["plant"]
    assert "native_twin_of" in ran("a")["sensor_1"]


@pytest.mark.slow
def test_one_that_is_native_already_is_no_exception(command, tmp_path):
    twin = build_block(SPRING, tmp_path, planned()).path
    assert command("run", "--swap", f"plant={twin}", *SHORT, "--native")[::2] == (0, "")
    system = tmp_path / "native.toml"
    text, kept = SYSTEM.read_text("utf-8"), shipped_twins(together("GripperPlant"))
    system.write_text(text.replace('fmu = "', f'fmu = "{kept}/'), "utf-8")
    for option in ("--native", "--python"):
        assert command("run", system, *SHORT, option)[::2] == (0, "")
    qualified = command(
        "qualify", twin, "--as", "plant", *SHORT, "--set", "components.plant.isolation=none"
    )
    assert qualified[2] == ""


def test_a_block_of_ones_own(command, tmp_path):
    """Its twin is one that the user has built, of the same source."""
    swap = ("--swap", "plant=fmus/build/SpringPlant.fmu", *SHORT)
    shutil.copy(SPRING, tmp_path)
    source = tmp_path / SPRING.name
    build_block(source, Path("fmus/build"))
    python = recorded(command, "a", *swap)
    without = "no native FMU runs as plant (SpringPlant.fmu has no native twin)\n"
    assert command("run", *swap, "--native")[2] == without
    build_block(source, Path("fmus/native"), planned())
    assert recorded(command, "b", *swap, "--native") == python
    assert "native_twin_of" in ran("b")["plant"]
    source.write_text(source.read_text("utf-8") + "\n# another\n", "utf-8")
    build_block(source, Path("fmus/build"))
    assert command("run", *swap)[2] == (
        "no native FMU runs as plant (fmus/native/SpringPlant.fmu is not the twin of this "
        "SpringPlant.fmu, or not for this machine)\n"
    )


def test_a_twin_is_found_beside_the_folder_of_its_fmu(command, tmp_path):
    build_block(SPRING, tmp_path / "project/build")
    build_block(SPRING, tmp_path / "project/native", planned())
    swap = f"plant={tmp_path / 'project/build/SpringPlant.fmu'}"
    assert command("run", "--swap", swap, *SHORT, "--native", "--out", "a")[::2] == (0, "")
    assert "native_twin_of" in ran("a")["plant"]


@pytest.mark.parametrize("wrong", ["processor", "platform", "damaged"])
def test_a_twin_that_does_not_run_here_is_left_alone(command, tmp_path, wrong):
    """One may have been built for another machine, with --target."""
    build_block(SPRING, Path("fmus/build"))
    twin = build_block(SPRING, tmp_path / "made", planned()).path
    with zipfile.ZipFile(twin) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    (binary,) = (name for name in files if name.startswith("binaries/"))
    library = files.pop(binary)
    if wrong == "processor":
        files[binary] = library[:18] + bytes(255 - b for b in library[18:20]) + library[20:]
    elif wrong == "platform":
        files[binary.replace(here().folder, "elsewhere")] = library
    Path("fmus/native").mkdir()
    with zipfile.ZipFile("fmus/native/SpringPlant.fmu", "w") as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    if wrong == "damaged":
        Path("fmus/native/SpringPlant.fmu").write_bytes(twin.read_bytes()[:-100])
    swap = ("--swap", "plant=fmus/build/SpringPlant.fmu", *SHORT)
    code, _, err = command("run", *swap, "--native")
    assert code == 0
    assert "as plant (fmus/native/SpringPlant.fmu is not the twin" in err


def test_nothing_is_built_into_the_current_folder(command):
    """So one that cannot be written to will do."""
    for option in ("--native", "--python"):
        assert command("run", *SHORT, option)[0] == 0
        assert os.listdir() == []  # noqa: PTH208
