"""A system without one of its components, whose place something outside takes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from ..base.errors import InputError
from ..interface.fmi_types import Value
from ..interface.variables import Variable
from .parts import Component, Condition, Port
from .structure import Structure
from .validity import as_written

ZEROS: Mapping[str, Value] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}
"""What a variable starts with for which its FMU declares no start value, by kind."""


def start_of(variable: Variable) -> Any:
    """The start value that an FMU declares for a variable, or else zero, false or no text."""
    start = variable.start_value
    return ZEROS[variable.kind] if start is None else start


def without(system: Structure, name: str) -> dict[str, Any]:
    """The attributes of a system that change where a component is taken out.

    What it was connected to are inputs without a source then. What a system says of it is left out,
    with a note for what acts or judges: events, faults, limits and the like.
    """
    system.component(name, f"without {name!r}")
    rest = [c for c in system.components if c.name != name]
    if not rest:
        raise InputError(f"without {name!r}: {system.name} has no other component; must keep one")
    freed = [c.target for c in system.connections if c.source.component == name]
    components = tuple(_started(component, freed) for component in rest)
    record, missing = system.record.without_missing(system.components, components, system.outputs)
    notes = [f"record: {text!r} matches no signal any more: it is left out" for text in missing]
    acting, remarks = _acting(system, name)
    return {
        "components": components,
        "connections": tuple(
            c for c in as_written(system) if name not in (c.source.component, c.target.component)
        ),
        **acting,
        **_named(system, name),
        "record": record,
        "notes": (*system.notes, *notes, *remarks),
    }


def _started(component: Component, freed: Iterable[Port]) -> Component:
    """The component with values for inputs that have lost their source."""
    by_name = component.interface.by_name
    names = [port.variable for port in freed if port.component == component.name]
    starts = {name: start_of(by_name[name]) for name in names}
    return replace(component, values={**starts, **component.values}) if starts else component


def _acting(system: Structure, name: str) -> tuple[dict[str, Any], list[str]]:
    """The events, faults and limits that are about no port of a component, and notes on the others.

    A fault is also about the source of the connection that it is on.
    """
    sources = {c.target: c.source for c in system.connections}
    ports: dict[str, list[tuple[Any, list[Port]]]] = {
        "events": [(e, [*e.set, *_signal(e.when)]) for e in system.events],
        "faults": [(f, [f.target, sources[f.target], *_signal(f.when)]) for f in system.faults],
        "limits": [(limit, _signal(limit.when)) for limit in system.limits],
    }
    staying: dict[str, Any] = {}
    notes: list[str] = []
    for kind, parts in ports.items():
        about = [n for n, (_, named) in enumerate(parts) if name in {p.component for p in named}]
        staying[kind] = tuple(part for n, (part, _) in enumerate(parts) if n not in about)
        notes += [f"{kind}[{n}] is about {name}: it is left out" for n in about]
    return staying, notes


def _signal(condition: Condition | None) -> list[Port]:
    """The signal of a condition, if there is one."""
    return [condition.port] if condition else []


def _named(system: Structure, name: str) -> dict[str, Any]:
    """Roles, presets, inputs and outputs of the system that do not name a component."""
    places = f"{name}.", f"components.{name}."
    links = {
        n: tuple(link for link in i.links if link.port.component != name)
        for n, i in system.inputs.items()
    }
    return {
        "roles": {role: c for role, c in system.roles.items() if c != name},
        "presets": {
            preset: {place: v for place, v in values.items() if not place.startswith(places)}
            for preset, values in system.presets.items()
        },
        "inputs": {n: replace(system.inputs[n], links=left) for n, left in links.items() if left},
        "outputs": {n: o for n, o in system.outputs.items() if o.link.port.component != name},
    }
