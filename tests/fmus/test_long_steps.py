"""A step that is longer than a block takes is discarded at once, with the reason."""

from ctypes import byref, c_int
from math import inf
from types import SimpleNamespace

import pytest
from grasp_fmus.contract import longest_step
from support.fmi2 import OK, Instance
from support.kinds import all_kinds

pytestmark = all_kinds

LONGEST = {
    "GripperPlant": 2.0,
    "GripperPlantCompliant": 2.0,
    "GripperPlantMovable": 2.0,
    "ProximitySensor": 2.0,
}

TERMINATED = 3
"""Of fmi2StatusKind."""


@pytest.mark.parametrize("name", LONGEST)
def test_a_step_that_is_too_long_is_discarded(load, name):
    """The instance stays as it is, and takes the step that the log says it would take."""
    longest = LONGEST[name]
    with Instance(load(name)).initialise() as instance:
        assert instance.step(0.0, 1e-3) == OK
        before = instance.outputs(), instance.state().to_bytes()
        assert instance.step(1e-3, 2.0 * longest) == instance.fmu.discarded
        said = f"step of {2.0 * longest} s: must be at most {longest:g} s"
        assert instance.log[-1].text == f"instance, t = 0.001 s: {said}"
        assert (instance.outputs(), instance.state().to_bytes()) == before
        ends = c_int(-1)
        assert instance.call("GetBooleanStatus", TERMINATED, byref(ends)) == OK
        assert not ends.value  # it is the step that is wrong, not the time to end
        assert instance.step(1e-3, longest) == OK


@pytest.mark.parametrize("name", ["GraspController", "GraspControllerAdaptive"])
def test_a_block_without_sub_steps_takes_any_step(load, name):
    with Instance(load(name)).initialise() as instance:
        assert instance.step(0.0, 1e300) == OK


STIFF = {
    "GripperPlant": {"baumgarte_alpha": 1e5},
    "GripperPlantCompliant": {"kelvin_voigt.damping": 1e5},
    "GripperPlantMovable": {"kelvin_voigt.damping": 1e5},
}


@pytest.mark.parametrize("name", STIFF)
def test_a_step_with_too_many_sub_steps_is_discarded(load, name):
    """They would be over 20,000; the instance takes a shorter one."""
    closed = {"initial_position[1]": 0.0651, "initial_position[2]": -0.0051}
    with Instance(load(name)).initialise(**closed, **STIFF[name]) as instance:
        assert instance.set({"force[1]": -3.0, "force[2]": 3.0}) == OK
        assert instance.step(0.0, 1.0) == instance.fmu.discarded
        assert "step of 1.0 s: position[1] = nan m" in instance.log[-1].text
        assert instance.log[-1].text.endswith("must be finite")
        assert instance.step(0.0, 1e-5) == OK


@pytest.mark.parametrize(("declared", "longest"), [({}, inf), ({"LONGEST_STEP": 2}, 2.0)])
def test_the_longest_step_of_a_block(declared, longest):
    assert longest_step(SimpleNamespace(**declared)) == longest


@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), "10", True, None])
def test_a_longest_step_is_a_positive_number(value):
    with pytest.raises(TypeError, match=r"^LONGEST_STEP = .*: must be a positive number, in s$"):
        longest_step(SimpleNamespace(LONGEST_STEP=value))
