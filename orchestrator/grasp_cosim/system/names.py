"""Several names of one variable: a system has what is set or connected by its main name.

So a variable has one source and one value, by whichever of its names these are given.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, TypeVar

from ..base.errors import InputError
from ..interface.interface import Interface
from .parts import Component, Port
from .structure import Structure

Part = TypeVar("Part")


def in_main_names(system: Structure) -> dict[str, Any]:
    """The attributes of a system with ports by their main names; none where all have these."""
    interfaces = {c.name: c.interface for c in system.components}
    if not any(interface.main_names for interface in interfaces.values()):
        return {}
    events = [
        replace(event, set=_by_port(f"{system.name}: events[{i}]: set", interfaces, event.set))
        for i, event in enumerate(system.events)
    ]
    stimuli = system.input
    if stimuli is not None:
        columns = _by_port(stimuli.file, interfaces, stimuli.columns)
        stimuli = replace(stimuli, columns=columns)
    return {
        "components": tuple(_component(system, c) for c in system.components),
        "connections": tuple(
            replace(c, target=main_port(interfaces, c.target)) for c in system.connections
        ),
        "events": tuple(events),
        "faults": tuple(replace(f, target=main_port(interfaces, f.target)) for f in system.faults),
        "input": stimuli,
    }


def main_port(interfaces: Mapping[str, Interface], port: Port) -> Port:
    """The port by the main name of its variable."""
    interface = interfaces.get(port.component)
    return port if interface is None else Port(port.component, interface.main_name(port.variable))


def _component(system: Structure, component: Component) -> Component:
    values = component.interface.by_main_names(
        component.values, lambda name: f"{system.name}: {component.name}.{name}"
    )
    return component if values == component.values else replace(component, values=values)


def _by_port(
    place: str, interfaces: Mapping[str, Interface], parts: Mapping[Port, Part]
) -> dict[Port, Part]:
    """The same by main ports; InputError where two of them are one."""
    spelling: dict[Port, Port] = {}
    by_main_port: dict[Port, Part] = {}
    for port, part in parts.items():
        main = main_port(interfaces, port)
        if main in spelling:
            raise InputError(
                f"{place}: {spelling[main]} and {port} are names of one variable; must be one of "
                "them"
            )
        spelling[main], by_main_port[main] = port, part
    return by_main_port
