"""A grasp that is run no longer than it takes."""

import signal

import pytest
from grasp_cosim import simulate
from grasp_cosim.grasp.published.compared import LOOK, close
from grasp_cosim.master.simulation import Session

STEP = 2e-3
CASE_0 = {
    "controller.simultaneous_contact.enabled": False,
    "controller.impact_reduction.enabled": False,
}
"""Both fingers touch within 0.26 s."""


@pytest.fixture
def quick(grasp):
    return grasp.with_values(CASE_0).with_experiment(step=STEP, stop=1.0)


def test_it_ends_once_both_fingers_touch_and_is_the_same_until_then(quick):
    short, whole = close(quick, after=0.0), simulate(quick)
    second = max(whole.metrics["time_to_contact"])
    assert second <= short.time[-1] <= second + LOOK + STEP
    for name, column in short.items():
        assert column.tobytes() == whole[name][: len(column)].tobytes(), name
    assert short.metrics["time_to_contact"] == whole.metrics["time_to_contact"]


def test_it_goes_on_for_a_while(quick):
    second = max(simulate(quick).metrics["time_to_contact"])
    assert close(quick, after=0.3).time[-1] == pytest.approx(second + 0.3, abs=2.0 * LOOK)


def test_it_ends_at_the_stop_time_at_the_latest(quick):
    assert close(quick, after=9.0).time[-1] == 1.0
    assert close(quick.with_experiment(stop=0.1), after=0.0).time[-1] == 0.1


@pytest.mark.usefixtures("ctrl_c")
def test_ctrl_c_ends_it_between_two_steps(quick, monkeypatch):
    step = Session.step
    taken = []

    def interrupted(self, steps=1):
        signal.raise_signal(signal.SIGINT)
        taken.append(step(self, steps))
        return taken[-1]

    monkeypatch.setattr(Session, "step", interrupted)
    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        close(quick, after=0.0)
    assert taken == [True]
    assert signal.getsignal(signal.SIGINT) is handler
