"""CVode behind our calls: accurate, never beyond its stop, with the errors of its functions."""

from ctypes import c_double

import numpy as np
import pytest
from grasp_cosim.system.parts import Solver
from support.native_fmus import needs_cvode

pytestmark = needs_cvode


def cvode(*arguments):
    from grasp_cosim.fmi.cvode import Cvode  # here, as it may not be there

    return Cvode(*arguments)


class Decay:
    """x' = -x, and an indicator x - 0.5; the latest time and the number of evaluations."""

    def __init__(self):
        self.latest, self.count = 0.0, 0
        self.solver = cvode(1, 1, self.slopes, self.crossings, Solver())
        self.solver.x[0] = 1.0

    def slopes(self, time, states, slopes):
        self.latest, self.count = max(self.latest, time), self.count + 1
        c_double.from_address(slopes).value = -c_double.from_address(states).value
        return 0

    def crossings(self, time, states, values):
        c_double.from_address(values).value = c_double.from_address(states).value - 0.5
        return 0


def test_it_stops_at_a_root_and_at_its_stop():
    decay = Decay()
    decay.solver.restart(0.0)
    time, found = 0.0, False
    while not found:
        time, found = decay.solver.step(1.0)
    assert time == pytest.approx(np.log(2.0), rel=1e-7)
    assert decay.solver.x[0] == pytest.approx(0.5, rel=1e-7)
    while time < 1.0:
        time, _ = decay.solver.step(1.0)
    assert (time, decay.latest) == (1.0, 1.0)
    decay.solver.close()


def test_new_nominal_values_are_kept_to():
    """Against a huge one the state is nothing, and takes few evaluations."""
    counts = []
    for nominal in (1.0, 1e12):
        decay, time = Decay(), 0.0
        decay.solver.restart(0.0, np.array([nominal]))
        while time < 1.0:
            time, _ = decay.solver.step(1.0)
        counts.append(decay.count)
        decay.solver.close()
    assert counts[1] < counts[0] / 2
