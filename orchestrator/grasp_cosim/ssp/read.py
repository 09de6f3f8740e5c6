"""From an SSP 1.0 archive to a system.

What the archive holds is run or refused by name; what the standard lets a tool decide is decided
here, as orchestrator/README.md describes, and said in the notes of the system.
"""

import math
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import fields, replace
from pathlib import Path as FilePath
from typing import Any

from ..errors import InputError, choices
from ..interface.expansion import expanded
from ..interface.interface import Value
from ..interface.units import known_unit
from ..system.description import System, in_nanoseconds
from ..system.parts import NANOSECONDS, Component, Connection, Port, Solver
from ..system.stimuli import Stimuli
from .annotation import TYPE, Beside, Extras, no_extras, read_extras
from .archive import STRUCTURE, Archive
from .document import at, child, children, qualified
from .foreign import FOREIGN, Steps, read_steps
from .network import Carried, Network, Part
from .notes import Notes
from .order import flow_order
from .origin import open_structure
from .parameters import read_settings, read_sizes
from .tree import Element, Hop, Path, read_system
from .units import same


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
    top = read_system(origin, child(root, "ssd:System"))
    parts = {e.path: Part(e, e.interface) for e in top.within() if e.interface is not None}
    if not parts:
        raise InputError(f"{top.place}: system {top.name!r} has no components; must have some")
    systems = {e.path: e for e in top.within() if e.interface is None}
    names = _names(file, parts)
    annotated = _annotated(file, root, names.values())
    given_ns = None if step is None else in_nanoseconds("step", step)
    steps = Steps() if annotated else read_steps(file, root, given_ns)
    extras = annotated or no_extras(names.values(), steps)
    parts = _sized(systems, parts, notes)
    called = {
        at: _Called(f"{file}: {names[at]}", part, extras.components[names[at]])
        for at, part in parts.items()
    }
    parts = {at: called[at].in_units() for at in parts}
    network = Network(systems, parts)
    network.check()
    connections = tuple(_connections(network, names, called))
    values = read_settings(network)
    given = [
        called[at].component(names[at], part, values.get(at, {})) for at, part in parts.items()
    ]
    stimuli = stimuli or extras.input
    driven = stimuli.columns if stimuli else ()
    decided: list[str] = []
    components = tuple(_keep_starts(file, given, connections, driven, decided))
    if annotated is None:
        components = flow_order(components, connections)
        decided.append(f"order of execution: {', '.join(c.name for c in components)}")
    stop_ns = _stop(file, root, parts.values(), stop, decided)
    step_ns = _step(file, parts.values(), stop_ns, given_ns, annotated, steps, decided)
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
        (*_unused(archive, root, used), *_renamed(names), *notes.lines(), *decided),
        extras.roles,
        extras.presets,
        extras.diverging,
        stimuli,
    )


def _sized(
    systems: Mapping[Path, Element], parts: Mapping[Path, Part], notes: Notes
) -> dict[Path, Part]:
    """The parts with their arrays taken apart, of as many elements as the archive's values say."""
    if not any(v.shape for part in parts.values() for v in part.interface.variables):
        return dict(parts)
    with notes.off():  # of the values of elements that are not there yet
        sizes = read_sizes(Network(systems, parts))
    return {
        at: replace(part, interface=expanded(part.interface, sizes.get(at, {})))
        for at, part in parts.items()
    }


class _Called:
    """The names of a component's variables, its FMU's and the system's, and units by the latter."""

    def __init__(self, place: str, part: Part, beside: Beside) -> None:
        self._place, self._part, self._beside = place, part, beside
        renamed = part.interface.renamed(beside.rename, f"{place}: rename").variables
        pairs = zip(part.interface.variables, renamed, strict=True)
        self._new = {own: new for new, own in beside.rename.items()}  # of whole arrays, too
        self._new |= {own.name: new.name for own, new in pairs}
        own = {new: own for own, new in self._new.items()}
        self._units = {
            **_units(part),
            **{own.get(name, name): unit for name, unit in beside.units.items()},
        }

    def new(self, own: str) -> str:
        """The system's name of a variable of the FMU."""
        return self._new.get(own, own)

    def in_units(self) -> Part:
        """The part with the units that the archive names."""
        return replace(
            self._part, interface=self._part.interface.in_units(self._units, self._place)
        )

    def component(self, name: str, part: Part, values: Mapping[str, Value]) -> Component:
        """The component with these values, by the FMU's names."""
        own = {self.new(variable): value for variable, value in values.items()}
        units = {self.new(variable): unit for variable, unit in self._units.items()}
        more = {f.name: getattr(self._beside, f.name) for f in fields(Beside)} | {"units": units}
        if part.element.exchange and "CoSimulation" in part.interface.kinds:
            more["solver"] = self._beside.solver or Solver()
        return Component(name, part.interface.path, own, **more)


def _units(part: Part) -> dict[str, str]:
    """The units that connectors name for variables that have none in the FMU."""
    variables = part.interface.by_name
    connectors = {
        c.name: c.unit
        for c in part.element.connectors.values()
        if c.unit and (v := variables.get(c.name)) and v.kind == "Real" and v.unit is None
    }
    meant = {n: (unit, known_unit(unit.name)) for n, unit in connectors.items()}
    return {n: unit.name for n, (unit, known) in meant.items() if known and same(unit, known)}


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


def _names(file: str, parts: Iterable[Path]) -> dict[Path, str]:
    """The components' names in the system, where a dot parts component and variable."""
    names = {path: "_".join(path).replace(".", "_") for path in parts}
    for name, count in Counter(names.values()).items():
        if count > 1:
            same = choices(".".join(path) for path in names if names[path] == name)
            raise InputError(f"{file}: components {same} would all be {name!r} here; must differ")
    return names


def _connections(
    network: Network, names: Mapping[Path, str], called: Mapping[Path, _Called]
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


def _carried(network: Network, hops: list[Hop]) -> Carried:
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


def _keep_starts(
    file: str,
    components: Iterable[Component],
    connections: Iterable[Connection],
    driven: Iterable[Port],
    notes: list[str],
) -> Iterator[Component]:
    """The components, with the start values of inputs that have no source as values."""
    connected = {*(connection.target for connection in connections), *driven}
    for component in components:
        starts: dict[str, Value] = {}
        for variable in component.interface.of("input"):
            port, start = Port(component.name, variable.name), variable.start
            given = port in connected or variable.name in component.values
            if variable.supported and not variable.element and not given and start is not None:
                place = f"{file}: start value of {port}"
                starts[variable.name] = component.interface.parse(
                    place, variable.name, start, text=True
                )
                notes.append(f"input {port} is not connected; keeps its start value {start}")
        yield replace(component, values={**component.values, **starts})


def _stop(
    file: str, root: Any, parts: Iterable[Part], given: float | None, notes: list[str]
) -> int:
    """The stop time in ns: given, or of the archive, or the longest that its FMUs name."""
    experiment = child(root, "ssd:DefaultExperiment")
    attributes = {} if experiment is None else experiment.attrib
    start = float(attributes.get("startTime", "0"))
    if start != 0.0:
        raise InputError(
            f"{at(file, experiment)}: startTime = {start:g} s is not supported; must be 0"
        )
    if given is not None:
        return in_nanoseconds("stop", given)
    if "stopTime" in attributes:
        return in_nanoseconds(f"{at(file, experiment)}: stopTime", float(attributes["stopTime"]))
    declared = [part.interface.experiment.get("stop_time") for part in parts]
    stop = max((float(time) for time in declared if time is not None), default=0.0)
    if not 0.0 < stop < math.inf:
        raise InputError(f"{file}: no stopTime in a DefaultExperiment; give one: --stop")
    notes.append(f"stop = {stop:g} s, the longest that its FMUs name; the archive names none")
    return in_nanoseconds(f"{file}: stop time of its FMUs", stop)


def _step(
    file: str,
    parts: Iterable[Part],
    stop_ns: int,
    given_ns: int | None,
    annotated: Extras | None,
    steps: Steps,
    notes: list[str],
) -> int:
    """The step in ns: given, ours, another tool's, or the FMUs' smallest that divides the stop."""
    if given_ns is not None:
        return given_ns
    if annotated:
        return annotated.step_ns
    if steps.base_ns:
        notes.append(f"step = {steps.base_ns / NANOSECONDS:g} s, scheme jacobi, by {steps.said}")
        return steps.base_ns
    declared_steps = sorted({part.interface.step for part in parts if part.interface.step})
    for step in declared_steps:
        if not 0.0 < step * NANOSECONDS <= stop_ns:
            continue
        step_ns = round(step * NANOSECONDS)
        if step_ns and stop_ns % step_ns == 0 and math.isclose(step_ns / NANOSECONDS, step):
            notes.append(f"step = {step:g} s, the smallest that its FMUs name; SSP has none")
            return step_ns
    listed = choices(f"{step:g} s" for step in declared_steps)
    raise InputError(
        f"{file}: names no step, as SSP has none, and of those of its FMUs ({listed}) none "
        f"divides the stop of {stop_ns / NANOSECONDS:g} s; give one: --step"
    )


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


def _renamed(names: Mapping[Path, str]) -> Iterator[str]:
    for path, name in names.items():
        if name != ".".join(path):
            yield f"component {'.'.join(path)} is called {name} here"
