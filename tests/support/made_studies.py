"""Studies of one native FMU: a.x is the integral of gain·u over 0.1 s; it fails when it is told."""

from pathlib import Path

from grasp_cosim import System
from grasp_cosim.interface.read import read_interface
from grasp_cosim.sweep.read import Made, read_studies
from grasp_cosim.sweep.study import Study
from support.native_fmus import build

STARTS = {"u_Boolean": "false", "u_String": "''", "u_Enumeration": "1", "u_Real": "2.0"}

GAIN = '[[parameters]]\nname = "gain"\nvariables = ["a.gain"]\n'
HEAD = 'system = "system.toml"\noutputs = ["a.x", "a.steps"]\n'
GRID = f'{HEAD}[design]\nkind = "grid"\n{GAIN}'


def write_native(folder: Path) -> Path:
    """The FMU a.fmu and system.toml in folder; returns the folder."""
    fmu = build(folder, "a", "2.0")
    inputs = [v.name for v in read_interface(fmu).of("input")]
    values = ", ".join(f"{name} = {STARTS.get(name, '0')}" for name in inputs)
    (folder / "system.toml").write_text(
        f"[experiment]\nstep = 0.01\nstop = 0.1\n[components.a]\nfmu = 'a.fmu'\n"
        f"values = {{ {values} }}\n"
    )
    return folder


def load(path: Path | None) -> System:
    assert path is not None
    return System.load(path)


def native_study(folder: Path, text: str, name: str = "study.toml") -> Study:
    """The study of that text, of the system that write_native() left in folder."""
    (folder / name).write_text(text)
    (study,) = read_studies(folder / name, Made(load))
    return study
