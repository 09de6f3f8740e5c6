"""An FMU as a host sees it: plain FMPy, values before and after a set."""

import numpy as np
import pytest
from fmpy import simulate_fmu
from grasp_fmus.contract import declared, unpacker
from grasp_fmus.shipped import blocks
from support.fmi2 import OK, Instance
from support.kinds import all_kinds
from support.marks import skip_without_pythonfmu

pytestmark = all_kinds

BLOCKS = blocks()


@pytest.fixture(scope="module")
def of(folder_of, kind):
    """The folder with the FMUs of the kind that the test is run on."""
    return folder_of(kind)


@pytest.mark.parametrize("name", BLOCKS)
def test_runs_in_plain_fmpy(of, name):
    skip_without_pythonfmu()
    result = simulate_fmu(of / f"{name}.fmu", stop_time=0.01, validate=True)
    assert len(result) > 10
    assert all(np.isfinite(result[column]).all() for column in result.dtype.names)


@pytest.mark.parametrize("name", BLOCKS)
def test_start_values_are_those_of_the_block(load, name):
    block = BLOCKS[name]
    with Instance(load(name)) as instance:
        assert (instance.setup(), instance.enter()) == (OK, OK)
        u = block.Inputs()
        y = block.outputs(block.Params(), block.initial_state(block.Params(), u), u)
        values = unpacker(declared(block))(y)
        assert instance.outputs() == [value for value in values if not isinstance(value, bool)]


def test_outputs_agree_with_inputs_in_initialisation_mode(load):
    with Instance(load("ProximitySensor")) as instance:
        assert (instance.setup(), instance.enter()) == (OK, OK)
        for gap, reflectance in ((0.02, 1.0), (0.01, 0.5)):
            assert instance.set({"gap": gap, "reflectance": reflectance}) == OK
            expected = 0.0024 * reflectance / (gap + 0.005) ** 1.1506
            assert instance.get("intensity") == [pytest.approx(expected, rel=1e-14)]


def test_outputs_follow_a_tunable_parameter_at_run_time(load):
    with Instance(load("ProximitySensor")).initialise() as instance:
        assert instance.step(0.0, 1e-3) == OK
        (before,) = instance.get("intensity")
        assert instance.set({"reflectance": 0.25}) == OK
        assert instance.get("intensity") == [0.25 * before]
        assert instance.step(1e-3, 1e-3) == OK
        assert instance.get("intensity") == [0.25 * before]
