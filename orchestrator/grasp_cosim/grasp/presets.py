"""The cases and the bench of the paper, as presets of any system that has a grasp; SI values.

A system file may define presets of these names itself; where it does not, those of the built-in
grasp are used, its components found by their roles.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any

from ..base.checks import known
from ..interface.fmi_types import Value
from ..interface.units import IDENTITY
from ..metrics.metric import resolved
from ..system.description import System
from ..system.overrides import PLACE, as_overrides
from ..system.parts import Port
from ..system.settings import given_values
from ..system.structure import parameter_in_si

SYSTEM = Path(__file__).parent / "grasp.toml"
"""The built-in system: the published grasp."""

CASES = (0, 1, 2)
"""Case 0 is contact force control only, 1 with impact reduction, 2 with simultaneous contact."""


def with_case(system: System, case: int) -> System:
    """The system in one of the CASES; InputError where it lacks what a case sets."""
    return with_preset(system, f"case_{case}")


def with_preset(system: System, name: str) -> System:
    """The system with its own preset, or else of the built-in grasp, case_0 to _2 or bench.

    InputError where there is neither, or the system lacks what it sets.
    """
    if name in system.presets:
        return system.with_presets(name)
    known(f"{system.name}: no preset", name, {**system.presets, **built_in_presets()})
    return with_si_values(system, built_in_presets()[name], f"[presets.{name}] of {SYSTEM.name}:")


def case_of(settings: Mapping[str, Any]) -> str:
    """The case of a run by its settings, "0" to "2"; "other" where it is in none of these.

    What is not set is taken to be as in case 2, as the controller starts.
    """
    presets = built_in_presets()
    set_values = _values_by_role(settings)
    values = {key: set_values(key, value) for key, value in presets["case_2"].items()}
    return next((str(case) for case in CASES if presets[f"case_{case}"] == values), "other")


def words_of(settings: Mapping[str, Any]) -> list[str]:
    """What a grasp is in the words of a title: its case, the bench, the FMU of its controller."""
    case = case_of(settings)
    words = ["no published case" if case == "other" else f"case {case}"]
    set_values = _values_by_role(settings)
    bench = built_in_presets()["bench"]
    if all(set_values(key) == value for key, value in bench.items()):
        words.append("bench")
    controller = resolved("controller.", settings.get("roles", {})).removesuffix(".")
    fmu = str(settings["components"].get(controller, {}).get("fmu", ""))
    if fmu:
        words.append(fmu.removesuffix(".fmu"))
    return words


def _values_by_role(settings: Mapping[str, Any]) -> Callable[..., Any]:
    """A function of a variable by role and a default, None: the value to which a run sets it."""
    roles, values = settings.get("roles", {}), given_values(settings)
    return lambda key, default=None: values.get(resolved(key, roles), default)


def with_si_values(system: System, values: Mapping[str, Value], place: str) -> System:
    """The system with start values by role, like plant.object_width, numbers in SI units.

    They are converted where a component has another unit; InputError, naming the place, where that
    is not defined or there is no such variable.
    """
    converted: dict[str, Value] = {}
    for key, value in values.items():
        port = _port(system, key)
        to_si = parameter_in_si(system, f"{place} {port}", port)
        converted[str(port)] = value if to_si == IDENTITY else to_si.back(float(value))
    return system.with_overrides(as_overrides(converted, f"{place} {PLACE}"))


def start_in_si(system: System, key: str) -> float:
    """The number, in SI units, that a variable by role, like plant.object_width, starts with."""
    port = _port(system, key)
    return parameter_in_si(system, system.name, port)(system.start(str(port)))


def _port(system: System, key: str) -> Port:
    return Port(*resolved(key, system.roles).split(".", 1))


@cache
def built_in_presets() -> dict[str, dict[str, Any]]:
    """The presets of the built-in grasp by name: values by names like controller.gain."""
    presets: dict[str, dict[str, Any]] = tomllib.loads(SYSTEM.read_text("utf-8"))["presets"]
    return presets
