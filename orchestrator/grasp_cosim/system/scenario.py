"""Events and faults as entries of the system file, and back; and their checks: they act on what
exists, in a way that it permits. The format: docs/system_files.md.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from typing import Any

from ..base.checks import as_table, check_keys, choice, exact, known, number, real, whole
from ..base.errors import InputError, choices, nearest
from ..interface.interface import Interface, Value
from .faults import FAULTS, RANDOM
from .parts import (
    NANOSECONDS,
    RELATIONS,
    Condition,
    Connection,
    Event,
    Fault,
    Port,
    first_step,
    in_nanoseconds,
    seconds,
)
from .stimuli_checks import driven
from .structure import Structure

_CONDITION = re.compile(r"""(.+?\S)\s*(<=|>=|==|!=|<|>)\s*('[^']*'|"[^"]*"|[^<>=!\s]+)""")


def read_events(place: str, entries: Any) -> tuple[Event, ...]:
    """The events of a list of entries; a System checks them. InputError where one is malformed."""
    return tuple(_event(at, entry) for at, entry in _entries(place, "events", entries))


def read_faults(place: str, entries: Any, connections: Sequence[Connection]) -> tuple[Fault, ...]:
    """The faults of a list of entries on connections; a System checks them.

    InputError where one is malformed.
    """
    return tuple(_fault(at, entry, connections) for at, entry in _entries(place, "faults", entries))


def event_entry(event: Event) -> dict[str, Any]:
    """The entry that reads as this event; it fits into JSON."""
    moment: dict[str, Any] = {}
    if event.at_ns is not None:
        moment["at"] = event.at_ns / NANOSECONDS
    if event.when is not None:
        moment["when"] = str(event.when)
    return {**moment, "set": {str(port): value for port, value in event.set.items()}}


def fault_entry(fault: Fault) -> dict[str, Any]:
    """The entry that reads as this fault; it fits into JSON."""
    entry = {"connection": str(fault.target), "kind": fault.kind, **fault.parameters}
    entry["from"] = fault.start_ns / NANOSECONDS
    if fault.end_ns is not None:
        entry["until"] = fault.end_ns / NANOSECONDS
    if fault.when is not None:
        entry["when"] = str(fault.when)
    if fault.kind in RANDOM:
        entry["seed"] = fault.seed
    return entry


def _entries(place: str, key: str, entries: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables of a list, each with its place."""
    if not isinstance(entries, list):
        raise InputError(f"{place}: {key} = {entries!r}: must be a list of tables, [[{key}]]")
    for i, entry in enumerate(entries):
        at = f"{place}: {key}[{i}]"
        yield at, as_table(at, entry)


def _event(place: str, entry: dict[str, Any]) -> Event:
    check_keys(place, entry, {"at", "when", "set"})
    values = as_table(f"{place}: set", entry.get("set"))
    for name, value in values.items():
        if not isinstance(value, float | int | bool | str):
            raise InputError(
                f"{place}: set.{name} = {value!r}: must be a number, boolean or string; "
                'a name stands in quotes, like "sensor_1.reflectance" = 0.6'
            )
    at = entry.get("at")
    return Event(
        {_port(f"{place}: set", name): value for name, value in values.items()},
        None if at is None else in_nanoseconds(f"{place}: at", at, zero=True),
        _condition(place, entry.get("when")),
    )


def _fault(place: str, entry: dict[str, Any], connections: Sequence[Connection]) -> Fault:
    kind: Any = entry.get("kind")
    until = entry.get("until")
    common = {"connection", "kind", "from", "until", "when", *(["seed"] if kind in RANDOM else [])}
    return Fault(
        _target(place, entry.get("connection"), connections),
        kind,
        {key: value for key, value in entry.items() if key not in common},
        in_nanoseconds(f"{place}: from", entry.get("from", 0.0), zero=True),
        None if until is None else in_nanoseconds(f"{place}: until", until),
        entry.get("seed", 0) if kind in RANDOM else 0,
        _condition(place, entry.get("when")),
    )


def _target(place: str, text: Any, connections: Sequence[Connection]) -> Port:
    """The target of the connection that the text names, by both of its ends or the target alone."""
    parts = [part.strip() for part in text.split("->")] if isinstance(text, str) else []
    if len(parts) not in (1, 2) or not all("." in part for part in parts):
        raise InputError(
            f"{place}: connection = {text!r}: must be 'component.output -> component.input', or "
            "'component.input' alone"
        )
    ends = [_port(place, part) for part in parts]
    if len(ends) == 2 and ends not in [[c.source, c.target] for c in connections]:
        found = nearest(text, connections)
        raise InputError(f"{place}: connection = {text!r}: no such connection; {found}")
    return ends[-1]


def _condition(place: str, text: Any) -> Condition | None:
    if text is None:
        return None
    found = _CONDITION.fullmatch(text.strip()) if isinstance(text, str) else None
    value = _constant(found[3]) if found else None
    if found is None or value is None:
        raise InputError(
            f"{place}: when = {text!r}: must be like 'plant.gap[1] < 0.01', "
            "'plant.contact[1] == true' or, for an Enumeration, \"plant.mode == 'fast'\""
        )
    return Condition(_port(f"{place}: when", found[1]), found[2], value)  # type: ignore[arg-type]


def _constant(text: str) -> float | str | None:
    if text[0] in "'\"":
        return text[1:-1] if len(text) > 1 and text[-1] == text[0] else None
    if text in ("true", "false"):
        return text == "true"
    try:
        return real(text)
    except ValueError:
        return None


def _port(place: str, text: str) -> Port:
    component, _, variable = text.partition(".")
    if not component or not variable:
        raise InputError(f"{place}: {text!r}: must be 'component.variable'")
    return Port(component, variable)


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
            at, given = f"{place}: {name}", fault.parameters.get(name)
            number(at, given, valid.low, valid.high, above=valid.above, must=str(valid))
        elif valid is None and name in fault.parameters:
            at, given = f"{place}: {name}", fault.parameters[name]
            exact(at, interface.parse(at, fault.target.variable, given))
