"""A system from Python: what a system file has, with Python objects in the place of texts.

Its sections are those of a file, under the same names: docs/reference/system_file.md. A component
is more than the path of an FMU: see component_from().
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from ..base.checks import check_keys
from ..base.errors import InputError
from ..base.registry import registered
from .overrides import ENTRIES_OF_COMPONENT
from .parts import Component, Connection, Port
from .python_code import End, Function, PythonCode, WithStep, is_code, with_interface
from .structure import unit_of
from .toml import check_sections, described, read_connection, with_entries

Part = (
    str | Path | Component | ModuleType | type[WithStep] | WithStep | Function | Mapping[str, Any]
)
"""What component_from() takes, or a mapping with that as "fmu"."""

MUST_OF_COMPONENT = (
    "the path of an FMU, the file of a block, NAME.py, a Component, or Python code with "
    "step(t, inputs)"
)


def from_sections(
    name: str, components: Any, connections: Any, sections: dict[str, Any]
) -> dict[str, Any]:
    """The attributes of a system of that name; InputError where something is wrong.

    `components` are by name what component_from() takes, or mappings with that as "fmu" and the
    other entries of a component in a file; connections as _connection_entry() takes them; sections
    as a file has them.
    """
    if not isinstance(components, Mapping) or not components:
        raise InputError(
            f"{name}: components = {components!r}: must be by name, as {{'plant': 'Plant.fmu'}}"
        )
    if isinstance(connections, str) or not isinstance(connections, Iterable):
        raise InputError(
            f"{name}: connections = {connections!r}: must be a list, as ['a.output -> b.input']"
        )
    entries = [_connection_entry(connection) for connection in connections]
    file = {**sections, "components": {**components}, "connections": entries}
    check_sections(file, name)
    read = [read_connection(f"{name}: connections[{i}]", entry) for i, entry in enumerate(entries)]
    tables = {n: e if isinstance(e, Mapping) else {"fmu": e} for n, e in components.items()}
    with_fmus = [n for n, table in tables.items() if not is_code(table.get("fmu"))]
    with_code = [n for n, table in tables.items() if is_code(table.get("fmu"))]
    by_name: dict[str, Component] = {}
    for component in (*with_fmus, *with_code):  # code takes types and units from its other ends
        table = tables[component]
        label = f"{name}: components.{component}"
        check_keys(label, table, ENTRIES_OF_COMPONENT)
        new = component_from(label, component, table.get("fmu"), by_name, read)
        by_name[component] = with_entries(new, table, name)
    return described(file, name, [by_name[n] for n in tables])


def component_from(
    place: str,
    name: str,
    entry: Any,
    known_components: Mapping[str, Component],
    connections: Iterable[Connection],
) -> Component:
    """The component of that name: a path is that of an FMU, or of the file of a block, NAME.py.

    The FMU of a block is built and kept. A Component gets the name. Python code is as
    python_code.py has it. InputError for anything else.
    """
    if isinstance(entry, Component):
        return replace(entry, name=name)
    if isinstance(entry, ModuleType) and entry.__file__:
        entry = entry.__file__
    if isinstance(entry, str | Path):
        path = Path(entry)
        return Component(name, _built_fmu(place, path) if path.suffix == ".py" else path, {})
    if not is_code(entry):
        raise InputError(f"{place} = {entry!r}: must be {MUST_OF_COMPONENT}")
    return _python_component(place, name, entry, known_components, [*connections])


def _python_component(
    place: str,
    name: str,
    code: Any,
    known_components: Mapping[str, Component],
    connections: Iterable[Connection],
) -> Component:
    """A component that is Python code; inputs without a connection keep their start values."""
    connected: dict[str, dict[str, End]] = {"input": {}, "output": {}}
    for c in connections:
        ends = ("input", c.target, c.source), ("output", c.source, c.target)
        for causality, port, peer in ends:
            if port.component == name:
                end = connected[causality].get(port.variable, End())
                connected[causality][port.variable] = end.or_as(_end_at(known_components, peer))
    python_code: PythonCode = with_interface(place, code, connected)
    interface = python_code.interface
    values: dict[str, Any] = {}
    for variable in interface.of("input"):
        if variable.name not in connected["input"] and variable.start_value is not None:
            values[variable.name] = variable.start_value
    return Component(name, interface.path, values, code=python_code)


def _end_at(known_components: Mapping[str, Component], port: Port) -> End:
    """What is known of a variable of a component with an FMU; nothing where there is none."""
    component = known_components.get(port.component)
    variable = component.interface.by_name.get(port.variable) if component else None
    if component is None or variable is None or not variable.is_number:
        return End()
    return End(variable.kind, unit_of(component.interface, variable))


def _built_fmu(place: str, file: Path) -> Path:
    """The FMU of the block in a file, which is kept for as long as the file stays as it is."""
    try:
        fmu: Path = registered("blocks", ".py")(file)
    except OSError as error:
        raise InputError(f"{place}: {file}: {error.strerror}") from error
    except ValueError as error:
        raise InputError(f"{place}: {error}") from error
    return fmu


def _connection_entry(entry: Any) -> Any:
    """A connection as a file has it, "a.y -> b.u" or a table; a pair of ports is one, too."""
    if isinstance(entry, Connection):
        scale = {"factor": entry.factor, "offset": entry.offset}
        given_scale = {key: value for key, value in scale.items() if value is not None}
        return {"from": str(entry.source), "to": str(entry.target), **given_scale}
    if isinstance(entry, tuple | list) and len(entry) == 2:
        return {"from": str(entry[0]), "to": str(entry[1])}
    return entry
