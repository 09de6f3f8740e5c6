"""Builds the gripper plant of another vendor: native, in mm and mN, with names of its own."""

import tempfile
from pathlib import Path

from fmpy.fmi3 import FMU3Slave
from grasp_cosim import cli

from .compiled import pack, shared_library

SOURCE = Path(__file__).with_name("vendor.c")
FLOATS = {
    "ForceRight": (1, "input", 'unit="mN" start="0"'),
    "ForceLeft": (2, "input", 'unit="mN" start="0"'),
    "Brake": (3, "input", 'start="0" description="share of the force that is lost"'),
    "Gaps": (10, "output", 'unit="mm"'),
    "Fingers.Right.Position": (11, "output", 'unit="mm"'),
    "Fingers.Left.Position": (12, "output", 'unit="mm"'),
    "SpeedRight": (13, "output", ""),
    "SpeedLeft": (14, "output", ""),
    "LoadRight": (15, "output", 'unit="mN"'),
    "LoadLeft": (16, "output", 'unit="mN"'),
    "PartPosition": (17, "output", 'unit="mm"'),
    "PartStart": (30, "parameter", 'unit="mm" start="30"'),
}
"""By name the value reference, the causality and more attributes."""

TOUCH = {"TouchRight": 20, "TouchLeft": 21}
DIMENSION = '<Dimension start="2"/>'
UNITS = {"mm": 'm="1"', "mN": 'kg="1" m="1" s="-2"'}


def vendor_plant(path):
    """Build it as an FMU at path, with gcc."""
    with tempfile.TemporaryDirectory() as folder:
        assert cli.main(["build", "--native", "--c-only", folder, "GripperPlant"]) == 0
        ours = Path(folder, "GripperPlant.c")
        library = shared_library(SOURCE, ours, options=(f"-I{folder}", "-lm"), asked=FMU3Slave)
    return pack(path, "3.0", "vendor", description(), library)


def description():
    """Its model description."""
    units = "".join(
        f'<Unit name="{name}"><BaseUnit {base} factor="0.001"/></Unit>'
        for name, base in UNITS.items()
    )
    variables = (
        '<Float64 name="time" valueReference="0" causality="independent"/>'
        + "".join(
            f'<Float64 name="{name}" valueReference="{reference}" causality="{causality}" '
            f'variability="{"fixed" if causality == "parameter" else "continuous"}" {more}>'
            f"{DIMENSION if name == 'Gaps' else ''}</Float64>"
            for name, (reference, causality, more) in FLOATS.items()
        )
        + "".join(
            f'<Boolean name="{name}" valueReference="{reference}" causality="output" '
            'variability="discrete"/>'
            for name, reference in TOUCH.items()
        )
    )
    outputs = [r for r, causality, _ in FLOATS.values() if causality == "output"]
    known = "".join(
        f'<{kind} valueReference="{reference}" dependencies=""/>'
        for kind in ("Output", "InitialUnknown")
        for reference in (*outputs, *TOUCH.values())
    )
    return (
        '<?xml version="1.0"?><fmiModelDescription fmiVersion="3.0" modelName="vendor" '
        'instantiationToken="{vendor}"><CoSimulation modelIdentifier="vendor" '
        'canHandleVariableCommunicationStepSize="true"/>'
        f'<UnitDefinitions>{units}</UnitDefinitions><DefaultExperiment stopTime="3" '
        f'stepSize="0.001"/><ModelVariables>{variables}</ModelVariables>'
        f"<ModelStructure>{known}</ModelStructure></fmiModelDescription>"
    )
