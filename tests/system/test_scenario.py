"""Events and faults in the system file: what they mean, and a mistake is one line."""

import json
import math
from dataclasses import replace
from pathlib import Path

import pytest
from grasp_cosim import InputError, System
from grasp_cosim.grasp.presets import SYSTEM
from grasp_cosim.interface.interface import Interface, Variable
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
GRASP = SYSTEM.read_text("utf-8")
INTENSITY = Port("controller", "intensity[1]")

EVENTS = """
[[events]]
at = 0.5
set = { "sensor_1.reflectance" = 0.6 }

[[events]]
when = "plant.gap[1] < 0.01"
set = { "sensor_1.reflectance" = 0.4, "sensor_2.reflectance" = 1 }
"""
FAULTS = """
[[faults]]
connection = "sensor_1.intensity -> controller.intensity[1]"
kind = "noise"
standard_deviation = 0.002
from = 0.5
until = 1.0
when = "plant.contact[2] == true"
seed = 1

[[faults]]
connection = "controller.intensity[1]"
kind = "saturation"
high = 0.4
"""


def load(text, fmus, folder):
    path = folder / "system.toml"
    path.write_text(text, encoding="utf-8")
    return System.load(path, fmus)


WRONG_EVENTS = [
    ("at = 0.5", "att = 0.5", r"events\[0\]: unknown entry 'att'; did you mean at"),
    ("at = 0.5", "", r"events\[0\]: must have either at, a time in s, or when, a condition"),
    ("at = 0.5", 'at = 0.5\nwhen = "plant.gap[1] < 1"', "must have either at"),
    ("at = 0.5", "at = -1", r"events\[0\]: at = -1 s: must be a number from 0 to 1e\+09"),
    ("at = 0.5", "at = 'now'", "at = 'now' s: must be a number"),
    ("at = 0.5", "at = 1.5e-9", "must be a whole number of nanoseconds"),
    (
        '"sensor_1.reflectance" = 0.6',
        "",
        r"set is empty; valid: plant\.finger_mass\[1\], plant\.finger_mass\[2\], plant\.fric",
    ),
    ('set = { "sensor_1.reflectance" = 0.6 }', "", r"events\[0\]: set: missing; must be a table"),
    ('"sensor_1.reflectance" = 0.6', "reflectance = 0.6", "must be 'component.variable'"),
    (
        '"sensor_1.reflectance" = 0.6',
        "sensor_1.reflectance = 0.6",
        "must be a number, boolean or string; a name stands in quotes",
    ),
    (
        "sensor_1.reflectance",
        "sensr.reflectance",
        "no component 'sensr'; did you mean sensor_1",
    ),
    (
        "sensor_1.reflectance",
        "sensor_1.reflection",
        r"set\.sensor_1\.reflection: not there; must be a tunable parameter or an input "
        r"without a connection; did you mean sensor_1\.reflectance",
    ),
    (
        "sensor_1.reflectance",
        "plant.object_width",
        "is a fixed parameter; must be a tunable parameter",
    ),
    ("sensor_1.reflectance", "sensor_1.intensity", "is a continuous output; must be a tunable"),
    (
        "sensor_1.reflectance",
        "sensor_1.gap",
        r"set\.sensor_1\.gap: has a connection, from plant\.gap\[1\]; put a fault of kind 'stuck'",
    ),
    ("= 0.6", "= 11", "reflectance = 11: must be a finite number from 0 to 10$"),
    ("= 0.6", "= [0.6]", r"set\.sensor_1\.reflectance = \[0\.6\]: must be a number, boolean or"),
    ("plant.gap[1] < 0.01", "plant.gap[1]", r"events\[1\]: when = 'plant.gap\[1\]': must be like"),
    ("plant.gap[1] < 0.01", "gap < 0.01", "when: 'gap': must be 'component.variable'"),
    ("plant.gap[1] < 0.01", "plant.gap[1] < true", "must be compared with a finite number"),
    ("plant.gap[1] < 0.01", "plant.gap[1] == 0.01", "is Real; must be compared with <, <=, >, >="),
    ("plant.gap[1] < 0.01", "plant.contact[1] > 0", "is Boolean; must be compared with ==, !="),
    ("plant.gap[1] < 0.01", "plant.contact[1] == 1", "must be compared with true or false"),
    (
        "plant.gap[1] < 0.01",
        "plant.force[1] < 1",
        r"numeric output 'force\[1\]'; did you mean con",
    ),
    ("plant.gap[1] < 0.01", "robot.gap[1] < 1", "no component 'robot'; valid: plant"),
    ("[[events]]\nat = 0.5", "[events]\nat = 0.5", r"must be a list of tables, \[\[events\]\]"),
]

WRONG_FAULTS = [
    ('kind = "noise"', 'kind = "hum"', "kind = 'hum': must be one of stuck, dropout, bias, noise"),
    ('kind = "noise"', "kind = ['noise']", r"kind = \['noise'\]: must be one of stuck"),
    (
        "standard_deviation",
        "sigma",
        r"faults\[0\]: unknown entry 'sigma' of noise; valid: standard_deviation, connection, "
        "kind, from, until, when, seed",
    ),
    ("standard_deviation = 0.002", "", "standard_deviation = None: must be a finite number of at"),
    ("= 0.002", "= -1", "standard_deviation = -1: must be a finite number of at least 0"),
    ("from = 0.5", "from = -0.5", r"from = -0.5 s: must be a number from 0 to 1e\+09"),
    ("until = 1.0", "until = 0", "until = 0 s: must be a number greater than 0"),
    ("until = 1.0", "until = 0.5", "from 0.5 s until 0.5 s: must hold a communication point"),
    ("from = 0.5\nuntil = 1.0", "from = 0.11e-3\nuntil = 0.19e-3", "a multiple of 0.0001 s"),
    ("seed = 1", "seed = -1", "seed = -1: must be a whole number, at least 0"),
    (
        "sensor_1.intensity ->",
        "sensor_2.intensity ->",
        r"no such connection; did you mean sensor_2.intensity -> controller.intensity\[2\]",
    ),
    ("sensor_1.intensity ->", "a.b -> c.d ->", "must be 'component.output -> component.input', or"),
    ('"controller.intensity[1]"', "7", r"faults\[1\]: connection = 7: must be"),
    ('"controller.intensity[1]"', '"intensity"', "connection = 'intensity': must be"),
    (
        '"controller.intensity[1]"',
        '"sensor_1.intensity"',
        r"'sensor_1.intensity': no connection ends there; did you mean controller.intensity\[1\]",
    ),
    (
        "contact[2] ==",
        "contact[3] ==",
        r"numeric output 'contact\[3\]'; did you mean contact\[1\]",
    ),
    ("high = 0.4", "", "a saturation must have low, high or both"),
    ("high = 0.4", "high = 0.4\nlow = 0.4", "high = 0.4: must be above low = 0.4"),
    ("high = 0.4", "high = 0.4\nseed = 1", "unknown entry 'seed' of saturation; valid: low, high"),
    ('"saturation"\nhigh = 0.4', '"dropout"\nprobability = 1.1', "must be a number from 0 to 1"),
    ('"saturation"\nhigh = 0.4', '"quantisation"\nstep = 0', "must be a finite number above 0"),
    ('"saturation"\nhigh = 0.4', '"bias"\nvalue = "x"', "value = 'x': must be a finite number"),
    ('"saturation"\nhigh = 0.4', '"delay"\ntime = -1e-3', "must be a number from 0 to 1e"),
    (
        '"saturation"\nhigh = 0.4',
        '"delay"\ntime = 1.23e-3',
        "time = 0.00123 s: must be a whole number of steps of 0.0001 s; could be 0.0012 s",
    ),
    ('"saturation"\nhigh = 0.4', '"stuck"\nvalue = nan', r"value: intensity\[1\] = nan: must be a"),
    (
        '"saturation"\nhigh = 0.4',
        '"stuck"\nhold = 1.0',
        "'hold' of stuck; valid: value, connection",
    ),
]

WRONG_INITIALISATION = [
    ("loop = 'refuse'", "unknown entry 'loop'; did you mean loops"),
    ("loops = 'ignore'", "loops = 'ignore': must be one of iterate, refuse"),
    ("tolerance = 0.0", "tolerance = 0.0: must be a number between 0 and 1"),
    ("iterations = 0", "iterations = 0: must be a whole number, at least 1"),
]


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG_EVENTS)
def test_a_mistake_in_an_event_is_one_line(fmus, tmp_path, right, wrong, message):
    events = EVENTS.split("\n\n")[0] if wrong.split("\n")[0] == "[events]" else EVENTS
    refused(events, right, wrong, message, fmus, tmp_path)


@pytest.mark.parametrize(("right", "wrong", "message"), WRONG_FAULTS)
def test_a_mistake_in_a_fault_is_one_line(fmus, tmp_path, right, wrong, message):
    refused(FAULTS, right, wrong, message, fmus, tmp_path)


@pytest.mark.parametrize(("entry", "message"), WRONG_INITIALISATION)
def test_a_mistake_in_the_initialisation_is_one_line(fmus, tmp_path, entry, message):
    refused("[initialisation]\nX", "X", entry, message, fmus, tmp_path)


def refused(scenario, right, wrong, message, fmus, folder):
    assert right in scenario
    with pytest.raises(InputError, match=message) as caught:
        load(GRASP + scenario.replace(right, wrong, 1), fmus, folder)
    assert str(caught.value).startswith("system.toml: ")
    assert "\n" not in str(caught.value)


def test_an_event_may_come_after_the_end(grasp):
    """So that a shorter run of the same system is no error."""
    event = Event({Port("sensor_1", "reflectance"): 0.5}, at_ns=2_000_000_000)
    assert replace(grasp, events=(event,)).with_experiment(stop=1.0).events == (event,)


def test_another_step_must_suit_the_delays(grasp):
    delayed = replace(grasp, faults=(Fault(INTENSITY, "delay", {"time": 3e-4}),))
    with pytest.raises(InputError, match=r"must be a whole number of steps of 0\.0002 s"):
        delayed.with_experiment(step=2e-4)


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
    kind = path.stem  # type: ignore[assignment]
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


def test_the_readme_has_a_row_for_each_kind_of_fault():
    """A new kind touches faults.py and that row."""
    text = (Path(__file__).parents[2] / "docs/system_files.md").read_text("utf-8")
    table = text.split("| kind | makes of a value | parameters |\n|---|---|---|\n")[1]
    rows = [row.split(" | ") for row in table.split("\n\n")[0].splitlines()]
    assert [row[0].removeprefix("| ") for row in rows] == [*KINDS]
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
