"""Builds the C test FMUs of tests/fmi/native: every scalar type, and failures on demand.

Both versions have inputs u_T and outputs y_T = u_T for each type T of theirs, the outputs x (the
integral of gain * u_Real or u_Float64), now and steps, and the parameters gain and, as times in s
in a step that then goes wrong: crash_at, exit_at, hang_at, error_at, discard_at (no part of the
step is done), early_at, terminate_at (the step ends there) and interrupt_at (SIGINT for the process
whose number is the parameter interrupted).
"""

import shutil
from pathlib import Path

import pytest
from fmpy.fmi3 import FMU3Slave

from .compiled import pack, shared_library

SOURCES = Path(__file__).parents[1] / "fmi" / "native"
needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")

TYPES = {
    "2.0": {"Real": 0, "Integer": 6, "Boolean": 10, "Enumeration": 11, "String": 12},
    "3.0": {
        "Float64": 0,
        "Float32": 1,
        "Int8": 2,
        "UInt8": 3,
        "Int16": 4,
        "UInt16": 5,
        "Int32": 6,
        "UInt32": 7,
        "Int64": 8,
        "UInt64": 9,
        "Boolean": 10,
        "Enumeration": 11,
        "String": 12,
    },
}
"""By version, the types and what is added to 100 (u_T) or 200 (y_T) as value reference."""

PARAMETERS = (
    "crash_at",
    "exit_at",
    "hang_at",
    "error_at",
    "discard_at",
    "early_at",
    "terminate_at",
    "gain",
    "interrupt_at",
    "interrupted",
)
UNITS = {
    "m": 'm="1"',
    "mm": 'm="1" factor="0.001"',
    "N": 'kg="1" m="1" s="-2"',
    "K": 'K="1"',
    "degC": 'K="1" offset="273.15"',
    "degF": 'K="1" factor="0.5555555555555556" offset="255.3722222222222"',
}
"""The units the FMUs define, in SI base units."""

CAPABLE = {"canHandleVariableCommunicationStepSize": "true"}
EARLY = {**CAPABLE, "mightReturnEarlyFromDoStep": "true"}


def build(
    folder,
    name="native",
    version="3.0",
    units=None,
    capabilities=None,
    token="{native}",
    complete=False,
    strings=True,
):
    """The FMU name.fmu in folder; units by variable, capabilities as attributes (else CAPABLE).

    It has outputs that are Strings only with strings.
    It loads with the right token only. With complete, it has the functions of FMI 3.0 for other
    kinds of FMUs, too, without which FMPy does not load it.
    """
    capabilities = CAPABLE if capabilities is None else capabilities
    describe = _description_2 if version == "2.0" else _description_3
    xml = describe(dict(units or {}), dict(capabilities), strings).replace("{native}", token)
    source, asked = SOURCES / f"fmi{version[0]}.c", FMU3Slave if complete else None
    library = shared_library(source, asked=asked)
    return pack(folder / f"{name}.fmu", version, "native", xml, library)


def _attributes(values):
    return "".join(f' {key}="{value}"' for key, value in values.items())


def _unit_definitions():
    units = "".join(f'<Unit name="{n}"><BaseUnit {base}/></Unit>' for n, base in UNITS.items())
    return f'<UnitDefinitions>{units}<Unit name="bare"/></UnitDefinitions>'


def _variables(version, strings):
    """Name, type, value reference, causality and variability."""
    real, whole = ("Real", "Integer") if version == "2.0" else ("Float64", "UInt64")
    rows = []
    for fmi_type, number in TYPES[version].items():
        varies = "continuous" if fmi_type in ("Real", "Float64", "Float32") else "discrete"
        rows.append((f"u_{fmi_type}", fmi_type, 100 + number, "input", varies))
        rows.append((f"y_{fmi_type}", fmi_type, 200 + number, "output", varies))
    for number, name in enumerate(PARAMETERS, 1):
        varies = "tunable" if name == "gain" else "fixed"
        rows.append((name, real, number, "parameter", varies))
    rows += [("x", real, 20, "output", "continuous"), ("now", real, 21, "output", "continuous")]
    rows.append(("steps", whole, 30, "output", "discrete"))
    return [row for row in rows if strings or row[1] != "String" or row[3] != "output"]


def _start(name, fmi_type):
    if name.startswith("u_") or name in PARAMETERS:
        texts = {"Boolean": "false", "String": "", "Enumeration": "1"}
        return texts.get(fmi_type, "1" if name == "gain" else "1e9" if name in PARAMETERS else "0")
    return ""


def _description_2(units, capabilities, strings):
    rows = _variables("2.0", strings)
    index = {name: number for number, (name, *_) in enumerate(rows, 1)}
    variables = ""
    for name, fmi_type, reference, causality, variability in rows:
        values = {"unit": units[name]} if name in units else {}
        if fmi_type == "Enumeration":
            values["declaredType"] = "Choice"
        if causality != "output":
            values["start"] = _start(name, fmi_type)
        variables += (
            f'<ScalarVariable name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{variability}"><{fmi_type}{_attributes(values)}/></ScalarVariable>'
        )
    outputs = initial = ""
    for name, _, _, causality, _ in rows:
        if causality == "output":
            needs = [f"u_{name[2:]}"] if name.startswith("y_") else []
            listed = " ".join(str(index[n]) for n in needs)
            unknown = f'<Unknown index="{index[name]}" dependencies="{listed}"/>'
            outputs, initial = outputs + unknown, initial + unknown
    return (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="2.0" modelName="native" '
        f'guid="{{native}}"><CoSimulation modelIdentifier="native"{_attributes(capabilities)}/>'
        f"{_unit_definitions()}"
        '<TypeDefinitions><SimpleType name="Choice"><Enumeration><Item name="one" value="1"/>'
        '<Item name="two" value="2"/></Enumeration></SimpleType></TypeDefinitions>'
        f"<ModelVariables>{variables}</ModelVariables><ModelStructure><Outputs>{outputs}</Outputs>"
        f"<InitialUnknowns>{initial}</InitialUnknowns></ModelStructure></fmiModelDescription>"
    )


def _description_3(units, capabilities, strings):
    rows = [
        *_variables("3.0", strings),
        ("size", "UInt64", 40, "structuralParameter", "fixed"),
        ("size_out", "UInt64", 41, "output", "discrete"),
    ]
    references = {name: reference for name, _, reference, _, _ in rows}
    variables = ""
    for name, fmi_type, reference, causality, variability in rows:
        values = {"unit": units[name]} if name in units else {}
        if fmi_type == "Enumeration":
            values["declaredType"] = "Choice"
        start = "3" if name == "size" else _start(name, fmi_type)
        child = ""
        if fmi_type == "String" and causality == "input":
            child = f'<Start value="{start}"/>'
        elif causality != "output":
            values["start"] = start
        variables += (
            f'<{fmi_type} name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{variability}"{_attributes(values)}>{child}</{fmi_type}>'
        )
    variables += (
        '<Binary name="u_Binary" valueReference="150" causality="input"><Start value="00"/>'
        "</Binary>"
        '<String name="y_array" valueReference="151" causality="output"><Dimension start="3"/>'
        '</String><Clock name="y_clock" valueReference="152" causality="output" '
        'intervalVariability="triggered"/><Float64 name="time" valueReference="153" '
        'causality="independent" variability="continuous"/>'
    )
    outputs = initial = ""
    for name, _, reference, causality, _ in rows:
        if causality == "output":
            needs = [f"u_{name[2:]}"] if name.startswith("y_") else []
            listed = " ".join(str(references[n]) for n in needs)
            known = f'valueReference="{reference}" dependencies="{listed}"/>'
            outputs, initial = outputs + f"<Output {known}", initial + f"<InitialUnknown {known}"
    outputs += '<Output valueReference="151"/><Output valueReference="152"/>'
    return (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="native" '
        'instantiationToken="{native}">'
        f'<CoSimulation modelIdentifier="native"{_attributes(capabilities)}/>'
        f"{_unit_definitions()}"
        '<TypeDefinitions><EnumerationType name="Choice"><Item name="one" value="1"/>'
        '<Item name="two" value="2"/></EnumerationType></TypeDefinitions>'
        f"<ModelVariables>{variables}</ModelVariables>"
        f"<ModelStructure>{outputs}{initial}</ModelStructure></fmiModelDescription>"
    )
