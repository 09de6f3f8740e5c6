"""System.natively(): the native twins of the FMUs of a system, with the same bits."""

import logging

import numpy as np
import pytest
from grasp_cosim import InputError, System, grasp_system, simulate
from grasp_cosim.grasp.system import with_controller
from support.marks import needs_compiler
from support.native_systems import write_oscillator

pytestmark = needs_compiler


def natives(system):
    return {c.name for c in system.components if c.native}


def test_it_is_asked_for_anew_as_often_as_one_likes(grasp):
    everything = {"plant", "sensor_1", "sensor_2", "controller"}
    assert natives(grasp) == natives(grasp.natively(False)) == set()
    for native in (None, True):
        assert natives(grasp.natively(native)) == everything
        assert grasp.natively(native).natively(False) == grasp
    assert grasp.natively().natively() == grasp.natively()


def test_what_is_swapped_in_afterwards_runs_as_it_is(grasp):
    adaptive = with_controller(grasp.natively(), "adaptive")
    assert natives(adaptive) == {"plant", "sensor_1", "sensor_2"}
    assert natives(adaptive.natively()) == natives(grasp.natively())


@pytest.mark.parametrize("law", ["published", "adaptive"])
def test_the_built_in_grasp_runs_natively(law):
    native, python = (grasp_system(law, native) for native in (None, False))
    assert natives(native) == {c.name for c in python.components}
    assert natives(python) == set()
    ours, theirs = (simulate(s, step=1e-3, stop=0.2) for s in (native, python))
    assert all(np.array_equal(ours[name], theirs[name]) for name in theirs)


def test_a_system_of_others_is_none_of_our_business(tmp_path, caplog):
    """Its FMUs need no Python."""
    system = System.load(write_oscillator(tmp_path))
    assert system.natively() == system == system.natively(True)
    assert caplog.text == ""


@pytest.mark.usefixtures("no_compiler")
def test_without_a_compiler_they_run_in_python_unless_asked(grasp, caplog):
    assert natives(grasp.natively()) == set()
    ((_, level, said),) = caplog.record_tuples
    assert level == logging.WARNING
    assert said.startswith("FMUs run in Python, which takes longer: no C compiler: must be one of")
    with pytest.raises(InputError, match=r"^native FMUs cannot be built: no C compiler: must"):
        grasp.natively(True)
