"""What was fitted as a file, and a system with it: values, and drives that are weak and late."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

from ...base.checks import as_table, check_keys, check_values, is_number, toml_table
from ...base.errors import InputError
from ...system.description import System
from ...system.overrides import PLACE, as_overrides
from ...system.parts import Connection, Fault, Port
from ..metrics import FINGERS

ENTRIES = (*(f"gain[{j}]" for j in FINGERS), "delay")


def with_fitted(system: System, path: Path) -> System:
    """The system with the values in a file of `identify -o`, and with its drives.

    A gain is the factor of the connection to the force of a finger, and the delay a fault of it.
    InputError where the file is none, or there are no such connections.
    """
    file = toml_table(path, "file of values")
    check_keys(path.name, file, ("values", "drives"))
    values = as_table(f"{path.name}: [values]", file.get("values", {}))
    check_values(f"{path.name}: [values]", values)
    drives = as_table(f"{path.name}: [drives]", file.get("drives", {}))
    check_keys(f"{path.name}: [drives]", drives, ENTRIES)
    for name, value in drives.items():
        if not is_number(value):
            raise InputError(f"{path.name}: drives.{name} = {value!r}: must be a number")
    changed = system.with_overrides(as_overrides(values, f"{path.name}: {PLACE}"))
    if not drives:
        return changed
    targets = {j: Port(_plant(system), f"force[{j}]") for j in FINGERS}
    connected = {c.target for c in changed.connections}
    for target in targets.values():
        if target not in connected:
            raise InputError(f"{path.name}: [drives]: no connection ends at {target}; must be one")
    gains = {targets[j]: float(drives.get(f"gain[{j}]", 1.0)) for j in FINGERS}
    delay = float(drives.get("delay", 0.0))
    late = tuple(Fault(t, "delay", {"time": delay}) for t in targets.values() if delay > 0.0)
    return replace(
        changed,
        connections=tuple(_with_gain(c, gains.get(c.target, 1.0)) for c in changed.connections),
        faults=(*changed.faults, *late),
    )


def _plant(system: System) -> str:
    return system.roles.get("plant", "plant")


def _with_gain(connection: Connection, gain: float) -> Connection:
    if gain == 1.0:
        return connection
    factor = 1.0 if connection.factor is None else connection.factor
    offset = 0.0 if connection.offset is None else connection.offset
    return replace(connection, factor=gain * factor, offset=gain * offset, of_arrays=None)
