"""Start values: parameter sets (SSV), mapped (SSM) and bound to a system or component.

As the standard has it: names in the sets are those of variables, after those of the elements they
are in and a dot, or those of connectors of a system, from which the value follows the connections.
With a mapping only what is mapped is applied. Later bindings go before earlier ones, those of an
outer system before those of an inner one. What fits nothing is not applied, and said.

A value is converted to the unit of its target, then transformed, as on a connection. Types must be
the same, but a whole number may be given to a Real, and an enumeration by number.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from ..errors import InputError, choices
from ..interface.interface import SETTABLE, Value
from ..interface.units import Unit
from .archive import Archive
from .document import ROOTS, at, checked, child, children, is_true, parse, short
from .network import Carried, Network
from .tree import Element, Node, Path, linear, transformation
from .units import change, named, read_units

_READERS: Mapping[str, Callable[[str], Value]] = {
    "Real": float,
    "Integer": int,
    "Boolean": lambda text: text.strip() in ("true", "1"),
    "String": str,
    "Enumeration": str,
}
"""From the text of a value to the value, by SSP type; an enumeration by name."""

_KINDS = {"ssv": "parameter-set", "ssm": "parameter-mapping"}
Units = Mapping[str, Unit]


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value of a set with its SSP type; place says where it is from."""

    place: str
    type: str
    value: Value
    unit: Unit | None
    settled: bool = True


@dataclass(frozen=True, slots=True)
class Given:
    """A parameter for what is called name at the binding's system or component.

    With suppress its unit is not converted. transformation is its element, or None.
    """

    name: str
    parameter: Parameter
    suppress: bool
    transformation: Any


def read_settings(
    archive: Archive, file: str, network: Network, units: Units
) -> tuple[dict[Path, dict[str, Value]], list[str]]:
    """The value that holds for each variable that is given one; what was not used.

    By the path of the component and the FMU's name of the variable.
    """
    values: dict[Path, dict[str, Value]] = {}
    notes: list[str] = []
    for element, binding in _bindings(network):
        place = f"{at(file, binding)}: {element.name!r}"
        for given in _given(archive, file, place, binding, units, notes):
            ends = [
                arrived
                for node in _nodes(network, element.path, given.name)
                for arrived in _spread(network, node, _adapted(network, node, given))
            ]
            if not ends:
                notes.append(f"{given.parameter.place}: no {given.name!r} to give it to; not used")
            for end, parameter in ends:
                value, source = _value(network, end, parameter), network.output(end)
                if source:
                    notes.append(f"{parameter.place}: {end} is connected to {source}; not used")
                else:
                    values.setdefault(end.path, {})[end.name] = value
    return values, notes


def _bindings(network: Network) -> Iterator[tuple[Element, Any]]:
    """All bindings with what they are at; who goes before another comes after it."""
    components = (part.element for part in network.parts.values())
    inner_first = sorted(network.systems.values(), key=lambda e: len(e.path), reverse=True)
    for element in (*components, *inner_first):
        for binding in element.bindings:
            yield element, binding


def _given(
    archive: Archive, file: str, place: str, binding: Any, units: Units, notes: list[str]
) -> Iterator[Given]:
    """Yield what a binding gives; `notes` get what is not mapped."""
    holder = child(binding, "ssd:ParameterValues")
    place_of_set, root = _document(archive, file, place, binding, holder, "ssv")
    inherited = units if place_of_set == file else {}
    parameters = _set(place_of_set, root, binding.get("prefix", ""), inherited)
    mapping = child(binding, "ssd:ParameterMapping")
    if mapping is None:
        for name, parameter in parameters.items():
            yield Given(name, parameter, False, None)
        return
    place, root = _document(archive, file, place, mapping, mapping, "ssm")
    unmapped = dict(parameters)
    targets: set[str] = set()
    for element in children(root, "ssm:MappingEntry"):
        source, target = element.get("source"), element.get("target")
        where = f"{at(place, element)}: mapping '{source} -> {target}'"
        if target in targets:
            raise InputError(f"{where}: {target!r} has two sources; must have one")
        targets.add(target)
        unmapped.pop(source, None)
        if source in parameters:
            suppress = is_true(element, "suppressUnitConversion")
            yield Given(target, parameters[source], suppress, transformation(element))
        else:
            notes.append(f"{where}: no parameter {source!r}; not used")
    notes += [f"{p.place}: not in the mapping; not used" for p in unmapped.values()]


def _set(place: str, root: Any, prefix: str, inherited: Units) -> dict[str, Parameter]:
    known = {**inherited, **read_units(place, root, "ssv")}
    parameters: dict[str, Parameter] = {}
    for element in children(root, "ssv:Parameters", "ssv:Parameter"):
        name = element.get("name")
        where = f"{at(place, element)}: parameter {name!r}"
        if prefix + name in parameters:
            raise InputError(f"{where}: there are two; must be one")
        parameters[prefix + name] = _parameter(where, element[0], known)
    return parameters


def _document(
    archive: Archive, file: str, place: str, entry: Any, holder: Any, form: str
) -> tuple[str, Any]:
    """The name and the root of a set or mapping: of a file that `entry` names, or inline in holder.

    The name of what is inline is `file`.
    """
    kind = _KINDS[form]
    named_type = entry.get("type", f"application/x-ssp-{kind}")
    if named_type != f"application/x-ssp-{kind}":
        raise InputError(
            f"{place}: type {named_type!r} is not supported; must be application/x-ssp-{kind}"
        )
    if entry.get("sourceBase", "SSD") != "SSD":
        raise InputError(
            f"{place}: sourceBase 'component' is not supported; put the file into resources/"
        )
    source, inline = entry.get("source"), None if holder is None else child(holder, ROOTS[form])
    if (source is None) == (inline is None):
        raise InputError(f"{place}: {kind}: must have either a source or an inline {ROOTS[form]}")
    if source is None:
        return file, checked(file, inline, form)
    found = archive.resolve(place, source)
    name = f"{archive.place}: {found}"
    return name, parse(name, archive.read(found), form)


def _parameter(place: str, element: Any, units: Units) -> Parameter:
    kind, text = short(element.tag).removeprefix("ssv:"), element.get("value")
    if kind not in _READERS:
        raise InputError(f"{place}: type {kind} is not supported; valid: {choices(_READERS)}")
    return Parameter(place, kind, _READERS[kind](text), named(place, element.get("unit"), units))


def _nodes(network: Network, path: Path, name: str) -> Iterator[Node]:
    """Yield the variables and connectors that a name means at a system or component."""
    part = network.parts.get(path)
    if part is not None:
        if name in part.interface.by_name:
            yield Node(path, name)
        return
    system = network.systems[path]
    if name in system.connectors:
        yield Node(path, name)
    for element in system.elements:
        if name.startswith(f"{element}."):
            yield from _nodes(network, (*path, element), name[len(element) + 1 :])


def _spread(network: Network, node: Node, given: Parameter) -> Iterator[tuple[Node, Parameter]]:
    """Yield the variables of components that get a value at a node, there or passed on to."""
    if node.path in network.parts:
        yield node, given
        return
    connector = network.systems[node.path].connectors[node.name]
    if connector.value_kind not in (None, given.type) and (connector.type, given.type) != (
        "Real",
        "Integer",
    ):
        raise InputError(f"{given.place}: {given.type}; {node} is {connector.type}")
    for hop in network.out_of.get(node, ()):
        if given.type in ("Real", "Integer"):
            carried = network.carry(hop, Carried(given.unit, settled=given.settled))
            number = _linear(given.value, carried.factor, carried.offset)
            passed = replace(given, value=number, unit=carried.unit, settled=carried.settled)
        elif hop.transformation:
            raise InputError(f"{hop.place}: transforms a {given.type}; must be Real")
        else:
            passed = given
        yield from _spread(network, hop.target, passed)


def _adapted(network: Network, node: Node, given: Given) -> Parameter:
    """The parameter in the unit of the node, transformed."""
    unit, parameter = network.unit(node), given.parameter
    if parameter.unit and unit and not given.suppress:
        factor, offset = change(parameter.place, parameter.unit, unit)
        parameter = replace(parameter, value=_linear(parameter.value, factor, offset))
    if given.transformation is not None:
        parameter = _transformed(parameter, given.transformation)
    settled = unit is not None or given.transformation is None
    return replace(parameter, unit=unit or parameter.unit, settled=settled)


def _transformed(given: Parameter, element: Any) -> Parameter:
    kind = short(element.tag).removeprefix("ssc:").removesuffix("Transformation")
    if kind == "Linear":
        if given.type not in ("Real", "Integer"):
            raise InputError(
                f"{given.place}: {given.type} has a linear transformation; must be Real"
            )
        return replace(given, type="Real", value=_linear(given.value, *linear(element)))
    mapped = kind.removesuffix("Mapping")
    if given.type != mapped:
        raise InputError(f"{given.place}: {given.type} has {short(element.tag)}; must be {mapped}")
    read = _READERS[mapped]
    table = {
        read(entry.get("source")): read(entry.get("target"))
        for entry in children(element, "ssc:MapEntry")
    }
    if given.value not in table:
        raise InputError(
            f"{given.place}: {given.value!r} is not in its {short(element.tag)}; "
            f"valid: {choices(map(repr, table))}"
        )
    return replace(given, value=table[given.value])


def _linear(value: Value, factor: float, offset: float) -> Value:
    """The value times factor plus offset; the value itself where they do nothing."""
    return value if (factor, offset) == (1.0, 0.0) else factor * float(value) + offset


def _value(network: Network, node: Node, given: Parameter) -> Value:
    """The value for a variable of a component, checked."""
    part = network.parts[node.path]
    variable = part.interface.by_name[node.name]
    if variable.causality not in SETTABLE:
        raise InputError(
            f"{given.place}: {node} is {variable.causality}; only inputs and parameters are set"
        )
    fits = given.type == variable.kind or (given.type, variable.kind) == ("Integer", "Real")
    if not fits and not (given.type == "Enumeration" and variable.items):
        raise InputError(
            f"{given.place}: {given.type}; {node} is {variable.kind}, must be the same"
        )
    return part.interface.parse(given.place, node.name, given.value)
