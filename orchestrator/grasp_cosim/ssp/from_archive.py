"""From an archive to a system.

What the archive holds is run or refused by name; what the standard lets a tool decide is decided
here, as docs/system_files.md describes, and said in the notes of the system.
"""

from collections import Counter
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path as FilePath
from typing import Any

from ..base.errors import InputError, choices
from ..interface.expansion import expanded
from ..interface.interface import Value
from ..system.description import System
from ..system.parts import Component, Connection, Port, in_nanoseconds
from ..system.stimuli import Stimuli
from .annotations import FOREIGN, TYPE, Extras, Steps, no_extras, read_extras, read_steps
from .archive import STRUCTURE, Archive, Notes
from .connectors import Carried, Connectors, Part
from .decisions import Called, component_names, flow_order, renamed, step_time, times
from .document import at, child, children, qualified
from .elements import Element, Hop, Path, read_system
from .origin import Origin, open_structure
from .parameters import read_settings, read_sizes


def read_ssp(
    path: FilePath,
    step: float | None = None,
    stop: float | None = None,
    stimuli: Stimuli | None = None,
) -> System:
    """The system of an archive; step and stop in s, and stimuli, go before what it names."""
    notes = Notes()
    archive = Archive(path, notes)
    origin, root = open_structure(archive, notes)
    file = origin.place
    systems, parts = _elements(origin, root)
    names = component_names(file, parts)
    annotated = _annotated(file, root, names.values())
    given_ns = None if step is None else in_nanoseconds("step", step)
    steps = Steps() if annotated else read_steps(file, root, given_ns)
    extras = annotated or no_extras(names.values(), steps)
    called = _called(file, _sized(systems, parts, notes), names, extras)
    parts = {at: part.in_units() for at, part in called.items()}
    network = Connectors(systems, parts)
    network.check()
    connections = tuple(_connections(network, names, called))
    stimuli = stimuli or extras.input
    sourced = {*(c.target for c in connections), *(stimuli.columns if stimuli else ())}
    decided: list[str] = []
    components = tuple(_components(file, network, names, called, sourced, decided))
    if annotated is None:
        components = flow_order(components, connections)
        decided.append(f"order of execution: {', '.join(c.name for c in components)}")
    if steps.base_ns:
        decided.append(f"scheme = {extras.scheme}, as meant by {steps.said}")
    start_ns, stop_ns = times(file, root, parts.values(), stop, decided)
    span_ns = stop_ns - start_ns
    step_ns = step_time(file, parts.values(), span_ns, given_ns, annotated, steps, decided)
    used = {TYPE, *FOREIGN} if annotated or steps.base_ns else {TYPE}
    return System(
        archive.place,
        components,
        connections,
        step_ns,
        stop_ns,
        extras.scheme,
        extras.events,
        extras.faults,
        extras.initialisation,
        (*_unused(archive, root, used), *renamed(names), *notes.lines(), *decided),
        extras.roles,
        extras.presets,
        extras.diverging,
        stimuli,
        extras.realtime,
        extras.metrics,
        start_ns,
    )


def _elements(origin: Origin, root: Any) -> tuple[dict[Path, Element], dict[Path, Part]]:
    """The systems and the components of a structure; InputError where it has no component."""
    top = read_system(origin, child(root, "ssd:System"))
    parts = {e.path: Part(e, e.interface) for e in top.within() if e.interface is not None}
    if not parts:
        raise InputError(f"{top.place}: system {top.name!r} has no components; must have some")
    return {e.path: e for e in top.within() if e.interface is None}, parts


def _called(
    file: str,
    parts: Mapping[Path, Part],
    names: Mapping[Path, str],
    extras: Extras,
) -> dict[Path, Called]:
    """The components under the names that they get, and under those of their variables."""
    return {
        at: Called(f"{file}: {names[at]}", part, extras.components[names[at]])
        for at, part in parts.items()
    }


def _sized(
    systems: Mapping[Path, Element], parts: Mapping[Path, Part], notes: Notes
) -> dict[Path, Part]:
    """The parts with their arrays taken apart, of as many elements as the archive's values say."""
    if not any(v.shape for part in parts.values() for v in part.interface.variables):
        return dict(parts)
    with notes.off():  # of the values of elements that are not there yet
        sizes = read_sizes(Connectors(systems, parts))
    return {
        at: replace(part, interface=expanded(part.interface, sizes.get(at, {})))
        for at, part in parts.items()
    }


def _annotated(file: str, root: Any, names: Collection[str]) -> Extras | None:
    """The extras of our annotation, if there is one; `names` are those of the components.

    It is in the default experiment, in earlier archives below the root.
    """
    experiment = children(root, "ssd:DefaultExperiment", "ssd:Annotations", "ssc:Annotation")
    for annotation in (*experiment, *children(root, "ssd:Annotations", "ssc:Annotation")):
        if annotation.get("type") == TYPE:
            extras = read_extras(at(file, annotation), annotation)
            if set(extras.components) != set(names):
                raise InputError(
                    f"{file}: annotation {TYPE!r} is about other components, "
                    f"{choices(extras.components)}; valid: {choices(names)}; remove it"
                )
            return extras
    return None


def _connections(
    network: Connectors, names: Mapping[Path, str], called: Mapping[Path, Called]
) -> Iterator[Connection]:
    """The connections, in the order of the connections that reach the inputs."""
    for target in network.into:
        if target.path not in network.parts or network.output(target) is None:
            continue
        hops = network.trace(target)
        carried = _carried(network, hops)
        source, sink = (
            Port(names[node.path], called[node.path].new(node.name))
            for node in (hops[0].source, target)
        )
        if network.decided_by_units(hops, carried):
            yield Connection(source, sink)
        else:
            yield Connection(source, sink, carried.factor, carried.offset)


def _carried(network: Connectors, hops: list[Hop]) -> Carried:
    """Follow a value from component to component; InputError where the way is not allowed."""
    carried = Carried(network.unit(hops[0].source))
    variable = network.variable(hops[0].source)
    kind: str = variable.kind
    for hop in hops:
        place = hop.place
        causality, reached = network.nature(hop.target)
        if variable.causality != "output" or causality == "parameter":
            raise InputError(
                f"{place}: leads from {hops[0].source} to a parameter, or from one; "
                "only outputs are passed on to inputs, give the parameter a value"
            )
        reached = reached or kind
        if reached != kind and (kind, reached) != ("Integer", "Real"):
            raise InputError(
                f"{place}: from {kind} to {reached} at {hop.target}; must be the same, "
                "or from Integer to Real"
            )
        kind = reached
        if hop.transformation and kind != "Real":
            raise InputError(f"{place}: transforms a {kind}; must be Real")
        carried = network.carry(hop, carried)
    return carried


def _components(
    file: str,
    network: Connectors,
    names: Mapping[Path, str],
    called: Mapping[Path, Called],
    sourced: Collection[Port],
    notes: list[str],
) -> Iterator[Component]:
    """The components with the archive's values, and start values of inputs not among sourced."""
    settings = read_settings(network)
    for path, part in network.parts.items():
        component = called[path].component(names[path], part, settings.get(path, {}))
        starts: dict[str, Value] = {}
        for variable in component.interface.of("input"):
            port, start = Port(component.name, variable.name), variable.start
            given = port in sourced or variable.name in component.values
            if variable.supported and not variable.element and not given and start is not None:
                place = f"{file}: start value of {port}"
                starts[variable.name] = component.interface.parse(
                    place, variable.name, start, text=True
                )
                notes.append(f"input {port} is not connected; keeps its start value {start}")
        yield replace(component, values={**component.values, **starts})


def _unused(archive: Archive, root: Any, used: Collection[str]) -> Iterator[str]:
    """Yield a note for each part of the archive that has no bearing on the run.

    used are the types of the annotations that were read.
    """
    for name in archive.names:
        if name.endswith(".ssd") and "/" not in name and name != STRUCTURE:
            yield f"variant {name} is not used; {STRUCTURE} is"
    types = Counter(annotation.get("type") for annotation in root.iter(qualified("ssc:Annotation")))
    for kind in sorted(set(types) - set(used)):
        yield f"annotations of type {kind!r} are not used ({types[kind]})"
