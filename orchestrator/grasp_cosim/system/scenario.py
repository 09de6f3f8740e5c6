"""Events, faults, limits and the trigger of a recording as entries of the system file, and back;
and their checks: they act on what exists, in a way that it permits.

The format: docs/reference/system_file.md.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from ..base.checks import (
    as_table,
    check_keys,
    check_values,
    choice,
    exact,
    known,
    number,
    real,
    whole,
)
from ..base.errors import InputError, choices, nearest
from ..interface.expansion import parse_values
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.values import Given, parse_value
from ..interface.variables import PARAMETERS, Variable
from .connectors import read_at, taps
from .faults import FAULTS, RANDOM
from .parts import (
    RELATIONS,
    THENS,
    Condition,
    Connection,
    Event,
    Fault,
    Limit,
    Port,
    as_lists,
    as_port,
    as_signal,
)
from .record import Trigger
from .structure import Structure
from .times import Time, first_step, in_nanoseconds, in_seconds, seconds, written
from .validity import MAX_NAMED, driven

_CONDITION = re.compile(r"""(.+?\S)\s*(<=|>=|==|!=|<|>)\s*('[^']*'|"[^"]*"|[^<>=!\s'"]+)""")


def read_events(name: str, entries: Any) -> tuple[Event, ...]:
    """The events of a list of entries; a System checks them. InputError where one is malformed."""
    events = []
    for place, entry in _tables(name, "events", entries):
        check_keys(place, entry, {"at", "when", "set"})
        values = as_table(f"{place}: set", entry.get("set"))
        check_values(f"{place}: set", values)
        events.append(
            Event(
                {as_port(f"{place}: set", port): value for port, value in values.items()},
                _time(place, entry, "at", zero=True),
                _condition(place, entry),
            )
        )
    return tuple(events)


def read_faults(name: str, entries: Any, connections: Sequence[Connection]) -> tuple[Fault, ...]:
    """The faults of a list of entries on connections; as read_events()."""
    faults = []
    for place, entry in _tables(name, "faults", entries):
        kind: Any = entry.get("kind")
        faults.append(
            Fault(
                _target_port(place, entry.get("connection"), connections),
                kind,
                {key: value for key, value in entry.items() if key not in _entries_of_kind(kind)},
                _time(place, {"from": 0.0, **entry}, "from", zero=True) or 0,
                _time(place, entry, "until"),
                entry.get("seed", 0) if kind in RANDOM else 0,
                _condition(place, entry),
            )
        )
    return tuple(faults)


def read_limits(name: str, entries: Any) -> tuple[Limit, ...]:
    """The limits of a list of entries; as read_events()."""
    limits = []
    for place, entry in _tables(name, "limits", entries):
        check_keys(place, entry, {"when", "then"})
        condition = _condition(place, entry)
        if condition is None:
            raise InputError(f"{place}: no entry 'when'; must have one, like 'plant.gap[1] < 0.01'")
        then = choice(f"{place}: then", entry.get("then", THENS[0]), THENS)
        limits.append(Limit(condition, then))
    return tuple(limits)


def trigger_entry(trigger: Trigger) -> dict[str, Any]:
    """The trigger of a recording as run.json has it; times in s."""
    return {
        "when": str(trigger.when),
        "before": in_seconds(trigger.before_ns),
        "after": in_seconds(trigger.after_ns),
    }


def limit_entry(limit: Limit) -> dict[str, Any]:
    """The entry that reads as this limit; it fits into JSON."""
    return {"when": str(limit.when), "then": limit.then}


def event_entry(event: Event) -> dict[str, Any]:
    """The entry that reads as this event; it fits into JSON."""
    entry: dict[str, Any] = {}
    if event.at_ns is not None:
        entry["at"] = in_seconds(event.at_ns)
    if event.when:
        entry["when"] = str(event.when)
    entry["set"] = {str(port): as_lists(value) for port, value in event.set.items()}
    return entry


def fault_entry(fault: Fault) -> dict[str, Any]:
    """The entry that reads as this fault; it fits into JSON."""
    entry: dict[str, Any] = {"connection": str(fault.target), "kind": fault.kind}
    entry |= fault.parameters
    entry["from"] = in_seconds(fault.start_ns)
    if fault.end_ns is not None:
        entry["until"] = in_seconds(fault.end_ns)
    if fault.when:
        entry["when"] = str(fault.when)
    if fault.kind in RANDOM:
        entry["seed"] = fault.seed
    return entry


def _entries_of_kind(kind: Any) -> list[str]:
    """The entries of a fault of a kind, in addition to its parameters."""
    seed = ["seed"] if kind in RANDOM else []
    return ["connection", "kind", "from", "until", "when", *seed]


def _tables(name: str, key: str, entries: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """The tables of a list, each with its place."""
    if not isinstance(entries, list):
        raise InputError(f"{name}: {key} = {entries!r}: must be a list of tables, [[{key}]]")
    for i, entry in enumerate(entries):
        yield f"{name}: {key}[{i}]", as_table(f"{name}: {key}[{i}]", entry)


def _time(place: str, entry: Mapping[str, Any], key: str, zero: bool = False) -> Time | None:
    return in_nanoseconds(f"{place}: {key}", entry[key], zero) if key in entry else None


def _target_port(place: str, text: Any, connections: Sequence[Connection]) -> Port:
    """The target of the connection that the text names, by both of its ends or the target only."""
    ends = [part.strip() for part in text.split("->")] if isinstance(text, str) else [text]
    if len(ends) == 1:
        return as_port(f"{place}: connection", ends[0], "'component.output -> component.input'")
    for connection in connections:
        if ends == [str(connection.source), str(connection.target)]:
            return connection.target
    near = nearest(text, connections)
    raise InputError(f"{place}: connection = {text!r}: no such connection; {near}")


def _condition(place: str, entry: Mapping[str, Any]) -> Condition | None:
    text = entry.get("when")
    return None if text is None else read_condition(f"{place}: when", text)


def read_condition(place: str, text: Any) -> Condition:
    """The condition that a text is; InputError where it is none."""
    parts = _CONDITION.fullmatch(text.strip()) if isinstance(text, str) else None
    try:
        port, relation, constant = parts.groups() if parts else ("", "", "none")
        value = _constant_from(constant)
    except ValueError:
        raise InputError(
            f"{place} = {text!r}: must be like 'plant.gap[1] < 0.01', "
            "'plant.contact[1] == true' or, for an Enumeration, \"plant.mode == 'fast'\""
        ) from None
    return Condition(as_signal(place, port), relation, value)  # type: ignore[arg-type]


def _constant_from(text: str) -> float | bool | str:
    if text in ("true", "false"):
        return text == "true"
    return text[1:-1] if text[0] in "'\"" else real(text)


def check_scenario(system: Structure) -> None:
    """InputError at the first event or fault that is not as it must be."""
    for i, event in enumerate(system.events):
        place = f"{system.name}: events[{i}]"
        if (event.at_ns is None) == (event.when is None):
            raise InputError(f"{place}: must have either at, a time in s, or when, a condition")
        if not event.set:
            raise InputError(f"{place}: set is empty; valid: {choices(settable_ports(system))}")
        _check_condition(system, event.when, f"{place}: when")
        for port, value in event.set.items():
            parse_set_values(system, port, value, f"{place}: set.{port}")
    for i, limit in enumerate(system.limits):
        _check_condition(system, limit.when, f"{system.name}: limits[{i}]: when")
    for i, fault in enumerate(system.faults):
        _check_fault(system, fault, f"{system.name}: faults[{i}]")
    if trigger := system.record.trigger:
        _check_condition(system, trigger.when, f"{system.name}: record.trigger")


def settable_ports(system: Structure) -> dict[Port, Variable]:
    """The ports an event may set: tunable parameters and inputs without a source."""
    connected = {*(connection.target for connection in system.connections), *driven(system)}
    return {
        port: v
        for component in system.components
        for v in component.interface.of("input", "parameter")
        if v.supported
        and (port := Port(component.name, v.name)) not in connected
        and (v.causality == "input" or v.variability == "tunable")
    }


def parse_set_values(system: Structure, port: Port, value: Given, place: str) -> dict[Port, Value]:
    """The value that is set at a port in the run, of a whole array those of its elements.

    InputError where it cannot be set then.
    """
    interface = system.component(port.component, place).interface
    settable = system.once(settable_ports)
    if not settable.keys() >= {*system.elements(port)}:
        of_component = [str(p) for p in settable if p.component == port.component]
        near = (
            nearest(port, of_component, interface.listing)
            if of_component
            else "the component has none"
        )
        settable_kinds = (
            "what can be set in a run is an input without a source, or a tunable parameter"
        )
        raise InputError(
            f"{place}: {_reason_unsettable(system, interface, port)}; {settable_kinds}; {near}"
        )
    values = parse_values(interface, place, port.variable, value)
    return {Port(port.component, name): v for name, v in values.items()}


def _reason_unsettable(system: Structure, interface: Interface, port: Port) -> str:
    """Why a variable, or a whole array, cannot be set in the run, and what else does that."""
    v = interface.sample(port.variable)
    if v is None:
        return f"{interface.short} has no variable {port.variable!r}"
    if port.variable not in (v.name, *interface.arrays):
        several = choices(interface.elements(port.variable), MAX_NAMED)
        return f"there are {several} of it, which must be set one by one"
    elements = system.elements(port)
    if {*elements} & {*driven(system)}:
        return "is driven by a column: must have its values there, or no column"
    instead = f"must be set before the run, --set {port}=VALUE"
    if v.causality == "structuralParameter":
        return f"is a structural parameter, which decides on sizes: {instead}"
    if v.causality in PARAMETERS:
        return f"is a {v.variability} parameter: {instead}"
    if v.causality != "input":
        return f"is the start of what the FMU calculates: {instead}" if v.settable else v.unsettable
    connection = next((c for c in system.connections if c.target in elements), None)
    if connection is None:
        return f"is an input of type {v.nature}, which cannot be set"
    stuck = f"a fault on '{connection}' of kind 'stuck' puts a value in its place"
    return f"is an input with a connection: {stuck}"


def _check_condition(system: Structure, condition: Condition | None, place: str) -> None:
    if condition is None:
        return
    port, value = condition.port, condition.value
    source, _ = read_at(system, port)
    source = as_port(place, str(source))
    place = f"{place} = '{condition}'"
    interface = system.component(source.component, place).interface
    valid = [v.name for v in interface.variables if v.is_number]
    lacking = f"{place}: {source.component} has no number"
    known(lacking, source.variable, valid, see=interface.listing)
    kind: str = interface.by_name[source.variable].kind
    items = interface.by_name[source.variable].items
    if source != port:
        kind = system.once(taps)[str(port)].kind
    boolean = kind == "Boolean"
    is_word = isinstance(value, bool)
    relations = RELATIONS
    if kind == "Real":
        relations = RELATIONS[:4]
    elif boolean and is_word:
        relations = RELATIONS[4:]
    if isinstance(value, str):
        known(f"{place}: {port} is {kind} and has no item", value, items)
    elif kind == "Integer" and float(value).is_integer():
        exact(place, int(value))
    fits_number = value in (0.0, 1.0) if boolean else not is_word
    fits = isinstance(value, str) or (fits_number and math.isfinite(value))
    if condition.relation not in relations or not fits:
        constants = "true or false, or 0 or 1" if boolean else "a finite number"
        raise InputError(
            f"{place}: {port} is {kind}; must be compared with {constants}, by {choices(relations)}"
        )


def _check_fault(system: Structure, fault: Fault, place: str) -> None:
    targets = [connection.target for connection in system.connections]
    if fault.target not in targets:
        raise InputError(
            f"{place}: connection = '{fault.target}': no connection ends there; "
            f"{nearest(fault.target, targets)}"
        )
    choice(f"{place}: kind", fault.kind, FAULTS)
    interface = system.component(fault.target.component, place).interface
    kind, fault_kind = interface.by_name[fault.target.variable].kind, FAULTS[fault.kind]
    possible = [name for name, f in FAULTS.items() if kind == "Real" or f.discrete]
    if kind == "String" or fault.kind not in possible:
        raise InputError(
            f"{place}: kind = {fault.kind!r}: {fault.target} is {kind}; must be one of "
            f"{choices(possible if kind != 'String' else ())}"
        )
    entries = [*fault_kind.parameters, *_entries_of_kind(fault.kind)]
    for name in fault.parameters:
        known(f"{place}: unknown entry", name, entries, f" of {fault.kind}")
    for name, valid_range in fault_kind.parameters.items():
        label, parameter = f"{place}: {name}", fault.parameters.get(name)
        if valid_range and (valid_range.needed or name in fault.parameters):
            number(
                label,
                parameter,
                valid_range.low,
                valid_range.high,
                above=valid_range.above,
                must=valid_range.must,
            )
        elif not valid_range and name in fault.parameters:
            exact(
                label, parse_value(interface, label, fault.target.variable, fault.parameters[name])
            )
    fault_kind.check(place, fault.parameters, system.step_ns)
    step, start, end = system.step_ns, fault.start_ns, fault.end_ns
    since = system.start_ns
    if end is not None and first_step(start, step, since) >= first_step(end, step, since):
        raise InputError(
            f"{place}: from {seconds(start)} until {seconds(end)}: must hold a communication "
            f"point, a multiple of {written(step)} s"
        )
    _check_condition(system, fault.when, f"{place}: when")
    whole(f"{place}: seed", fault.seed, 0, must="a whole number, at least 0")
