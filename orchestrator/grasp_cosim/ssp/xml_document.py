"""XML of SSP: read without entities and network, checked against the official schemas; its units.

SSP 2.0 is read as 1.0: it has the same namespaces, and most of what it adds has a form in 1.0.
Types with a width are Real or Integer, structural parameters are parameters; meta data and
signatures are left out. Arrays, clocks and the new kinds of connectors that are connected are
refused by name. After: the schemas of SSP 2.0 (2024-12-20), compared with those of 1.0.
"""

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from posixpath import dirname
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..base.checks import known
from ..base.errors import InputError
from ..base.si_units import BASE, Unit, known_unit
from ..interface.attributes import base_unit
from ..interface.units import conversion
from .archive import Archive, Notes

_BASE = "http://ssp-standard.org/SSP1/SystemStructure"
NAMESPACES = {
    "ssc": f"{_BASE}Common",
    "ssd": f"{_BASE}Description",
    "ssv": f"{_BASE}ParameterValues",
    "ssm": f"{_BASE}ParameterMapping",
    "ssb": f"{_BASE}SignalDictionary",
}
ROOTS = {
    "ssd": "ssd:SystemStructureDescription",
    "ssv": "ssv:ParameterSet",
    "ssm": "ssm:ParameterMapping",
    "ssb": "ssb:SignalDictionary",
}
"""The root element of each format."""

SCHEMAS = Path(__file__).parent / "schemas"
"""The schemas of SSP 1.0 as the Modelica Association publishes them, with their licence in each."""

_UNDECLARED = etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE
"""The one error of XML that is taken: annotations in circulation have a prefix for no namespace."""

VERSION = "1.0"
_VERSION_1 = re.compile(r"1\.\d+(\.\d+)?(-.*)?")
_BRACKETS = re.compile(r"\s*\[\s*(.*?)\s*\]\s*")
"""A unit as some write it: [m]."""

_LAST = (
    "Connectors", "ConnectorGeometry", "ConnectionGeometry", "ElementGeometry",
    "ParameterBindings", "ParameterValues", "ParameterMapping", "Elements", "Connections",
    "SignalDictionaries", "SystemGeometry", "GraphicalElements", "Parameters", "Enumerations",
    "Units", "DefaultExperiment", "Annotations",
)  # fmt: skip
"""Of the elements below one parent, those that come last in the schemas, in their order."""

_LISTS = ("Connectors", "ParameterBindings", "Elements", "Connections", "Annotations", "Units")
"""Elements that the schemas want either to have content or to be left out."""

_TYPES = {
    **dict.fromkeys(("Float64", "Float32"), "Real"),
    **{f"{sign}Int{bits}": "Integer" for sign in ("", "U") for bits in (8, 16, 32, 64)},
}
_KINDS = ("local", "constant", "unspecified")


def qualified(name: str) -> str:
    """A prefixed name like ssd:System as lxml writes it, {namespace}System."""
    prefix, _, local = name.partition(":")
    return f"{{{NAMESPACES[prefix]}}}{local}"


def short(name: str) -> str:
    """The reverse: a readable name."""
    for prefix, namespace in NAMESPACES.items():
        name = name.replace(f"{{{namespace}}}", f"{prefix}:")
    return name


def parse(place: str, data: bytes, form: str, notes: Notes) -> Any:
    """The root of a document of the given form, valid by its schema.

    InputError where it is not; place names the file.
    """
    try:
        root = etree.fromstring(data, _parser())
    except etree.XMLSyntaxError as error:
        lenient = _parser(recover=True)
        root = etree.fromstring(data, lenient)
        reason = " ".join(str(error.msg).split())
        if {entry.type for entry in lenient.error_log} != {_UNDECLARED}:
            raise InputError(f"{place}: not readable as XML: {reason}") from error
        notes.add(place, f"taken, although XML has it otherwise: {reason}")
        for element in root.iter():
            prefix, colon, name = element.tag.partition(":")
            if colon and not prefix.startswith("{"):
                element.tag = f"{{{NAMESPACES.get(prefix, prefix)}}}{name}"
    if root.getroottree().docinfo.doctype:
        raise InputError(f"{place}: has a document type; SSP has none")
    return checked(place, root, form, notes)


def _parser(recover: bool = False) -> Any:
    return etree.XMLParser(
        resolve_entities=False,
        no_network=True,
        remove_comments=True,
        remove_pis=True,
        recover=recover,
    )


def checked(place: str, root: Any, form: str, notes: Notes) -> Any:
    """The root, valid by the schema of its form; InputError with the line where it is not.

    What SSP 2.0 shares with 1.0 is valid too, and what is in another order or an empty list.
    """
    expected, actual = etree.QName(qualified(ROOTS[form])), etree.QName(root)
    if actual.localname == expected.localname and actual.namespace != expected.namespace:
        notes.add(place, f"taken, although its namespace is {actual.namespace!r}")
        for element in root.iter(f"{{{actual.namespace or ''}}}*"):
            element.tag = f"{{{expected.namespace}}}{etree.QName(element).localname}"
    if root.tag != expected.text:
        raise InputError(f"{at(place, root)}: {short(root.tag)}: must be {ROOTS[form]}")
    version = root.get("version", "").strip()
    if version == "2.0":
        notes.add(place, "of SSP 2.0, read as far as it is shared with 1.0")
        as_version_1(place, root, notes)
    elif not _VERSION_1.fullmatch(version):
        raise InputError(f"{at(place, root)}: SSP version {version!r}; must be '1.0' or '2.0'")
    root.set("version", VERSION)
    schema = _schema(form)
    if not schema.validate(root):
        error = schema.error_log[0]
        as_version_1(place, root, notes)
        _tidy(root)
        if not schema.validate(root):
            raise InputError(f"{place}:{error.line}: against the schema: {short(error.message)}")
        notes.add(place, f"taken, although the schema has it otherwise: {short(error.message)}")
    return root


def _tidy(root: Any) -> None:
    """Put the elements into the order of the schema, without what is empty and must not be."""
    for element in list(root.iter()):
        name, parent = etree.QName(element).localname, element.getparent()
        nameless = name == "Enumeration" and not element.attrib
        if parent is not None and len(element) == 0 and (name in _LISTS or nameless):
            parent.remove(element)
        else:
            element[:] = sorted(element, key=_place)


def _place(element: Any) -> int:
    name = etree.QName(element).localname
    return _LAST.index(name) if name in _LAST else -1


def as_version_1(place: str, root: Any, notes: Notes) -> None:
    """Change a document of SSP 2.0 into one of 1.0; InputError where it has no form there."""
    ends = ("startConnector", "endConnector")
    connected = {e.get(end) for e in root.iter("{*}Connection") for end in ends}
    for element in list(root.iter()):
        tag, parent, refused = etree.QName(element), element.getparent(), ""
        line, name, kind = at(place, element), element.get("name"), element.get("kind")
        match tag.localname:
            case "MetaData" | "Signature":
                notes.add(line, f"{tag.localname} is not used")
                parent.remove(element)
            case "Dimension" | "Clock" if "SystemStructure" in (tag.namespace or ""):
                refused = f"{parent.get('name')!r}: {tag.localname}"
            case type_ if type_ in _TYPES:
                element.tag = f"{{{tag.namespace}}}{_TYPES[type_]}"
            case "Connector" if kind == "structuralParameter":
                element.set("kind", "parameter")
            case "Connector" if kind in _KINDS and name in connected:
                refused = f"connector {name!r} on a connection: kind {kind!r}"
            case "Connector" if kind in _KINDS:
                notes.add(f"{line}: {name!r}", f"a connector of kind {kind!r} is not used")
                parent.remove(element)
            case "Connection" if not {"startIndices", "endIndices"}.isdisjoint(element.keys()):
                refused = "startIndices or endIndices"
            case "ConnectorGeometry":
                for attribute in ("systemInnerX", "systemInnerY"):
                    element.attrib.pop(attribute, None)
            case "Value" if len(parent) > 1:
                refused = "several Values"
            case "Value":  # below a String or Enumeration
                parent.set("value", element.get("value", ""))
                parent.remove(element)
        if refused:
            raise InputError(
                f"{line}: {refused} of SSP 2.0 not supported; must be scalar, and inputs, outputs "
                "or parameters"
            )


def at(place: str, element: Any) -> str:
    """Return the place of an element, file and line."""
    return f"{place}:{element.sourceline}"


def child(element: Any, name: str) -> Any:
    """The child of that prefixed name, or None."""
    return element.find(qualified(name))


def children(element: Any, *path: str) -> list[Any]:
    """The elements at the end of a path of prefixed names."""
    return list(element.findall("/".join(qualified(name) for name in path)))


def is_true(element: Any, attribute: str) -> bool:
    """An xs:boolean that is false where it is left out."""
    return element.get(attribute, "false").strip() in ("true", "1")


def to_bytes(root: Any) -> bytes:
    """The document, indented; the same for the same content."""
    etree.indent(root)
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n")


def new(name: str, /, foreign: Mapping[str, str] | None = None, **attributes: str) -> Any:
    """A root element, with the prefixes of the standard and those of `foreign` namespaces."""
    prefixes = {prefix: NAMESPACES[prefix] for prefix in sorted({"ssc", name.partition(":")[0]})}
    return etree.Element(qualified(name), attributes, nsmap={**prefixes, **(foreign or {})})


def add(parent: Any, name: str, /, **attributes: str) -> Any:
    """A new child at the end of parent."""
    return etree.SubElement(parent, qualified(name), attributes)


@lru_cache(maxsize=len(ROOTS))
def _schema(form: str) -> Any:
    """The official schema of a form."""
    name = NAMESPACES[form].rpartition("/")[2]
    return etree.XMLSchema(file=str(SCHEMAS / f"{name}.xsd"))


def read_units(file: str, parent: Any, prefix: str) -> Mapping[str, Unit]:
    """The units below an element of the format with that prefix; file is for error messages."""
    units = {}
    for base in children(parent, f"{prefix}:Units", "ssc:Unit", "ssc:BaseUnit"):
        name = base.getparent().get("name")
        try:
            units[name] = base_unit(name, base.attrib)
        except ValueError as error:
            raise InputError(f"{at(file, base)}: {error}") from error
    return units


def write_units(parent: Any, prefix: str, units: Iterable[Unit]) -> None:
    """The reverse; nothing where there are none."""
    all_units = list(units)
    if not all_units:
        return
    element = add(parent, f"{prefix}:Units")
    for unit in all_units:
        exponents = zip(BASE, unit.exponents, strict=True)
        base = {name: str(exponent) for name, exponent in exponents if exponent}
        if unit.factor != 1.0:
            base["factor"] = repr(unit.factor)
        if unit.offset != 0.0:
            base["offset"] = repr(unit.offset)
        add(add(element, "ssc:Unit", name=unit.name), "ssc:BaseUnit", **base)


def same(a: Unit, b: Unit) -> bool:
    """Return True if they mean the same, whatever they are called."""
    return (a.exponents, a.factor, a.offset) == (b.exponents, b.factor, b.offset)


def change(place: str, source: Unit, target: Unit) -> tuple[float, float]:
    """(factor, offset) such that target value = factor * source value + offset.

    Exactly (1.0, 0.0) where they mean the same; InputError where they are of different quantities.
    """
    to_target = conversion(source, target)
    if to_target is None:
        raise InputError(
            f"{place}: {source.name} cannot be converted to {target.name}; "
            "units must be of the same quantity, or suppressUnitConversion set"
        )
    return to_target


_TYPE_OF = {
    "ssv": "parameter-set",
    "ssm": "parameter-mapping",
    "ssb": "signal-dictionary",
}


@dataclass(frozen=True, slots=True)
class Origin:
    """A document, an entry of an archive, with its units and the documents that it is nested in.

    fmu is the entry of the component that an element stands in, empty where it stands in none.
    """

    archive: Archive
    entry: str
    notes: Notes
    units: Mapping[str, Unit] = field(default_factory=dict)
    around: tuple[str, ...] = ()
    fmu: str = ""

    @property
    def place(self) -> str:
        """The name of the document in messages."""
        return f"{self.archive.place}: {self.entry}"

    def resolve(self, place: str, uri: str) -> str:
        """The entry of a source, relative to the document."""
        return self.archive.resolve(place, uri, dirname(self.entry))

    def inside(self, fragment: str = "") -> "Origin":
        """The same, in what is nested in it; InputError where that is nested in itself."""
        place = f"{self.place}{fragment}"
        if place in self.around:
            raise InputError(f"{place}: contains itself, which is not allowed")
        return replace(self, around=(*self.around, place))

    def unit_name(self, element: Any) -> str | None:
        """The unit that a type or a value names; some write it in brackets, [m]."""
        name: str | None = element.get("unit")
        if name is None or name in self.units:
            return name
        in_brackets = _BRACKETS.fullmatch(name)
        return in_brackets[1] if in_brackets else name

    def unit(self, place: str, name: str | None, fmu_unit: str | None) -> Unit | None:
        """The unit of that name, None for none; fmu_unit is that which the FMU names, if it does.

        One that the document does not define is the FMU's, or goes by its name. InputError where
        nothing says what it is.
        """
        if name == "":
            self.notes.add(place, "unit '' is taken as no unit")
        if not name or name in self.units:
            return self.units.get(name or "")
        if fmu_unit == name:
            self.notes.add(place, f"unit {name!r} is not defined; taken as the FMU's")
            return None
        unit = known_unit(name)
        if unit is None:
            known(f"{place}: unit", name, self.units, " is not defined")
        self.notes.add(place, f"unit {name!r} is not defined; known by its name")
        return unit

    def inner(self, place: str, entry: Any, form: str, holder: Any) -> tuple["Origin", Any]:
        """A set, mapping or dictionary: the file that `entry` names, or inline in `holder`.

        With what its units refer to.
        """
        kind = _TYPE_OF[form]
        media_type = f"application/x-ssp-{kind}"
        if entry.get("type", media_type) != media_type:
            raise InputError(
                f"{place}: type {entry.get('type')!r} is not supported; must be {media_type}"
            )
        source = entry.get("source")
        inline = None if holder is None else child(holder, ROOTS[form])
        if (source is None) == (inline is None):
            raise InputError(
                f"{place}: {kind}: must have either a source or an inline {ROOTS[form]}"
            )
        if source is None:
            root = checked(self.place, inline, form, self.notes)
            return replace(self, units={**self.units, **read_units(self.place, root, form)}), root
        base = self._within_fmu(place) if entry.get("sourceBase") == "component" else self
        document = replace(base, entry=base.resolve(place, source), units={})
        root = parse(document.place, document.archive.read(document.entry), form, self.notes)
        return replace(document, units=read_units(document.place, root, form)), root

    def _within_fmu(self, place: str) -> "Origin":
        """The place of the files in the component's FMU."""
        if not self.fmu:
            raise InputError(f"{place}: sourceBase 'component': must be at a component with an FMU")
        label = f"{self.archive.place}: {self.fmu}"
        path = self.archive.extract(self.fmu)
        archive = Archive(path, self.notes, label, "modelDescription.xml")
        return replace(self, archive=archive, entry="")


def open_structure(
    archive: Archive, notes: Notes, entry: str, around: tuple[str, ...] = ()
) -> tuple[Origin, Any]:
    """A structure of an archive: where its elements stand, and its root."""
    origin = Origin(archive, entry, notes, around=around).inside()
    root = parse(origin.place, archive.read(entry), "ssd", notes)
    return replace(origin, units=read_units(origin.place, root, "ssd")), root
