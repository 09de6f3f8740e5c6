"""Whole runs in which a native FMU rejects steps, ends early or wants to end."""

import pytest
from fmi.instances import KINDS, real
from grasp_cosim import SimulationError, System, simulate
from grasp_cosim.system.parts import Component
from support.marks import engines
from support.native_fmus import CAPABLE, EARLY, TYPES, build, needs_gcc

pytestmark = needs_gcc
DISCARDED = (
    r"^part: native.fmu returned discard at t = 0.3 s: the step is too long "
    r"\(inputs: u_\w+ = 2, .*\)(\n|$)"
)
both = pytest.mark.parametrize(("version", "isolation"), KINDS)
STARTS = {"Boolean": False, "String": "", "Enumeration": 1}


def alone(folder, version, isolation, **values):
    """A native FMU that integrates 2.0 for a second in steps of 0.1 s."""
    fmu = build(folder, version=version, capabilities=CAPABLE if version == "2.0" else EARLY)
    starts = {f"u_{t}": STARTS.get(t, 0) for t in TYPES[version]}
    given = {**starts, f"u_{real(version)}": 2.0, **values}
    component = Component("part", fmu, given, isolation=isolation)
    connections = ()
    return System("alone", (component,), connections, 100_000_000, 1_000_000_000, "sequential")


@both
@engines
@pytest.mark.parametrize("parameter", ["early_at", "discard_at"])
def test_a_rejected_step_is_taken_in_parts(tmp_path, version, isolation, engine, parameter):
    """The integral of a constant does not depend on how the step is divided."""
    result = simulate(alone(tmp_path, version, isolation, **{parameter: 0.35}), engine=engine)
    assert result.complete
    assert result["part.x"] == pytest.approx(2.0 * result.time, rel=1e-13, abs=1e-15)
    rejection = result.rejections["part"]
    assert (rejection.count, rejection.first) == (1, 0.3)
    assert result["part.steps"][-1] == 11  # of two parts each
    assert result["part.now"][-1] == pytest.approx(1.0, rel=1e-15)


@both
@engines
def test_a_wish_to_end_ends_the_run_in_good_order(tmp_path, version, isolation, engine):
    """The last row is that of the communication point behind it."""
    result = simulate(alone(tmp_path, version, isolation, terminate_at=0.35), engine=engine)
    assert result.complete
    assert result["part.x"] == pytest.approx([0.0, 0.2, 0.4, 0.6, 0.7], rel=1e-13)
    assert result.log[-1] == (
        "part asked for the end of the simulation at t = 0.35 s; its values there are in the last "
        "row, that of t = 0.4 s"
    )
    assert not result.rejections


def test_a_wish_to_end_in_a_part_of_a_step(tmp_path):
    result = simulate(alone(tmp_path, "2.0", "none", early_at=0.32, terminate_at=0.37))
    assert result.complete
    assert result["part.x"][-1] == pytest.approx(0.74, rel=1e-13)
    assert "at t = 0.37 s" in result.log[-1]


@pytest.mark.parametrize("version", ["2.0", "3.0"])
def test_a_step_that_must_not_vary_ends_the_run(tmp_path, version):
    system = alone(tmp_path, version, "none", discard_at=0.35)
    build(tmp_path, version=version, capabilities={})
    with pytest.raises(SimulationError, match=DISCARDED):
        simulate(system)


@both
def test_a_step_that_no_part_of_can_be_taken_ends_the_run(tmp_path, version, isolation):
    """A step is halved at most ten times; so close to its start none of them is short enough."""
    system = alone(tmp_path, version, isolation, discard_at=0.3 + 1e-6)
    with pytest.raises(SimulationError, match=DISCARDED) as caught:
        simulate(system)
    assert len(caught.value.__notes__) == 11
