"""The inputs and outputs of the systems of an archive, as those of the one system that is run.

The top system's are called as they are there; those of a system in it after that and a dot, as the
variables of a component are. An input is one that nothing in the archive leads to. What leads from
it to the components, or from one of these to an output, is followed from hop to hop.
"""

from collections.abc import Callable, Iterator

from ..base.errors import InputError
from ..base.si_units import Unit
from ..interface.units import IDENTITY, conversion
from ..interface.variables import SETTABLE
from ..system.parts import Link, Port, SystemInput, SystemOutput
from ..system.structure import unit_of
from .elements import Hop, Node
from .network import Carried, Network

_TIME = "time"
"""The name of the first column of a recording."""

PortOf = Callable[[Node], Port]
"""The name in the system of a variable of a component."""


def system_outputs(network: Network, port_of: PortOf) -> dict[str, SystemOutput]:
    """The outputs of the systems that come from an output of a component, by name."""
    outputs: dict[str, SystemOutput] = {}
    for name, node, place in _system_connectors(network, port_of, ("output",)):
        notes = network.systems[node.path].origin.notes
        source = network.output(node)
        if source is None:
            notes.add(place, f"{name} has no output of a component behind it; not recorded")
            continue
        if not network.variable(source).supported:
            notes.add(place, f"{name} is of type {network.variable(source).nature}; not recorded")
            continue
        hops = network.trace(node)
        try:
            kind, carried = network.follow(hops)
        except InputError as error:
            notes.add(place, f"{name} is not recorded: {error}")
            continue
        source_unit = unit_of(network.parts[source.path].interface, network.variable(source))
        unit = carried.unit if carried.settled else None
        outputs[name] = SystemOutput(
            _link_along(port_of(source), hops, source_unit, unit, carried), unit, kind
        )
    return outputs


def system_inputs(network: Network, port_of: PortOf) -> dict[str, SystemInput]:
    """The inputs and parameters of the systems that lead to a component, by name."""
    targets_of: dict[Node, list[tuple[Node, list[Hop]]]] = {}
    for target in network.into:
        if target.path in network.parts:
            hops = network.trace(target)
            targets_of.setdefault(hops[0].source, []).append((target, hops))
    inputs: dict[str, SystemInput] = {}
    for name, node, place in _system_connectors(network, port_of, ("input", "parameter")):
        notes = network.systems[node.path].origin.notes
        if node in network.into:
            continue
        unit = network.unit(node)
        links: list[Link] = []
        for target, hops in targets_of.get(node, []):
            variable = network.variable(target)
            if variable.causality not in SETTABLE or not variable.supported:
                notes.add(place, f"{name} leads to {target}, which cannot be set; not passed on")
                continue
            carried = Carried(unit)
            try:
                for hop in hops:
                    carried = network.carry(hop, carried)
            except InputError as error:
                notes.add(place, f"{name} is not passed on: {error}")
                continue
            target_unit = unit_of(network.parts[target.path].interface, variable)
            links.append(_link_along(port_of(target), hops, unit, target_unit, carried))
        if links:
            inputs[name] = SystemInput(tuple(links), unit)
        else:
            notes.add(place, f"{name} leads to no variable of a component; cannot be given a value")
    return inputs


def _link_along(
    port: Port, hops: list[Hop], start: Unit | None, end: Unit | None, carried: Carried
) -> Link:
    """The link along the hops; without numbers where the units at its two ends say all about it."""
    by_units = conversion(start, end) if start and end else IDENTITY
    transformed = any(hop.suppress or hop.transformation for hop in hops)
    if not transformed and by_units == (carried.factor, carried.offset):
        return Link(port)
    return Link(port, carried.factor, carried.offset)


def _system_connectors(
    network: Network, port_of: PortOf, kinds: tuple[str, ...]
) -> Iterator[tuple[str, Node, str]]:
    """Yield the connectors of systems of these kinds, by the names that they have in the run.

    One that has the name of something else is left out, with a note.
    """
    taken = {
        str(port_of(Node(path, variable.name)))
        for path, part in network.parts.items()
        for variable in part.interface.variables
    }
    for path, system in network.systems.items():
        for connector in system.connectors.values():
            system_name = "_".join(path).replace(".", "_")
            name = f"{system_name}.{connector.name}" if path else connector.name
            if connector.kind not in kinds:
                continue
            if name in taken or name.lower() == _TIME:
                system.origin.notes.add(
                    connector.place, f"{name!r} is the name of something else; left out"
                )
                continue
            taken.add(name)
            yield name, Node(path, connector.name), connector.place
