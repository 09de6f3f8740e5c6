"""The sensor's FMU, of every kind: inf is a gap, -1 is none."""

import sys
from math import inf, nan

import pytest
from fmpy import read_model_description
from grasp_cosim.interface.read import describe
from support.fmi2 import OK, Instance
from support.kinds import all_kinds

pytestmark = all_kinds

NO_GAP = "gap = -1.0 m: must be from -0.005 m on, where the sensing element is; a ray that hit"


def sensor(load, **values):
    return Instance(load("ProximitySensor"), "eye").initialise(**values)


@pytest.mark.parametrize("gap", [inf, sys.float_info.max])
def test_nothing_in_range_is_no_light(load, gap):
    with sensor(load, gap=gap) as eye:
        assert eye.get("gap", "intensity") == [gap, 0.0]
        assert eye.step(0.0, 1e-3) == OK
        saved = eye.state().to_bytes()
        assert eye.set({"gap": 0.01}) == OK
        assert eye.step(1e-3, 1e-3) == OK
        assert eye.get("intensity")[0] > 0.0
        assert eye.set({"gap": gap}) == OK
        assert eye.step(2e-3, 1e-3) == OK
        assert eye.get("intensity") == [0.0]
        status, state = eye.from_bytes(saved)
        assert (status, eye.restore(state)) == (OK, OK)
        assert eye.get("gap", "intensity") == [gap, 0.0]
        assert eye.log == []


def test_a_ray_that_hit_nothing_is_no_touch(load):
    """Neither where the output is asked for, nor in a step; the next gap heals all."""
    with sensor(load, gap=0.02) as eye:
        (before,) = eye.get("intensity")
        assert eye.set({"gap": -1.0}) == OK
        assert eye.get_real([1])[0] == eye.fmu.refused
        assert eye.step(0.0, 1e-3) == eye.fmu.refused
        assert [f"eye, t = 0 s: {NO_GAP}" in said.text for said in eye.log] == [True, True]
        assert eye.set({"gap": 0.02}) == OK
        assert eye.step(0.0, 1e-3) == OK
        assert eye.get("intensity") == [before]


def test_a_gap_that_is_no_number_is_refused_when_it_is_set(load):
    with sensor(load) as eye:
        for gap in (nan, -inf):
            assert eye.set({"gap": gap}) == eye.fmu.refused
            text = f"eye, t = 0 s: gap = {gap} m: must be a finite number, or inf"
            assert text in eye.log.pop().text


def test_the_description_says_which_input_takes_inf(folder_of, kind):
    path = folder_of(kind) / "ProximitySensor.fmu"
    assert [v.name for v in describe(path).variables if v.infinite] == ["gap"]
    assert read_model_description(path).modelName == "ProximitySensor"
    assert not any(v.infinite for v in describe(folder_of(kind) / "GripperPlant.fmu").variables)
