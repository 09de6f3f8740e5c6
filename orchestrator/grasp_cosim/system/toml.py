"""The entries of a system file, docs/system_files.md: read as a whole, or changed by their places.

A place is like experiment.step, components.plant.fmu, or plant.object_width for a value. Messages
begin with what a function `place` makes of one.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from ..base.checks import (
    as_table,
    check_keys,
    check_values,
    choice,
    integer,
    is_number,
    known,
    real,
    text,
    toml_table,
)
from ..base.errors import InputError, nearest
from ..base.quantity import unwrapped
from ..interface.read import read_interface
from .changes import replaced, with_given, with_old_values
from .parts import (
    ISOLATIONS,
    Acceptance,
    Component,
    Connection,
    Initialisation,
    Logging,
    Realtime,
    Solver,
    as_port,
)
from .record import Record
from .scenario import read_events, read_faults, read_limits
from .stimuli import INTERPOLATIONS, Stimuli, read_stimuli
from .structure import Structure, experiment
from .times import in_nanoseconds
from .validity import by_element

Options = TypeVar("Options")
Place = Callable[[str], str]

SECTIONS = (
    "experiment", "components", "connections", "initialisation", "events", "faults", "roles",
    "presets", "input", "realtime", "metrics", "limits", "verdict",
)  # fmt: skip
"""The entries of a system file, which are no names of components."""

RECORD = "record"
"""Another entry: a list alone, which no --set changes, so a component may have its name."""

PLACES: Mapping[str, Sequence[str]] = {
    "experiment": ("step", "stop", "scheme", "diverging", "start", "variant"),
    "components": (),
    "initialisation": Initialisation.__slots__,
    "roles": (),
    "realtime": Realtime.__slots__,
    "verdict": Acceptance.__slots__,
    "input": ("file", "interpolation"),
}
"""The sections that have single values, each with its entries, where these are always the same."""

NAMES = {"rename": "a variable of the FMU, a string", "units": "the name of a unit, like 'mm'"}
"""The tables of names that a component has, and what these must be."""

TABLES = ("values", *NAMES, "solver")
ENTRIES = ("fmu", "step", "isolation", "logging", *TABLES)
"""The entries of a component, of which some are tables."""

TODO = re.compile(r"""(?:[^#"']|"(?!TODO\b)(?:[^"\\]|\\.)*"|'(?!TODO\b)[^']*')*["']TODO\b""")
"""A line with a value that is left to do; a # in quotes begins no comment."""


def read_toml(path: Path, fmus: Path | None, stimuli: Stimuli | None) -> dict[str, Any]:
    """The attributes of the system of a TOML file; fmus is where its FMUs are, by default beside.

    stimuli go before those that it names.
    """
    file, place = toml_table(path, "system file"), f"{path.name}: ".__add__
    check_filled_in(path)
    checked(file, path.name, place)
    components = []
    for name, entry in file["components"].items():
        own = place(f"components.{name}")
        check_keys(own, as_table(own, entry), ENTRIES)
        fmu = text(f"{own}.fmu", entry.get("fmu"), "the path of an FMU, as a string")
        new = Component(name, (fmus or path.parent) / fmu, {})
        components.append(with_entries(new, entry, place)[0])
    return described(file, path.name, components, path.parent, stimuli)


def checked(file: dict[str, Any], name: str, place: Place) -> None:
    """Check which tables there are in a file of that name, and fill in those that are left out."""
    check_keys(name, file, (*SECTIONS, RECORD))
    for section in (*PLACES, "presets", RECORD):
        table = file.get(section, None if section in ("experiment", "components") else {})
        file[section] = as_table(place(f"[{section}]"), table)
        if PLACES.get(section):
            check_keys(place(f"[{section}]"), file[section], PLACES[section])


def described(
    file: dict[str, Any],
    name: str,
    components: Sequence[Component],
    folder: Path = Path(),
    stimuli: Stimuli | None = None,
) -> dict[str, Any]:
    """The attributes of a system of that name that the tables of a file in a folder describe."""
    place = f"{name}: ".__add__
    for preset, values in file["presets"].items():
        own = place(f"presets.{preset}")
        check_values(own, as_table(own, values))
    for group in _list(place, file, "metrics", '["grasp"]'):
        text(place("metrics"), group, "the name of a group of metrics")
    links = _list(place, file, "connections", "['component.output -> component.input']")
    connections = by_element(
        name,
        components,
        [read_connection(place(f"connections[{i}]"), link) for i, link in enumerate(links)],
    )
    if stimuli:
        file["input"] = {}
    file["experiment"] = {"step": None, "stop": None, "scheme": "sequential"} | file["experiment"]
    found = sections(None, file, place, folder)
    return {
        **found,
        "name": name,
        "components": tuple(components),
        "connections": connections,
        "events": read_events(name, file.get("events", [])),
        "faults": read_faults(name, file.get("faults", []), connections),
        "limits": read_limits(name, file.get("limits", [])),
        "presets": file["presets"],
        "metrics": tuple(file.get("metrics", ())),
        "input": stimuli or found["input"],
        "record": _record(place, file[RECORD]),
    }


def _record(place: Place, table: Mapping[str, Any]) -> Record:
    """What [record] says."""
    check_keys(place(f"[{RECORD}]"), table, ("signals",))
    signals = _list(lambda key: place(f"{RECORD}.{key}"), table, "signals", '["plant.*"]')
    for i, entry in enumerate(signals):
        text(place(f"{RECORD}.signals[{i}]"), entry, "a name like 'plant.gap[1]', or 'plant.*'")
    return Record(tuple(signals))


def _list(place: Place, file: Mapping[str, Any], key: str, form: str) -> list[Any]:
    found = file.get(key, [])
    if not isinstance(found, list):
        raise InputError(f"{place(key)} = {found!r}: must be a list, like {form}")
    return found


def sections(
    was: Structure | None, file: Mapping[str, Any], place: Place, folder: Path = Path()
) -> dict[str, Any]:
    """The attributes of a system that stand in sections of single values, with those of a file."""
    tables = {section: file.get(section, {}) for section in PLACES}
    for role, name in tables["roles"].items():
        text(place(f"roles.{role}"), name, "the name of a component")
    loops, pace = (was.initialisation, was.realtime) if was else (Initialisation(), Realtime())
    verdict = was.verdict if was else Acceptance()
    return {
        **experiment(lambda key: place(f"experiment.{key}"), tables["experiment"]),
        "initialisation": _changed(place("initialisation"), loops, tables["initialisation"]),
        "realtime": _changed(place("realtime"), pace, tables["realtime"]),
        "verdict": _changed(place("verdict"), verdict, tables["verdict"]),
        "roles": {**(was.roles if was else {}), **tables["roles"]},
        "input": _input(was.input if was else None, tables["input"], place, folder),
    }


def _input(
    was: Stimuli | None, table: Mapping[str, Any], place: Place, folder: Path
) -> Stimuli | None:
    """The stimuli with another file, or another way between its rows."""
    way, file = table.get("interpolation", "linear"), table.get("file")
    if not table:
        return was
    if file is None and was:
        chosen = choice(place("input.interpolation"), way, INTERPOLATIONS)
        return replace(was, interpolation=chosen)
    if not isinstance(file, str | Path):
        raise InputError(f"{place('input.file')} = {file!r}: must be the path of a CSV file")
    return read_stimuli(folder / file, way, place("input.interpolation"))


def _changed(place: str, options: Options, table: Any) -> Options:
    """Options such as Initialisation with those of a table; errors begin with the place."""
    check_keys(place, as_table(place, table), options.__slots__)  # type: ignore[attr-defined]
    try:
        return replace(options, **table)  # type: ignore[type-var]
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


def with_entries(
    was: Component, table: Mapping[str, Any], place: Place, system: Structure | None = None
) -> tuple[Component, list[str]]:
    """The component with entries of a file; and notes.

    Those for a component of a system are changes: texts may stand for numbers, and with an FMU,
    names and units are those of its variables, and so are values, in its units.
    """
    own, now, notes = f"components.{was.name}", was, list[str]()
    values, rename, units = (
        as_table(place(f"{own}.{entry}"), table.get(entry, {})) for entry in ("values", *NAMES)
    )
    if system is None:
        check_values(place(f"{own}.values"), values)
    for entry, must in NAMES.items():
        for key, name in table.get(entry, {}).items():
            text(place(f"{own}.{entry}.{key}"), name, must)
    if system and "fmu" in table:
        where, fmu = place(f"{own}.fmu"), table["fmu"]
        if not isinstance(fmu, str | Path):
            raise InputError(f"{where} = {fmu!r}: must be the path of an FMU")
        now = replaced(was, Path(fmu), rename, units, f"{where}: ")
        now, notes = with_old_values(system, was, now, values, where)
    if rename or units:
        now = replace(now, rename={**now.rename, **rename}, units={**now.units, **units})
        read_interface(now.fmu)  # what is wrong in it has a place of its own
        try:
            now.interface  # noqa: B018 - it is made
        except InputError as error:
            raise InputError(place(f"components.{error}")) from error
    if "step" in table:
        now = replace(now, step_ns=in_nanoseconds(place(f"{own}.step"), table["step"]))
    if "isolation" in table:
        chosen = choice(place(f"{own}.isolation"), table["isolation"], ISOLATIONS)
        now = replace(now, isolation=chosen)
    if "logging" in table:
        now = replace(now, logging=_logging(place(f"{own}.logging"), table["logging"]))
    if "solver" in table:
        solver = _changed(place(f"{own}.solver"), now.solver or Solver(), table["solver"])
        now = replace(now, solver=solver)
    if values:
        now = with_given(now, lambda n: place(f"{was.name}.{n}"), values, text=system is not None)
    return now, notes


def _logging(place: str, entry: Any) -> Logging:
    """What an FMU is to log: true or false, a category, or several, in a list or with commas."""
    if isinstance(entry, bool):
        return entry
    names = entry.split(",") if isinstance(entry, str) else entry
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(
            f"{place} = {entry!r}: must be true, false, the name of a category, or a list of such"
        )
    return tuple(name.strip() for name in names)


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


def read_connection(place: str, entry: Any) -> Connection:
    """The connection of an entry of a file."""
    if not isinstance(entry, dict):
        parts = [part.strip() for part in entry.split("->")] if isinstance(entry, str) else []
        if len(parts) != 2:
            raise InputError(f"{place}: {entry!r}: must be 'component.output -> component.input'")
        return Connection(as_port(place, parts[0]), as_port(place, parts[1]))
    check_keys(place, entry, {"from", "to", "factor", "offset"})
    for key in ("factor", "offset"):
        if not is_number(entry.get(key, 0.0)):
            raise InputError(f"{place}: {key} = {entry[key]!r}: must be a number")
    source, target = (as_port(f"{place}: {key}", entry.get(key)) for key in ("from", "to"))
    return Connection(source, target, entry.get("factor"), entry.get("offset"))


def check_places(settings: object, place: Place) -> None:
    """InputError where settings are no values by place."""
    if not isinstance(settings, Mapping):
        raise InputError(f"{place(repr(settings))}: must be a mapping of places to values")
    if other := next((key for key in settings if not isinstance(key, str)), None):
        raise InputError(f"{place(repr(other))}: must be a place in the system, a text")


def as_file(system: Structure, settings: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """The tables of a file with these settings; InputError where one is no place, or twice."""
    root: dict[str, Any] = {}
    names = [component.name for component in system.components]
    for key, value in settings.items():
        if "." not in key:
            entries = [f"{section}.{e}" for section, found in PLACES.items() for e in found]
            values = [
                f"{c.name}.{v.name}"
                for c in system.components
                for v in c.interface.variables
                if v.settable
            ]
            near = nearest(key, [*system.inputs, *entries, *values])
            raise InputError(f"{place(key)}: no place in a system file; {near}")
        *tables, name = place_of(names, key, place(key))
        table = root
        for entry in tables:
            table = table.setdefault(entry, {})
        if name in table:
            raise InputError(f"{place(key)}: this place is given twice; must be given once")
        as_it_is = {"roles", "input", "values", *NAMES} & {tables[0], *tables[2:]}
        table[name] = value if as_it_is or name == "fmu" else plain(value)
    return root


def place_of(names: Collection[str], key: str, said: str) -> tuple[str, ...]:
    """The entries of the tables that lead to a place; COMPONENT.VARIABLE is short for a value."""
    section, _, rest = key.partition(".")
    if section in names:
        section, rest = "components", f"{section}.values.{rest}"
    if section == RECORD:
        raise InputError(f"{said}: is a list; must be given by --record, or with_record()")
    known(f"{said}: no component", section, [*names, *PLACES])
    if section != "components":
        known(f"{said}: no entry", rest, PLACES[section] or [rest], f" of [{section}]")
        return section, rest
    name, _, rest = rest.partition(".")
    entry, _, last = rest.partition(".")
    known(f"{said}: no component", name, names)
    known(f"{said}: no entry", entry, ENTRIES, " of a component")
    if bool(last) != (entry in TABLES):
        form = f"components.{name}.{entry}"
        raise InputError(f"{said}: must be {form}{'.NAME' if entry in TABLES else ''}")
    return (section, name, entry, last) if last else (section, name, entry)


def plain(value: Any) -> Any:
    """A text from a command line as the number or boolean that it spells, without NumPy's types."""
    value = unwrapped(value)
    if not isinstance(value, str):
        return value
    if value in ("true", "false"):
        return value == "true"
    for kind in (integer, real):
        with suppress(ValueError):
            return kind(value)
    return value
