"""Events and faults in the system file: what they mean, and a mistake is one line."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.interface.interface import Interface
from grasp_cosim.interface.variables import Variable
from grasp_cosim.system import parts
from grasp_cosim.system.faults import FAULTS as KINDS
from grasp_cosim.system.faults import RANDOM
from grasp_cosim.system.parts import (
    Component,
    Condition,
    Connection,
    Event,
    Fault,
    Port,
)
from grasp_cosim.system.scenario import event_entry, fault_entry, read_events, read_faults
from hypothesis import given
from hypothesis import strategies as st
from support.marks import examples

QUICK = examples(60)
INTENSITY = Port("controller", "intensity[1]")


def test_an_event_may_come_after_the_end(grasp):
    """So that a shorter run of the same system is no error."""
    event = Event({Port("sensor_1", "reflectance"): 0.5}, at_ns=2_000_000_000)
    assert replace(grasp, events=(event,)).with_experiment(stop=1.0).events == (event,)


def test_another_step_must_suit_the_delays(grasp):
    delayed = replace(grasp, faults=(Fault(INTENSITY, "delay", {"time": 3e-4}),))
    with pytest.raises(InputError, match=r"must be a whole number of steps of 0\.0002 s"):
        delayed.with_experiment(step=2e-4)
    with pytest.raises(InputError, match=r"of 0\.333333333 s; could be 0\.3333333333333333 s$"):
        delayed.with_experiment(step="1/3")
    fitting = replace(delayed.faults[0], parameters={"time": 0.3333333333333333})
    assert replace(grasp.with_experiment(step="1/3"), faults=(fitting,)).total_steps == 9


def test_an_input_without_a_connection_can_be_set(grasp):
    event = Event({Port("sensor_1", "gap"): 0.02}, at_ns=0)
    components = tuple(
        replace(c, values={"gap": 0.1}) if c.name == "sensor_1" else c for c in grasp.components
    )
    connections = tuple(w for w in grasp.connections if w.target != Port("sensor_1", "gap"))
    assert replace(
        grasp, components=components, connections=connections, events=(event,)
    ).events == (event,)


def mock_system(kind, faults):
    """a.y -> b.u of one kind; read_interface is replaced."""
    components = tuple(Component(name, Path(f"{kind}.fmu"), {}) for name in "ab")
    connections = (
        Connection(Port("a", "y"), Port("b", "u")),
        Connection(Port("b", "y"), Port("a", "u")),
    )
    return System("mock.toml", components, connections, 10**6, 10**9, "jacobi", faults=faults)


def mock_interface(path):
    kind = path.stem
    u = Variable("u", kind, "input", 0, None, "0", -math.inf, 5.0, kind)
    y = Variable("y", kind, "output", 1, None, None, -math.inf, math.inf, kind)
    return Interface(path, "", "mock", (u, y))


ANY = {
    "stuck": {},
    "dropout": {"probability": 0.5},
    "bias": {"value": 1.0},
    "noise": {"standard_deviation": 1.0},
    "delay": {"time": 0.001},
    "saturation": {"low": 1.0},
    "quantisation": {"step": 1.0},
}


def test_each_kind_of_fault_is_tried():
    assert ANY.keys() == KINDS.keys()


@pytest.mark.parametrize("fault", ANY)
@pytest.mark.parametrize("kind", ["Real", "Integer", "Boolean"])
def test_numbers_that_are_not_real_can_be_stuck_lost_and_late(monkeypatch, kind, fault):
    monkeypatch.setattr(parts, "read_interface", mock_interface)
    faults = (Fault(Port("b", "u"), fault, ANY[fault]),)
    if kind == "Real" or fault in ("stuck", "dropout", "delay"):
        assert mock_system(kind, faults).faults == faults
    else:
        with pytest.raises(InputError, match=f"b.u is {kind}; must be one of stuck, dropout, del"):
            mock_system(kind, faults)


@pytest.mark.parametrize(
    ("kind", "value", "message"),
    [
        ("Integer", 1.5, r"value: u = 1\.5: must be a whole number"),
        ("Integer", 6, "value: u = 6: must be a whole number from -inf to 5"),
        ("Boolean", 1, "value: u = 1: must be true or false"),
        ("Boolean", True, None),
        ("Integer", 5, None),
    ],
)
def test_a_stuck_value_is_one_that_the_input_takes(monkeypatch, kind, value, message):
    monkeypatch.setattr(parts, "read_interface", mock_interface)
    faults = (Fault(Port("b", "u"), "stuck", {"value": value}),)
    if message is None:
        assert mock_system(kind, faults).faults == faults
    else:
        with pytest.raises(InputError, match=message):
            mock_system(kind, faults)


TIMES = st.integers(0, 10**15)
NUMBERS = st.floats(allow_nan=False, allow_infinity=False)
PORTS = st.sampled_from([Port("plant", "gap[1]"), Port("a", "b.c[2]"), Port("x y", "der(z)")])
CONDITIONS = st.builds(
    Condition,
    PORTS,
    st.sampled_from(parts.RELATIONS),
    st.one_of(NUMBERS, st.booleans()),
)
EVENT_LISTS = st.lists(
    st.builds(
        Event,
        st.dictionaries(PORTS, st.one_of(NUMBERS, st.booleans(), st.text("ab é'\"\n"))),
        st.none() | TIMES,
        st.none() | CONDITIONS,
    )
)
FAULT_LISTS = st.lists(
    st.sampled_from(list(ANY)).flatmap(
        lambda kind: st.builds(
            Fault,
            PORTS,
            st.just(kind),
            st.just(ANY[kind]),
            TIMES,
            st.none() | st.integers(1, 10**15),
            st.integers(0, 2**64) if kind in RANDOM else st.just(0),
            st.none() | CONDITIONS,
        )
    )
)


@QUICK
@given(EVENT_LISTS)
def test_an_entry_of_an_event_reads_as_it_again(events):
    entries = json.loads(json.dumps([event_entry(event) for event in events]))
    read = read_events("run.json", entries)
    assert read == tuple(events)
    assert [event_entry(event) for event in read] == entries  # which tells true from 1


@QUICK
@given(FAULT_LISTS)
def test_an_entry_of_a_fault_reads_as_it_again(faults):
    entries = json.loads(json.dumps([fault_entry(fault) for fault in faults]))
    read = read_faults("run.json", entries, ())
    assert read == tuple(faults)
    assert [fault_entry(fault) for fault in read] == entries
