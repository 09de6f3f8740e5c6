"""XML of SSP: read without entities and network, checked against the official schemas."""

import re
from collections.abc import Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..base.errors import InputError
from ..fmi import fmpy
from .remarks import Notes
from .version2 import as_version_1

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

_UNDECLARED = etree.ErrorTypes.NS_ERR_UNDEFINED_NAMESPACE
"""The one error of XML that is taken: annotations in circulation have a prefix for no namespace."""

VERSION = "1.0"
_VERSION_1 = re.compile(r"1\.\d+(\.\d+)?(-.*)?")
_LAST = (
    "Connectors", "ConnectorGeometry", "ConnectionGeometry", "ElementGeometry",
    "ParameterBindings", "ParameterValues", "ParameterMapping", "Elements", "Connections",
    "SignalDictionaries", "SystemGeometry", "GraphicalElements", "Parameters", "Enumerations",
    "Units", "DefaultExperiment", "Annotations",
)  # fmt: skip
"""Of the elements below one parent, those that come last in the schemas, in their order."""

_LISTS = ("Connectors", "ParameterBindings", "Elements", "Connections", "Annotations", "Units")
"""Elements that the schemas want either to have content or to be left out."""


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

    What SSP 2.0 shares with 1.0 is valid as well, and what is in another order or an empty list.
    """
    wanted, found = etree.QName(qualified(ROOTS[form])), etree.QName(root)
    if found.localname == wanted.localname and found.namespace != wanted.namespace:
        notes.add(place, f"taken, although its namespace is {found.namespace!r}")
        for element in root.iter(f"{{{found.namespace or ''}}}*"):
            element.tag = f"{{{wanted.namespace}}}{etree.QName(element).localname}"
    if root.tag != wanted.text:
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


def new(name: str, /, more: Mapping[str, str] | None = None, **attributes: str) -> Any:
    """A root element; the prefixes are those of the standard, and more."""
    prefixes = {prefix: NAMESPACES[prefix] for prefix in sorted({"ssc", name.partition(":")[0]})}
    return etree.Element(qualified(name), attributes, nsmap={**prefixes, **(more or {})})


def add(parent: Any, name: str, /, **attributes: str) -> Any:
    """A new child at the end of parent."""
    return etree.SubElement(parent, qualified(name), attributes)


@lru_cache(maxsize=len(ROOTS))
def _schema(form: str) -> Any:
    """The official schema, version 1.0, as FMPy brings it along."""
    name = re.sub(".*/", "", NAMESPACES[form])
    return etree.XMLSchema(file=str(Path(fmpy.__file__).parent / "ssp/schema" / f"{name}.xsd"))
