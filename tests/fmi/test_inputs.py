"""The inputs that a failure inside an FMU names."""

import math

import pytest
from fmi.instances import KINDS, real
from grasp_cosim import SimulationError, System, simulate
from grasp_cosim.fmi.inputs import Inputs
from grasp_cosim.interface.interface import Variable
from grasp_cosim.system.parts import Component, Connection, Port
from support.marks import engines
from support.native_fmus import TYPES, build, needs_gcc


def variable(name, kind="Real", causality="input", **more):
    given = {"unit": None, "start": None, "minimum": None, "maximum": None, **more}
    return Variable(name, kind, causality, 1, **given)  # type: ignore[arg-type]


def test_an_fmu_without_inputs_names_none():
    assert str(Inputs()) == ""


def test_of_many_those_that_are_out_of_range_come_first():
    inputs = Inputs()
    for i in range(20):
        inputs.set(variable(f"u[{i}]", minimum=0.0), float(i))
    inputs.set(variable("far", minimum=0.0, maximum=1.0), 2.0)
    inputs.set(variable("broken"), math.nan)
    assert str(inputs) == (
        " (inputs: far = 2, broken = nan, u[0] = 0, u[1] = 1, u[2] = 2, u[3] = 3, ... (16 more))"
    )


@needs_gcc
@pytest.mark.parametrize(("version", "isolation"), KINDS)
@engines
def test_a_failing_step_names_what_came_over_its_connections(tmp_path, version, isolation, engine):
    """Under the system's name, after the factor of the connection."""
    u, y = f"u_{real(version)}", f"y_{real(version)}"
    starts = {"Boolean": False, "String": "", "Enumeration": 1}
    others = {f"u_{t}": starts.get(t, 0) for t in list(TYPES[version])[1:]}
    fmu = build(tmp_path, version=version, units={u: "mm", y: "m"})
    system = System(
        "two",
        (
            Component("first", fmu, {u: 1.5, **others}),
            Component("second", fmu, {"error_at": 1.05, **others}, {"width": u}, None, isolation),
        ),
        (Connection(Port("first", y), Port("second", "width")),),
        100_000_000,
        2_000_000_000,
        "sequential",
    )
    with pytest.raises(SimulationError) as caught:
        simulate(system, engine=engine)  # type: ignore[arg-type]
    head, _, inputs = str(caught.value).partition(" (inputs: ")
    assert head.startswith("second: native.fmu returned error at t = 1 s")
    assert inputs.startswith("width = 1500 mm, u_")
