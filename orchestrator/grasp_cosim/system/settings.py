"""The settings of a run as plain data, for run.json and the header of an MDF file, and what of them
was changed since the system was read.
"""

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from .parts import Component, Realtime
from .scenario import event_entry, fault_entry
from .stimuli import input_entry
from .structure import Structure
from .times import in_seconds


def run_settings(system: Structure) -> dict[str, Any]:
    """The settings of a run: those of its system, and what of these is not as it was read."""
    return {**settings(system), "changed": changed(system)}


def settings(system: Structure) -> dict[str, Any]:
    """The settings of a system, of types that JSON has; times in s."""
    return {
        "system": system.name,
        "scheme": system.scheme,
        "step": in_seconds(system.step_ns),
        "stop": in_seconds(system.stop_ns),
        **({"start": in_seconds(system.start_ns)} if system.start_ns else {}),
        **({"diverging": system.diverging} if system.diverging != "stop" else {}),
        "initialisation": asdict(system.initialisation),
        "components": {
            c.name: {
                "fmu": c.fmu.name,
                "values": dict(c.values),
                "step": None if c.step_ns is None else in_seconds(c.step_ns),
                "isolation": c.isolation,
                "rename": dict(c.rename),
                "units": dict(c.units),
                **_solver(c),
                **({"logging": c.logging} if c.logging else {}),
            }
            for c in system.components
        },
        "metrics": list(system.metrics),
        **({"record": list(system.record.signals)} if system.record.signals else {}),
        "roles": dict(system.roles),
        "connections": [
            {"from": str(c.source), "to": str(c.target), "factor": c.factor, "offset": c.offset}
            for c in system.connections
        ],
        "events": [event_entry(e) for e in system.events],
        "faults": [fault_entry(f) for f in system.faults],
        **({"realtime": asdict(system.realtime)} if system.realtime != Realtime() else {}),
        **({"input": input_entry(system.input)} if system.input else {}),
    }


def _solver(component: Component) -> dict[str, Any]:
    """What solves the equations of a component, or the tolerance that its own solver is given."""
    if solver := component.integrated:
        return {"solver": asdict(solver)}
    if solver := component.solver:
        return {"tolerance": solver.relative_tolerance}
    return {}


def given_values(settings: Mapping[str, Any]) -> dict[str, Any]:
    """The start values in settings(), by names like plant.object_width."""
    return {
        f"{name}.{variable}": value
        for name, component in settings["components"].items()
        for variable, value in component["values"].items()
    }


def start_values(system: Structure) -> dict[str, Any]:
    """The start values that it sets, by names like plant.object_width."""
    return {f"{c.name}.{name}": v for c in system.components for name, v in c.values.items()}


def made_of(system: Structure) -> dict[str, Any]:
    """Its FMUs by component, the values given by variable, and the experiment; times in s."""
    return {
        **{c.name: c.fmu.name for c in system.components},
        **start_values(system),
        "step": in_seconds(system.step_ns),
        "stop": in_seconds(system.stop_ns),
        "start": in_seconds(system.start_ns),
        "scheme": system.scheme,
        "diverging": system.diverging,
        **({"input": system.input.file} if system.input else {}),
    }


def changed(system: Structure) -> dict[str, Any]:
    """Of made_of() what is not as it was read, as types that JSON has.

    A value that was not given there is compared with the one that the FMU starts with.
    """
    starts = {
        f"{c.name}.{name}": c.interface.by_name[name].start_value
        for c in system.components
        for name in c.values
    }
    return {
        key: value
        for key, value in made_of(system).items()
        if value != system.as_read.get(key, starts.get(key))
    }
