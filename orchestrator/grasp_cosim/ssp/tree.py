"""An SSD as it stands: systems, components, connectors, connections, parameter bindings.

What this master cannot run is refused here by its name and line. Geometry and notes only draw and
are passed over.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, TypeVar

from ..checks import known
from ..errors import InputError
from ..interface.units import Unit
from .document import at, child, children, is_true, short
from .units import named

FMU = "application/x-fmu-sharedlibrary"
_SOURCES = ("output", "calculatedParameter")
_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")


@dataclass(frozen=True, slots=True)
class Connector:
    """A connector; type and unit are None where they are left out."""

    place: str
    name: str
    kind: str
    type: str | None
    unit: Unit | None

    @property
    def gives(self) -> bool:
        """True if its element gives the value, seen from outside."""
        return self.kind in _SOURCES


@dataclass(frozen=True, slots=True)
class End:
    """A connector of an element of the system, or of the system itself where element is None."""

    element: str | None
    connector: str

    def __str__(self) -> str:
        return f"{self.element}.{self.connector}" if self.element else self.connector


@dataclass(frozen=True, slots=True)
class Connection:
    """Two ends; the transformation is None where there is none, else (factor, offset)."""

    place: str
    ends: tuple[End, End]
    transformation: tuple[float, float] | None
    suppress: bool


@dataclass(frozen=True, slots=True)
class Content:
    """A parameter set or mapping: the source of its file, or its element where it is inline."""

    source: str | None
    inline: Any


@dataclass(frozen=True, slots=True)
class Binding:
    """A parameter binding; mapping is None where there is none."""

    place: str
    prefix: str
    values: Content
    mapping: Content | None


@dataclass(frozen=True, slots=True)
class ComponentElement:
    """A component: an FMU in the archive."""

    place: str
    name: str
    source: str
    connectors: Mapping[str, Connector]
    bindings: tuple[Binding, ...]


@dataclass(frozen=True, slots=True)
class SystemElement:
    """A system with its elements, by name and in the order of the file."""

    place: str
    name: str
    elements: Mapping[str, "ComponentElement | SystemElement"]
    connectors: Mapping[str, Connector]
    connections: tuple[Connection, ...]
    bindings: tuple[Binding, ...]


Part = TypeVar("Part", Connector, ComponentElement | SystemElement)


def read_system(file: str, element: Any, units: Mapping[str, Unit]) -> SystemElement:
    """The system of an element; file names the document, for the error messages."""
    place = at(file, element)
    name = element.get("name")
    if (unsupported := child(element, "ssd:SignalDictionaries")) is not None:
        raise InputError(
            f"{at(file, unsupported)}: system {name!r}: signal dictionaries are not supported; "
            "connect the components directly"
        )
    found = child(element, "ssd:Elements")
    elements = [_element(file, entry, units) for entry in (() if found is None else found)]
    connections = children(element, "ssd:Connections", "ssd:Connection")
    return SystemElement(
        place,
        name,
        _by_name(elements, f"system {name!r}: two elements"),
        _connectors(file, element, units),
        tuple(_connection(file, entry) for entry in connections),
        tuple(_bindings(file, element)),
    )


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


def _element(
    file: str, entry: Any, units: Mapping[str, Unit]
) -> "ComponentElement | SystemElement":
    tag, name, place = short(entry.tag), entry.get("name"), at(file, entry)
    if tag == "ssd:System":
        return read_system(file, entry, units)
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
    return ComponentElement(
        place,
        name,
        entry.get("source"),
        _connectors(file, entry, units),
        tuple(_bindings(file, entry)),
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


def _connection(file: str, entry: Any) -> Connection:
    ends = tuple(
        End(entry.get(f"{side}Element") or None, entry.get(f"{side}Connector"))
        for side in ("start", "end")
    )
    place = f"{at(file, entry)}: connection '{ends[0]} - {ends[1]}'"
    change = transformation(entry)
    if change is not None and not short(change.tag).endswith("LinearTransformation"):
        raise InputError(
            f"{place}: {short(change.tag)} is not supported on a connection; "
            "must be linear, or in the mapping of a parameter"
        )
    return Connection(
        place,
        (ends[0], ends[1]),
        None if change is None else linear(change),
        is_true(entry, "suppressUnitConversion"),
    )


def _bindings(file: str, element: Any) -> Iterator[Binding]:
    for entry in children(element, "ssd:ParameterBindings", "ssd:ParameterBinding"):
        place = f"{at(file, entry)}: {element.get('name')!r}"
        holder = child(entry, "ssd:ParameterValues")
        values = _content(place, entry, holder, "parameter-set", "ssv:ParameterSet")
        mapping = child(entry, "ssd:ParameterMapping")
        if mapping is not None:
            mapping = _content(place, mapping, mapping, "parameter-mapping", "ssm:ParameterMapping")
        yield Binding(place, entry.get("prefix", ""), values, mapping)


def _content(place: str, entry: Any, holder: Any, form: str, root: str) -> Content:
    """The source of a set or mapping, or the element in holder; exactly one of the two."""
    kind = entry.get("type", f"application/x-ssp-{form}")
    if kind != f"application/x-ssp-{form}":
        raise InputError(
            f"{place}: type {kind!r} is not supported; must be application/x-ssp-{form}"
        )
    if entry.get("sourceBase", "SSD") != "SSD":
        raise InputError(
            f"{place}: sourceBase 'component' is not supported; put the file into resources/"
        )
    content = Content(entry.get("source"), None if holder is None else child(holder, root))
    if (content.source is None) == (content.inline is None):
        raise InputError(f"{place}: {form}: must have either a source or an inline {root}")
    return content
