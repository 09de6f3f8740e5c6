"""The FMU behind a server: which steps it makes, what its status means, what is safe for it."""

import pytest
from comparison.made import write_fmu
from grasp_cosim import InputError, SimulationError
from grasp_cosim.hil.driven_fmu import DrivenFmu
from grasp_cosim.hil.proxy_of_fmu import link_signature, read_limits
from grasp_cosim.hil.served import ServedFmu, Service
from grasp_cosim.interface.read import read_interface
from support.mocks import Mock
from support.proxies import HandProxy

MS = 1_000_000


@pytest.fixture
def mock(tmp_path, monkeypatch):
    """What is loaded in the place of an FMU: y is the time, or u where that is asked for."""
    mocks = []

    def make(output=lambda u, t: t, **more):
        mocks.append(Mock(tmp_path, "mock", output, **more))
        monkeypatch.setattr("grasp_cosim.hil.driven_fmu.load_here", lambda *_, **__: mocks[-1])
        return mocks[-1]

    return make


def driven(mock, u=0.0, p=1.0):
    fmu = DrivenFmu(mock.interface, link_signature(mock.interface)[0])
    fmu.initialise(0.0, [u, p], fresh=True)
    return fmu


def steps(mock):
    return [tuple(map(float, c.split()[1:])) for c in mock.calls if c.startswith("step ")]


@pytest.mark.parametrize("call", ["step", "send", "receive"])
@pytest.mark.parametrize(("status", "goes_on"), [(0, True), (1, True), (3, False), (4, False)])
def test_a_warning_lets_it_go_on_and_an_error_does_not(mock, call, status, goes_on):
    instance = mock()
    fmu = driven(instance)
    fmu.set([0.0, 1.0])
    instance.statuses[call] = status

    def go_on():
        fmu.step(0.0, 0.1, [0.5, 1.0])
        return fmu.outputs()

    if goes_on:
        assert go_on() == [pytest.approx(0.1)]
        assert fmu.time == pytest.approx(0.1)
    else:
        with pytest.raises(SimulationError, match=f"mock: status {status}"):
            go_on()


@pytest.mark.parametrize(
    ("time", "expected"),
    [
        (0.1, [(0.1, 0.1)]),
        (0.3, [(0.1, 0.1), (0.2, 0.1), (0.3, 0.1)]),
        (0.2, [(0.1, 0.1), (0.2, 0.1)]),
        (0.25, [(0.1, 0.1), (0.2, 0.05), (0.25, 0.1)]),
        (0.1 + 1e-10, [(0.1 + 1e-10, 0.1)]),
        (0.20001, [(0.1, 0.10001), (0.20001, 0.1)]),
    ],
)
def test_steps_that_were_lost_are_made_up_for(mock, time, expected):
    instance = mock()
    fmu = driven(instance)
    fmu.step(0.0, 0.1, [0.0, 1.0])
    assert steps(instance) == [(0.0, 0.1)]
    fmu.step(time, 0.1, [0.0, 1.0])
    assert steps(instance)[1:] == [pytest.approx(step) for step in expected]
    assert fmu.time == time + 0.1


@pytest.mark.parametrize("time", [0.0, 0.05, 1e5, float("inf")])
def test_a_step_from_before_or_far_ahead_is_refused(mock, time):
    instance = mock()
    fmu = driven(instance)
    fmu.step(0.0, 0.1, [0.0, 1.0])
    must = r"mock\.fmu: step from .* s: must be from 0\.1 s, or at most 100000 steps later"
    with pytest.raises(SimulationError, match=must):
        fmu.step(time, 0.1, [0.0, 1.0])
    assert len(steps(instance)) == 1


def test_parameters_are_set_where_they_change_and_inputs_at_each_step(mock):
    instance = mock(lambda u, t: u)
    fmu = driven(instance, u=0.5)
    assert fmu.outputs() == [0.5]
    for u, p in ((1.0, 1.0), (2.0, 3.0), (2.0, 3.0)):
        fmu.step(fmu.time, 0.1, [u, p])
        assert (instance.u, instance.p, fmu.outputs()) == (u, p, [u])
    assert instance.calls.count("exit") == 1
    # an input at each of 3 steps by a bound call, and the parameter once
    assert instance.calls.count("send") == 4
    fmu.close()
    assert instance.calls[-1] == "close"
    with pytest.raises(SimulationError, match=r"mock\.fmu: stepped before it was initialised"):
        fmu.outputs()


@pytest.mark.parametrize(
    ("kind", "declared", "failsafe", "expected"),
    [
        ("Real", "", {}, 0.0),
        ("Integer", "", {}, 0.0),
        ("Boolean", "", {}, 0.0),
        ("Real", 'start="0.25"', {}, 0.25),
        ("Integer", 'start="3"', {}, 3.0),
        ("Boolean", 'start="true"', {}, 1.0),
        ("Real", 'start="0.25"', {"u": 0.5}, 0.5),
        ("Integer", "", {"u": "7"}, 7.0),
    ],
)
def test_what_is_safe_is_what_is_said_or_the_start_value_or_zero(
    mock, tmp_path, kind, declared, failsafe, expected
):
    variability = "continuous" if kind == "Real" else "discrete"
    variables = {
        "u": f'causality="input" variability="{variability}" | {kind} {declared}',
        "y": 'causality="output" | Real',
        "p": 'causality="parameter" variability="tunable" | Real start="1"',
    }
    interface = read_interface(write_fmu(tmp_path / "made.fmu", variables, {}))
    instance = mock(kind=kind)
    served = ServedFmu(interface, Service(watchdog_ns=50 * MS, failsafe=failsafe), lambda _: None)
    now = 1000 * MS
    proxy = HandProxy(link_signature(interface)[0], lambda d: served.answer(d, "test", now))
    away = {"Real": 9.0, "Integer": 9, "Boolean": not expected}[kind]
    proxy.begin(1, [away, 1.0])
    proxy.step(0.0, 1e-3, [away, 1.0])
    assert instance.u == float(away)
    now += 49 * MS
    served.look(now)
    assert instance.u == float(away)
    now += 2 * MS
    served.look(now)
    assert instance.u == expected
    served.close()


def test_what_cannot_be_safe_is_refused(mock, tmp_path):
    interface = read_interface(write_fmu(tmp_path / "plant.fmu"))
    mock()
    with pytest.raises(InputError, match=r"^failsafe forse: no such input of plant\.fmu; did you"):
        ServedFmu(interface, Service(failsafe={"forse": 1.0}), lambda _: None)


@pytest.mark.parametrize("name", ["touching", "name", "width", "gab", ""])
def test_only_real_inputs_and_outputs_have_limits(tmp_path, name):
    fmu = write_fmu(tmp_path / "plant.fmu")
    assert [*read_limits(fmu, ["force=-1:1:10", "gap=0:1:"])] == ["force", "gap"]
    with pytest.raises(InputError, match=f"--limit {name}=0:1:: {name}: no Real input or output"):
        read_limits(fmu, [f"{name}=0:1:"])
