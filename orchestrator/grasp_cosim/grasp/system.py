"""The built-in system: the published grasp, its FMUs and its cases; the bench as a preset."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType

from ..errors import InputError
from ..interface.interface import Value
from ..system.description import System

SYSTEM = Path(__file__).parent / "grasp.toml"

BENCH = Path(__file__).parent / "bench_preset.toml"
"""The values that make the bench of the ideal grasp."""

FMU_FOLDER = Path("fmus/build")
"""Where the FMUs are built, below the current folder."""

BOUND_FOLDER = Path("fmus/bound")
"""Where those for hosts that are not Python are built."""

CASES: Mapping[int, Mapping[str, Value]] = MappingProxyType(
    {
        0: {
            "controller.simultaneous_contact.enabled": False,
            "controller.impact_reduction.enabled": False,
        },
        1: {
            "controller.simultaneous_contact.enabled": False,
            "controller.impact_reduction.enabled": True,
        },
        2: {
            "controller.simultaneous_contact.enabled": True,
            "controller.impact_reduction.enabled": True,
        },
    }
)
"""Case 0 is contact force control alone, 1 with impact reduction, 2 with simultaneous contact."""


def grasp_system() -> System:
    """The built-in grasp; its FMUs are built first where they are missing or out of date."""
    from grasp_fmus.build import build

    try:
        build(FMU_FOLDER)
    except OSError as error:
        raise InputError(
            f"{error.filename}: {error.strerror}; the FMUs are built into {FMU_FOLDER} below the "
            "current folder, which must be one that can be written to"
        ) from error
    return System.load(SYSTEM, FMU_FOLDER)


def with_bench(system: System) -> System:
    """The grasp as on the bench: the sensors with their electronics, friction identified."""
    values = tomllib.loads(BENCH.read_text("utf-8"))["values"]
    return system.revised({}, values, ("swap", BENCH.name))
