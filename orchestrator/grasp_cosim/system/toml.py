"""The system file: a system in TOML. Its entries are in docs/system_files.md."""

import re
from dataclasses import replace
from pathlib import Path
from typing import Any

from ..base.checks import as_table, check_keys, check_values, choice, is_number, text, toml_table
from ..base.errors import InputError
from ..interface.interface import Given
from ..interface.read import read_interface
from .arrays import with_given
from .changes import ENTRIES, PLACES, SECTIONS, changed
from .description import System
from .parts import (
    ISOLATIONS,
    Component,
    Connection,
    Initialisation,
    Port,
    Realtime,
    Solver,
    in_nanoseconds,
)
from .scenario import read_events, read_faults
from .stimuli import Stimuli, read_stimuli
from .structure import experiment

TODO = re.compile(r"""(?:[^#"']|"(?!TODO\b)(?:[^"\\]|\\.)*"|'(?!TODO\b)[^']*')*["']TODO\b""")
"""A line with a value that is left to do; a # in quotes begins no comment."""


def read_toml(path: Path, fmus: Path | None = None, stimuli: Stimuli | None = None) -> System:
    """The system of a TOML file; fmus is where its FMUs are, by default beside the file.

    stimuli go before those that it names.
    """
    place, folder = path.name, fmus or path.parent
    table = toml_table(path, "system file")
    check_filled_in(path)
    check_keys(place, table, SECTIONS)

    def part(name: str, default: Any = None) -> dict[str, Any]:
        return as_table(f"{place}: [{name}]", table.get(name, default))

    chosen = part("experiment")
    check_keys(f"{place}: [experiment]", chosen, PLACES["experiment"])
    components = part("components")
    connections = _connections(f"{place}: connections", table.get("connections", []))
    system = System(
        place,
        tuple(_component(place, name, entry, folder) for name, entry in components.items()),
        connections,
        **experiment(
            lambda key: f"{place}: experiment.{key}",
            {"step": None, "stop": None, "scheme": "sequential", **chosen},
        ),
        events=read_events(place, table.get("events", [])),
        initialisation=changed(
            f"{place}: [initialisation]", Initialisation(), part("initialisation", {})
        ),
        realtime=changed(f"{place}: [realtime]", Realtime(), part("realtime", {})),
        roles={
            role: text(f"{place}: [roles]: {role}", name, "the name of a component")
            for role, name in part("roles", {}).items()
        },
        presets={
            name: _values(f"{place}: [presets.{name}]", values)
            for name, values in part("presets", {}).items()
        },
        metrics=_groups(f"{place}: metrics", table.get("metrics", [])),
        input=stimuli or _input(f"{place}: [input]", table.get("input"), path.parent),
    )
    faults = read_faults(place, table.get("faults", []), system.connections)
    return replace(system, faults=faults) if faults else system


def _groups(place: str, names: Any) -> tuple[str, ...]:
    """The names of groups of metrics, of which ours are checked by the system."""
    if not isinstance(names, list):
        raise InputError(f'{place} = {names!r}: must be a list of groups, like ["grasp"]')
    return tuple(text(place, name, "the name of a group of metrics") for name in names)


def _input(place: str, entry: Any, folder: Path) -> Stimuli | None:
    if entry is None:
        return None
    check_keys(place, as_table(place, entry), PLACES["input"])
    file = text(f"{place}: file", entry.get("file"), "the path of a CSV file, as a string")
    way = entry.get("interpolation", "linear")
    return read_stimuli(folder / file, way, f"{place}: interpolation")


def check_filled_in(path: Path) -> None:
    """InputError at the first value of a system file that is a TODO, as `init` writes it."""
    left = to_do(path.read_text("utf-8"))
    if left:
        (number, line), *more = left.items()
        others = f", as is line {', '.join(str(n) for n, _ in more)}" if more else ""
        raise InputError(f"{path.name}: line {number}: {line}: must be filled in{others}")


def to_do(text: str) -> dict[int, str]:
    """The lines of a system file, by their numbers, with values that are a TODO."""
    lines = enumerate(text.split("\n"), 1)
    return {number: line.strip(" \t\r,") for number, line in lines if TODO.match(line)}


def _values(place: str, table: Any) -> dict[str, Given]:
    """A table of values; if they fit their variables is checked where it is used."""
    values = as_table(place, table)
    check_values(place, values)
    return values


def _component(place: str, name: str, entry: Any, folder: Path) -> Component:
    place = f"{place}: [components.{name}]"
    entry = as_table(place, entry)
    check_keys(place, entry, ENTRIES)
    fmu = folder / text(f"{place}: fmu", entry.get("fmu"), "the path of an FMU, as a string")
    values = _values(f"{place}: values", entry.get("values", {}))
    own = entry.get("step")
    rename = _names(f"{place}: rename", entry.get("rename", {}), "a variable of the FMU, a string")
    units = _names(f"{place}: units", entry.get("units", {}), "the name of a unit, like 'mm'")
    component = Component(
        name,
        fmu,
        {},
        rename,
        None if own is None else in_nanoseconds(f"{place}: step", own),
        choice(f"{place}: isolation", entry.get("isolation", "none"), ISOLATIONS),
        units,
        solver=changed(f"{place}: solver", Solver(), entry["solver"])
        if "solver" in entry
        else None,
    )
    sized = component.sized(read_interface(fmu)).renamed(rename, f"{place}: rename")
    sized.in_units(units, f"{place}: units")
    return with_given(component, lambda _: f"{place}: values", values)


def _names(place: str, table: Any, must: str) -> dict[str, str]:
    """A table of strings."""
    names = as_table(place, table)
    for key, name in names.items():
        text(f"{place}: {key!r}", name, must)
    return names


def _connections(place: str, entries: Any) -> tuple[Connection, ...]:
    if not isinstance(entries, list):
        raise InputError(f"{place} = {entries!r}: must be a list of 'output -> input'")
    return tuple(_connection(f"{place}[{i}]", entry) for i, entry in enumerate(entries))


def _connection(place: str, entry: Any) -> Connection:
    if not isinstance(entry, dict):
        parts = [part.strip() for part in entry.split("->")] if isinstance(entry, str) else []
        ports = [Port(*part.split(".", 1)) for part in parts if "." in part]
        if len(parts) != 2 or len(ports) != 2:
            raise InputError(f"{place}: {entry!r}: must be 'component.output -> component.input'")
        return Connection(ports[0], ports[1])
    check_keys(place, entry, {"from", "to", "factor", "offset"})
    for key in ("factor", "offset"):
        if not is_number(entry.get(key, 0.0)):
            raise InputError(f"{place}: {key} = {entry[key]!r}: must be a number")
    source, target = (_port(f"{place}: {key}", entry.get(key)) for key in ("from", "to"))
    return Connection(source, target, entry.get("factor"), entry.get("offset"))


def _port(place: str, name: Any) -> Port:
    if not isinstance(name, str) or "." not in name:
        raise InputError(f"{place} = {name!r}: must be 'component.variable'")
    return Port(*name.split(".", 1))
