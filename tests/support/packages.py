"""The FMUs that need more than Python, and where they can be run."""

from importlib.util import find_spec
from pathlib import Path

import pytest

PACKAGES = {"GripperPlantMuJoCo": "mujoco"}
"""What an FMU needs: without it, it cannot be run."""


def skip_where_it_cannot_run(name: str) -> None:
    """Skip a test of an FMU for want of its package."""
    if package := PACKAGES.get(name):
        reason = f"NO {package}: {name} cannot be run; python -m pip install '.[{package}]'"
        pytest.importorskip(package, reason=reason)


def runnable(fmus: Path) -> list[Path]:
    """The FMUs in a folder that can be run here."""
    paths = sorted(fmus.glob("*.fmu"))
    return [fmu for fmu in paths if fmu.stem not in PACKAGES or find_spec(PACKAGES[fmu.stem])]
