"""modelDescription.xml of FMI 2.0, from the fields that a block declares."""

from collections.abc import Iterable
from importlib import metadata
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .contract import Field, feedthrough
from .host_log import CATEGORIES


class Unit(NamedTuple):
    """Exponents of the SI base units, and what people read: name and factor from the unit."""

    base: dict[str, int]
    display: tuple[str, float] | None = None


UNITS: dict[str, Unit] = {
    "m": Unit({"m": 1}, ("mm", 1e3)),
    "m/s": Unit({"m": 1, "s": -1}, ("mm/s", 1e3)),
    "kg": Unit({"kg": 1}),
    "N": Unit({"kg": 1, "m": 1, "s": -2}),
    "N.s": Unit({"kg": 1, "m": 1, "s": -1}),
    "N.s/m": Unit({"kg": 1, "s": -1}),
    "N/m": Unit({"kg": 1, "s": -2}),
    "V": Unit({"kg": 1, "m": 2, "s": -3, "A": -1}, ("mV", 1e3)),
    "V/s": Unit({"kg": 1, "m": 2, "s": -4, "A": -1}),
    "1/s": Unit({"s": -1}),
    "Hz": Unit({"s": -1}),
    "1": Unit({}),
}
"""V.m^n is not among them: its exponent is a parameter."""

STEP_SIZE = 1e-4
STOP_TIME = 3.0

Dependencies = dict[str, list[str]]


def model_description(name: str, description: str, fields: list[Field], guid: str) -> bytes:
    """The document as UTF-8; the value reference of a variable is its position."""
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=guid,
        description=description,
        version=metadata.version("grasp-cosim"),
        license="MIT",
        generationTool=f"grasp-cosim with pythonfmu {metadata.version('pythonfmu')}",
        variableNamingConvention="structured",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        needsExecutionTool="true",
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate="true",
        canSerializeFMUstate="true",
    )
    _add_units(root, fields)
    categories = SubElement(root, "LogCategories")
    for category in CATEGORIES.values():
        SubElement(categories, "Category", name=category)
    SubElement(
        root, "DefaultExperiment", startTime="0", stopTime=repr(STOP_TIME), stepSize=repr(STEP_SIZE)
    )
    variables = SubElement(root, "ModelVariables")
    _add_variables(variables, fields)
    _add_structure(root, fields)
    indent(root)
    document: bytes = tostring(root, "UTF-8", xml_declaration=True)
    return document + b"\n"


def _add_units(root: Element, fields: list[Field]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for name in dict.fromkeys(f.unit for f in fields if f.unit):
        element = SubElement(definitions, "Unit", name=name)
        if name not in UNITS:
            continue
        unit = UNITS[name]
        SubElement(element, "BaseUnit", {base: str(power) for base, power in unit.base.items()})
        if unit.display:
            display, factor = unit.display
            SubElement(element, "DisplayUnit", name=display, factor=repr(factor))


def _add_variables(parent: Element, fields: list[Field]) -> None:
    for f in fields:
        for name, start in zip(f.names, f.starts, strict=True):
            variable = SubElement(
                parent,
                "ScalarVariable",
                name=name,
                valueReference=str(len(parent)),
                causality=f.causality,
                variability=_variability(f),
                description=f.description,
            )
            if f.causality != "input":
                variable.set("initial", "calculated" if f.causality == "output" else "exact")
            if f.kind is bool:
                attributes = {} if start is None else {"start": str(start).lower()}
                SubElement(variable, "Boolean", attributes)
            else:
                SubElement(variable, "Real", _real(f, start))


def _variability(f: Field) -> str:
    if f.causality == "parameter":
        return "tunable" if f.tunable else "fixed"
    return "discrete" if f.kind is bool else "continuous"


def _real(f: Field, start: float | None) -> dict[str, str]:
    attributes = {"unit": f.unit}
    if f.unit in UNITS and (display := UNITS[f.unit].display):
        attributes["displayUnit"] = display[0]
    if f.limits:
        attributes["min"], attributes["max"] = map(repr, f.limits)
    if f.nominal is not None:
        attributes["nominal"] = repr(f.nominal)
    if start is not None:
        attributes["start"] = repr(float(start))
    return attributes


def _add_structure(root: Element, fields: list[Field]) -> None:
    """What the outputs depend on: while stepping on inputs, at the start on parameters as well."""
    names = [name for f in fields for name in f.names]
    index = {name: i for i, name in enumerate(names, 1)}
    parameters = [name for f in fields if f.causality == "parameter" for name in f.names]
    structure = SubElement(root, "ModelStructure")
    for section, initially in (("Outputs", False), ("InitialUnknowns", True)):
        unknowns = SubElement(structure, section)
        for output, inputs in feedthrough(fields, initially).items():
            known: Iterable[str] = (*inputs, *parameters) if initially else inputs
            SubElement(
                unknowns,
                "Unknown",
                index=str(index[output]),
                dependencies=" ".join(str(index[name]) for name in known),
            )
