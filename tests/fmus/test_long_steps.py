"""A step that would need more sub-steps than a block takes is discarded at once, with a reason."""

import re
import sys
from ctypes import byref, c_int
from types import SimpleNamespace

import pytest
from conftest import Load
from grasp_fmus.contract import Bound, bound
from hypothesis import given
from hypothesis import strategies as st
from support.fmi2 import DISCARD, OK, Instance
from support.kinds import all_kinds

pytestmark = all_kinds

ELECTRONICS: dict[str, float] = {
    "noise.enabled": True,
    "filter.enabled": True,
    "median.enabled": True,
}
CLOSED = {"initial_position[1]": 0.0651, "initial_position[2]": -0.0051}
STARTS: dict[str, dict[str, float]] = {
    "GripperPlant": CLOSED,
    "GripperPlantCompliant": CLOSED,
    "GripperPlantMovable": CLOSED,
    "GripperPlantMuJoCo": {},
    "ProximitySensor": ELECTRONICS,
}
"""The fingers begin at the object, and the sensor samples."""

TERMINATED = 3
"""Of fmi2StatusKind."""

REASON = r"step of \S+ s: needs \S+ sub-steps, more than \d+; must be at most (\S+) s$"


@pytest.mark.parametrize("size", [1e3, 1e300, sys.float_info.max])
@pytest.mark.parametrize("name", STARTS)
def test_a_step_that_is_too_long_is_discarded(load: Load, name: str, size: float) -> None:
    """The instance stays as it is, and takes the step that the log says it would take."""
    with Instance(load(name)).initialise(**STARTS[name]) as instance:
        if "force[1]" in instance.fmu.references:
            assert instance.set({"force[1]": -3.0, "force[2]": 3.0}) == OK
        assert instance.step(0.0, 1e-3) == OK
        before = instance.outputs(), instance.state().to_bytes()
        assert instance.step(1e-3, size) == DISCARD
        found = re.search(REASON, instance.log[-1].text)
        assert found
        assert (instance.outputs(), instance.state().to_bytes()) == before
        ends = c_int(-1)
        assert instance.call("GetBooleanStatus", TERMINATED, byref(ends)) == OK
        assert not ends.value  # it is the step that is wrong, not the time to end
        if name != "GripperPlantMuJoCo":  # its fingers would go too far within a timestep
            longest = float(found[1])
            assert instance.step(1e-3, 1.01 * longest) == DISCARD
            assert instance.step(1e-3, longest) == OK
        else:
            assert instance.step(1e-3, 1e-3) == OK


@pytest.mark.parametrize("name", ["GraspController", "GraspControllerAdaptive", "ProximitySensor"])
def test_a_block_without_sub_steps_takes_any_step(load: Load, name: str) -> None:
    with Instance(load(name)).initialise() as instance:
        assert instance.step(0.0, 1e300) == OK


@given(rate=st.floats(1e-6, 1e9), most=st.integers(1, 10**6), times=st.floats(1.02, 1e200))
def test_the_longest_step_is_said_to_three_digits_and_fits(
    rate: float, most: int, times: float
) -> None:
    limit = Bound(lambda p, x, u, h: h * rate, most)
    h = times * most / rate
    said = re.search(r"at most (\S+) s$", limit.excess(None, None, None, h))
    assert said
    assert float(said[1]) == pytest.approx(most / rate, rel=1.1e-2)
    assert float(said[1]) * rate <= most * (1.0 + 1e-8)


def test_a_state_that_fits_no_step_names_none() -> None:
    limit = Bound(lambda *_: float("nan"), 10)
    assert limit.excess(None, None, None, 1.0) == "needs nan sub-steps, more than 10"


@pytest.mark.parametrize(
    "declared",
    [
        {"substeps": lambda p, x, u, h: h},
        {"MOST_SUBSTEPS": 10},
        {"substeps": 3, "MOST_SUBSTEPS": 10},
        {"substeps": lambda p, x, u, h: h, "MOST_SUBSTEPS": 0},
        {"substeps": lambda p, x, u, h: h, "MOST_SUBSTEPS": "many"},
    ],
)
def test_half_a_bound_is_refused(declared: dict[str, object]) -> None:
    with pytest.raises(TypeError, match="must be both there"):
        bound(SimpleNamespace(**declared))


def test_a_block_may_have_no_bound() -> None:
    assert bound(SimpleNamespace()) is None
