"""From an archive to a system.

What the archive holds is run or refused by name; what the standard lets a tool decide is decided
here, as docs/reference/ssp.md describes, and said in the notes of the system.
"""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from copy import deepcopy
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any, NamedTuple

from ..base.errors import InputError, choices
from ..base.si_units import known_unit
from ..interface.expansion import expanded
from ..interface.fmi_types import Value
from ..interface.renaming import in_units, renamed
from ..interface.values import parse_value
from ..system.description import System
from ..system.entries import experiment
from ..system.overrides import Override
from ..system.parts import Component, Connection, Port, Solver, SystemInput
from ..system.stimuli import Stimuli
from ..system.times import (
    LONGEST,
    NANOSECONDS,
    Time,
    in_nanoseconds,
    in_seconds,
    step_of,
    written,
)
from .annotations import FOREIGN, TYPE, Beside, Extras, read_extras, read_foreign
from .archive import SSD, STRUCTURE, Archive, Notes
from .elements import Element, Node, Path, read_system
from .flow import flow_order
from .network import Network, Part
from .start_values import read_start_values
from .system_connectors import system_inputs, system_outputs
from .xml_document import at, child, children, open_structure, qualified, same


class NamedComponent(NamedTuple):
    """A component under its name in the system.

    names are its variables' names there by its FMU's own, units those that the archive names by the
    former; the interface of the part has these, under the FMU's names.
    """

    name: str
    names: Mapping[str, str]
    units: Mapping[str, str]
    beside: Beside
    part: Part


def read_ssp(
    path: FilePath,
    times: Iterable[Override] = (),
    stimuli: Stimuli | None = None,
    variant: str | None = None,
) -> System:
    """The system of an archive; stimuli go before those that it names.

    So do the times, start, step and stop in s, but for our archive, which names all of them:
    System.with_overrides() changes them together.
    Its structure is the variant of that name, by default SystemStructure.ssd, or the only one.
    """
    notes = Notes()
    archive = Archive(path, notes)
    structure = archive.structure(variant)
    if variant is None and structure != STRUCTURE:
        notes.add(archive.place, f"its only structure is {structure}, which is read")
    origin, root = open_structure(archive, notes, structure)
    file = origin.place
    top = read_system(origin, child(root, "ssd:System"))
    systems = {e.path: e for e in top.within() if e.interface is None}
    parts = {e.path: Part(e, e.interface) for e in top.within() if e.interface is not None}
    if not parts:
        raise InputError(f"{top.place}: system {top.name!r} has no components; must have some")
    names = component_names(file, parts)
    annotated = _annotated(file, root, names.values())
    chosen_times = {} if annotated else experiment(times)
    chosen_step_ns = chosen_times.get("step_ns")
    extras, step_source = annotated, ""
    if extras is None:
        extras, step_source = read_foreign(file, root, names.values(), chosen_step_ns)
    named_components = {
        path: _named_component(file, names[path], part, extras.components[names[path]])
        for path, part in _sized(systems, parts, notes).items()
    }
    network = Network(systems, {path: c.part for path, c in named_components.items()})
    network.check()
    connections = tuple(_connections(network, named_components))

    def port_of(node: Node) -> Port:
        component = named_components[node.path]
        return Port(component.name, component.names[node.name])

    inputs, outputs = system_inputs(network, port_of), system_outputs(network, port_of)
    stimuli = stimuli or extras.input
    driven = {connection.target for connection in connections} | _driven_by(stimuli, inputs)
    decided: list[str] = []
    components = tuple(_components(file, network, named_components, driven, decided))
    if annotated is None:
        components = flow_order(components, connections)
        decided.append(f"order of execution: {', '.join(c.name for c in components)}")
    if step_source:
        decided.append(f"scheme = {extras.scheme}, as meant by {step_source}")
    start_ns, stop_ns = _times(file, root, parts.values(), chosen_times, decided)
    if step_source and not chosen_step_ns:
        decided.append(f"step = {written(extras.step_ns)} s, by {step_source}")
    step_ns = chosen_step_ns or extras.step_ns
    step_ns = step_ns or _shortest_step(file, parts.values(), stop_ns - start_ns, decided)
    used_annotations = {TYPE, *FOREIGN} if annotated or step_source else {TYPE}
    all_notes = (
        *_unused(archive, structure, root, used_annotations),
        *_renamed_components(names),
        *notes.lines(),
        *decided,
    )
    return System(
        archive.place if variant is None else f"{archive.place}#{structure}",
        components,
        connections,
        step_ns,
        stop_ns,
        extras.scheme,
        extras.events,
        extras.faults,
        extras.initialisation,
        all_notes,
        extras.roles,
        extras.presets,
        extras.diverging,
        stimuli,
        extras.realtime,
        extras.metrics,
        start_ns,
        extras.record,
        inputs=inputs,
        outputs=outputs,
        limits=extras.limits,
        verdict=extras.verdict,
    )


def _driven_by(stimuli: Stimuli | None, inputs: Mapping[str, SystemInput]) -> set[Port]:
    """The inputs of components that stimuli drive, some of them by inputs of the system."""
    driven: set[Port] = set()
    for column in stimuli.columns if stimuli else ():
        system_input = inputs.get(str(column))
        if system_input:
            driven |= {link.port for link in system_input.links}
        else:
            driven.add(column)
    return driven


def _renamed_components(names: Mapping[Path, str]) -> Iterator[str]:
    """Yield a note on each component that has another name in the system than in the archive."""
    for path, name in names.items():
        archive_name = ".".join(path)
        if archive_name != name:
            yield f"component {archive_name} is called {name} here"


def component_names(file: str, parts: Iterable[Path]) -> dict[Path, str]:
    """The components' names in the system, where a dot parts component and variable."""
    names = {path: "_".join(path).replace(".", "_") for path in parts}
    for name, count in Counter(names.values()).items():
        if count > 1:
            alike = choices(".".join(path) for path in names if names[path] == name)
            raise InputError(f"{file}: components {alike} would all be {name!r} here; must differ")
    return names


def _annotated(file: str, root: Any, names: Collection[str]) -> Extras | None:
    """The extras of our annotation, if there is one; `names` are those of the components."""
    for annotation in children(root, "ssd:DefaultExperiment", "ssd:Annotations", "ssc:Annotation"):
        if annotation.get("type") == TYPE:
            extras = read_extras(at(file, annotation), annotation)
            if set(extras.components) != set(names):
                raise InputError(
                    f"{file}: annotation {TYPE!r} is about other components, "
                    f"{choices(extras.components)}; valid: {choices(names)}; remove it"
                )
            return extras
    return None


def _sized(
    systems: Mapping[Path, Element], parts: Mapping[Path, Part], notes: Notes
) -> dict[Path, Part]:
    """The parts with their arrays taken apart, of as many elements as the archive's values say."""
    if not any(v.shape for part in parts.values() for v in part.interface.variables):
        return dict(parts)
    places = deepcopy(notes.places)
    sizes = read_start_values(Network(systems, parts), "structuralParameter")
    notes.places = places  # without those on values of elements that are not there yet
    return {
        at: replace(part, interface=expanded(part.interface, sizes.get(at, {})))
        for at, part in parts.items()
    }


def _named_component(file: str, name: str, part: Part, beside: Beside) -> NamedComponent:
    """The component of a part, under the names and in the units that the system has for it."""
    declared = part.interface
    in_system_names = renamed(declared, beside.rename, f"{file}: {name}: rename")
    pairs = zip(declared.variables, in_system_names.variables, strict=True)
    system_names = {declared_one.name: renamed_one.name for declared_one, renamed_one in pairs}
    units = {system_names[fmu_name]: unit for fmu_name, unit in _units(part).items()}
    units |= beside.units
    in_system_units = in_units(in_system_names, units, f"{file}: {name}")
    variables = tuple(
        replace(variable, name=fmu_name)
        for fmu_name, variable in zip(system_names, in_system_units.variables, strict=True)
    )
    interface = replace(declared, variables=variables, units=in_system_units.units)
    return NamedComponent(name, system_names, units, beside, replace(part, interface=interface))


def _units(part: Part) -> dict[str, str]:
    """The units that connectors name for variables that have none in the FMU, if they are known."""
    units = {}
    for connector in part.element.connectors.values():
        variable = part.interface.by_name.get(connector.name)
        unit = connector.unit
        if unit is None or variable is None or variable.kind != "Real" or variable.unit is not None:
            continue
        unit_of_name = known_unit(unit.name)
        if unit_of_name and same(unit, unit_of_name):
            units[connector.name] = unit.name
    return units


def _connections(
    network: Network, components: Mapping[Path, NamedComponent]
) -> Iterator[Connection]:
    """The connections, in the order of the connections that reach the inputs."""
    for target in network.into:
        if target.path not in network.parts or network.output(target) is None:
            continue
        hops = network.trace(target)
        _, carried = network.follow(hops)
        output = hops[0].source
        giver, taker = components[output.path], components[target.path]
        source_port = Port(giver.name, giver.names[output.name])
        input_name = taker.part.interface.main_name(target.name)
        target_port = Port(taker.name, taker.names[input_name])
        if network.decided_by_units(hops, carried):
            yield Connection(source_port, target_port)
        else:
            yield Connection(source_port, target_port, carried.factor, carried.offset)


def _components(
    file: str,
    network: Network,
    named_components: Mapping[Path, NamedComponent],
    driven: Collection[Port],
    notes: list[str],
) -> Iterator[Component]:
    """The components with the archive's values, and start values of inputs that nothing drives."""
    start_values = read_start_values(network)
    for path, (name, names, units, beside, part) in named_components.items():
        own_values = start_values.get(path, {})
        by_main_names = part.interface.by_main_names(own_values, f"{file}: {name}.".__add__)
        values = {names[fmu_name]: value for fmu_name, value in by_main_names.items()}
        solver = beside.solver
        if part.element.exchange and "CoSimulation" in part.interface.kinds:
            solver = solver or Solver()
        component = Component(
            name,
            part.interface.path,
            values,
            beside.rename,
            beside.step_ns,
            beside.isolation,
            units,
            solver=solver,
            logging=beside.logging,
        )
        starts: dict[str, Value] = {}
        for variable in component.interface.of("input"):
            port, start = Port(name, variable.name), variable.start
            has_value = port in driven or variable.name in values
            if variable.supported and not variable.element and not has_value and start is not None:
                place = f"{file}: start value of {port}"
                starts[variable.name] = parse_value(
                    component.interface, place, variable.name, start, text=True
                )
                notes.append(f"input {port} is not connected; keeps its start value {start}")
        yield replace(component, values={**values, **starts})


def _times(
    file: str, root: Any, parts: Iterable[Part], chosen: Mapping[str, Time], notes: list[str]
) -> tuple[Time, Time]:
    """The start and the stop time in ns.

    They are those chosen, or of the archive, or else 0 and the longest that its FMUs name.
    """
    default = child(root, "ssd:DefaultExperiment")
    attributes = {} if default is None else default.attrib
    start = float(attributes.get("startTime", "0"))
    place = file if default is None else at(file, default)
    start_ns = chosen.get("start_ns")
    if start_ns is None:
        start_ns = in_nanoseconds(f"{place}: startTime", start, zero=True, low=-LONGEST)
    if "stop_ns" in chosen:
        return start_ns, chosen["stop_ns"]
    if "stopTime" in attributes:
        return start_ns, in_nanoseconds(f"{place}: stopTime", float(attributes["stopTime"]))
    declared = [part.interface.experiment.get("stop_time") for part in parts]
    stop = max((float(time) for time in declared if time is not None), default=0.0)
    if not 0.0 < stop < math.inf:
        raise InputError(
            f"{file}: no stopTime in a DefaultExperiment; give one: --set experiment.stop=..."
        )
    notes.append(f"stop = {stop:g} s, the longest that its FMUs name; the archive names none")
    return start_ns, in_nanoseconds(f"{file}: stop time of its FMUs", stop)


def _shortest_step(file: str, parts: Iterable[Part], span_ns: Time, notes: list[str]) -> Time:
    """The smallest step in ns that the FMUs name and that divides the span."""
    declared = sorted({part.interface.step for part in parts if part.interface.step})
    for step in declared:
        step_ns = step_of(step) if 0.0 < step * NANOSECONDS <= span_ns else 0
        if step_ns and span_ns % step_ns == 0 and math.isclose(in_seconds(step_ns), step):
            notes.append(
                f"step = {written(step_ns)} s, the smallest that its FMUs name; SSP has none"
            )
            return step_ns
    steps = choices(f"{step:g} s" for step in declared)
    raise InputError(
        f"{file}: names no step, as SSP has none, and of those of its FMUs ({steps}) none "
        f"divides the stop of {in_seconds(span_ns):g} s; give one: --set experiment.step=..."
    )


def _unused(archive: Archive, structure: str, root: Any, used: Collection[str]) -> Iterator[str]:
    """Yield a note for each part of the archive that has no bearing on the run.

    structure is the one that was read, used are the types of the annotations that were read.
    """
    for name in archive.structures:
        if name != structure:
            option = f"--set experiment.variant={name.removesuffix(SSD)}"
            yield f"variant {name} is not used, {structure} is; {option} takes it"
    types = Counter(annotation.get("type") for annotation in root.iter(qualified("ssc:Annotation")))
    for kind in sorted(set(types) - set(used)):
        yield f"annotations of type {kind!r} are not used ({types[kind]})"
