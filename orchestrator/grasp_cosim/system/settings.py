"""What a run was asked to do, as plain data for run.json and for the header of an MDF file."""

from typing import Any

from .description import System
from .parts import NANOSECONDS, Component, Connection
from .scenario import event_entry, fault_entry


def settings(system: System) -> dict[str, Any]:
    """The settings of a system, of types that JSON has. Times are in s.

    Events and faults are as a system file has them.
    """
    loops = system.initialisation
    return {
        "system": system.name,
        "scheme": system.scheme,
        "step": _seconds(system.step_ns),
        "stop": _seconds(system.stop_ns),
        "initialisation": {
            "loops": loops.loops,
            "tolerance": loops.tolerance,
            "iterations": loops.iterations,
        },
        "components": {c.name: _component(c) for c in system.components},
        "roles": dict(system.roles),
        "connections": [_connection(w) for w in system.connections],
        "events": [event_entry(e) for e in system.events],
        "faults": [fault_entry(f) for f in system.faults],
    }


def _seconds(nanoseconds: int | None) -> float | None:
    return None if nanoseconds is None else nanoseconds / NANOSECONDS


def _component(component: Component) -> dict[str, Any]:
    return {
        "fmu": component.fmu.name,
        "values": dict(component.values),
        "step": _seconds(component.step_ns),
        "isolation": component.isolation,
        "rename": dict(component.rename),
    }


def _connection(connection: Connection) -> dict[str, Any]:
    return {
        "from": str(connection.source),
        "to": str(connection.target),
        "factor": connection.factor,
        "offset": connection.offset,
    }
