"""Writes modelDescription.xml of FMI 2.0 from the variables of a slave."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .host_log import CATEGORIES, DISCARD, ERROR
from .variable import Scalar, Variable

_WORD = r"(?:[A-Za-z_]\w*|'(?:[^'\\]|\\.)+')(?:\[\d+(?:,\d+)*\])?"
_STRUCTURED = re.compile(rf"{_WORD}(?:\.{_WORD})*", re.ASCII)
"""Names of FMI's structured naming convention, but for der(), which proxy.hold. cannot precede."""


class Unit(NamedTuple):
    """Exponents of the SI base units, and the name and factor of a unit to display.

    value in base units = factor * value + offset.
    """

    base: Mapping[str, int]
    display: tuple[str, float] | None = None
    factor: float = 1.0
    offset: float = 0.0


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
    "s": Unit({"s": 1}),
    "1/s": Unit({"s": -1}),
    "Hz": Unit({"s": -1}),
    "s/m": Unit({"s": 1, "m": -1}),
    "rad": Unit({"rad": 1}),
    "1": Unit({}),
}
"""V.m^n and N/m^n are not among them: their exponent is a parameter."""


class Experiment(NamedTuple):
    """A default experiment, times in s; None for what is not given."""

    start: float | None = 0.0
    stop: float | None = 3.0
    tolerance: float | None = None
    step: float | None = 1e-4


@dataclass(frozen=True)
class Description:
    """The content of a model description; the value reference of a variable is its position."""

    name: str
    summary: str
    variables: Sequence[Variable]
    units: Mapping[str, Unit] = field(default_factory=lambda: UNITS)
    """The definitions of units; a variable's unit that is not here is a name alone."""
    can_vary_step: bool = True
    has_states: bool = True
    experiment: Experiment = Experiment()
    statuses: Sequence[int] = (DISCARD, ERROR)
    """The statuses that are logged with messages."""


def model_description(d: Description, guid: str) -> bytes:
    """Return modelDescription.xml in UTF-8."""
    structured = all(_STRUCTURED.fullmatch(v.name) for v in d.variables)
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=d.name,
        guid=guid,
        description=d.summary,
        version=version(),
        license="MIT",
        generationTool=f"grasp-cosim with pythonfmu {version('pythonfmu')}",
        variableNamingConvention="structured" if structured else "flat",
        numberOfEventIndicators="0",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=d.name,
        needsExecutionTool="true",
        canHandleVariableCommunicationStepSize=_literal(d.can_vary_step),
        canNotUseMemoryManagementFunctions="true",
        canGetAndSetFMUstate=_literal(d.has_states),
        canSerializeFMUstate=_literal(d.has_states),
    )
    _add_units(root, d)
    _add_enumerations(root, d)
    categories = SubElement(root, "LogCategories")
    for status in d.statuses:
        SubElement(categories, "Category", name=CATEGORIES[status])
    times = zip(("startTime", "stopTime", "tolerance", "stepSize"), d.experiment, strict=True)
    experiment = {key: repr(time) for key, time in times if time is not None}
    if experiment:
        SubElement(root, "DefaultExperiment", experiment)
    variables = SubElement(root, "ModelVariables")
    for v in d.variables:
        _add_variable(variables, v, d.units)
    _add_structure(root, d.variables)
    indent(root)
    document: bytes = tostring(root, "UTF-8", xml_declaration=True)
    return document + b"\n"


def version(distribution: str = "grasp-cosim") -> str:
    """Return the version of an installed distribution."""
    from importlib import metadata  # takes longer to load than all the rest

    return metadata.version(distribution)


def _literal(value: Scalar) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _add_units(root: Element, d: Description) -> None:
    names = dict.fromkeys(v.unit for v in d.variables if v.unit)
    if not names:
        return
    definitions = SubElement(root, "UnitDefinitions")
    for name in names:
        element = SubElement(definitions, "Unit", name=name)
        if name not in d.units:
            continue
        unit = d.units[name]
        base = {key: str(power) for key, power in unit.base.items()}
        base |= {"factor": repr(unit.factor)} if unit.factor != 1.0 else {}
        base |= {"offset": repr(unit.offset)} if unit.offset != 0.0 else {}
        SubElement(element, "BaseUnit", base)
        if unit.display:
            display, factor = unit.display
            SubElement(element, "DisplayUnit", name=display, factor=repr(factor))


def _add_enumerations(root: Element, d: Description) -> None:
    used = dict.fromkeys(v.enumeration for v in d.variables if v.enumeration)
    if not used:
        return
    definitions = SubElement(root, "TypeDefinitions")
    for enumeration in used:
        simple = SubElement(definitions, "SimpleType", name=enumeration.name)
        parent = SubElement(simple, "Enumeration")
        for name, number in enumeration.items:
            SubElement(parent, "Item", name=name, value=str(number))


def _add_variable(parent: Element, v: Variable, units: Mapping[str, Unit]) -> None:
    element = SubElement(
        parent,
        "ScalarVariable",
        name=v.name,
        valueReference=str(len(parent)),
        causality=v.causality,
        variability=v.variability,
    )
    if v.description:
        element.set("description", v.description)
    if v.causality != "input":
        element.set("initial", _initial(v))
    SubElement(element, v.type, _attributes(v, units))


def _initial(v: Variable) -> str:
    if v.causality == "parameter" or v.variability == "constant":
        return "exact"
    return "calculated" if v.start is None else "approx"


def _attributes(v: Variable, units: Mapping[str, Unit]) -> dict[str, str]:
    attributes: dict[str, str] = {}
    if v.enumeration:
        attributes["declaredType"] = v.enumeration.name
    if v.kind is float and v.unit:
        attributes["unit"] = v.unit
        if v.unit in units and (display := units[v.unit].display):
            attributes["displayUnit"] = display[0]
    if v.relative:
        attributes["relativeQuantity"] = "true"
    if v.kind in (float, int) and v.limits:
        limits = zip(("min", "max"), v.limits, strict=True)
        attributes |= {key: repr(v.kind(limit)) for key, limit in limits if isfinite(limit)}
    if v.nominal is not None:
        attributes["nominal"] = repr(v.nominal)
    if v.start is not None:
        attributes["start"] = _literal(float(v.start) if v.kind is float else v.start)
    return attributes


def _add_structure(root: Element, variables: Sequence[Variable]) -> None:
    index = {v.name: i for i, v in enumerate(variables, 1)}
    structure = SubElement(root, "ModelStructure")
    outputs = [v for v in variables if v.causality == "output"]
    unknowns = {
        "Outputs": [(v, v.dependencies) for v in outputs],
        "InitialUnknowns": [(v, v.initial_dependencies) for v in outputs if _initial(v) != "exact"],
    }
    for section, listed in unknowns.items():
        parent = SubElement(structure, section) if listed else structure
        for v, known in listed:
            dependencies = " ".join(str(index[name]) for name in known)
            SubElement(parent, "Unknown", index=str(index[v.name]), dependencies=dependencies)
