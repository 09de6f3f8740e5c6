"""The FMUs that need more than Python, and where they can be run."""

from importlib.util import find_spec
from pathlib import Path

import fmpy
import pytest
from grasp_cosim.interface.obstacles import this_platform

needs_pythonfmu = pytest.mark.skipif(
    this_platform("2.0") != "linux64", reason="NO binary of pythonfmu for this machine"
)
"""On what calls an FMU that runs in Python, and not the native twin in its place."""

PACKAGES = {"GripperPlantMuJoCo": "mujoco"}
"""What an FMU needs: without it, it cannot be run."""


def skip_without_pythonfmu() -> None:
    """Skip a test that calls an FMU that runs in Python."""
    if needs_pythonfmu.args[0]:
        pytest.skip(needs_pythonfmu.kwargs["reason"])


def skip_where_it_cannot_run(name: str) -> None:
    """Skip a test of an FMU that runs in Python for want of its package, or of a binary."""
    skip_without_pythonfmu()
    if package := PACKAGES.get(name):
        reason = f"NO {package}: {name} cannot be run; python -m pip install '.[{package}]'"
        pytest.importorskip(package, reason=reason)


def runnable(fmus: Path) -> list[Path]:
    """The FMUs in a folder that can be run here."""
    paths = sorted(fmus.glob("*.fmu"))
    return [fmu for fmu in paths if fmu.stem not in PACKAGES or find_spec(PACKAGES[fmu.stem])]


def skip_where_fmpy_runs_none(version: str) -> None:
    """Skip a test in which FMPy simulates an FMU of that version of FMI."""
    if version == "3.0" and fmpy.architecture != "x86_64":
        pytest.skip(f"FMPy simulates no FMI 3.0 on {fmpy.architecture}")
