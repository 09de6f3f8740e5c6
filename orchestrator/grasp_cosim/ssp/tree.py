"""An SSD as it stands: systems, components, connectors, connections, parameter bindings.

What this master cannot run is refused here by its name and line. Geometry and notes only draw and
are passed over.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeVar

from ..checks import known
from ..errors import InputError
from ..interface.units import Unit
from .document import at, child, children, is_true, qualified, short
from .units import named

FMU = "application/x-fmu-sharedlibrary"
_SOURCES = ("output", "calculatedParameter")
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
    """A connector; type and unit are None where they are left out."""

    place: str
    name: str
    kind: str
    type: str | None
    unit: Unit | None

    @property
    def value_kind(self) -> str | None:
        """The kind of value, as an interface has it; None where the type is left out."""
        return "Integer" if self.type == "Enumeration" else self.type


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
    """A component, the source of whose FMU is in the archive, or a system, which has no source.

    The elements of a system are by name and in the order of the file; bindings are the elements of
    its parameter bindings as they stand.
    """

    place: str
    path: Path
    name: str
    connectors: Mapping[str, Connector]
    bindings: Sequence[Any]
    source: str | None = None
    elements: Mapping[str, "Element"] = field(default_factory=dict)
    hops: tuple[Hop, ...] = ()

    def within(self) -> Iterator["Element"]:
        """Yield the element and all in it, in the order of the file."""
        yield self
        for inner in self.elements.values():
            yield from inner.within()


Part = TypeVar("Part", Connector, Element)


def read_system(file: str, element: Any, units: Mapping[str, Unit], path: Path = ()) -> Element:
    """The system of an element; file names the document, for the error messages."""
    name = element.get("name")
    if (unsupported := child(element, "ssd:SignalDictionaries")) is not None:
        raise InputError(
            f"{at(file, unsupported)}: system {name!r}: signal dictionaries are not supported; "
            "connect the components directly"
        )
    entries = element.iterfind(f"{qualified('ssd:Elements')}/*")
    elements = [_element(file, entry, units, path) for entry in entries]
    system = Element(
        at(file, element),
        path,
        name,
        _connectors(file, element, units),
        children(element, *_BINDING),
        elements=_by_name(elements, f"system {name!r}: two elements"),
    )
    connections = children(element, "ssd:Connections", "ssd:Connection")
    return replace(system, hops=tuple(_hop(file, entry, system) for entry in connections))


def transformation(element: Any) -> Any:
    """The element of a transformation below a connection or mapping entry, or None."""
    for name in ("Linear", "BooleanMapping", "IntegerMapping", "EnumerationMapping"):
        found = child(element, f"ssc:{name}Transformation")
        if found is not None:
            return found
    return None


def linear(element: Any) -> tuple[float, float]:
    """(factor, offset) of a linear transformation."""
    return float(element.get("factor", "1")), float(element.get("offset", "0"))


def _by_name(parts: Iterable[Part], twice: str) -> dict[str, Part]:
    """The parts by their names, which must differ; else `twice` is said of them."""
    found: dict[str, Part] = {}
    for part in parts:
        if part.name in found:
            raise InputError(f"{part.place}: {twice} {part.name!r}; must differ")
        found[part.name] = part
    return found


def _element(file: str, entry: Any, units: Mapping[str, Unit], parent: Path) -> Element:
    tag, name, place = short(entry.tag), entry.get("name"), at(file, entry)
    if tag == "ssd:System":
        return read_system(file, entry, units, (*parent, name))
    if tag != "ssd:Component":
        raise InputError(f"{place}: {tag} {name!r} is not supported; must be a Component or System")
    kind = entry.get("type", FMU)
    if kind != FMU:
        raise InputError(
            f"{place}: component {name!r}: type {kind!r} is not supported; must be {FMU}"
        )
    if entry.get("implementation") == "ModelExchange":
        raise InputError(
            f"{place}: component {name!r}: implementation 'ModelExchange' is not supported; "
            "must be CoSimulation or any"
        )
    return Element(
        place,
        (*parent, name),
        name,
        _connectors(file, entry, units),
        children(entry, *_BINDING),
        entry.get("source"),
    )


def _connectors(file: str, element: Any, units: Mapping[str, Unit]) -> dict[str, Connector]:
    entries = children(element, "ssd:Connectors", "ssd:Connector")
    connectors = [_connector(at(file, entry), entry, units) for entry in entries]
    return _by_name(connectors, f"{element.get('name')}: two connectors")


def _connector(place: str, entry: Any, units: Mapping[str, Unit]) -> Connector:
    name, kind = entry.get("name"), entry.get("kind")
    if kind == "inout":
        raise InputError(f"{place}: connector {name!r}: kind 'inout' is not supported")
    types = [short(e.tag).removeprefix("ssc:") for e in entry if short(e.tag).startswith("ssc:")]
    declared = types[0] if types else None
    if declared is not None:
        known(f"{place}: connector {name!r}: type", declared, _TYPES, " is not supported")
    unit = child(entry, "ssc:Real").get("unit") if declared == "Real" else None
    return Connector(place, name, kind, declared, named(f"{place}: {name!r}", unit, units))


def _hop(file: str, entry: Any, system: Element) -> Hop:
    """A connection of a system, from the end that gives a value there to the one that takes it."""
    ends = [(entry.get(f"{side}Element"), entry.get(f"{side}Connector")) for side in _SIDES]
    said = " - ".join(".".join(filter(None, end)) for end in ends)
    place = f"{at(file, entry)}: connection '{said}'"
    change = transformation(entry)
    if change is not None and not short(change.tag).endswith("LinearTransformation"):
        raise InputError(
            f"{place}: {short(change.tag)} is not supported on a connection; "
            "must be linear, or in the mapping of a parameter"
        )
    (a, gives_a), (b, gives_b) = (_end(place, system, *end) for end in ends)
    if gives_a == gives_b:
        raise InputError(
            f"{place}: both {'give' if gives_a else 'take'} a value; "
            "must lead from one that gives to one that takes"
        )
    return Hop(
        place,
        a if gives_a else b,
        b if gives_a else a,
        None if change is None else linear(change),
        is_true(entry, "suppressUnitConversion"),
    )


def _end(place: str, system: Element, element: str | None, name: str) -> tuple[Node, bool]:
    """The node of an end, and whether it gives a value in the system."""
    owner = system
    if element:
        known(f"{place}: no element", element, system.elements)
        owner = system.elements[element]
    known(f"{place}: {owner.name} has no connector", name, owner.connectors)
    gives_outside = owner.connectors[name].kind in _SOURCES
    return Node(owner.path, name), gives_outside != (owner is system)
