"""Writes modelDescription.xml of FMI 2.0 and 3.0 from variables, and how an FMU in C is built."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from math import isfinite
from typing import Literal, NamedTuple
from xml.etree.ElementTree import Element, SubElement, indent, tostring

from ..base.c_compilers import BITS, LIBM
from ..base.si_units import BASE, Unit, known_unit
from .contract import Scalar, Variable

Version = Literal[2, 3]
"""Of FMI."""

TYPES: dict[type[Scalar], str] = {float: "Float64", bool: "Boolean", int: "Int32"}
"""What FMI 3.0 calls a kind of variable."""

OPTIONS = " ".join((*BITS, *(f"-fno-builtin-{function}" for function in LIBM)))
"""Of any compiler that calls them so; contracted, an FMU makes no instance."""

WARNING, DISCARD, ERROR = 1, 2, 3
"""FMI statuses."""

CATEGORIES = {WARNING: "logStatusWarning", DISCARD: "logStatusDiscard", ERROR: "logStatusError"}
"""The categories of messages in use, by status; their names are those of the FMI standard."""

_WORD = r"(?:[A-Za-z_]\w*|'(?:[^'\\]|\\.)+')(?:\[\d+(?:,\d+)*\])?"
_STRUCTURED = re.compile(rf"{_WORD}(?:\.{_WORD})*", re.ASCII)
"""Names of FMI's structured naming convention, but for der(), which proxy.hold. cannot precede."""

ANNOTATION = "grasp-cosim"
"""The tool of our annotations: what FMI has no attribute for."""

DISPLAY = {"m": "mm", "m/s": "mm/s", "V": "mV"}
"""Units to show values in, a thousand times as many."""


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
    units: Mapping[str, Unit] | None = None
    """The definitions of units, by default those known by their names; others are names only."""
    can_vary_step: bool = True
    has_states: bool = True
    experiment: Experiment = Experiment()
    statuses: Sequence[int] = (DISCARD, ERROR)
    """The statuses that are logged with messages."""


def model_description(
    d: Description, guid: str, fmi: Version = 2, *, native: bool = False
) -> bytes:
    """Return modelDescription.xml in UTF-8, of an FMU in C, with sources, if it is native.

    In FMI 3.0, which only native ones have, `guid` is the token, and the last variable is the time.
    """
    structured = all(_STRUCTURED.fullmatch(v.name) for v in d.variables)
    tool = "grasp-cosim" if native else f"grasp-cosim with pythonfmu {version('pythonfmu')}"
    about = {
        "fmiVersion": f"{fmi}.0",
        "modelName": d.name,
        "guid" if fmi == 2 else "instantiationToken": guid,
        "description": d.summary,
        "version": version(),
        "license": "MIT",
        "generationTool": tool,
        "variableNamingConvention": "structured" if structured else "flat",
    }
    root = Element("fmiModelDescription", about)
    if fmi == 2:
        root.set("numberOfEventIndicators", "0")
    _add_interface(root, d, fmi, native)
    _add_units(root, d, *(("s",) if fmi == 3 else ()))
    _add_enumerations(root, d, fmi)
    if native:  # pythonfmu logs without categories, which a host must not leave out
        categories = SubElement(root, "LogCategories")
        for status in d.statuses:
            SubElement(categories, "Category", name=CATEGORIES[status])
    times = zip(("startTime", "stopTime", "tolerance", "stepSize"), d.experiment, strict=True)
    if experiment := {key: repr(time) for key, time in times if time is not None}:
        SubElement(root, "DefaultExperiment", experiment)
    infinite = [v.name for v in d.variables if v.infinite]
    if infinite and fmi == 2:
        annotations = SubElement(root, "VendorAnnotations")
        _add_infinite(SubElement(annotations, "Tool", name=ANNOTATION), infinite)
    variables = SubElement(root, "ModelVariables")
    for reference, v in enumerate(d.variables):
        _add_variable(variables, v, reference, DISPLAY if d.units is None else {}, fmi)
    if fmi == 3:
        name = "time"
        while name in {v.name for v in d.variables}:
            name += "_"
        time = {"name": name, "valueReference": str(len(d.variables)), "causality": "independent"}
        time |= {"variability": "continuous", "description": "t", "unit": "s"}
        SubElement(variables, "Float64", time)
    _add_structure(root, d.variables, fmi)
    if infinite and fmi == 3:
        annotations = SubElement(root, "Annotations")
        _add_infinite(SubElement(annotations, "Annotation", type=ANNOTATION), infinite)
    return _document(root)


def build_description(name: str, networked: bool = False) -> bytes:
    """Return sources/buildDescription.xml, which FMI 2.0 takes as FMI 3.0 defines it.

    One that is networked has its own configuration for Windows, with the library of sockets;
    hosts that read a single one take the first, which links everywhere else.
    """
    root = Element("fmiBuildDescription", fmiVersion="3.0")
    for only in ({}, {"platform": "x86_64-windows"}) if networked else ({},):
        of = {"modelIdentifier": name, **only}
        configuration = SubElement(root, "BuildConfiguration", of)
        files = SubElement(configuration, "SourceFileSet", language="C99", compilerOptions=OPTIONS)
        SubElement(files, "SourceFile", name=f"{name}.c")
        if only:
            sockets = {"name": "ws2_32", "description": "the sockets of Windows"}
            SubElement(configuration, "Library", sockets)
    return _document(root)


def version(distribution: str = "grasp-cosim") -> str:
    """Return the version of an installed distribution."""
    from importlib import metadata  # takes longer to load than all the rest

    return metadata.version(distribution)


def _document(root: Element) -> bytes:
    indent(root)
    text: bytes = tostring(root, "UTF-8", xml_declaration=True)
    return text + b"\n"


def _literal(value: Scalar) -> str:
    return str(value).lower() if isinstance(value, bool) else str(value)


def _add_interface(root: Element, d: Description, fmi: Version, native: bool) -> None:
    state, varies = "FMUstate" if fmi == 2 else "FMUState", _literal(d.can_vary_step)
    steps = {"canHandleVariableCommunicationStepSize": varies}
    states = {f"{can}{state}": _literal(d.has_states) for can in ("canGetAndSet", "canSerialize")}
    tool = {"needsExecutionTool": _literal(not native)}
    memory = {"canNotUseMemoryManagementFunctions": _literal(not native)}
    able = {**tool, **steps, **memory, **states} if fmi == 2 else {**states, **steps}
    interface = SubElement(root, "CoSimulation", {"modelIdentifier": d.name, **able})
    if native and fmi == 2:
        SubElement(SubElement(interface, "SourceFiles"), "File", name=f"{d.name}.c")


def _add_infinite(annotation: Element, names: Sequence[str]) -> None:
    """Say which inputs have inf as a value, for which FMI has no attribute."""
    for name in names:
        SubElement(annotation, "Infinite", variable=name)


def _add_units(root: Element, d: Description, *extra: str) -> None:
    """Add the units of the variables, and more, with what is known of them."""
    names = dict.fromkeys([*(v.unit for v in d.variables if v.unit), *extra])
    definitions = SubElement(root, "UnitDefinitions") if names else root
    for name in names:
        element = SubElement(definitions, "Unit", name=name)
        unit = known_unit(name) if d.units is None else d.units.get(name)
        if unit:
            powers = zip(BASE, unit.exponents, strict=True)
            base = {key: str(power) for key, power in powers if power}
            base |= {"factor": repr(unit.factor)} if unit.factor != 1.0 else {}
            base |= {"offset": repr(unit.offset)} if unit.offset != 0.0 else {}
            SubElement(element, "BaseUnit", base)
        if d.units is None and name in DISPLAY:
            SubElement(element, "DisplayUnit", name=DISPLAY[name], factor=repr(1e3))


def _add_enumerations(root: Element, d: Description, fmi: Version) -> None:
    enumerations = dict.fromkeys(v.enumeration for v in d.variables if v.enumeration)
    definitions = SubElement(root, "TypeDefinitions") if enumerations else root
    for enumeration in enumerations:
        tag = "SimpleType" if fmi == 2 else "EnumerationType"
        items = SubElement(definitions, tag, name=enumeration.name)
        items = SubElement(items, "Enumeration") if fmi == 2 else items
        for name, number in enumeration.items:
            SubElement(items, "Item", name=name, value=str(number))


def _add_variable(
    parent: Element, v: Variable, reference: int, display: Mapping[str, str], fmi: Version
) -> None:
    role = {"name": v.name, "valueReference": str(reference)}
    role |= {"causality": v.causality, "variability": v.variability}
    role |= {"description": v.description} if v.description else {}
    role |= {"initial": _initial(v)} if v.causality != "input" else {}
    limits = zip(("min", "max"), v.limits or () if v.kind in (float, int) else (), strict=False)
    values = {"declaredType": v.enumeration.name} if v.enumeration else {}
    if v.kind is float and v.unit:
        values["unit"] = v.unit
        values |= {"displayUnit": display[v.unit]} if v.unit in display else {}
    values |= {"relativeQuantity": "true"} if v.relative else {}
    values |= {key: repr(v.kind(limit)) for key, limit in limits if isfinite(limit)}
    values |= {"nominal": repr(v.nominal)} if v.nominal is not None else {}
    if v.start is not None:
        values["start"] = _literal(float(v.start) if v.kind is float else v.start)
    if fmi == 2:
        SubElement(SubElement(parent, "ScalarVariable", role), v.type, values)
    elif v.kind is str:
        SubElement(SubElement(parent, "String", role), "Start", value=values["start"])
    else:
        SubElement(parent, "Enumeration" if v.enumeration else TYPES[v.kind], role | values)


def _initial(v: Variable) -> str:
    if v.causality == "parameter" or v.variability == "constant":
        return "exact"
    return "calculated" if v.start is None else "approx"


def _add_structure(root: Element, variables: Sequence[Variable], fmi: Version) -> None:
    """Add outputs and initial unknowns: FMI 2.0 counts variables from 1, FMI 3.0 refers to them."""
    structure = SubElement(root, "ModelStructure")
    number = {v.name: str(i) for i, v in enumerate(variables, 1 if fmi == 2 else 0)}
    outputs = [v for v in variables if v.causality == "output"]
    directly = [(v.name, v.dependencies) for v in outputs]
    initially = [(v.name, v.initial_dependencies) for v in outputs if _initial(v) != "exact"]
    for section, unknowns in (("Output", directly), ("InitialUnknown", initially)):
        parent, tag, key = structure, section, "valueReference"
        if fmi == 2 and unknowns:
            parent, tag, key = SubElement(structure, f"{section}s"), "Unknown", "index"
        for name, sources in unknowns:
            dependencies = " ".join(number[source] for source in sources)
            SubElement(parent, tag, {key: number[name], "dependencies": dependencies})
