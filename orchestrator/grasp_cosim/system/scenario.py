"""Events and faults as entries of the system file, and back: see docs/system_files.md."""

import re
from collections.abc import Iterator, Sequence
from typing import Any

from ..base.checks import as_table, check_keys, real
from ..base.errors import InputError, nearest
from .faults import RANDOM
from .parts import (
    NANOSECONDS,
    Condition,
    Connection,
    Event,
    Fault,
    Port,
    in_nanoseconds,
)

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
