"""The numbers in the bytes of a state: behind its head, and put there by an FMU that takes them."""

import numpy as np
import pytest
from fmpy.fmi1 import FMICallException
from grasp_cosim.fmi.numbers import state_numbers, take_numbers
from grasp_cosim.fmu_export.slave import HEAD
from grasp_cosim.interface.read import read_interface


class Slave:
    """An instance as FMPy has it, whose only state is these bytes."""

    def __init__(self, content, refuses=""):
        self.content, self.refuses, self.kept = content, refuses, []

    def getFMUState(self):
        self.kept.append(self.content)
        return self.content

    def freeFMUState(self, state):
        self.kept.remove(state)

    def serializeFMUState(self, state):
        return state

    def deserializeFMUState(self, content):
        self._fail("deserialize")
        self.kept.append(content)
        return content

    def setFMUState(self, state):
        self._fail("set")
        self.content = state

    def _fail(self, what):
        if self.refuses == what:
            raise FMICallException(what, 3)


@pytest.fixture
def interface(fmus):
    return read_interface(fmus / "ProximitySensor.fmu")


def state_of(interface, numbers):
    """The head, phase and time, the inputs and parameters, then these numbers."""
    saved = [v for v in interface.variables if v.causality in ("input", "parameter")]
    before = np.arange(2.0 + len(saved), dtype="<f8")
    return bytes(range(HEAD)) + before.tobytes() + np.array(numbers, "<f8").tobytes()


def test_the_numbers_are_those_behind_what_the_host_has_set(interface):
    slave = Slave(state_of(interface, [1.5, -2.0, 1e-300]))
    assert state_numbers(slave, interface).tolist() == [1.5, -2.0, 1e-300]
    assert take_numbers(slave, interface, np.array([3.0, 0.25, -1.0])) is True
    assert slave.content == state_of(interface, [3.0, 0.25, -1.0])
    assert slave.kept == []


def test_numbers_that_are_refused_leave_the_state_as_it_is(interface):
    slave = Slave(state_of(interface, [1.0]), refuses="deserialize")
    assert take_numbers(slave, interface, np.array([0.5])) is False
    assert (slave.content, slave.kept) == (state_of(interface, [1.0]), [])
    slave.refuses = "set"
    with pytest.raises(FMICallException):
        take_numbers(slave, interface, np.array([0.5]))
    assert slave.kept == []
