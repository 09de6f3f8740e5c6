"""A component with another FMU: what the system says of it is meant in units of the former."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import replace
from pathlib import Path

from ..errors import InputError
from ..interface.interface import Interface, Value
from ..interface.read import read_interface
from ..interface.units import IDENTITY
from .parts import Component, Port
from .readings import unit_of
from .structure import Structure


def with_fmu(
    system: Structure, was: Component, fmu: Path, anew: Collection[str], place: str
) -> Component:
    """The component with another FMU, its values converted to the units of that.

    A name for a unit stays where the FMUs declare the same one, or the new FMU none. `anew` are
    variables that get another value. InputError where a value, or another number that the system
    states, has no meaning in the new unit.
    """
    ours, theirs = (read_interface(f).renamed(was.rename) for f in (was.fmu, fmu))
    units = {
        name: unit
        for name, unit in was.units.items()
        if name not in theirs.by_name
        or theirs.by_name[name].unit in (None, ours.by_name[name].unit)
    }
    now = replace(was, fmu=fmu, native=None, units=units)
    before, after = was.interface, now.interface
    kept = {name: value for name, value in was.values.items() if name not in anew}
    for name in [*kept, *sorted(stated(system, was.name))]:
        reason = _lost(before, after, name, name in kept)
        if reason:
            raise InputError(f"{place}: {name} {reason}")
    return replace(now, values={**was.values, **converted(kept, before, after)})


def stated(system: Structure, name: str) -> frozenset[str]:
    """The variables of a component for which the system states numbers, beside its values.

    In events, conditions, faults and factors of connections.
    """
    ends = [(port, c) for c in system.connections for port in (c.source, c.target)]
    scaled = [port for port, c in ends if (c.factor, c.offset) != (None, None)]
    faulty = {fault.target for fault in system.faults}
    through = [port for port, c in ends if c.target in faulty]
    tuned = [port for event in system.events for port in event.set]
    conditions = [*(e.when for e in system.events), *(f.when for f in system.faults)]
    asked = [condition.port for condition in conditions if condition]
    ports: list[Port] = [*scaled, *through, *tuned, *asked]
    return frozenset(port.variable for port in ports if port.component == name)


def converted(values: Mapping[str, Value], before: Interface, after: Interface) -> dict[str, Value]:
    """Values of one FMU in the units of another that has the same variables."""
    result: dict[str, Value] = {}
    for name, value in values.items():
        if name in after.by_name and after.by_name[name].kind == "Real":
            change = before.conversion(name, after)
            value = change(float(value)) if change and change != IDENTITY else value
        result[name] = value
    return result


def _lost(before: Interface, after: Interface, name: str, value: bool) -> str:
    """Why a number for a variable cannot be meant in its new unit; empty where it can."""
    if name not in before.by_name or name not in after.by_name:
        return ""
    was, now = before.by_name[name], after.by_name[name]
    unit, change = unit_of(before, was), before.conversion(name, after)
    if was.unit and now.unit is None and now.kind == "Real" and (unit is None or not unit.si):
        return f"has no unit in {after.path.name}, but is set in {was.unit}; must be named in units"
    if change is None:
        return (
            f"is in {now.unit}, which its value in {was.unit} cannot be converted to; set it anew"
        )
    if change != IDENTITY and not value:
        return (
            f"is in {now.unit}, but an event, a fault or the factor of a connection is meant in "
            f"{was.unit}; must be in that"
        )
    return ""
