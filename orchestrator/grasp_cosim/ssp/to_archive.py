"""From a system to an SSP 1.0 archive, as docs/reference/ssp.md describes it.

The same system gives the same bytes. What SSP has no form for: annotations.py.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from importlib.metadata import version
from itertools import count
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.files import check_file
from ..base.si_units import Unit
from ..base.text import counted
from ..interface.fmi_types import Value
from ..interface.obstacles import of_binary
from ..interface.read import read_interface
from ..interface.renaming import in_units
from ..interface.variables import Variable
from ..system.connectors import change_along, taps
from ..system.description import System, as_system
from ..system.parts import Component, Connection, Port
from ..system.times import in_seconds, written
from ..system.validity import transforms
from .annotations import PREFIXES, extras_of, write_extras, write_hint, write_steps
from .archive import RESOURCES, STRUCTURE, write_archive
from .elements import FMU
from .xml_document import VERSION, add, new, same, to_bytes, write_units

SET = "initialValues"
"""The name of all parameter sets: Ecos takes those of one name, EcosSimulation.init(...)."""

_CAUSALITIES = ("input", "output", "parameter", "calculatedParameter")
_TOOL = f"grasp-cosim {version('grasp-cosim')}"


@dataclass(frozen=True, slots=True)
class Written:
    """An SSP archive that was written."""

    entries: tuple[str, ...]
    """The names of its entries."""
    notes: tuple[str, ...]
    """What other tools will make of it differently, a line each."""


def write_ssp(system: System | str | Path, path: str | Path) -> Written:
    """Write the SSP archive of a system, with its FMUs.

    Args:
        system: The system, or the path of a system file.
        path: The archive, .ssp.

    Returns:
        What was written, and what other tools will make of it differently.

    Raises:
        InputError: The path is no .ssp file, cannot be written, or a component is Python code.

    Example:
        >>> from grasp_cosim import System, grasp_system, write_ssp
        >>> written = write_ssp(grasp_system(), "grasp.ssp")
        >>> sorted(System.load("grasp.ssp").by_name)
        ['controller', 'plant', 'sensor_1', 'sensor_2']
    """
    system, path = as_system(system, "write_ssp"), Path(path)
    if path.suffix.lower() != ".ssp" or path.is_dir():
        raise InputError(f"{path}: must be a file named like system.ssp")
    if code := next((c for c in system.components if c.code), None):
        raise InputError(
            f"{path}: {code.name} is Python code, {code.fmu}; must be an FMU to be in an archive, "
            "like that of a block: grasp-cosim build NAME.py"
        )
    check_file(path)
    entries: dict[str, bytes] = {}
    sources = {c.name: _fmu_entry(c.fmu, entries) for c in system.components}
    bindings = {c.name: _values_entry(c, entries) for c in system.components if c.values}
    structure = to_bytes(_structure(system, sources, bindings))
    entries = {STRUCTURE: structure, **dict(sorted(entries.items()))}
    write_archive(path, entries)
    return Written(tuple(entries), tuple(_notes(system)))


def _notes(system: System) -> Iterable[str]:
    yield (
        f"SSP has no form for the step, {written(system.step_ns)} s: OSP and OMSimulator "
        "read it from their own annotations"
    )
    if system.scheme != "jacobi":
        yield (
            f"SSP has no form for the scheme, {system.scheme}: it is in an annotation that other "
            "tools do not read; most step all components at once, as jacobi does"
        )
    with_own_step = [c.name for c in system.components if c.step_ns is not None]
    if with_own_step:
        yield f"only OSP reads the steps of {', '.join(with_own_step)}"
    for component in system.components:
        if obstacle := of_binary(component.interface):
            yield f"{component.name}: {component.interface.called} {obstacle.reason}"
        if arrays := component.interface.arrays:
            yield (
                f"{component.name}: SSP 1.0 has no arrays: {', '.join(arrays)} by elements, which "
                "other tools do not know"
            )
        for variable in component.interface.of(*_CAUSALITIES):
            if not variable.supported:
                port = Port(component.name, variable.name)
                yield f"{port} is of type {variable.nature}: it has no connector"
    special = ((system.events, "event"), (system.faults, "fault"), (system.limits, "limit"))
    for parts, noun in special:
        if parts:
            yield f"only in the annotation: {counted(len(parts), noun)}"
    if system.input:
        yield f"only in the annotation: what {system.input.file} drives"


def _fmu_entry(fmu: Path, entries: dict[str, bytes]) -> str:
    """The entry of an FMU, added where there is none with its content yet."""
    data = fmu.read_bytes()
    for name, content in entries.items():
        if content == data:
            return name
    return _added(entries, _plain(fmu.stem), ".fmu", data)


def _values_entry(component: Component, entries: dict[str, bytes]) -> str:
    """The entry of the values of a component, under the names of its FMU."""
    interface, fmu_names = component.interface, _fmu_names(component)
    units = _units([component])
    root = new("ssv:ParameterSet", version=VERSION, name=SET, generationTool=_TOOL)
    parameters = add(root, "ssv:Parameters")
    used: dict[str, Unit] = {}
    for name, value in component.values.items():
        variable = interface.by_name[name]
        element = add(parameters, "ssv:Parameter", name=fmu_names[name])
        labels = [label for label, number in variable.items.items() if number == value]
        if labels:
            add(element, "ssv:Enumeration", value=labels[0])
            continue
        text = _text(f"{component.name}.{name}", variable, value)
        typed = add(element, f"ssv:{variable.kind}", value=text)
        unit = _unit(component, variable, units)
        if unit:
            typed.set("unit", unit.name)
            used[unit.name] = unit
    write_units(root, "ssv", used.values())
    return _added(entries, _plain(component.name), ".ssv", to_bytes(root))


def _added(entries: dict[str, bytes], stem: str, suffix: str, data: bytes) -> str:
    """Add data under the first free name like stem, stem_2, ..."""
    name = f"{RESOURCES}{stem}{suffix}"
    numbers = count(2)
    while name in entries:
        name = f"{RESOURCES}{stem}_{next(numbers)}{suffix}"
    entries[name] = data
    return name


def _structure(system: System, sources: Mapping[str, str], bindings: Mapping[str, str]) -> Any:
    """The document of a system, with the entries of the FMUs and values of its components."""
    name = re.sub(r"\W|^(?=\d)", "_", Path(system.name).stem, flags=re.ASCII)  # as OMSimulator asks
    attributes = {"version": VERSION, "name": name, "generationTool": _TOOL}
    root = new("ssd:SystemStructureDescription", PREFIXES, **attributes)
    top = add(root, "ssd:System", name=name)
    units = _units(system.components)
    for unit in _outside_units(system):
        units.setdefault(unit.name, unit)
    _write_outside(top, system, units)
    elements = add(top, "ssd:Elements")
    for component in system.components:
        name = component.name
        _write_component(elements, component, sources[name], bindings.get(name), units)
    if system.connections or system.inputs or system.outputs:
        connections = add(top, "ssd:Connections")
        changes = transforms(system)
        names = {component.name: _fmu_names(component) for component in system.components}
        for connection in system.connections:
            _write_connection(connections, connection, changes[connection.target], names)
        _write_links(connections, system, names)
    system_annotations = add(top, "ssd:Annotations")
    write_units(root, "ssd", units.values())
    experiment = add(
        root,
        "ssd:DefaultExperiment",
        startTime=repr(in_seconds(system.start_ns)),
        stopTime=repr(in_seconds(system.stop_ns)),
    )
    annotations = add(experiment, "ssd:Annotations")
    write_steps(annotations, system_annotations, system.step_ns)
    write_extras(annotations, extras_of(system))
    return root


def _write_component(
    elements: Any, component: Component, source: str, values: str | None, units: Mapping[str, Unit]
) -> None:
    kind = "ModelExchange" if component.integrated else "CoSimulation"
    attributes = {"name": component.name, "type": FMU, "source": source, "implementation": kind}
    element = add(elements, "ssd:Component", **attributes)
    variables = _connected(component)
    connectors = add(element, "ssd:Connectors") if variables else None
    for variable in variables:
        connector = add(connectors, "ssd:Connector", name=variable.name, kind=variable.causality)
        if variable.items:
            continue  # an enumeration: its items are in the FMU, so that the type may be left out
        unit = _unit(component, variable, units)
        element_of_type = add(connector, f"ssc:{variable.kind}")
        if unit:
            element_of_type.set("unit", unit.name)
    if values:
        add(add(element, "ssd:ParameterBindings"), "ssd:ParameterBinding", source=values)
    if component.step_ns is not None:
        write_hint(element, component.step_ns)


def _connected(component: Component) -> list[Variable]:
    """The variables that get a connector: those of a kind and causality that SSP has, too.

    A parameter needs none to be set; libcosim refuses one whose type, an enumeration, it ignores.
    """
    fmu_names = {**component.rename, **_fmu_names(component)}
    units = {fmu_names[name]: unit for name, unit in component.units.items()}
    declared = in_units(component.sized(read_interface(component.fmu)), units)
    variables = declared.of(*_CAUSALITIES)
    connected = []
    for variable in variables:
        is_enumerated_parameter = variable.items and variable.causality == "parameter"
        if variable.supported and not is_enumerated_parameter:
            connected.append(variable)
    return connected


def _write_connection(
    connections: Any,
    connection: Connection,
    change: tuple[float, float],
    names: Mapping[str, Mapping[str, str]],
) -> None:
    source, target = connection.source, connection.target
    element = add(
        connections,
        "ssd:Connection",
        startElement=source.component,
        startConnector=names[source.component][source.variable],
        endElement=target.component,
        endConnector=names[target.component][target.variable],
    )
    transformed = connection.factor is not None or connection.offset is not None
    _write_change(element, change, transformed)


def _write_change(element: Any, change: tuple[float, float], transformed: bool) -> None:
    """What a connection makes of a value, as a transformation where it does anything."""
    if transformed or change != (1.0, 0.0):
        element.set("suppressUnitConversion", "true")
        factor, offset = map(repr, change)
        add(element, "ssc:LinearTransformation", factor=factor, offset=offset)


def _write_outside(top: Any, system: System, units: Mapping[str, Unit]) -> None:
    """The connectors of the system itself."""
    if not (system.inputs or system.outputs):
        return
    connectors = add(top, "ssd:Connectors")
    for name, system_input in system.inputs.items():
        variables = [_variable(system, link.port) for link in system_input.links]
        are_parameters = all(variable.causality == "parameter" for variable in variables)
        kind = "parameter" if are_parameters else "input"
        connector = add(connectors, "ssd:Connector", name=name, kind=kind)
        if not variables[0].items:
            _write_type(connector, variables[0].kind, system_input.unit, units)
    for name, tap in system.once(taps).items():
        connector = add(connectors, "ssd:Connector", name=name, kind="output")
        if not _variable(system, tap.source).items:
            _write_type(connector, tap.kind, tap.quantity, units)


def _write_type(connector: Any, kind: str, unit: Unit | None, units: Mapping[str, Unit]) -> None:
    """The type of a connector, with its unit where its name means that in the archive."""
    element = add(connector, f"ssc:{kind}")
    if kind == "Real" and unit is not None and same(unit, units[unit.name]):
        element.set("unit", unit.name)


def _write_links(connections: Any, system: System, names: Mapping[str, Mapping[str, str]]) -> None:
    """The connections between the connectors of the system itself and the components."""
    for name, system_input in system.inputs.items():
        for link in system_input.links:
            component = link.port.component
            connection = add(
                connections,
                "ssd:Connection",
                startConnector=name,
                endElement=component,
                endConnector=names[component][link.port.variable],
            )
            change = change_along(system, name, link)
            _write_change(connection, change, link.factor is not None)
    for name, tap in system.once(taps).items():
        component = tap.source.component
        connection = add(
            connections,
            "ssd:Connection",
            startElement=component,
            startConnector=names[component][tap.source.variable],
            endConnector=name,
        )
        _write_change(connection, tap.change, system.outputs[name].link.factor is not None)


def _outside_units(system: System) -> Iterable[Unit]:
    """The units of the connectors of the system itself."""
    quantities = [system_input.unit for system_input in system.inputs.values()]
    quantities += [tap.quantity for tap in system.once(taps).values()]
    return [unit for unit in quantities if unit is not None]


def _variable(system: System, port: Port) -> Variable:
    """The variable of a port of a component."""
    return system.component(port.component, str(port)).interface.by_name[port.variable]


def _fmu_names(component: Component) -> dict[str, str]:
    """The FMU's names of the variables by those of the system, of elements of arrays, too."""
    declared = component.sized(read_interface(component.fmu)).variables
    pairs = zip(component.interface.variables, declared, strict=True)
    return {variable.name: fmu_variable.name for variable, fmu_variable in pairs}


def _units(components: Iterable[Component]) -> dict[str, Unit]:
    """The units of all variables by name; of two that mean something else the first."""
    units: dict[str, Unit] = {}
    for component in components:
        for variable in component.interface.variables:
            if unit := component.interface.unit(variable):
                units.setdefault(unit.name, unit)
    return dict(sorted(units.items()))


def _unit(component: Component, variable: Variable, units: Mapping[str, Unit]) -> Unit | None:
    """The unit to write at a variable; none where its name means something else in the archive."""
    unit = component.interface.unit(variable)
    return unit if unit and same(unit, units[unit.name]) else None


def _text(place: str, variable: Variable, value: Value) -> str:
    """A value as SSP writes it; InputError for a whole number that has no form there."""
    if variable.kind == "Real":
        return repr(float(value))
    if variable.kind == "Integer" and not -(2**31) <= int(value) < 2**31:
        raise InputError(f"{place} = {value}: must fit into 32 bits, as an Integer of SSP 1.0")
    return str(value).lower() if isinstance(value, bool) else str(value)


def _plain(name: str) -> str:
    """A name of letters that every file system and URI takes."""
    return re.sub(r"[^A-Za-z0-9_.-]", "_", name)
