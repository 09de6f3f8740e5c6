"""Modules in the current folder, which may be that of a stranger, are not run."""

import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from grasp_cosim.grasp.presets import SYSTEM

MARK = "imported.txt"


def poison(folder, names):
    """A folder of modules, each of which notes that it was imported, and fails."""
    folder.mkdir()
    for name in filter(str.isidentifier, names):
        noted = f"open({str(folder / MARK)!r}, 'a').write({name!r} + ' ')"
        (folder / f"{name}.py").write_text(f"{noted}\nraise ImportError({name!r})\n")
    return folder


@pytest.fixture
def everything(tmp_path):
    """All that Python and its packages have, under false colours."""
    ours = {"sitecustomize", "usercustomize"}
    return poison(
        tmp_path / "strange", {*sys.stdlib_module_names, *packages_distributions(), *ours}
    )


@pytest.fixture
def system(fmus, tmp_path):
    """The grasp as a file."""
    path = tmp_path / "grasp.toml"
    path.write_text(SYSTEM.read_text("utf-8").replace('fmu = "', f'fmu = "{fmus}/'), "utf-8")
    return path


def not_imported(folder, command, *arguments):
    """What a command that stands in the folder says; it imports nothing from there."""
    done = subprocess.run(
        [sys.executable, *command, *arguments],
        cwd=folder, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    imported = folder / MARK
    assert not imported.exists(), imported.read_text()
    assert done.returncode in (0, 1), done.stderr
    return done.stdout


@pytest.fixture
def installed(tmp_path):
    """As the installed command starts: its own folder is the first to look into."""
    (tmp_path / "bin").mkdir()
    program = tmp_path / "bin" / "grasp-cosim.py"
    program.write_text(
        "from grasp_cosim.cli import entry\nif __name__ == '__main__':\n    entry()\n"
    )
    return [str(program)]


@pytest.mark.slow
def test_a_component_in_a_process(installed, everything, system):
    text = system.read_text("utf-8")
    system.write_text(text.replace("[components.plant]", '[components.plant]\nisolation="process"'))
    not_imported(everything, installed, "run", str(system), "--stop", "0.001")


@pytest.mark.slow
@pytest.mark.parametrize(
    "line",
    [
        "run {SYSTEM} --stop 0.001",
        "qualify {FMUS}/GripperPlant.fmu --as plant --system {SYSTEM} --stop 0.001",
        "inspect {FMUS}/GripperPlant.fmu --load",
        "inspect {FMUS}/GripperPlant.fmu",
        "sweep {SYSTEM} --stop 0.001 --vary plant.object_width=0.05,0.06 --out {OUT} --workers 2",
        "ssp {SYSTEM} -o {OUT}.ssp",
        "build {BLOCK} --out {OUT}",
        "proxy {FMUS}/GripperPlant.fmu -o {OUT}.fmu",
    ],
)
def test_a_command(line, installed, everything, system, fmus, tmp_path):
    block = Path(__file__).parents[2] / "docs" / "spring_plant.py"
    places = {
        "SYSTEM": system, "FMUS": fmus, "BLOCK": block,
        "OUT": tmp_path / "out",
    }  # fmt: skip
    not_imported(everything, installed, *(word.format(**places) for word in line.split()))


@pytest.mark.slow
def test_python_m_imports_what_it_needs_to_find_us_alone(tmp_path, system):
    text = system.read_text("utf-8")
    system.write_text(text.replace("[components.plant]", '[components.plant]\nisolation="process"'))
    names = {"numpy", "socket", "click", "fmpy", "lxml", "ctypes", "tomllib", "multiprocessing"}
    folder = poison(tmp_path / "strange", names)
    not_imported(folder, ["-m", "grasp_cosim"], "run", str(system), "--stop", "0.001")
