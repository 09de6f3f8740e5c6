"""The connections of nested systems as one net, in which a value is followed from hop to hop.

A hop leads from one connector to another along a connection. Inside a system its inputs and
parameters give values and its outputs take them; of its elements, outputs give and inputs take. The
two ends of a connection are in no order, so the direction of the hop comes from that.

Along a hop a value is first converted to the unit of the connector it reaches, then transformed:
target = factor * converted + offset. With suppressUnitConversion the transformation, if any, is
all. So the standard has it: schema of SSP 1.0, LinearTransformation and suppressUnitConversion.
A connector of a system without a unit passes on that of the value.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from ..base.errors import InputError, nearest
from ..base.si_units import Unit
from ..interface.interface import Interface
from ..interface.variables import Variable
from .elements import Element, Hop, Node, Path
from .xml_document import change, same

OTHERWISE = "unit {!r} is defined otherwise by the FMU, whose definition is taken"


@dataclass(frozen=True, slots=True)
class Part:
    """A component: its element, and its interface under the FMU's own names."""

    element: Element
    interface: Interface


class Carried(NamedTuple):
    """A number x after some hops: factor * x + offset, in unit.

    unit is None where it is not known. settled is False where a transformation has led to a
    connector without a unit, so that the unit is a guess.
    """

    unit: Unit | None
    factor: float = 1.0
    offset: float = 0.0
    settled: bool = True


@dataclass(frozen=True)
class Network:
    """All systems and components by path, and the hops between their connectors."""

    systems: Mapping[Path, Element]
    parts: Mapping[Path, Part]

    def check(self) -> None:
        """InputError at a connector that its FMU lacks."""
        for part in self.parts.values():
            _check_connectors(part)

    @cached_property
    def into(self) -> dict[Node, Hop]:
        """The hop that leads to a node; InputError where there are two."""
        into: dict[Node, Hop] = {}
        for hop in (hop for system in self.systems.values() for hop in system.hops):
            if hop.target in into:
                raise InputError(
                    f"{hop.place}: {hop.target} has two sources, "
                    f"{into[hop.target].source} and {hop.source}; must have one"
                )
            into[hop.target] = hop
        return into

    def trace(self, node: Node) -> list[Hop]:
        """The hops that lead to a node, from where its value comes first."""
        hops: list[Hop] = []
        while node in self.into:
            hop = self.into[node]
            if hop in hops:
                raise InputError(f"{hop.place}: leads back to itself")
            hops.insert(0, hop)
            node = hop.source
        return hops

    def output(self, node: Node) -> Node | None:
        """The output of a component that a node gets its values from in the end, if any."""
        hops = self.trace(node)
        return hops[0].source if hops and hops[0].source.path in self.parts else None

    def unit(self, node: Node) -> Unit | None:
        """The unit of a node: that of its connector, of a component that of the variable."""
        part = self.parts.get(node.path)
        if part is None:
            return self.systems[node.path].connectors[node.name].unit
        connector = part.element.connectors.get(node.name)
        return part.interface.unit(self.variable(node)) or (connector.unit if connector else None)

    def unit_name(self, node: Node) -> str | None:
        """The name of the unit of a node."""
        if node.path in self.parts and self.variable(node).unit:
            return self.variable(node).unit
        unit = self.unit(node)
        return unit.name if unit else None

    def variable(self, node: Node) -> Variable:
        """The variable of a node of a component."""
        return self.parts[node.path].interface.by_name[node.name]

    def nature(self, node: Node) -> tuple[str, str | None]:
        """Causality and kind of value of a node; the kind is None where a connector names none."""
        if node.path in self.parts:
            variable = self.variable(node)
            return variable.causality, variable.kind
        connector = self.systems[node.path].connectors[node.name]
        return connector.kind, connector.type

    def carry(self, hop: Hop, carried: Carried) -> Carried:
        """Return what is carried after one more hop; InputError where units do not fit."""
        place, target = hop.place, self.unit(hop.target)
        factor, offset, unit = carried.factor, carried.offset, carried.unit
        if unit and target and not hop.suppress:
            if not carried.settled and not same(unit, target):
                raise InputError(
                    f"{place}: the unit at {hop.source} is not clear, {unit.name} or "
                    f"{target.name}; give that connector a unit"
                )
            factor, offset = _composed(factor, offset, change(place, unit, target))
        transformation = hop.transformation
        if transformation is not None:
            factor, offset = _composed(factor, offset, transformation)
        settled = target is not None or (carried.settled and transformation is None)
        return Carried(target or unit, factor, offset, settled)

    def follow(self, hops: list[Hop]) -> tuple[str, Carried]:
        """The kind of value, and what is carried, of an output at the end of the hops.

        InputError where the way is not allowed.
        """
        carried = Carried(self.unit(hops[0].source))
        variable = self.variable(hops[0].source)
        kind: str = variable.kind
        for hop in hops:
            place = hop.place
            causality, reached = self.nature(hop.target)
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
            carried = self.carry(hop, carried)
        return kind, carried

    def decided_by_units(self, hops: list[Hop], carried: Carried) -> bool:
        """True if the units that the two FMUs declare say all about the way along the hops."""
        if any(h.suppress or h.transformation for h in hops):
            return False
        nodes = hops[0].source, hops[-1].target
        names = [self.variable(node).unit for node in nodes]
        units = [self.parts[node.path].interface.unit(self.variable(node)) for node in nodes]
        direct = (1.0, 0.0)
        if None not in names and names[0] != names[1]:
            if units[0] is None or units[1] is None:  # a connection is refused, unless the archive
                return None in (self.unit(node) for node in nodes)  # says what they are
            direct = change(hops[-1].place, units[0], units[1])
        return direct == (carried.factor, carried.offset)


def _check_connectors(part: Part) -> None:
    for connector in part.element.connectors.values():
        place = f"{connector.place}: {part.element.name}: connector {connector.name!r}"
        variable = part.interface.by_name.get(connector.name)
        if variable is None or variable.causality != connector.kind:
            names = [v.name for v in part.interface.of(connector.kind)]
            raise InputError(
                f"{place}: {part.interface.path.name} has no {connector.kind} of that name; "
                f"{nearest(connector.name, names)}"
            )
        if connector.type not in (None, variable.kind):
            raise InputError(f"{place}: {connector.type}; the FMU has {variable.kind}")
        declared = part.interface.unit(variable)
        if not declared or not connector.unit or same(declared, connector.unit):
            continue
        if connector.unit.name == variable.unit:
            part.element.origin.notes.add(place, OTHERWISE.format(variable.unit))
        else:
            raise InputError(
                f"{place}: unit {connector.unit.name} is not the one that the FMU declares, "
                f"{declared.name}; must mean the same"
            )


def _composed(factor: float, offset: float, conversion: tuple[float, float]) -> tuple[float, float]:
    """First factor and offset, then the conversion; exact where one of the two does nothing."""
    return conversion[0] * factor, conversion[0] * offset + conversion[1]
