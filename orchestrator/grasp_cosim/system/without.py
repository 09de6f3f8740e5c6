"""A system without one of its components, whose place something outside takes."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any, TypeVar

from ..base.errors import InputError
from ..interface.values import Given
from .parts import Component, Condition, Event, Link, Port, SystemInput
from .structure import Structure
from .validity import as_written

STARTS: Mapping[str, Given] = {"Real": 0.0, "Integer": 0, "Boolean": False, "String": ""}
"""What an input starts with for which its FMU declares no start value, by kind."""

Part = TypeVar("Part")


def without(system: Structure, name: str) -> dict[str, Any]:
    """The attributes of a system that change where a component is taken out.

    What it was connected to are inputs without a source then. What a system says of it is left out,
    with a note for what acts or judges: events, faults, limits and the like.
    """
    system.component(name, f"without {name!r}")
    components = tuple(c for c in system.components if c.name != name)
    if not components:
        raise InputError(f"without {name!r}: {system.name} has no other component; must keep one")
    connections = tuple(
        c for c in as_written(system) if name not in (c.source.component, c.target.component)
    )
    freed = {
        c.target for c in system.connections if c.source.component == name != c.target.component
    }
    notes: list[str] = []
    record, missing = system.record.without_missing(system.components, components, system.outputs)
    notes += [f"record: {text!r} matches no signal any more: it is left out" for text in missing]

    def kept(kind: str, parts: Iterable[tuple[Part, Iterable[Port]]]) -> tuple[Part, ...]:
        """Those of parts that name no port of the component; a note on each other one."""
        staying = []
        for number, (part, ports) in enumerate(parts):
            if any(port.component == name for port in ports):
                notes.append(f"{kind}[{number}] is about {name}: it is left out")
            else:
                staying.append(part)
        return tuple(staying)

    sources = {c.target: c.source for c in system.connections}
    faults = ((f, [f.target, sources[f.target], *_of(f.when)]) for f in system.faults)
    return {
        "components": tuple(_started(component, freed) for component in components),
        "connections": connections,
        "events": kept("events", ((e, _ports_of(e)) for e in system.events)),
        "faults": kept("faults", faults),
        "limits": kept("limits", ((limit, [limit.when.port]) for limit in system.limits)),
        "roles": {role: c for role, c in system.roles.items() if c != name},
        "presets": {
            preset: {p: v for p, v in values.items() if not _is_of(p, name)}
            for preset, values in system.presets.items()
        },
        "inputs": _inputs(system, name),
        "outputs": {n: o for n, o in system.outputs.items() if o.link.port.component != name},
        "record": record,
        "notes": (*system.notes, *notes),
    }


def _started(component: Component, freed: Iterable[Port]) -> Component:
    """The component with values for inputs that have lost their source."""
    values = {
        port.variable: component.interface.by_name[port.variable].start_value
        for port in freed
        if port.component == component.name and port.variable not in component.values
    }
    filled: dict[str, Any] = {
        variable: STARTS[component.interface.by_name[variable].kind] if value is None else value
        for variable, value in values.items()
    }
    return replace(component, values={**filled, **component.values}) if filled else component


def _of(condition: Condition | None) -> list[Port]:
    """The signal of a condition, if there is one."""
    return [condition.port] if condition else []


def _ports_of(event: Event) -> list[Port]:
    """What an event sets, and what it waits for."""
    return [*event.set, *_of(event.when)]


def _is_of(place: str, name: str) -> bool:
    """True for the place of a value or of an entry of a component."""
    return place.startswith((f"{name}.", f"components.{name}."))


def _inputs(system: Structure, name: str) -> dict[str, SystemInput]:
    """The inputs of the system, with the links that do not end at the component."""

    def stays(link: Link) -> bool:
        return link.port.component != name

    linked = {n: tuple(filter(stays, i.links)) for n, i in system.inputs.items()}
    return {n: replace(system.inputs[n], links=links) for n, links in linked.items() if links}
