"""Start values: parameter sets (SSV), mapped (SSM) and bound to a system or component.

As the standard has it: names in the sets are those of variables, after those of the elements they
are in and a dot, or those of connectors of a system, from which the value follows the connections.
With a mapping only what is mapped is applied. Later bindings go before earlier ones, those of an
outer system before those of an inner one. What fits nothing is not applied, and said; so is a value
for what an FMU calculates itself, or for a constant.

A connection that brings a value goes before all bindings at where it leads to. SSP 1.0.1 says that
bindings set start values (5.2.3, ParameterBindings), and that of the data flow along connections
there must be one source at most (5.3.2, Connections): it ranks bindings among each other only, and
a connector has the value of what it is connected to. OMSimulator does the same.

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

    named is the name of its unit in the set; unit is what it is in at a connector or variable.
    """

    place: str
    origin: Origin
    type: str
    value: Value
    named: str | None
    unit: Unit | None = None
    settled: bool = True


@dataclass(frozen=True, slots=True)
class Given:
    """A parameter for what is called name at the binding's system or component; place says so.

    With suppress its unit is not converted. transformation is its element, or None.
    """

    place: str
    name: str
    parameter: Parameter
    suppress: bool = False
    transformation: Any = None


def read_settings(network: Network, causality: str = "") -> dict[Path, dict[str, Value]]:
    """The value that holds for each variable that is given one; of one causality, if that is named.

    By the path of the component and the FMU's name of the variable.
    """
    values: dict[Path, dict[str, Value]] = {}
    for end, parameter in _settled(network):
        variable = network.parts[end.path].interface.by_name.get(end.name)
        if causality and (variable is None or variable.causality != causality):
            continue
        if variable is not None and not variable.settable:
            text = f"{end} {variable.unsettable}; not used"
            parameter.origin.notes.add(parameter.place, text)
            continue
        value, source = _value(network, end, parameter), network.output(end)
        if source:
            text = f"{end} is connected to {source}; not used"
            parameter.origin.notes.add(parameter.place, text)
        else:
            values.setdefault(end.path, {})[end.name] = value
    return values


def _settled(network: Network) -> Iterator[tuple[Node, Parameter]]:
    """Yield the variables that are given a value, and the one that holds."""
    given: dict[Node, Parameter] = {}
    for element, origin, binding in _bindings(network):
        place = f"{at(origin.place, binding)}: {element.name!r}"
        for entry in _given(origin, place, binding):
            nodes = list(_nodes(network, element, entry.name))
            for node in nodes:
                given[node] = _adapted(network, node, entry)
            if not nodes:
                origin.notes.add(entry.place, "nothing of that name to give it to; not used")
    for node in dict.fromkeys((*given, *network.into)):
        ways = (node, *(hop.source for hop in network.trace(node)))
        if node.path in network.parts and not given.keys().isdisjoint(ways):
            yield node, _arriving(network, node, given)


def _bindings(network: Network) -> Iterator[tuple[Element, Origin, Any]]:
    """All bindings with what they are at; who goes before another comes after it."""
    components = (part.element for part in network.parts.values())
    inner_first = sorted(network.systems.values(), key=lambda e: len(e.path), reverse=True)
    for element in (*components, *inner_first):
        for origin, binding in element.bindings:
            yield element, origin, binding


def _given(origin: Origin, place: str, binding: Any) -> Iterator[Given]:
    holder = child(binding, "ssd:ParameterValues")
    parameters = _set(*origin.inner(place, binding, "ssv", holder), binding.get("prefix", ""))
    mapping = child(binding, "ssd:ParameterMapping")
    if mapping is None:
        for name, parameter in parameters.items():
            yield Given(parameter.place, name, parameter)
        return
    inner, root = origin.inner(place, mapping, "ssm", mapping)
    unmapped = dict(parameters)
    targets: set[str] = set()
    for element in children(root, "ssm:MappingEntry"):
        source, target = element.get("source"), element.get("target")
        where = f"{at(inner.place, element)}: mapping '{source} -> {target}'"
        unmapped.pop(source, None)
        if source not in parameters:
            origin.notes.add(where, f"no parameter {source!r}; not used")
            continue
        if target in targets:
            raise InputError(f"{where}: {target!r} has two sources; must have one")
        targets.add(target)
        suppress = is_true(element, "suppressUnitConversion")
        yield Given(where, target, parameters[source], suppress, transformation(element))
    for parameter in unmapped.values():
        origin.notes.add(parameter.place, "not in the mapping; not used")


def _set(origin: Origin, root: Any, prefix: str) -> dict[str, Parameter]:
    parameters: dict[str, Parameter] = {}
    for element in children(root, "ssv:Parameters", "ssv:Parameter"):
        name = element.get("name")
        where = f"{at(origin.place, element)}: parameter {name!r}"
        kind, text = short(element[0].tag).removeprefix("ssv:"), element[0].get("value")
        known(f"{where}: type", kind, _READERS, " is not supported")
        named = origin.unit_name(element[0])
        parameter = Parameter(where, origin, kind, _READERS[kind](text), named)
        before = parameters.setdefault(prefix + name, parameter)
        if (before.value, before.named) != (parameter.value, parameter.named):
            raise InputError(f"{where}: there are two; must be one")
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


def _arriving(network: Network, node: Node, given: Mapping[Node, Parameter]) -> Parameter:
    """The value that holds at a node: of what it is connected to, else its own."""
    hops = network.trace(node)
    start = next((k for k, hop in enumerate(hops) if hop.source in given), None)
    if start is None:
        return given[node]
    parameter = given[hops[start].source]
    for hop in hops[start:]:
        beaten = given.get(hop.target)
        if beaten is not None:
            text = (
                f"{hop.target} has the value of {hop.source} by a connection, which goes before it"
            )
            beaten.origin.notes.add(beaten.place, f"{text}; not used")
        parameter = _passed(network, hop, parameter)
    return parameter


def _passed(network: Network, hop: Hop, given: Parameter) -> Parameter:
    """The parameter after one more hop."""
    if given.type in ("Real", "Integer"):
        carried = network.carry(hop, Carried(given.unit, settled=given.settled))
        value, (unit, factor, offset, settled) = given.value, carried
        if (factor, offset) != (1.0, 0.0):
            value = factor * float(value) + offset
        given = replace(given, value=value, unit=unit, settled=settled)
    elif hop.transformation:
        raise InputError(f"{hop.place}: transforms a {given.type}; must be Real")
    return given


def _adapted(network: Network, node: Node, given: Given) -> Parameter:
    """The parameter in the unit of the node, transformed as on a connection, or by a table."""
    own = None if given.suppress else _own_unit(network, node, given.parameter)
    parameter, change, factors = replace(given.parameter, unit=own), given.transformation, None
    if change is not None and short(change.tag) != "ssc:LinearTransformation":
        parameter = _mapped(parameter, change)
    elif change is not None:
        factors = linear(change)
        parameter = replace(parameter, type=parameter.type.replace("Integer", "Real"))
    return _passed(network, Hop(parameter.place, node, node, factors, given.suppress), parameter)


def _own_unit(network: Network, node: Node, parameter: Parameter) -> Unit | None:
    """The unit of a value for a node; None where it is that of the node, or has no meaning there.

    A unit of the name that the FMU gives it is the FMU's, however the set defines it.
    """
    name, origin, place = parameter.named, parameter.origin, parameter.place
    unit, wanted = network.unit(node), network.unit_name(node)
    defined = origin.units.get(name or "")
    if name and node.path in network.parts and name == wanted:
        if defined and unit and not same(defined, unit):
            origin.notes.add(place, OTHERWISE.format(name))
        if defined:
            return unit
    if name and not defined and node.path in network.parts and wanted is None:
        text = f"unit {name!r} is not defined, and {node} has none; taken as it is"
        origin.notes.add(place, text)
        return None
    return origin.unit(place, name, wanted)


def _mapped(given: Parameter, element: Any) -> Parameter:
    table = short(element.tag)
    kind = table.removeprefix("ssc:").removesuffix("MappingTransformation")
    if given.type != kind:
        raise InputError(f"{given.place}: {given.type} has {table}; must be {kind}")
    read, entries = _READERS[kind], children(element, "ssc:MapEntry")
    targets = {read(entry.get("source")): read(entry.get("target")) for entry in entries}
    if given.value not in targets:
        valid = choices(map(repr, targets))
        raise InputError(f"{given.place}: {given.value!r} is not in its {table}; valid: {valid}")
    return replace(given, value=targets[given.value])


def _value(network: Network, node: Node, given: Parameter) -> Value:
    part = network.parts[node.path]
    variable = part.interface.by_name[node.name]
    fits = given.type == variable.kind or (given.type, variable.kind) == ("Integer", "Real")
    if not fits and not (given.type == "Enumeration" and variable.items):
        said = f"{given.place}: {given.type}; {node} is {variable.kind}, must be the same"
        raise InputError(said)
    return parse_value(part.interface, given.place, node.name, given.value)
