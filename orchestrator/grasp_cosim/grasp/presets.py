"""The cases and the bench of the paper, as presets of any system that has a grasp.

A system file may define presets of these names itself; where it does not, those of the built-in
grasp are used, its components found by their roles.
"""

from __future__ import annotations

import tomllib
from functools import cache
from pathlib import Path
from typing import Any

from ..metrics.metric import resolved
from ..system.description import System

SYSTEM = Path(__file__).parent / "grasp.toml"
"""The built-in system: the published grasp."""

STUDIES = Path(__file__).parent / "studies"
"""The folder of the built-in studies."""

CASES = (0, 1, 2)
"""Case 0 is contact force control alone, 1 with impact reduction, 2 with simultaneous contact."""


def with_case(system: System, case: int) -> System:
    """The system in one of the CASES; InputError where it lacks what a case sets."""
    return with_preset(system, f"case_{case}")


def with_preset(system: System, name: str) -> System:
    """The system with a preset of its own, or else of the built-in grasp, case_0 to _2 or bench.

    InputError where there is neither, or the system lacks what it sets.
    """
    if name in system.presets or name not in built_in_presets():
        return system.with_presets(name)
    values = {resolved(key, system.roles): v for key, v in built_in_presets()[name].items()}
    place = f"[presets.{name}] of {SYSTEM.name}:"
    return system.revised({}, values, (place, place))


@cache
def built_in_presets() -> dict[str, dict[str, Any]]:
    """The presets of the built-in grasp by name: values by names like controller.gain."""
    presets: dict[str, dict[str, Any]] = tomllib.loads(SYSTEM.read_text("utf-8"))["presets"]
    return presets
