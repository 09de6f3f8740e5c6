"""Start values: parameter sets (SSV), mapped (SSM) and bound to a system or component.

As the standard has it: names in the sets are those of variables, behind a dot after those of their
elements; or those of connectors of a system, from which the value follows the connections. With a
mapping only what is mapped is applied. Later bindings go before earlier ones, those of an outer
system before those of an inner one. What fits nothing is not applied, and said; so is a value for
what an FMU calculates itself, or for a constant.

A connection that brings a value goes before all bindings at where it leads to. By SSP 1.0.1
bindings set start values (5.2.3, ParameterBindings). The data flow along connections has one source
at most (5.3.2, Connections): it ranks bindings among each other only, and a connector has the value
of what it is connected to. OMSimulator does the same.

A value is converted to the unit of its target, then transformed, as on a connection. Types must be
the same, but a whole number may be given to a Real, and an enumeration by number.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..base.checks import known
from ..base.errors import InputError, choices
from ..base.si_units import Unit
from ..interface.fmi_types import Value
from ..interface.values import parse_value
from .elements import Element, Hop, Node, Path, linear, transformation
from .network import OTHERWISE, Carried, Network
from .xml_document import Origin, at, child, children, is_true, same, short

_READERS: Mapping[str, Callable[[str], Value]] = {
    "Real": float,
    "Integer": int,
    "Boolean": lambda text: text.strip() in ("true", "1"),
    "String": str,
    "Enumeration": str,
}
"""From the text of a value to the value, by SSP type; an enumeration by name."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value of a set with its SSP type; place says where it is from, in the document of origin.

    unit_name is the name of its unit in the set; unit is what it is in at a connector or variable.
    """

    place: str
    origin: Origin
    type: str
    value: Value
    unit_name: str | None
    unit: Unit | None = None
    settled: bool = True


@dataclass(frozen=True, slots=True)
class BoundValue:
    """A parameter for what is called name at the binding's system or component; place says so.

    With suppress its unit is not converted. transformation is its element, or None.
    """

    place: str
    name: str
    parameter: Parameter
    suppress: bool = False
    transformation: Any = None


def read_start_values(network: Network, causality: str = "") -> dict[Path, dict[str, Value]]:
    """The value that holds for each variable that is given one; of one causality, if that is named.

    By the path of the component and the FMU's name of the variable.
    """
    values: dict[Path, dict[str, Value]] = {}
    for end, parameter in _values_that_hold(network):
        variable = network.parts[end.path].interface.by_name.get(end.name)
        if causality and (variable is None or variable.causality != causality):
            continue
        if variable is not None and not variable.settable:
            text = f"{end} {variable.unsettable}; not used"
            parameter.origin.notes.add(parameter.place, text)
            continue
        value, source = _checked_value(network, end, parameter), network.output(end)
        if source:
            text = f"{end} is connected to {source}; not used"
            parameter.origin.notes.add(parameter.place, text)
        else:
            values.setdefault(end.path, {})[end.name] = value
    return values


def _values_that_hold(network: Network) -> Iterator[tuple[Node, Parameter]]:
    """Yield the variables that are given a value, and the one that holds."""
    parameters: dict[Node, Parameter] = {}
    for element, origin, binding in _bindings(network):
        place = f"{at(origin.place, binding)}: {element.name!r}"
        for entry in _bound_values(origin, place, binding):
            nodes = list(_nodes(network, element, entry.name))
            for node in nodes:
                parameters[node] = _in_unit_of_node(network, node, entry)
            if not nodes:
                origin.notes.add(entry.place, "nothing of that name to give it to; not used")
    for node in dict.fromkeys((*parameters, *network.into)):
        sources = (node, *(hop.source for hop in network.trace(node)))
        if node.path in network.parts and not parameters.keys().isdisjoint(sources):
            yield node, _value_at(network, node, parameters)


def _bindings(network: Network) -> Iterator[tuple[Element, Origin, Any]]:
    """All bindings with what they are at; who goes before another comes after it."""
    components = (part.element for part in network.parts.values())
    inner_first = sorted(network.systems.values(), key=lambda e: len(e.path), reverse=True)
    for element in (*components, *inner_first):
        for origin, binding in element.bindings:
            yield element, origin, binding


def _bound_values(origin: Origin, place: str, binding: Any) -> Iterator[BoundValue]:
    """Yield the values of a binding, of a set with a mapping those that are mapped."""
    holder = child(binding, "ssd:ParameterValues")
    parameters = _parameter_set(
        *origin.inner(place, binding, "ssv", holder), binding.get("prefix", "")
    )
    mapping = child(binding, "ssd:ParameterMapping")
    if mapping is None:
        for name, parameter in parameters.items():
            yield BoundValue(parameter.place, name, parameter)
        return
    inner, root = origin.inner(place, mapping, "ssm", mapping)
    unmapped = dict(parameters)
    targets: set[str] = set()
    for element in children(root, "ssm:MappingEntry"):
        source, target = element.get("source"), element.get("target")
        entry_place = f"{at(inner.place, element)}: mapping '{source} -> {target}'"
        unmapped.pop(source, None)
        if source not in parameters:
            origin.notes.add(entry_place, f"no parameter {source!r}; not used")
            continue
        if target in targets:
            raise InputError(f"{entry_place}: {target!r} has two sources; must have one")
        targets.add(target)
        suppress = is_true(element, "suppressUnitConversion")
        yield BoundValue(entry_place, target, parameters[source], suppress, transformation(element))
    for parameter in unmapped.values():
        origin.notes.add(parameter.place, "not in the mapping; not used")


def _parameter_set(origin: Origin, root: Any, prefix: str) -> dict[str, Parameter]:
    """The parameters of a set by their names, with the prefix of its binding."""
    parameters: dict[str, Parameter] = {}
    for element in children(root, "ssv:Parameters", "ssv:Parameter"):
        name = element.get("name")
        place = f"{at(origin.place, element)}: parameter {name!r}"
        typed_value = element[0]
        kind = short(typed_value.tag).removeprefix("ssv:")
        known(f"{place}: type", kind, _READERS, " is not supported")
        value = _READERS[kind](typed_value.get("value"))
        parameter = Parameter(place, origin, kind, value, origin.unit_name(typed_value))
        first = parameters.setdefault(prefix + name, parameter)
        if (first.value, first.unit_name) != (parameter.value, parameter.unit_name):
            raise InputError(f"{place}: there are two; must be one")
    return parameters


def _nodes(network: Network, element: Element, name: str) -> Iterator[Node]:
    """Yield the variables and connectors that a name means at a system or component."""
    if element.path in network.parts:
        if name in network.parts[element.path].interface.by_name:
            yield Node(element.path, name)
        return
    if name in element.connectors:
        yield Node(element.path, name)
    for dot, letter in enumerate(name):
        inner = element.elements.get(name[:dot]) if letter == "." else None
        if inner is not None:
            yield from _nodes(network, inner, name[dot + 1 :])


def _value_at(network: Network, node: Node, parameters: Mapping[Node, Parameter]) -> Parameter:
    """The value that holds at a node: of what it is connected to, else its own."""
    hops = network.trace(node)
    start = next((k for k, hop in enumerate(hops) if hop.source in parameters), None)
    if start is None:
        return parameters[node]
    parameter = parameters[hops[start].source]
    for hop in hops[start:]:
        overridden = parameters.get(hop.target)
        if overridden is not None:
            overridden.origin.notes.add(
                overridden.place,
                f"{hop.target} has the value of {hop.source} by a connection, which goes before "
                "it; not used",
            )
        parameter = _after_hop(network, hop, parameter)
    return parameter


def _after_hop(network: Network, hop: Hop, parameter: Parameter) -> Parameter:
    """The parameter after one more hop."""
    if parameter.type in ("Real", "Integer"):
        start = Carried(parameter.unit, settled=parameter.settled)
        unit, factor, offset, settled = network.carry(hop, start)
        value = parameter.value
        if (factor, offset) != (1.0, 0.0):
            value = factor * float(value) + offset
        return replace(parameter, value=value, unit=unit, settled=settled)
    if hop.transformation:
        raise InputError(f"{hop.place}: transforms a {parameter.type}; must be Real")
    return parameter


def _in_unit_of_node(network: Network, node: Node, bound: BoundValue) -> Parameter:
    """The parameter in the unit of the node, transformed as on a connection, or by a table."""
    unit = None if bound.suppress else _unit_for_node(network, node, bound.parameter)
    parameter = replace(bound.parameter, unit=unit)
    element, factors = bound.transformation, None
    if element is not None and short(element.tag) != "ssc:LinearTransformation":
        parameter = _by_table(parameter, element)
    elif element is not None:
        factors = linear(element)
        parameter = replace(parameter, type=parameter.type.replace("Integer", "Real"))
    return _after_hop(network, Hop(parameter.place, node, node, factors, bound.suppress), parameter)


def _unit_for_node(network: Network, node: Node, parameter: Parameter) -> Unit | None:
    """The unit of a value for a node; None where it is that of the node, or has no meaning there.

    A unit of the name that the FMU gives it is the FMU's, however the set defines it.
    """
    name, origin, place = parameter.unit_name, parameter.origin, parameter.place
    unit, unit_name = network.unit(node), network.unit_name(node)
    defined = origin.units.get(name or "")
    if name and node.path in network.parts and name == unit_name:
        if defined and unit and not same(defined, unit):
            origin.notes.add(place, OTHERWISE.format(name))
        if defined:
            return unit
    if name and not defined and node.path in network.parts and unit_name is None:
        text = f"unit {name!r} is not defined, and {node} has none; taken as it is"
        origin.notes.add(place, text)
        return None
    return origin.unit(place, name, unit_name)


def _by_table(parameter: Parameter, element: Any) -> Parameter:
    """The parameter with the value that a mapping transformation has for its value."""
    table = short(element.tag)
    kind = table.removeprefix("ssc:").removesuffix("MappingTransformation")
    if parameter.type != kind:
        raise InputError(f"{parameter.place}: {parameter.type} has {table}; must be {kind}")
    read, entries = _READERS[kind], children(element, "ssc:MapEntry")
    targets = {read(entry.get("source")): read(entry.get("target")) for entry in entries}
    if parameter.value not in targets:
        place, valid = parameter.place, choices(map(repr, targets))
        raise InputError(f"{place}: {parameter.value!r} is not in its {table}; valid: {valid}")
    return replace(parameter, value=targets[parameter.value])


def _checked_value(network: Network, node: Node, parameter: Parameter) -> Value:
    """The value of a parameter, checked as one of a variable."""
    interface = network.parts[node.path].interface
    variable = interface.by_name[node.name]
    is_number = (parameter.type, variable.kind) == ("Integer", "Real")
    is_item = parameter.type == "Enumeration" and variable.items
    if parameter.type != variable.kind and not is_number and not is_item:
        raise InputError(
            f"{parameter.place}: {parameter.type}; {node} is {variable.kind}, must be the same"
        )
    return parse_value(interface, parameter.place, node.name, parameter.value)
