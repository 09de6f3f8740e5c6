"""The settings of a run as plain data, for run.json and the header of an MDF file. The changes
since the system was read are among them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from .parts import Acceptance, Component, Event, Realtime
from .scenario import event_entry, fault_entry, limit_entry, trigger_entry
from .stimuli import input_entry
from .structure import Structure
from .times import in_seconds


def run_settings(system: Structure) -> dict[str, Any]:
    """The settings of a run: those of its system, and what of these is not as it was read."""
    return {**settings(system), "changed": changed(system)}


def with_events(settings: Mapping[str, Any], events: Sequence[Event]) -> Mapping[str, Any]:
    """The settings of a run with events in addition, which come last."""
    if not events:
        return settings
    return {**settings, "events": [*settings["events"], *map(event_entry, events)]}


def settings(system: Structure) -> dict[str, Any]:
    """The settings of a system, of types that JSON has; times in s."""
    entries: dict[str, Any] = {
        "system": system.name,
        "scheme": system.scheme,
        "step": in_seconds(system.step_ns),
        "stop": in_seconds(system.stop_ns),
    }
    if system.start_ns:
        entries["start"] = in_seconds(system.start_ns)
    if system.diverging != "stop":
        entries["diverging"] = system.diverging
    entries["initialisation"] = asdict(system.initialisation)
    entries["components"] = {c.name: _component(c) for c in system.components}
    entries["metrics"] = list(system.metrics)
    if system.record.signals:
        entries["record"] = list(system.record.signals)
    if system.record.trigger:
        entries["trigger"] = trigger_entry(system.record.trigger)
    entries["roles"] = dict(system.roles)
    entries["connections"] = [
        {"from": str(c.source), "to": str(c.target), "factor": c.factor, "offset": c.offset}
        for c in system.connections
    ]
    entries["events"] = [event_entry(e) for e in system.events]
    entries["faults"] = [fault_entry(f) for f in system.faults]
    if system.limits:
        entries["limits"] = [limit_entry(limit) for limit in system.limits]
    if system.verdict != Acceptance():
        entries["acceptance"] = _acceptance(system.verdict)
    if system.realtime != Realtime():
        entries["realtime"] = asdict(system.realtime)
    if system.steered:
        entries["steered"] = True
    if system.input:
        entries["input"] = input_entry(system.input)
    return entries


def _acceptance(verdict: Acceptance) -> dict[str, Any]:
    """The limits of the verdict, those of metrics by name."""
    entries = asdict(verdict)
    metrics = {limit.pop("name"): limit for limit in entries.pop("metrics")}
    return {**entries, "metrics": metrics} if metrics else entries


def _component(component: Component) -> dict[str, Any]:
    """The settings of a component."""
    step = component.step_ns
    entries: dict[str, Any] = {
        "fmu": component.fmu.name,
        "values": dict(component.values),
        "value_units": _value_units(component),
        "step": None if step is None else in_seconds(step),
        "isolation": component.isolation,
        "rename": dict(component.rename),
        "units": dict(component.units),
        **_solver(component),
    }
    if component.logging:
        entries["logging"] = component.logging
    return entries


def _value_units(component: Component) -> dict[str, str]:
    """The units of the start values of a component, but for mere numbers, of unit 1."""
    variables = component.interface.by_name
    units = {name: variables[name].unit for name in component.values if name in variables}
    return {name: unit for name, unit in units.items() if unit not in (None, "", "1")}


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


def given_units(settings: Mapping[str, Any]) -> dict[str, str]:
    """The units of the start values in settings() by the same names; older runs have none."""
    return {
        f"{name}.{variable}": unit
        for name, component in settings["components"].items()
        for variable, unit in component.get("value_units", {}).items()
    }


def start_values(system: Structure) -> dict[str, Any]:
    """The start values that it sets, by names like plant.object_width."""
    return {f"{c.name}.{name}": v for c in system.components for name, v in c.values.items()}


def summary(system: Structure) -> dict[str, Any]:
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
    """Of summary() what is not as it was read, as types that JSON has.

    A value that was not given there is compared with the one that the FMU starts with.
    """
    starts = {
        f"{c.name}.{name}": c.interface.by_name[name].start_value
        for c in system.components
        for name in c.values
    }
    return {
        key: value
        for key, value in summary(system).items()
        if value != system.as_read.get(key, starts.get(key))
    }
