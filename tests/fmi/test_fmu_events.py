"""Events settle, and come to rest, or end the run; without any FMU."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from grasp_cosim import SimulationError
from grasp_cosim.base.calls import Call
from grasp_cosim.fmi.events import MAX_DENSE_EVENTS, MAX_UPDATES, ConnectedInputs, Events


def refuse(what, time, must=""):
    return SimulationError(f"a.fmu {what} at t = {time:g} s{must}")


def clocks(*ticks):
    """Clocks that tick as listed, then no more; what they are told is in calls."""
    coming, calls = iter(ticks), []
    return SimpleNamespace(
        calls=calls,
        begin=lambda time: calls.append(time),
        tick=lambda: next(coming, ()),
        schedule=lambda ticked: calls.append(ticked),
    )


def updates(*answers):
    """An update of the discrete states that answers as listed."""
    coming = iter(answers)
    return lambda: next(coming)


REST = (False, False, False, False, False, 0.0)
AGAIN = (True, False, True, False, False, 0.0)
NEXT = (False, False, False, False, True, 2.5)
END = (False, True, False, False, False, 0.0)


@pytest.mark.parametrize(
    ("answers", "settled"),
    [
        ([REST], (False, False, math.inf)),
        ([AGAIN, NEXT], (False, True, 2.5)),
        ([AGAIN, END], (True, True, math.inf)),
    ],
)
def test_it_settles_or_ends(answers, settled):
    events = Events(clocks(), refuse)
    assert events.settle(1.0, updates(*answers), lambda _: None) == settled


def test_inputs_arrive_with_each_tick_and_its_clock_is_scheduled():
    ticking, arrived = clocks([1], [2], []), []
    Events(ticking, refuse).settle(1.0, updates(REST, REST), arrived.append)
    assert arrived == [[1], [2], []]
    assert ticking.calls == [1.0, [1], [2]]


def test_what_does_not_settle_ends_the_run():
    with pytest.raises(SimulationError, match=f"does not settle an event in {MAX_UPDATES} iter"):
        Events(clocks(), refuse).settle(0.1, lambda: AGAIN, lambda _: None)
    with pytest.raises(SimulationError, match="names nan as the time of its next event"):
        Events(clocks(), refuse).settle(0.1, updates((*NEXT[:5], math.nan)), lambda _: None)


def test_events_that_come_one_upon_another_end_the_run():
    events, apart = Events(clocks(), refuse), Events(clocks(), refuse)
    for k in range(MAX_DENSE_EVENTS):
        events.count(0.25 * k, 0.25, 1.0)
        apart.count(0.5 * k, 0.25, 1.0)
    apart.count(0.5 * MAX_DENSE_EVENTS, 0.25, 1.0)
    message = r"next at t = 300 s\) at t = 250 s; must have .* or have a shorter step than 1 s$"
    with pytest.raises(SimulationError, match=message):
        events.count(0.25 * MAX_DENSE_EVENTS, 0.25, 1.0, 300.0)


def test_inputs_are_passed_on_once_for_each_change():
    data, calls = np.zeros(2), []
    inputs = ConnectedInputs(data, Call(lambda: calls.append([*data]) or 0))
    assert inputs.changed()
    assert inputs.pass_on() == 0
    assert not inputs.changed()
    data[1] = 3.0
    assert inputs.changed()
    inputs.pass_on()
    assert calls == [[0.0, 0.0], [0.0, 3.0]]
