"""Builds the FMU of tests/support/models/state_space.c: arrays, sized by parameters."""

from pathlib import Path

from fmpy.fmi3 import FMU3Slave

from .compiled import pack, shared_library

SOURCE = Path(__file__).parent / "models" / "state_space.c"
TYPES = (
    "Float64",
    "Float32",
    "Int8",
    "UInt8",
    "Int16",
    "UInt16",
    "Int32",
    "UInt32",
    "Int64",
    "UInt64",
    "Boolean",
    "Enumeration",
)
"""The types of the arrays u_T and y_T = u_T, of 2 x k."""

_UNIT = "1 0 0 0 1 0 0 0 1"


def state_space(
    folder, name="ss", types=False, more="", kind="CoSimulation", binary=True, complete=False
):
    """The FMU name.fmu in folder: m inputs u, n states x, r outputs y, 3 of each at the start.

    With types it has u_T and y_T for all types; more are further variables of its description. kind
    is CoSimulation or ModelExchange. One without a binary needs no compiler. With complete, it has
    the functions of other kinds of FMUs, too, without which FMPy does not load it.
    """
    asked = FMU3Slave if complete else None
    library = shared_library(SOURCE, asked=asked) if binary else b""
    description = _description(types, more, kind)
    return pack(folder / f"{name}.fmu", "3.0", "state_space", description, library)


def _variable(kind, name, reference, causality, sizes, start="", own=""):
    """sizes are references of sizes like "2 1", or "=2" for a fixed one."""
    dimensions = "".join(
        f'<Dimension start="{s[1:]}"/>' if s[0] == "=" else f'<Dimension valueReference="{s}"/>'
        for s in sizes.split()
    )
    given = f' start="{start}"' if start else ""
    return (
        f'<{kind} name="{name}" valueReference="{reference}" causality="{causality}"{given}{own}>'
        f"{dimensions}</{kind}>"
    )


def _description(types, more, kind):
    tunable = ' variability="tunable"'
    variables = [
        '<Float64 name="time" valueReference="0" causality="independent"/>',
        *(
            _variable("UInt64", name, reference, "structuralParameter", "", "3", tunable)
            for reference, name in enumerate("mnrk", 1)
        ),
        _variable("Float64", "A", 5, "parameter", "2 2", _UNIT, tunable),
        _variable("Float64", "B", 6, "parameter", "2 1", _UNIT, tunable),
        _variable("Float64", "C", 7, "parameter", "3 2", _UNIT, tunable),
        _variable("Float64", "D", 8, "parameter", "3 1", _UNIT, tunable),
        _variable("Float64", "x0", 9, "parameter", "2", "0", ' variability="fixed"'),
        _variable("Float64", "u", 10, "input", "1", "1 2 3"),
        _variable("Float64", "y", 11, "output", "3"),
        _variable("Float64", "x", 12, "local", "2"),
    ]
    able = ' canHandleVariableCommunicationStepSize="true"' if kind == "CoSimulation" else ""
    outputs = '<Output valueReference="11" dependencies="7 8 10 12"/>'
    for number, of in enumerate(TYPES) if types else ():
        start = "false" if of == "Boolean" else "1" if of == "Enumeration" else "0"
        own = ' variability="discrete"' if "Float" not in of else ""
        own += ' declaredType="Choice"' if of == "Enumeration" else ""
        variables.append(_variable(of, f"u_{of}", 100 + number, "input", "=2 4", start, own))
        variables.append(_variable(of, f"y_{of}", 200 + number, "output", "=2 4", "", own))
        outputs += f'<Output valueReference="{200 + number}" dependencies="{100 + number}"/>'
    return (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="StateSpace" '
        f'instantiationToken="{{state space}}"><{kind} modelIdentifier="state_space"{able}/>'
        "<TypeDefinitions>"
        '<EnumerationType name="Choice"><Item name="slow" value="1"/><Item name="fast" value="2"/>'
        f"</EnumerationType></TypeDefinitions><ModelVariables>{''.join(variables)}{more}"
        f"</ModelVariables><ModelStructure>{outputs}"
        '<InitialUnknown valueReference="11" dependencies="7 8 9 10"/></ModelStructure>'
        "</fmiModelDescription>"
    )
