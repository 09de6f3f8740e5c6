"""SSP 2.0 as 1.0: it has the same namespaces, and most of what it adds has a form in 1.0.

Types with a width are Real or Integer, structural parameters are parameters; meta data and
signatures are left out. Arrays, clocks and the new kinds of connectors that are connected are
refused by name. After: the schemas of SSP 2.0 (2024-12-20), compared with those of 1.0.
"""

from typing import Any

from lxml import etree  # type: ignore[import-untyped]

from ..base.errors import InputError
from .remarks import Notes

_TYPES = {
    "Float64": "Real",
    "Float32": "Real",
    **dict.fromkeys(
        ("Int8", "UInt8", "Int16", "UInt16", "Int32", "UInt32", "Int64", "UInt64"), "Integer"
    ),
}
_LEFT_OUT = ("MetaData", "Signature")
_REFUSED = {"Dimension": "arrays", "Clock": "clocks"}
_KINDS = ("local", "constant", "unspecified")


def as_version_1(place: str, root: Any, notes: Notes) -> None:
    """Change a document of SSP 2.0 into one of 1.0; InputError where it has no form there."""
    connected = {
        element.get(end)
        for element in root.iter("{*}Connection")
        for end in ("startConnector", "endConnector")
    }
    for element in list(root.iter()):
        tag = etree.QName(element)
        where = f"{place}:{element.sourceline}"
        if tag.localname in _LEFT_OUT:
            notes.add(where, f"{tag.localname} is not used")
            element.getparent().remove(element)
        elif tag.localname in _REFUSED and "SystemStructure" in (tag.namespace or ""):
            raise InputError(
                f"{where}: {element.getparent().get('name')!r}: {tag.localname}: "
                f"{_REFUSED[tag.localname]} of SSP 2.0 are not supported; must be scalar"
            )
        elif tag.localname in _TYPES:
            element.tag = f"{{{tag.namespace}}}{_TYPES[tag.localname]}"
        elif tag.localname == "Connector":
            _change_connector(where, element, connected, notes)
        elif tag.localname == "Connection":
            _check_connection(where, element)
        elif tag.localname == "ConnectorGeometry":
            for attribute in ("systemInnerX", "systemInnerY"):
                element.attrib.pop(attribute, None)
        elif tag.localname == "Value":
            _change_value(where, element)


def _change_connector(where: str, element: Any, connected: set[Any], notes: Notes) -> None:
    name, kind = element.get("name"), element.get("kind")
    if kind == "structuralParameter":
        element.set("kind", "parameter")
    elif kind in _KINDS and name in connected:
        raise InputError(
            f"{where}: connector {name!r}: kind {kind!r} of SSP 2.0 is not supported on a "
            "connection; must be input, output or parameter"
        )
    elif kind in _KINDS:
        notes.add(f"{where}: {name!r}", f"a connector of kind {kind!r} is not used")
        element.getparent().remove(element)


def _check_connection(where: str, element: Any) -> None:
    for attribute in ("startIndices", "endIndices"):
        if attribute in element.attrib:
            raise InputError(
                f"{where}: {attribute}: elements of arrays of SSP 2.0 are not supported; "
                "must connect scalar variables"
            )


def _change_value(where: str, element: Any) -> None:
    """One Value below a String or Enumeration is its value."""
    parent = element.getparent()
    if len(parent) > 1:
        raise InputError(f"{where}: arrays of SSP 2.0 are not supported; must be one Value")
    parent.set("value", element.get("value", ""))
    parent.remove(element)
