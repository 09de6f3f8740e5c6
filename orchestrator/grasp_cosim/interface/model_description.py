"""Reads a model description as FMPy does, but for what FMPy is needlessly strict about."""

import copy
import io
import zipfile
from contextlib import suppress
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import fmpy

from ..errors import InputError
from ..files import check_fmu_file

FROM_TYPE = ("unit", "displayUnit", "min", "max", "nominal", "relativeQuantity")
"""What a variable has from its declared type where it says nothing itself."""


def read_description(path: Path) -> tuple[Any, ElementTree.Element, list[str]]:
    """The description as FMPy reads it and, for what FMPy leaves out, as XML; the files' names.

    InputError where there is no FMU.
    """
    check_fmu_file(path)
    try:
        with zipfile.ZipFile(path) as archive:
            files = [name.replace("\\", "/") for name in archive.namelist()]
            if "modelDescription.xml" not in files:
                raise ValueError("no modelDescription.xml at the top of the archive")
            xml = archive.read("modelDescription.xml")
        root = ElementTree.fromstring(xml)  # noqa: S314
        if not root.get("fmiVersion"):
            raise ValueError("no fmiVersion in modelDescription.xml")
        return _described(xml, root), root, files
    except Exception as error:  # FMPy raises whatever its XML and ZIP libraries do
        reason = " ".join(str(error).split()) or type(error).__name__
        raise InputError(f"{path}: not a readable FMU: {reason}") from error


def _described(xml: bytes, root: ElementTree.Element) -> Any:
    try:
        return _by_fmpy(xml)
    except Exception:
        with suppress(Exception):
            return _by_fmpy(_mended(root))
        raise


def _by_fmpy(xml: bytes) -> Any:
    archive = io.BytesIO()  # with a file, FMPy would leave it open after an error
    with zipfile.ZipFile(archive, "w") as file:
        file.writestr("modelDescription.xml", xml)
    return fmpy.read_model_description(archive, validate=False)


def _mended(root: ElementTree.Element) -> bytes:
    """Without what FMPy refuses even where it need not validate.

    What variables have from their declared types is added to root itself, too.
    """
    types = {
        t.get("name"): {k: v for e in (t, *t) for k, v in e.attrib.items() if k in FROM_TYPE}
        for t in root.iterfind("TypeDefinitions/*")
    }
    for element in root.iterfind("ModelVariables//*"):
        declared = types.get(element.get("declaredType"), {})
        element.attrib.update({**declared, **element.attrib})
    mended = copy.deepcopy(root)
    kept = {t.get("name") for t in mended.iterfind("TypeDefinitions/*") if _is_enumeration(t)}
    for element in mended.iterfind("ModelVariables//*[@declaredType]"):
        if element.get("declaredType") not in kept:
            del element.attrib["declaredType"]
    for definitions in mended.findall("TypeDefinitions"):
        for simple in [t for t in definitions if t.get("name") not in kept]:
            definitions.remove(simple)
    for definitions in mended.findall("UnitDefinitions"):
        mended.remove(definitions)
    for element in mended.iterfind("ModelVariables/*"):
        element.attrib.setdefault("initial", "")  # causality and variability do not match
    for element in mended.iterfind("ModelStructure//*[@dependencies]"):
        element.set("dependencies", " ".join(element.get("dependencies", "").split()))
    return ElementTree.tostring(mended)


def _is_enumeration(definition: ElementTree.Element) -> bool:
    return definition.tag == "EnumerationType" or definition.find("Enumeration") is not None
