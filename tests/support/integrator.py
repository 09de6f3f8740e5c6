"""A system of one native FMU: a.x is the integral of gain·u, and it fails when it is told."""

from grasp_cosim import System
from grasp_cosim.interface.read import read_interface
from support.native_fmus import build
from support.oscillator import STARTS

METRICS = '''from grasp_cosim import metric


@metric("end", unit="m", needs=["a.x"])
def end(run):
    """The last value."""
    return run["a.x"][-1]


@metric("half", entries=("first", "second"))
def half(run):
    """At both halves of the time."""
    return [run["a.x"][len(run.time) // 2] > 0.1, None]
'''


def write_integrator(folder):
    """The FMU a.fmu, system.toml and mine.py in folder; returns the folder."""
    fmu = build(folder, "a", "2.0")
    inputs = [v.name for v in read_interface(fmu).of("input")]
    values = ", ".join(f"{name} = {STARTS.get(name, '0')}" for name in inputs)
    (folder / "system.toml").write_text(
        f"[experiment]\nstep = 0.01\nstop = 0.1\n[components.a]\nfmu = 'a.fmu'\n"
        f"values = {{ {values} }}\n"
    )
    (folder / "mine.py").write_text(METRICS)
    return folder


def integrator(folder):
    return System.load(write_integrator(folder) / "system.toml")
