"""What a run was asked to do, as plain data for run.json and for the header of an MDF file."""

from collections.abc import Mapping
from typing import Any

from ..system.description import System
from ..system.parts import NANOSECONDS, Component, Event, Fault, Port, Wire


def settings(system: System) -> dict[str, Any]:
    """The settings of a system, of types that JSON has. Times are in s."""
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
        "wires": [_wire(w) for w in system.wires],
        "events": [_event(e) for e in system.events],
        "faults": [_fault(f) for f in system.faults],
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


def _wire(wire: Wire) -> dict[str, Any]:
    return {
        "from": str(wire.source),
        "to": str(wire.target),
        "factor": wire.factor,
        "offset": wire.offset,
    }


def _event(event: Event) -> dict[str, Any]:
    when = event.when
    return {
        "at": _seconds(event.at_ns),
        "when": None if when is None else f"{when.port} {when.relation} {when.value!r}",
        "set": _by_name(event.set),
    }


def _fault(fault: Fault) -> dict[str, Any]:
    return {
        "wire": str(fault.target),
        "kind": fault.kind,
        "parameters": dict(fault.parameters),
        "start": _seconds(fault.start_ns),
        "end": _seconds(fault.end_ns),
        "seed": fault.seed,
    }


def _by_name(values: Mapping[Port, Any]) -> dict[str, Any]:
    return {str(port): value for port, value in values.items()}
