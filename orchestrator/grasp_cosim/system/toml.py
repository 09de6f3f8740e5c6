"""Read a system file: its entries override the defaults. docs/reference/system_file.md."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..base.checks import as_table, check_keys, check_values, is_number, text, toml_table
from ..base.errors import InputError
from .entries import sections, with_overrides
from .overrides import (
    ENTRIES_OF_COMPONENT,
    ENTRIES_OF_SECTIONS,
    PLACE,
    RECORD,
    SECTIONS,
    SIGNALS,
    TABLES_OF_COMPONENT,
    ComponentOverrides,
    Override,
)
from .parts import Component, Connection, as_port
from .scenario import read_events, read_faults, read_limits
from .stimuli import Stimuli
from .validity import by_element

DEFAULT_EXPERIMENT = {"step": None, "stop": None, "scheme": "sequential"}
"""What [experiment] says where a file leaves it out; None is refused, as it must be given."""

TODO = re.compile(r"""(?:[^#"']|"(?!TODO\b)(?:[^"\\]|\\.)*"|'(?!TODO\b)[^']*')*["']TODO\b""")
"""A line with a value that is left to do; a # in quotes begins no comment."""


FMU_ENTRY = re.compile(r"[^#]*\bfmu\s*=")
"""A line of a system file that names an FMU."""


def read_toml(path: Path, fmus: Path | None, stimuli: Stimuli | None) -> dict[str, Any]:
    """The attributes of the system of a TOML file; fmus is the folder of its FMUs, or None.

    stimuli go before those that it names.
    """
    file = toml_table(path, "system file")
    check_filled_in(path)
    check_sections(file, path.name)
    components = []
    for name, table in file["components"].items():
        label = f"{path.name}: components.{name}"
        check_keys(label, as_table(label, table), ENTRIES_OF_COMPONENT)
        fmu = text(f"{label}.fmu", table.get("fmu"), "the path of an FMU, as a string")
        component = Component(name, (fmus or path.parent) / fmu, {})
        check_is_there(component, path, fmu)
        components.append(with_entries(component, table, path.name))
    return described(file, path.name, components, path.parent, stimuli)


def check_is_there(component: Component, path: Path, fmu: str) -> None:
    """InputError with the line of a system file if the FMU that it names does not exist."""
    if component.fmu.exists():
        return
    lines = path.read_text("utf-8").splitlines()
    stated = [
        number for number, line in enumerate(lines, 1) if FMU_ENTRY.match(line) and fmu in line
    ]
    number = stated[0] if stated else 1
    raise InputError(
        f"{path.name}: line {number}: components.{component.name}.fmu = {fmu!r}: there is no such "
        f"FMU in {component.fmu.parent}; must be the path of a file, relative to the system file"
    )


def with_entries(component: Component, table: Mapping[str, Any], file: str) -> Component:
    """The component with the entries of its table in a file of that name, but for its FMU."""
    place = f"components.{component.name}"
    entries = _overrides(file, place, table)
    entries.pop("fmu", None)
    tables = {}
    for name in TABLES_OF_COMPONENT:
        if entry := entries.pop(name, None):
            tables[name] = _overrides(file, entry.place, as_table(entry.label, entry.value))
    check_values(f"{file}: {place}.values", table.get("values", {}))
    return with_overrides(component, ComponentOverrides(entries, tables))[0]


def _overrides(file: str, place: str, table: Mapping[str, Any]) -> dict[str, Override]:
    """The overrides that a table at a place of a file of that name stands for, by entry."""
    origin = f"{file}: {PLACE}"
    return {entry: Override(f"{place}.{entry}", value, origin) for entry, value in table.items()}


def check_sections(file: dict[str, Any], name: str) -> None:
    """Check which tables there are in a file of that name, and fill in those that are left out."""
    check_keys(name, file, (*SECTIONS, RECORD))
    for section in (*ENTRIES_OF_SECTIONS, "presets"):
        label = f"{name}: [{section}]"
        must_be_there = section in ("experiment", "components")
        file[section] = as_table(label, file.get(section, None if must_be_there else {}))
        if entries := ENTRIES_OF_SECTIONS.get(section):
            keys = (SIGNALS, *entries) if section == RECORD else entries
            check_keys(label, file[section], keys)


def described(
    file: dict[str, Any],
    name: str,
    components: Sequence[Component],
    folder: Path = Path(),
    stimuli: Stimuli | None = None,
) -> dict[str, Any]:
    """The attributes of a system of that name that the tables of a file in a folder describe."""
    for preset, values in file["presets"].items():
        label = f"{name}: presets.{preset}"
        check_values(label, as_table(label, values))
    metrics = _list(f"{name}: metrics", file.get("metrics", []), '["grasp"]')
    for group in metrics:
        text(f"{name}: metrics", group, "the name of a group of metrics")
    form = "['component.output -> component.input']"
    entries = _list(f"{name}: connections", file.get("connections", []), form)
    read = [read_connection(f"{name}: connections[{i}]", entry) for i, entry in enumerate(entries)]
    connections = by_element(name, components, read)
    if stimuli:
        file["input"] = {}
    file["experiment"] = DEFAULT_EXPERIMENT | file["experiment"]
    file[RECORD] = {**file[RECORD]}
    recorded = _recorded_signals(name, file[RECORD].pop(SIGNALS, []))
    single_values = {
        section: _overrides(name, section, file[section])
        for section in ENTRIES_OF_SECTIONS
        if section != "components"
    }
    attributes = sections(None, single_values, folder)
    if stimuli:
        attributes["input"] = stimuli
    return {
        **attributes,
        "name": name,
        "components": tuple(components),
        "connections": connections,
        "events": read_events(name, file.get("events", [])),
        "faults": read_faults(name, file.get("faults", []), connections),
        "limits": read_limits(name, file.get("limits", [])),
        "presets": file["presets"],
        "metrics": tuple(metrics),
        "record": replace(attributes["record"], signals=recorded),
    }


def _recorded_signals(name: str, entry: Any) -> tuple[str, ...]:
    """The signals that [record] of a file of that name has."""
    label = f"{name}: {RECORD}.{SIGNALS}"
    signals = _list(label, entry, '["plant.*"]')
    for i, signal in enumerate(signals):
        text(f"{label}[{i}]", signal, "a name like 'plant.gap[1]', or 'plant.*'")
    return tuple(signals)


def _list(label: str, entry: Any, form: str) -> list[Any]:
    """The entry, which must be a list of that form."""
    if not isinstance(entry, list):
        raise InputError(f"{label} = {entry!r}: must be a list, like {form}")
    return entry


def check_filled_in(path: Path) -> None:
    """InputError at the first value of a system file that is a TODO, as `init` writes it."""
    unfilled = to_do(path.read_text("utf-8"))
    if not unfilled:
        return
    (number, line), *later = unfilled.items()
    also = f", as is line {', '.join(str(n) for n, _ in later)}" if later else ""
    raise InputError(f"{path.name}: line {number}: {line}: must be filled in{also}")


def to_do(text: str) -> dict[int, str]:
    """The lines of a system file, by their numbers, with values that are a TODO."""
    lines = enumerate(text.split("\n"), 1)
    return {number: line.strip(" \t\r,") for number, line in lines if TODO.match(line)}


def read_connection(place: str, entry: Any) -> Connection:
    """The connection of an entry of a file."""
    if not isinstance(entry, dict):
        ends = [end.strip() for end in entry.split("->")] if isinstance(entry, str) else []
        if len(ends) != 2:
            raise InputError(f"{place}: {entry!r}: must be 'component.output -> component.input'")
        return Connection(as_port(place, ends[0]), as_port(place, ends[1]))
    check_keys(place, entry, {"from", "to", "factor", "offset"})
    for key in ("factor", "offset"):
        if not is_number(entry.get(key, 0.0)):
            raise InputError(f"{place}: {key} = {entry[key]!r}: must be a number")
    source = as_port(f"{place}: from", entry.get("from"))
    target = as_port(f"{place}: to", entry.get("to"))
    return Connection(source, target, entry.get("factor"), entry.get("offset"))
