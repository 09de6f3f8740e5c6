"""What `tune` does of itself: the gains of a grasp, its limits and conditions, from tuning.toml."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..metrics.metric import Signals, metric, resolved
from ..system.description import System
from ..tuning.problem import Condition, Gain
from .metrics import ENTRIES, FINGERS, NEEDS, time_to_contact, time_to_settle
from .presets import with_preset, with_si_values

FILE = Path(__file__).parent / "tuning.toml"


@metric("grasp_time", unit="s", needs=NEEDS, group="grasp", entries=ENTRIES)
def grasp_time(signals: Signals) -> list[float | None]:
    """Time until the force of a finger has settled: time to contact and settling time."""
    times = [(time_to_contact(signals, j), time_to_settle(signals, j)) for j in FINGERS]
    return [None if touch is None or settle is None else touch + settle for touch, settle in times]


@cache
def defaults() -> Mapping[str, Any]:
    """What is in tuning.toml."""
    return tomllib.loads(FILE.read_text("utf-8"))


def default_gains(system: System) -> tuple[Gain, ...]:
    """The gains of tuning.toml, within its factor of their values in a system.

    InputError where the system has no such gain, or one that starts at 0.
    """
    factor = defaults()["factor"]
    found = []
    for names in defaults()["gains"]:
        variables = tuple(resolved(name, system.roles) for name in names)
        start = system.start(variables[0])
        if not start:
            raise InputError(f"{variables[0]} = 0: has no range of its own; --vary must give one")
        low, high = sorted((start / factor, start * factor))
        found.append(Gain(variables, low, high))
    return tuple(found)


def default_limits() -> dict[str, None]:
    """The limits of tuning.toml: what the gains of the system reach."""
    return dict.fromkeys(defaults()["limits"])


def default_conditions(system: System) -> tuple[Condition, ...]:
    """The conditions of tuning.toml; InputError where the system cannot have one."""
    return tuple(_condition(system, entry) for entry in defaults()["conditions"])


def default_checks(system: System) -> tuple[tuple[Condition, ...], list[str]]:
    """The checks of tuning.toml, and a line for each that the system cannot have."""
    found, left_out = [], []
    for entry in defaults()["checks"]:
        try:
            found.append(_condition(system, entry))
        except InputError as error:
            left_out.append(f"left out the check {entry['name']!r}: {error}")
    return tuple(found), left_out


def is_published(system: System, gains: Sequence[Gain]) -> bool:
    """True if these gains are as their FMUs declare them, which is as they were published."""
    names = [name for gain in gains for name in gain.variables]
    pairs = [name.split(".", 1) for name in names]
    declared = [system.component(c, c).interface.by_name[v].start for c, v in pairs]
    return all(system.start(n) == float(d or 0.0) for n, d in zip(names, declared, strict=True))


def _condition(system: System, entry: Mapping[str, Any]) -> Condition:
    """A system changed as an entry of tuning.toml says."""
    changed = with_preset(system, entry["preset"]) if "preset" in entry else system
    changed = with_si_values(changed, entry["values"], f"{FILE.name}: {entry['name']}:")
    return Condition(entry["name"], changed.with_experiment(entry.get("step"), entry.get("stop")))
