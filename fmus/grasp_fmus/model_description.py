"""Writes modelDescription.xml of FMI 2.0 from the variables of a slave.

What FMI 3.0 has in common with it is here as well; the rest of that is in native/description.py.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import isfinite
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from .host_log import CATEGORIES, DISCARD, ERROR
from .variable import Enumeration, Scalar, Variable

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


def model_description(d: Description, guid: str, native: bool = False) -> bytes:
    """Return modelDescription.xml in UTF-8; that of an FMU in C, with sources, if it is native."""
    tool = "grasp-cosim" if native else f"grasp-cosim with pythonfmu {version('pythonfmu')}"
    root = root_element(d, "2.0", {"guid": guid}, tool)
    root.set("numberOfEventIndicators", "0")
    interface = SubElement(
        root,
        "CoSimulation",
        modelIdentifier=d.name,
        needsExecutionTool=literal(not native),
        canHandleVariableCommunicationStepSize=literal(d.can_vary_step),
        canNotUseMemoryManagementFunctions=literal(not native),
        canGetAndSetFMUstate=literal(d.has_states),
        canSerializeFMUstate=literal(d.has_states),
    )
    if native:
        SubElement(SubElement(interface, "SourceFiles"), "File", name=f"{d.name}.c")
    add_units(root, d)
    _add_enumerations(root, d)
    add_categories_and_experiment(root, d)
    variables = SubElement(root, "ModelVariables")
    for v in d.variables:
        _add_variable(variables, v, d.units)
    _add_structure(root, d.variables)
    return document(root)


def root_element(d: Description, fmi: str, token: Mapping[str, str], tool: str) -> Element:
    """Return the root of a model description, with what an FMU of any version says of itself."""
    structured = all(_STRUCTURED.fullmatch(v.name) for v in d.variables)
    return Element(
        "fmiModelDescription",
        {"fmiVersion": fmi, "modelName": d.name, **token},
        description=d.summary,
        version=version(),
        license="MIT",
        generationTool=tool,
        variableNamingConvention="structured" if structured else "flat",
    )


def document(root: Element) -> bytes:
    """Return an XML document in UTF-8."""
    indent(root)
    text: bytes = tostring(root, "UTF-8", xml_declaration=True)
    return text + b"\n"


def version(distribution: str = "grasp-cosim") -> str:
    """Return the version of an installed distribution."""
    from importlib import metadata  # takes longer to load than all the rest

    return metadata.version(distribution)


def literal(value: Scalar) -> str:
    """Return a value as it stands in an attribute."""
    return str(value).lower() if isinstance(value, bool) else str(value)


def add_units(root: Element, d: Description, *more: str) -> None:
    """Add the units of the variables, and more, with what is known of them."""
    names = dict.fromkeys([*(v.unit for v in d.variables if v.unit), *more])
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


def enumerations(d: Description) -> list[Enumeration]:
    """Return the types of the variables that are whole numbers with names."""
    return list(dict.fromkeys(v.enumeration for v in d.variables if v.enumeration))


def add_items(parent: Element, enumeration: Enumeration) -> None:
    """Add the names of an enumeration."""
    for name, number in enumeration.items:
        SubElement(parent, "Item", name=name, value=str(number))


def _add_enumerations(root: Element, d: Description) -> None:
    if not enumerations(d):
        return
    definitions = SubElement(root, "TypeDefinitions")
    for enumeration in enumerations(d):
        simple = SubElement(definitions, "SimpleType", name=enumeration.name)
        add_items(SubElement(simple, "Enumeration"), enumeration)


def add_categories_and_experiment(root: Element, d: Description) -> None:
    """Add the categories of messages in the log, and the default experiment if there is one."""
    categories = SubElement(root, "LogCategories")
    for status in d.statuses:
        SubElement(categories, "Category", name=CATEGORIES[status])
    times = zip(("startTime", "stopTime", "tolerance", "stepSize"), d.experiment, strict=True)
    experiment = {key: repr(time) for key, time in times if time is not None}
    if experiment:
        SubElement(root, "DefaultExperiment", experiment)


def _add_variable(parent: Element, v: Variable, units: Mapping[str, Unit]) -> None:
    element = SubElement(parent, "ScalarVariable", role(v, len(parent)))
    SubElement(element, v.type, attributes(v, units))


def role(v: Variable, reference: int) -> dict[str, str]:
    """Return the attributes of a variable that say what it is for."""
    found = {
        "name": v.name,
        "valueReference": str(reference),
        "causality": v.causality,
        "variability": v.variability,
    }
    if v.description:
        found["description"] = v.description
    if v.causality != "input":
        found["initial"] = _initial(v)
    return found


def _initial(v: Variable) -> str:
    if v.causality == "parameter" or v.variability == "constant":
        return "exact"
    return "calculated" if v.start is None else "approx"


def attributes(v: Variable, units: Mapping[str, Unit]) -> dict[str, str]:
    """Return the attributes of a variable that say what values it has."""
    found: dict[str, str] = {}
    if v.enumeration:
        found["declaredType"] = v.enumeration.name
    if v.kind is float and v.unit:
        found["unit"] = v.unit
        if v.unit in units and (display := units[v.unit].display):
            found["displayUnit"] = display[0]
    if v.relative:
        found["relativeQuantity"] = "true"
    if v.kind in (float, int) and v.limits:
        limits = zip(("min", "max"), v.limits, strict=True)
        found |= {key: repr(v.kind(limit)) for key, limit in limits if isfinite(limit)}
    if v.nominal is not None:
        found["nominal"] = repr(v.nominal)
    if v.start is not None:
        found["start"] = literal(float(v.start) if v.kind is float else v.start)
    return found


def _add_structure(root: Element, variables: Sequence[Variable]) -> None:
    structure = SubElement(root, "ModelStructure")
    for section, listed in unknowns(variables, first=1).items():
        parent = SubElement(structure, f"{section}s") if listed else structure
        for index, dependencies in listed:
            SubElement(parent, "Unknown", index=index, dependencies=dependencies)


def unknowns(variables: Sequence[Variable], first: int) -> dict[str, list[tuple[str, str]]]:
    """Return outputs and initial unknowns with what they depend on, counted from `first`."""
    number = {v.name: str(i) for i, v in enumerate(variables, first)}

    def known(v: Variable, names: Sequence[str]) -> tuple[str, str]:
        return number[v.name], " ".join(number[name] for name in names)

    outputs = [v for v in variables if v.causality == "output"]
    return {
        "Output": [known(v, v.dependencies) for v in outputs],
        "InitialUnknown": [
            known(v, v.initial_dependencies) for v in outputs if _initial(v) != "exact"
        ],
    }
