"""Events and faults at communication points, with components that only note what they are given."""

import math
from pathlib import Path

import numpy as np
import pytest
from grasp_cosim import InputError, SimulationError, System
from grasp_cosim.interface.interface import Interface
from grasp_cosim.interface.variables import Variable
from grasp_cosim.master.scenario import Scenario
from grasp_cosim.system import parts
from grasp_cosim.system.parts import Component, Condition, Connection, Event, Fault, Port

STEP = 100_000_000
"""ns"""


def interface(path):
    """Outputs y and on, a connected input u, a free one v, tunable parameters p, n and label."""
    outputs = [("y", "Real"), ("on", "Boolean")]
    parameters = [("p", "Real"), ("n", "Integer"), ("label", "String")]
    variables = [
        *((name, kind, "output", "continuous") for name, kind in outputs),
        *((name, "Real", "input", "continuous") for name in "uv"),
        *((name, kind, "parameter", "tunable") for name, kind in parameters),
    ]
    made = (
        Variable(name, kind, causality, k, None, None, -math.inf, math.inf, kind, variability)
        for k, (name, kind, causality, variability) in enumerate(variables)
    )
    return Interface(path, "", "mock", tuple(made))


@pytest.fixture(autouse=True)
def _no_files(monkeypatch):
    monkeypatch.setattr(parts, "read_interface", interface)


class Mock:
    """A component that notes what is set."""

    def __init__(self, name):
        self.name = name
        self.interface = interface(Path("mock.fmu"))
        self.given = []

    def set(self, variables, values):
        for variable, value in zip(variables, values, strict=True):
            if value == -1.0:
                raise SimulationError(f"{self.name}: {variable.name}")
            self.given.append((variable.name, value))


class Rig:
    """A scenario of components a, b and slow, which steps every third base step."""

    def __init__(self, events=(), faults=()):
        names = ("a", "b", "slow")
        system = System(
            "mock.toml",
            tuple(
                Component(n, Path("m.fmu"), {"v": 0.0}, step_ns=3 * STEP if n == "slow" else None)
                for n in names
            ),
            tuple(Connection(Port("a", "y"), Port(n, "u")) for n in names),
            STEP,
            30 * STEP,
            "sequential",
            tuple(events),
            tuple(faults),
        )
        self.mocks = {name: Mock(name) for name in names}
        self.values = np.zeros(2)
        self.scenario = Scenario(
            system,
            [*self.mocks.values()],
            {Port("a", "y"): 0, Port("a", "on"): 1},
            self.values,
        )

    def run(self, steps, y=()):
        """Ask before every step; y are the values of a.y and a.on. The log."""
        for step in range(steps):
            self.values[:] = y[step] if step < len(y) else 0.0
            self.scenario.before_step(step)
        return self.scenario.log


def at(seconds, **values):
    """Sets a's variables at a time."""
    settings = {Port("a", name): value for name, value in values.items()}
    return Event(settings, at_ns=round(seconds * 1e9))


def when(relation, value, port="y", **values):
    settings = {Port("a", name): value for name, value in values.items()}
    return Event(settings, when=Condition(Port("a", port), relation, value))


def slow(seconds=None, **moment):
    at_ns = None if seconds is None else round(seconds * 1e9)
    return Event({Port("slow", "p"): 1.0}, at_ns=at_ns, **moment)


LATE = Condition(Port("a", "y"), ">", 0.5)


@pytest.mark.parametrize(
    ("events", "y", "log"),
    [
        ([at(0.5, p=0.6)], [], ["0.5 s: a.p = 0.6"]),
        (
            [at(0.2, p=1.0), at(0.1, p=2.0, v=3.0), at(0.2, p=4.0)],  # of one time as in the file
            [],
            ["0.1 s: a.p = 2.0", "0.1 s: a.v = 3.0", "0.2 s: a.p = 1.0", "0.2 s: a.p = 4.0"],
        ),
        ([at(0.41, p=1.0)], [], ["0.5 s: a.p = 1.0"]),  # at the first point at or after its time
        ([at(0.500000001, p=1.0)], [], ["0.6 s: a.p = 1.0"]),
        ([when("<", 0.01, p=1.0)], [1, 0.5, 0.01, 0.005], ["0.3 s: a.p = 1.0 (a.y < 0.01)"]),
        ([when("<=", 1.0, p=1.0)], [1.5, 1.0], ["0.1 s: a.p = 1.0 (a.y <= 1.0)"]),
        ([when(">", 1.0, p=1.0)], [0.5, 1.0, 1.5], ["0.2 s: a.p = 1.0 (a.y > 1.0)"]),
        ([when(">=", 1.0, p=1.0)], [0.5, 1.0], ["0.1 s: a.p = 1.0 (a.y >= 1.0)"]),
        ([when("==", True, "on", p=1.0)], [0, 1], ["0.1 s: a.p = 1.0 (a.on == true)"]),
        ([when("!=", True, "on", p=1.0)], [1, 0], ["0.1 s: a.p = 1.0 (a.on != true)"]),
        # a slow component is set at its own points: in between it stands elsewhere in time
        ([slow(0.0)], [], ["0 s: slow.p = 1.0"]),
        ([slow(0.1)], [], ["0.3 s: slow.p = 1.0"]),
        ([slow(0.3)], [], ["0.3 s: slow.p = 1.0"]),
        ([slow(when=LATE)], [0, 1, 0, 0], []),
        ([slow(when=LATE)], [0, 1, 1, 1], ["0.3 s: slow.p = 1.0 (a.y > 0.5)"]),
    ],
)
def test_each_event_happens_once_and_is_logged(events, y, log):
    rig = Rig(events)
    assert rig.run(8, y) == [f"t = {line}" for line in log]
    given = [float(line.split(" = ")[1].split()[0]) for line in log]
    assert [value for mock in rig.mocks.values() for _, value in mock.given] == given


def test_values_arrive_in_the_declared_type():
    rig = Rig([at(0.0, p=1, n=2.0, label="x")])
    rig.run(1)
    assert repr(rig.mocks["a"].given) == "[('p', 1.0), ('n', 2), ('label', 'x')]"


def test_a_refusal_ends_the_run():
    with pytest.raises(SimulationError, match="a: p"):
        Rig([at(0.1, p=-1.0)]).run(2)


@pytest.mark.parametrize(
    ("y", "first"),
    [
        ([0, 0, 0, 1, 0], 3),
        ([1, 0, 0, 0, 0, 1], 5),  # the condition counts in the window only
        ([0, 0, 1, 0], 2),
        ([0, 0, 0, 0, 0, 0, 0, 1], 7),  # behind its window
    ],
)
def test_a_condition_begins_a_fault_within_its_window(y, first):
    condition = Condition(Port("a", "y"), ">", 0.5)
    fault = Fault(Port("b", "u"), "bias", {"value": 1.0}, 2 * STEP, 7 * STEP, when=condition)
    rig = Rig(faults=[fault])
    function = rig.scenario.fault_functions[Port("b", "u")]
    shifts = [function(0.0, -1)]
    for step in range(10):
        rig.values[0] = y[step] if step < len(y) else 0.0
        rig.scenario.before_step(step)
        shifts.append(function(0.0, step))
    assert [step for step, shift in enumerate(shifts, -1) if shift] == list(range(first, 7))
    said = [f"t = 0.{first} s: b.u: bias begins", "t = 0.7 s: b.u: bias ends"]
    assert rig.scenario.log == (said if first < 7 else [])
    assert len(rig.scenario.pending()) == (first == 7)


def test_what_did_not_happen_is_said():
    rig = Rig([at(0.1, p=1.0), at(5.0, p=2.0), when("<", -1.0, p=3.0)])
    rig.run(8)
    assert rig.scenario.pending() == [
        "events[1] did not happen: no step began at or after t = 5 s",
        "events[2] did not happen: a.y < -1.0 never held",
    ]


@pytest.mark.parametrize(
    ("name", "value", "message"),
    [
        ("a.u", 1.0, r"^set: a\.u: is an input with a connection: a fault on 'a\.y -> a\.u' of"),
        ("a.w", 1.0, r"^set: a\.w: .* has no variable 'w'; what can be set in a run is an input "),
        ("c.p", 1.0, r"^set: c\.p: no component 'c'; valid: a, b, slow$"),
        ("p", 1.0, r"^set: p: no component 'p'"),
        ("a.p", "1", r"^set: a\.p: p = '1': must be a finite number"),
    ],
)
def test_what_cannot_be_set_by_hand(name, value, message):
    rig = Rig()
    with pytest.raises(InputError, match=message):
        rig.scenario.set({name: value}, 0)
    assert not rig.mocks["a"].given
