"""modelDescription.xml of FMI 2.0, from the fields that a block declares."""

from xml.etree.ElementTree import Element, SubElement

from .contract import Field

UNITS: dict[str, dict[str, str]] = {
    "m": {"m": "1"},
    "m/s": {"m": "1", "s": "-1"},
    "kg": {"kg": "1"},
    "N": {"kg": "1", "m": "1", "s": "-2"},
    "N.s": {"kg": "1", "m": "1", "s": "-1"},
    "N.s/m": {"kg": "1", "s": "-1"},
    "N/m": {"kg": "1", "s": "-2"},
    "V": {"kg": "1", "m": "2", "s": "-3", "A": "-1"},
    "1/s": {"s": "-1"},
    "1": {},
}
"""SI base unit exponents. V.m^n has none: its exponent is a parameter."""

STEP_SIZE = 1e-4
STOP_TIME = 3.0


def model_description(name: str, description: str, fields: list[Field], guid: str) -> Element:
    """The document; the value reference of a variable is its position."""
    root = Element(
        "fmiModelDescription",
        fmiVersion="2.0",
        modelName=name,
        guid=guid,
        description=description,
        generationTool="grasp-cosim with pythonfmu",
        variableNamingConvention="structured",
    )
    SubElement(
        root,
        "CoSimulation",
        modelIdentifier=name,
        needsExecutionTool="true",
        canHandleVariableCommunicationStepSize="true",
        canNotUseMemoryManagementFunctions="true",
    )
    _add_units(root, fields)
    SubElement(
        root, "DefaultExperiment", startTime="0", stopTime=repr(STOP_TIME), stepSize=repr(STEP_SIZE)
    )
    variables = SubElement(root, "ModelVariables")
    structure = SubElement(root, "ModelStructure")
    _add_variables(variables, fields)
    outputs = [str(i + 1) for i, v in enumerate(variables) if v.get("causality") == "output"]
    for section in ("Outputs", "InitialUnknowns"):
        unknowns = SubElement(structure, section)
        for index in outputs:
            SubElement(unknowns, "Unknown", index=index)
    return root


def _add_units(root: Element, fields: list[Field]) -> None:
    definitions = SubElement(root, "UnitDefinitions")
    for unit in dict.fromkeys(f.unit for f in fields if f.unit):
        element = SubElement(definitions, "Unit", name=unit)
        if unit in UNITS:
            SubElement(element, "BaseUnit", UNITS[unit])


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
                initial="calculated" if f.causality == "output" else "exact",
                description=f.description,
            )
            if f.causality == "input":
                del variable.attrib["initial"]
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
    if f.limits:
        attributes["min"], attributes["max"] = map(repr, f.limits)
    if start is not None:
        attributes["start"] = repr(float(start))
    return attributes
