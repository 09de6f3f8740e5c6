"""The settings of a run, as plain data for run.json and for the header of an MDF file."""

from dataclasses import asdict
from typing import Any

from .description import System
from .made_of import changed
from .parts import NANOSECONDS
from .realtime import Realtime
from .scenario import event_entry, fault_entry
from .stimuli import input_entry


def run_settings(system: System) -> dict[str, Any]:
    """The settings of a run: those of its system, and what of these is not as it was read."""
    return {**settings(system), "changed": changed(system)}


def settings(system: System) -> dict[str, Any]:
    """The settings of a system, of types that JSON has. Times are in s.

    Events and faults are as a system file has them.
    """
    return {
        "system": system.name,
        "scheme": system.scheme,
        "step": system.step_ns / NANOSECONDS,
        "stop": system.stop_ns / NANOSECONDS,
        **({"start": system.start_ns / NANOSECONDS} if system.start_ns else {}),
        **({"diverging": system.diverging} if system.diverging != "stop" else {}),
        "initialisation": asdict(system.initialisation),
        "components": {
            component.name: {
                "fmu": component.fmu.name,
                "values": dict(component.values),
                "step": None if component.step_ns is None else component.step_ns / NANOSECONDS,
                "isolation": component.isolation,
                "rename": dict(component.rename),
                "units": dict(component.units),
                **({"solver": asdict(solver)} if (solver := component.integrated) else {}),
            }
            for component in system.components
        },
        "metrics": list(system.metrics),
        "roles": dict(system.roles),
        "connections": [
            {
                "from": str(connection.source),
                "to": str(connection.target),
                "factor": connection.factor,
                "offset": connection.offset,
            }
            for connection in system.connections
        ],
        "events": [event_entry(e) for e in system.events],
        "faults": [fault_entry(f) for f in system.faults],
        **({"realtime": asdict(system.realtime)} if system.realtime != Realtime() else {}),
        **({"input": input_entry(system.input)} if system.input else {}),
    }
