"""Writes modelDescription.xml and buildDescription.xml of a native FMU."""

from typing import Literal
from xml.etree.ElementTree import Element, SubElement

from c_compilers import BITS, LIBM

from ..model_description import (
    Description,
    add_categories_and_experiment,
    add_items,
    add_units,
    attributes,
    document,
    enumerations,
    literal,
    model_description,
    role,
    root_element,
    unknowns,
)
from ..variable import Scalar, Variable

TYPES: dict[type[Scalar], str] = {
    float: "Float64",
    bool: "Boolean",
    int: "Int32",
    str: "String",
}
"""What FMI 3.0 calls a kind of variable."""

OPTIONS = " ".join((*BITS, *(f"-fno-builtin-{function}" for function in LIBM)))
"""Of any compiler that calls them so; contracted, an FMU makes no instance."""


def native_description(d: Description, guid: str, fmi: Literal[2, 3]) -> bytes:
    """Return modelDescription.xml of a native FMU for FMI `fmi`; its GUID or token is `guid`.

    In FMI 3.0 the variables are those of FMI 2.0, and then the time.
    """
    if fmi == 2:
        return model_description(d, guid, native=True)
    root = root_element(d, "3.0", {"instantiationToken": guid}, "grasp-cosim")
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=d.name,
        canGetAndSetFMUState=literal(d.has_states),
        canSerializeFMUState=literal(d.has_states),
        canHandleVariableCommunicationStepSize=literal(d.can_vary_step),
    )
    add_units(root, d, "s")
    _add_enumerations(root, d)
    add_categories_and_experiment(root, d)
    variables = SubElement(root, "ModelVariables")
    for reference, v in enumerate(d.variables):
        found = {**role(v, reference), **attributes(v, d.units)}
        start = found.pop("start", None) if v.kind is str else None
        element = SubElement(variables, _type(v), found)
        if start is not None:
            SubElement(element, "Start", value=start)
    SubElement(variables, "Float64", _time(d))
    structure = SubElement(root, "ModelStructure")
    for section, listed in unknowns(d.variables, first=0).items():
        for known, dependencies in listed:
            SubElement(structure, section, valueReference=known, dependencies=dependencies)
    return document(root)


def build_description(name: str, fmi: Literal[2, 3], networked: bool = False) -> bytes:
    """Return sources/buildDescription.xml, which FMI 2.0 takes as FMI 3.0 defines it.

    One that is networked has a configuration of its own for Windows, with the library of sockets;
    hosts that read a single one take the first, which links everywhere else.
    """
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    _add_configuration(root, name, modelIdentifier=name)
    if networked:
        windows = _add_configuration(root, name, modelIdentifier=name, platform="x86_64-windows")
        SubElement(windows, "Library", name="ws2_32", description="the sockets of Windows")
    return document(root)


def _add_configuration(root: Element, name: str, **attributes: str) -> Element:
    configuration = SubElement(root, "BuildConfiguration", attributes)
    files = SubElement(configuration, "SourceFileSet", language="C99", compilerOptions=OPTIONS)
    SubElement(files, "SourceFile", name=f"{name}.c")
    return configuration


def _type(v: Variable) -> str:
    return "Enumeration" if v.enumeration else TYPES[v.kind]


def _add_enumerations(root: Element, d: Description) -> None:
    if not enumerations(d):
        return
    definitions = SubElement(root, "TypeDefinitions")
    for enumeration in enumerations(d):
        add_items(SubElement(definitions, "EnumerationType", name=enumeration.name), enumeration)


def _time(d: Description) -> dict[str, str]:
    name = "time"
    while name in {v.name for v in d.variables}:
        name += "_"
    return {
        "name": name,
        "valueReference": str(len(d.variables)),
        "causality": "independent",
        "variability": "continuous",
        "description": "t",
        "unit": "s",
    }
