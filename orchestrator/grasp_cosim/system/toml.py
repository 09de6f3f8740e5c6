"""The system description: components, connections and the experiment, from one TOML file.

    connections = ["plant.gap[1] -> sensor_1.gap", ...]   # before the first table, as TOML wants it

    [experiment]
    step = 1e-4                     # s, communication step
    stop = 3.0                      # s
    scheme = "sequential"           # or "jacobi"

    [components.plant]              # the order of the components is the order of execution
    fmu = "GripperPlant.fmu"        # relative to the TOML file
    values = { object_width = 0.07 }
    step = 5e-4                     # s, where it differs: a whole multiple of the experiment's step
    rename = { "gap[1]" = "Gap1" }  # the system's name = the FMU's, where they differ
    isolation = "process"           # in a process of its own; or "none"

A connection that scales is a table: { from = "a.x", to = "b.y", factor = 1000.0, offset = 0.0 }.
Without factor and offset, units that differ are converted.

    [initialisation]                # may be left out, as each of its entries
    loops = "iterate"               # what to do with an algebraic loop at t = 0; or "refuse"
    tolerance = 1e-10               # relative, of the iteration
    iterations = 50                 # at most

    [roles]                         # who plays which part, where the names do not say it
    plant = "gripper"

    [presets.bench]                 # values under a name, for run --preset bench
    "sensor_1.noise.enabled" = true

Every input has exactly one source: a connection or a value. [[events]] and [[faults]]: see
scenario.py.
"""

from dataclasses import replace
from pathlib import Path
from typing import Any

from ..checks import as_table, check_keys, check_values, toml_table
from ..errors import InputError, choices
from ..interface.interface import Value
from ..interface.read import read_interface
from .description import System, as_scheme, in_nanoseconds
from .parts import ISOLATIONS, Component, Connection, Initialisation, Isolation, Port
from .scenario import read_events, read_faults

KEYS = (
    "experiment", "components", "connections", "initialisation", "events", "faults", "roles",
    "presets",
)  # fmt: skip
"""The entries of a system file."""


def read_toml(path: Path, fmus: Path | None = None) -> System:
    """The system of a TOML file; fmus is where its FMUs are, by default beside the file."""
    return _from_table(path.name, toml_table(path, "system file"), fmus or path.parent)


def _from_table(place: str, table: dict[str, Any], folder: Path) -> System:
    check_keys(place, table, KEYS)
    experiment = as_table(f"{place}: [experiment]", table.get("experiment"))
    check_keys(f"{place}: [experiment]", experiment, {"step", "stop", "scheme"})
    components = as_table(f"{place}: [components]", table.get("components"))
    texts = table.get("connections", [])
    if not isinstance(texts, list):
        raise InputError(f"{place}: connections = {texts!r}: must be a list of 'output -> input'")
    connections = tuple(
        _connection(f"{place}: connections[{i}]", text) for i, text in enumerate(texts)
    )
    return System(
        place,
        tuple(_component(place, name, entry, folder) for name, entry in components.items()),
        connections,
        in_nanoseconds(f"{place}: experiment.step", experiment.get("step")),
        in_nanoseconds(f"{place}: experiment.stop", experiment.get("stop")),
        as_scheme(f"{place}: experiment.scheme", experiment.get("scheme", "sequential")),
        read_events(place, table.get("events", [])),
        read_faults(place, table.get("faults", []), connections),
        read_initialisation(f"{place}: [initialisation]", table.get("initialisation", {})),
        roles=_roles(f"{place}: [roles]", table.get("roles", {})),
        presets=read_presets(f"{place}: [presets]", table.get("presets", {})),
    )


def _roles(place: str, table: Any) -> dict[str, str]:
    roles = as_table(place, table)
    for role, name in roles.items():
        if not isinstance(name, str):
            raise InputError(f"{place}: {role} = {name!r}: must be the name of a component")
    return roles


def read_presets(place: str, table: Any) -> dict[str, dict[str, Value]]:
    """The presets of a table of tables; what the values may be is checked where one is used."""
    presets = as_table(place, table)
    for name, values in presets.items():
        check_values(f"{place[:-1]}.{name}]", as_table(f"{place[:-1]}.{name}]", values))
    return presets


def read_initialisation(place: str, table: Any) -> Initialisation:
    """The options of the initialisation; a System checks their values."""
    table = as_table(place, table)
    check_keys(place, table, Initialisation.__slots__)
    return Initialisation(**table)


def _component(place: str, name: str, entry: Any, folder: Path) -> Component:
    place = f"{place}: [components.{name}]"
    entry = as_table(place, entry)
    check_keys(place, entry, {"fmu", "values", "step", "rename", "isolation"})
    fmu = entry.get("fmu")
    if not isinstance(fmu, str):
        raise InputError(f"{place}: fmu = {fmu!r}: must be the path of an FMU, as a string")
    values = as_table(f"{place}: values", entry.get("values", {}))
    check_values(f"{place}: values", values)
    own = entry.get("step")
    component = Component(
        name,
        folder / fmu,
        {},
        _rename(f"{place}: rename", folder / fmu, entry.get("rename", {})),
        None if own is None else in_nanoseconds(f"{place}: step", own),
        _isolation(f"{place}: isolation", entry.get("isolation", "none")),
    )
    parsed = {k: component.interface.parse(f"{place}: values", k, v) for k, v in values.items()}
    return replace(component, values=parsed)


def _rename(place: str, fmu: Path, table: Any) -> dict[str, str]:
    """The table of names, each of which the FMU knows."""
    names = as_table(place, table)
    for new, own in names.items():
        if not isinstance(own, str):
            raise InputError(f"{place}: {new!r} = {own!r}: must be a variable of the FMU, a string")
    read_interface(fmu).renamed(names, place)
    return names


def _isolation(place: str, name: Any) -> Isolation:
    if name not in ISOLATIONS:
        raise InputError(f"{place} = {name!r}: must be one of {choices(ISOLATIONS)}")
    return name  # type: ignore[no-any-return]


def _connection(place: str, entry: Any) -> Connection:
    if not isinstance(entry, dict):
        parts = [part.strip() for part in entry.split("->")] if isinstance(entry, str) else []
        ports = [Port(*part.split(".", 1)) for part in parts if "." in part]
        if len(parts) != 2 or len(ports) != 2:
            raise InputError(f"{place}: {entry!r}: must be 'component.output -> component.input'")
        return Connection(ports[0], ports[1])
    check_keys(place, entry, {"from", "to", "factor", "offset"})
    for key in ("factor", "offset"):
        number = entry.get(key, 0.0)
        if isinstance(number, bool) or not isinstance(number, float | int):
            raise InputError(f"{place}: {key} = {number!r}: must be a number")
    source, target = (_port(f"{place}: {key}", entry.get(key)) for key in ("from", "to"))
    return Connection(source, target, entry.get("factor"), entry.get("offset"))


def _port(place: str, text: Any) -> Port:
    if not isinstance(text, str) or "." not in text:
        raise InputError(f"{place} = {text!r}: must be 'component.variable'")
    return Port(*text.split(".", 1))
