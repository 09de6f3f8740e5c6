"""What was fitted as a file, and a system with it: values, and drives that are weak and late."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

from ...base.checks import as_table, check_keys, check_values, is_number, toml_table
from ...base.errors import InputError
from ...system.description import System
from ...system.overrides import PLACE, as_overrides
from ...system.parts import Connection, Fault, Port
from ..metrics import FINGERS

DRIVE_ENTRIES = (*(f"gain[{j}]" for j in FINGERS), "delay")


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
    check_keys(f"{path.name}: [drives]", drives, DRIVE_ENTRIES)
    for name, value in drives.items():
        if not is_number(value):
            raise InputError(f"{path.name}: drives.{name} = {value!r}: must be a number")
    system = system.with_overrides(as_overrides(values, f"{path.name}: {PLACE}"))
    return _with_drives(system, drives, f"{path.name}: [drives]") if drives else system


def _with_drives(system: System, drives: Mapping[str, float], place: str) -> System:
    """The system with gains and a delay in s on the connections to the forces of the fingers."""
    targets = {j: Port(_plant(system), f"force[{j}]") for j in FINGERS}
    connected = {c.target for c in system.connections}
    for target in targets.values():
        if target not in connected:
            raise InputError(f"{place}: no connection ends at {target}; must be one")
    gains = {target: float(drives.get(f"gain[{j}]", 1.0)) for j, target in targets.items()}
    connections = [_with_gain(c, gains.get(c.target, 1.0)) for c in system.connections]
    faults = list(system.faults)
    delay = float(drives.get("delay", 0.0))
    if delay > 0.0:
        faults += [Fault(target, "delay", {"time": delay}) for target in targets.values()]
    return replace(system, connections=tuple(connections), faults=tuple(faults))


def _plant(system: System) -> str:
    return system.roles.get("plant", "plant")


def _with_gain(connection: Connection, gain: float) -> Connection:
    if gain == 1.0:
        return connection
    factor = 1.0 if connection.factor is None else connection.factor
    offset = 0.0 if connection.offset is None else connection.offset
    return replace(connection, factor=gain * factor, offset=gain * offset, of_arrays=None)
