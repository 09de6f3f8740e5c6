"""Checks of events and faults: they act on what exists, in a way that it permits."""

from __future__ import annotations

import math

from ..base.checks import choice, exact, known, whole
from ..base.errors import InputError, choices, nearest
from ..interface.interface import Interface, Value
from .faults import FAULTS
from .parts import RELATIONS, Condition, Event, Fault, Port, first_step, seconds
from .stimuli_checks import driven
from .structure import Structure


def check_scenario(system: Structure) -> None:
    """InputError at the first event or fault that is not as it must be."""
    for i, event in enumerate(system.events):
        _check_event(system, event, f"{system.name}: events[{i}]")
    for i, fault in enumerate(system.faults):
        _check_fault(system, fault, f"{system.name}: faults[{i}]")


def _check_event(system: Structure, event: Event, place: str) -> None:
    if (event.at_ns is None) == (event.when is None):
        raise InputError(f"{place}: must have either at, a time in s, or when, a condition")
    if not event.set:
        raise InputError(f"{place}: set is empty; valid: {choices(_settable(system))}")
    if event.when is not None:
        _check_condition(system, event.when, f"{place}: when = '{event.when}'")
    for port, value in event.set.items():
        check_setting(system, port, value, f"{place}: set.{port}")


def _settable(system: Structure) -> list[Port]:
    """Return the ports an event may set: tunable parameters and inputs without a source."""
    connected = {*(connection.target for connection in system.connections), *driven(system)}
    return [
        port
        for component in system.components
        for v in component.interface.of("input", "parameter")
        if v.supported
        and (port := Port(component.name, v.name)) not in connected
        and (v.causality == "input" or v.variability == "tunable")
    ]


def check_setting(system: Structure, port: Port, value: Value, place: str) -> None:
    """InputError where the value cannot be set at the port during a run."""
    interface = system.component(port.component, place).interface
    for connection in system.connections:
        if connection.target == port:
            raise InputError(
                f"{place}: has a connection, from {connection.source}; put a fault of kind 'stuck' "
                "on it, with a value"
            )
    if system.input and port in driven(system):
        raise InputError(f"{place}: has a column in {system.input.file}; must have one source")
    settable = _settable(system)
    if port not in settable:
        variable = interface.by_name.get(port.variable)
        found = f"is a {variable.variability} {variable.causality}" if variable else "not there"
        own = [p for p in settable if p.component == port.component]
        if port.variable in interface.arrays:
            found, names = "is an array", interface.arrays[port.variable].names
            own = [p for p in own if p.variable in names]
        raise InputError(
            f"{place}: {found}; must be a tunable parameter or an input without a connection; "
            f"{nearest(port, own or settable, interface.listing)}"
        )
    interface.parse(place, port.variable, value)


def _check_condition(system: Structure, condition: Condition, place: str) -> None:
    interface = system.component(condition.port.component, place).interface
    valid = [v.name for v in interface.of("output") if v.is_number]
    component, variable = condition.port.component, condition.port.variable
    said = f"{place}: {component} has no numeric output"
    known(said, variable, valid, see=interface.listing)
    kind, items = interface.by_name[variable].kind, interface.by_name[variable].items
    relations = {"Real": RELATIONS[:4], "Boolean": RELATIONS[4:]}.get(kind, RELATIONS)
    if condition.relation not in relations:
        raise InputError(
            f"{place}: {condition.port} is {kind}; must be compared with {choices(relations)}"
        )
    if isinstance(condition.value, str):
        said = f"{place}: {condition.port} is {kind} and has no item"
        known(said, condition.value, items)
        return
    if kind == "Integer" and float(condition.value).is_integer():
        exact(place, int(condition.value))
    boolean = isinstance(condition.value, bool)
    if boolean != (kind == "Boolean") or not math.isfinite(condition.value):
        expected = "true or false" if kind == "Boolean" else "a finite number"
        raise InputError(f"{place}: {condition.port} is {kind}; must be compared with {expected}")


def _check_fault(system: Structure, fault: Fault, place: str) -> None:
    targets = [connection.target for connection in system.connections]
    if fault.target not in targets:
        raise InputError(
            f"{place}: connection = '{fault.target}': no connection ends there; "
            f"{nearest(fault.target, targets)}"
        )
    choice(f"{place}: kind", fault.kind, FAULTS)
    interface = system.component(fault.target.component, place).interface
    kind = interface.by_name[fault.target.variable].kind
    discrete = kind in ("Integer", "Boolean")
    possible = [name for name, f in FAULTS.items() if kind == "Real" or (discrete and f.discrete)]
    if fault.kind not in possible:
        raise InputError(
            f"{place}: kind = {fault.kind!r}: {fault.target} is {kind}; "
            f"must be one of {choices(possible)}"
        )
    _check_parameters(fault, interface, place)
    step, start, end = system.step_ns, fault.start_ns, fault.end_ns
    since = system.start_ns
    if end is not None and first_step(start, step, since) >= first_step(end, step, since):
        raise InputError(
            f"{place}: from {seconds(start)} until {seconds(end)}: must hold a communication "
            f"point, a multiple of {seconds(step)}"
        )
    FAULTS[fault.kind].check(place, fault.parameters, system.step_ns)
    if fault.when is not None:
        _check_condition(system, fault.when, f"{place}: when = '{fault.when}'")
    whole(f"{place}: seed", fault.seed, 0, must="a whole number, at least 0")


def _check_parameters(fault: Fault, interface: Interface, place: str) -> None:
    kind = FAULTS[fault.kind]
    for name in fault.parameters:
        if name not in kind.parameters:
            others = ["connection", "kind", "from", "until", "when", *["seed"] * kind.random]
            raise InputError(
                f"{place}: unknown entry {name!r} of {fault.kind}; "
                f"{nearest(name, [*kind.parameters, *others])}"
            )
    for name, valid in kind.parameters.items():
        if valid is not None and (valid.needed or name in fault.parameters):
            valid.check(f"{place}: {name}", fault.parameters.get(name))
        elif valid is None and name in fault.parameters:
            at, given = f"{place}: {name}", fault.parameters[name]
            exact(at, interface.parse(at, fault.target.variable, given))
