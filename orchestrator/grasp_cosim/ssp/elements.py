"""An SSD as it stands: systems, components, connectors, connections, parameter bindings.

What this master cannot run is refused here by its name and line. Geometry and notes only draw and
are passed over. A nested archive is a system in the place of its component, a signal dictionary one
that has only connectors: who is connected to an entry gives it its value, or takes it.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from posixpath import splitext
from typing import Any, TypeVar

from ..base.checks import known
from ..base.errors import InputError, choices
from ..base.si_units import Unit
from ..interface.interface import Interface
from ..interface.read import read_interface
from ..interface.variables import Variable
from .archive import Archive
from .xml_document import (
    Origin,
    at,
    child,
    children,
    is_true,
    open_structure,
    qualified,
    same,
    short,
)

FMU = "application/x-fmu-sharedlibrary"
_DEFINITION, _PACKAGE = "application/x-ssp-definition", "application/x-ssp-package"
_TYPE_OF_SUFFIX = {".ssd": _DEFINITION, ".ssp": _PACKAGE}
_SOURCES = ("output", "calculatedParameter")
_CAUSALITIES = ("input", "parameter", *_SOURCES)
_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
_SIDES = ("start", "end")
_BINDING = ("ssd:ParameterBindings", "ssd:ParameterBinding")

Path = tuple[str, ...]
"""The names of the elements from the top system, () itself, down to an element."""


@dataclass(frozen=True, slots=True)
class Node:
    """A connector, or a variable of a component."""

    path: Path
    name: str

    def __str__(self) -> str:
        return ".".join((*self.path, self.name))


@dataclass(frozen=True, slots=True)
class Connector:
    """A connector; type, Integer of an Enumeration, and unit are None where they are left out."""

    place: str
    name: str
    kind: str
    type: str | None = None
    unit: Unit | None = None


@dataclass(frozen=True, slots=True)
class Hop:
    """A connection from source to target.

    The transformation is None where there is none, else (factor, offset).
    """

    place: str
    source: Node
    target: Node
    transformation: tuple[float, float] | None
    suppress: bool


@dataclass(frozen=True, slots=True)
class Element:
    """A component with the interface of its FMU, or a system, which has none.

    The elements of a system are by name and in the order of the file. bindings are the elements of
    its parameter bindings with the documents that they stand in. refers is True for a reference to
    a signal dictionary, whose path it has. exchange is True where it is to run by model exchange.
    """

    place: str
    path: Path
    name: str
    origin: Origin
    connectors: Mapping[str, Connector]
    bindings: Sequence[tuple[Origin, Any]] = ()
    interface: Interface | None = None
    elements: Mapping[str, "Element"] = field(default_factory=dict)
    hops: tuple[Hop, ...] = ()
    dictionaries: Mapping[str, "Element"] = field(default_factory=dict)
    refers: bool = False
    exchange: bool = False

    def within(self) -> Iterator["Element"]:
        """Yield the element and all in it, in the order of the file, without references."""
        if not self.refers:
            yield self
        for inner in (*self.elements.values(), *self.dictionaries.values()):
            yield from inner.within()


Part = TypeVar("Part", Connector, Element)
Dictionaries = Mapping[str, Element]


def read_system(
    origin: Origin, element: Any, path: Path = (), around: Dictionaries | None = None
) -> Element:
    """The system of an element; around are the signal dictionaries of the systems around it."""
    name, place = element.get("name"), at(origin.place, element)
    entries = children(element, "ssd:SignalDictionaries", "ssd:SignalDictionary")
    dictionaries = [_dictionary(origin, entry, path) for entry in entries]
    own_dictionaries = _by_name(dictionaries, f"system {name!r}: two signal dictionaries")
    reachable = {**(around or {}), **own_dictionaries}
    elements = [
        _element(origin, entry, path, reachable)
        for entry in element.iterfind(f"{qualified('ssd:Elements')}/*")
    ]
    system = Element(
        place,
        path,
        name,
        origin,
        _connectors(origin, element),
        _bindings(origin, element),
        elements=_by_name(elements, f"system {name!r}: two elements"),
        dictionaries=own_dictionaries,
    )
    connections = children(element, "ssd:Connections", "ssd:Connection")
    return replace(system, hops=tuple(_hop(origin, entry, system) for entry in connections))


def transformation(element: Any) -> Any:
    """The element of a transformation below a connection or mapping entry, or None."""
    return next((e for e in element if short(e.tag).endswith("Transformation")), None)


def linear(element: Any) -> tuple[float, float]:
    """(factor, offset) of a linear transformation."""
    return float(element.get("factor", "1")), float(element.get("offset", "0"))


def _by_name(parts: Iterable[Part], twice: str) -> dict[str, Part]:
    """The parts by their names; InputError, in which `twice` names them, if two are alike."""
    by_name: dict[str, Part] = {}
    for part in parts:
        if part.name in by_name:
            raise InputError(f"{part.place}: {twice} {part.name!r}; must differ")
        by_name[part.name] = part
    return by_name


def _bindings(origin: Origin, entry: Any) -> tuple[tuple[Origin, Any], ...]:
    return tuple((origin, binding) for binding in children(entry, *_BINDING))


def _element(origin: Origin, entry: Any, parent: Path, reachable: Dictionaries) -> Element:
    tag, name, place = short(entry.tag), entry.get("name"), at(origin.place, entry)
    path = (*parent, name)
    if tag == "ssd:System":
        return read_system(origin, entry, path, reachable)
    if tag == "ssd:SignalDictionaryReference":
        return _reference(origin, entry, reachable)
    kind, place = entry.get("type", FMU), f"{place}: component {name!r}"
    source_file = entry.get("source").partition("#")[0]
    suffix = splitext(source_file)[1].lower()
    if "type" not in entry.attrib and suffix in _TYPE_OF_SUFFIX:
        kind = _TYPE_OF_SUFFIX[suffix]
        entry.set("type", kind)
        origin.notes.add(place, f"names no type; {source_file} is taken as {kind}")
    known(f"{place}: type", kind, (FMU, _PACKAGE, _DEFINITION), " is not supported")
    if kind != FMU:
        return _nested(origin, entry, path, place)
    return _component(origin, entry, path, place)


def _component(origin: Origin, entry: Any, path: Path, place: str) -> Element:
    """A component that is an FMU."""
    fmu = origin.resolve(place, entry.get("source"))
    file = origin.archive.extract(fmu)
    try:
        interface = read_interface(file)
    except InputError as error:
        reason = str(error).removeprefix(f"{file}: ")
        raise InputError(f"{place}: {fmu}: {reason}") from error
    kind = entry.get("implementation", "any")
    if kind != "any" and kind not in interface.kinds:
        raise InputError(
            f"{place}: implementation {kind!r}: {entry.get('source')} has none; must be "
            f"{choices(interface.kinds)}, or any"
        )
    return Element(
        at(origin.place, entry),
        path,
        entry.get("name"),
        origin,
        _connectors(origin, entry, interface),
        _bindings(replace(origin, fmu=fmu), entry),
        interface,
        exchange=kind == "ModelExchange",
    )


def _nested(origin: Origin, entry: Any, path: Path, place: str) -> Element:
    """The system that a component refers to, as if it stood in the place of the component.

    The component's parameter bindings come after its own and so go before them.
    """
    source = entry.get("source")
    inner, element = _source_system(origin, entry, place, source)
    system = read_system(inner, element, path)
    connectors = dict(system.connectors)
    for name, outer in _connectors(origin, entry).items():
        known(f"{outer.place}: {system.name} has no connector", name, connectors)
        unit = connectors[name].unit or outer.unit
        if outer.unit and unit and not same(outer.unit, unit):
            raise InputError(
                f"{outer.place}: connector {name!r}: unit {outer.unit.name} is not that of "
                f"{source}, {unit.name}; must mean the same"
            )
        connectors[name] = replace(connectors[name], unit=unit)
    bindings = (*system.bindings, *_bindings(origin, entry))
    return replace(system, name=entry.get("name"), connectors=connectors, bindings=bindings)


def _source_system(origin: Origin, entry: Any, place: str, source: str) -> tuple[Origin, Any]:
    """The element of a system that a source names, and where it stands.

    It is the top one of an archive, of its structure or a variant, or of an SSD; or, by its id, one
    of the same document.
    """
    file, _, fragment = source.partition("#")
    if not file:
        systems = entry.getroottree().iter(qualified("ssd:System"))
        by_id = {system.get("id"): system for system in systems if system.get("id")}
        known(f"{place}: source {source!r}: no system of the id", fragment, by_id)
        return origin.inside(source), by_id[fragment]
    resolved = origin.resolve(place, file)
    if entry.get("type") == _DEFINITION:
        archive, structure = origin.archive, resolved
    else:
        label = f"{origin.archive.place}: {resolved}"
        archive = Archive(origin.archive.extract(resolved), origin.notes, label)
        structure = archive.resolve(place, fragment) if fragment else archive.structure()
    inner, root = open_structure(archive, origin.notes, structure, origin.around)
    return inner, child(root, "ssd:System")


def _dictionary(origin: Origin, entry: Any, path: Path) -> Element:
    name, place = entry.get("name"), at(origin.place, entry)
    inner, root = origin.inner(f"{place}: {name!r}", entry, "ssb", entry)
    signals = [
        _connector(inner, at(inner.place, signal), signal, "inout", None)
        for signal in children(root, "ssb:DictionaryEntry")
    ]
    connectors = _by_name(signals, f"{name}: two entries")
    return Element(place, (*path, f"<{name}>"), name, inner, connectors)


def _reference(origin: Origin, entry: Any, reachable: Dictionaries) -> Element:
    """A reference to a signal dictionary: its connectors are the dictionary's entries."""
    name, place = entry.get("name"), at(origin.place, entry)
    known(f"{place}: {name!r}: no signal dictionary", entry.get("dictionary"), reachable)
    dictionary = reachable[entry.get("dictionary")]
    entries = children(entry, "ssd:Connectors", "ssd:Connector")
    connectors = _by_name(
        [_connector(origin, at(origin.place, e), e, e.get("kind"), None) for e in entries],
        f"{name}: two connectors",
    )
    for connector in connectors.values():
        lacking = f"{connector.place}: signal dictionary {dictionary.name} has no entry"
        known(lacking, connector.name, dictionary.connectors)
    return replace(dictionary, place=place, name=name, connectors=connectors, refers=True)


def _connectors(
    origin: Origin, element: Any, interface: Interface | None = None
) -> dict[str, Connector]:
    """The connectors of an element; of a component with the interface of its FMU."""
    connectors = []
    for entry in children(element, "ssd:Connectors", "ssd:Connector"):
        place, name, kind = at(origin.place, entry), entry.get("name"), entry.get("kind")
        if kind == "inout":
            raise InputError(f"{place}: connector {name!r}: kind 'inout' is not supported")
        variable = interface.by_name.get(name) if interface else None
        connectors.append(_connector(origin, place, entry, kind, variable))
    return _by_name(connectors, f"{element.get('name')}: two connectors")


def _connector(
    origin: Origin, place: str, entry: Any, kind: str, variable: Variable | None
) -> Connector:
    """A connector, of that variable of its FMU, or the entry of a signal dictionary."""
    name = entry.get("name")
    types = [short(e.tag).removeprefix("ssc:") for e in entry if short(e.tag).startswith("ssc:")]
    declared = types[0] if types else None
    if declared is not None:
        known(f"{place}: connector {name!r}: type", declared, _TYPES, " is not supported")
    unit_name = origin.unit_name(child(entry, "ssc:Real")) if declared == "Real" else None
    fmu_unit = variable.unit if variable else None
    unit = origin.unit(f"{place}: {name!r}", unit_name, fmu_unit)
    return Connector(place, name, kind, "Integer" if declared == "Enumeration" else declared, unit)


def _hop(origin: Origin, entry: Any, system: Element) -> Hop:
    """A connection of a system, from the end that gives a value there to the one that takes it."""
    ends = [(entry.get(f"{side}Element"), entry.get(f"{side}Connector")) for side in _SIDES]
    names = " - ".join(".".join(filter(None, end)) for end in ends)
    place = f"{at(origin.place, entry)}: connection '{names}'"
    element = transformation(entry)
    if element is not None and not short(element.tag).endswith("LinearTransformation"):
        raise InputError(
            f"{place}: {short(element.tag)} is not supported on a connection; "
            "must be linear, or in the mapping of a parameter"
        )
    (start, start_gives), (end, end_gives) = (_end(place, system, *side) for side in ends)
    if start_gives is None and end_gives is not None:
        start_gives = not end_gives
    if start_gives == end_gives:
        verb = {True: "give", False: "take", None: "may give or take"}[start_gives]
        raise InputError(
            f"{place}: both {verb} a value; must lead from one that gives to one that takes"
        )
    source, target = (start, end) if start_gives else (end, start)
    factors = None if element is None else linear(element)
    return Hop(place, source, target, factors, is_true(entry, "suppressUnitConversion"))


def _end(place: str, system: Element, element: str | None, name: str) -> tuple[Node, bool | None]:
    """The node of an end, and whether it gives a value in the system; None for either."""
    owner = system
    if element:
        known(f"{place}: no element", element, system.elements)
        owner = system.elements[element]
    variable = owner.interface.by_name.get(name) if owner.interface else None
    if name not in owner.connectors and variable and variable.causality in _CAUSALITIES:
        text = "an end has no connector, but its FMU a variable of that name"
        system.origin.notes.add(place, text)
        kind = variable.causality
    else:
        known(f"{place}: {owner.name} has no connector", name, owner.connectors)
        kind = owner.connectors[name].kind
    if kind == "inout":
        return Node(owner.path, name), None
    return Node(owner.path, name), (kind in _SOURCES) != (owner is system)
