"""A served FMU without its socket: stepped by requests or by a clock that the test moves."""

import math
from contextlib import ExitStack, closing

import numpy as np
import pytest
from grasp_cosim.base.errors import InputError
from grasp_cosim.fmi.make_instance import load_here
from grasp_cosim.hil.driven import DrivenFmu
from grasp_cosim.hil.protocol import exchanged, link_signature
from grasp_cosim.hil.served import ServedFmu, Service
from grasp_cosim.interface.read import read_interface
from grasp_fmus.link.message import STEP as STEP_REQUEST
from grasp_fmus.link.peer import TOO_LONG
from support import native_fmus
from support.proxies import HandProxy, RefusedError

MS = 1_000_000
STEP = 1e-3


class Clocked:
    """A served FMU, a proxy of it and their clock."""

    def __init__(self, fmu, serving):
        self.now = 10_000 * MS
        self.said = []
        self.served = ServedFmu(read_interface(fmu), serving, self.said.append)
        signature, _ = link_signature(exchanged(fmu))
        self.proxy = HandProxy(signature, lambda d: self.served.answer(d, "test", self.now))

    def wait(self, milliseconds):
        """Let time pass; it looks whenever it wants to."""
        end = self.now + round(milliseconds * MS)
        while (due := self.served.due()) is not None and due <= end:
            self.now = max(self.now, due)
            self.served.look(self.now)
        self.now = end


@pytest.fixture
def clocked():
    """Serves FMUs with a clock; closes them."""
    with ExitStack() as stack:

        def make(fmu, serving):
            it = Clocked(fmu, serving)
            stack.callback(it.served.close)
            return it

        yield make


def starts(fmu, **values):
    """A request's values: the start values, but for those given by name."""
    interface = read_interface(fmu)
    signature, _ = link_signature(interface)
    declared = {v.name: interface.by_name[v.name].start or "" for v in signature.request}
    return [
        values.get(name, interface.parse("", name, start, text=True))
        for name, start in declared.items()
    ]


def directly(fmu, gaps, reflectance):
    """The intensities of a sensor stepped in this process."""
    interface = read_interface(fmu)
    gap, intensity = interface.by_name["gap"], interface.by_name["intensity"]
    found = []
    with closing(load_here("sensor", interface)) as sensor:
        sensor.enter_initialization({"reflectance": reflectance, "gap": gaps[0]}, None)
        found += sensor.get([intensity])
        sensor.exit_initialization()
        clock = np.zeros(1)
        advance = sensor.stepper(clock, STEP)
        for k, value in enumerate(gaps[1:]):
            clock[0] = k * STEP
            sensor.set([gap], [value])
            assert advance.python() == 0
            found += sensor.get([intensity])
    return found


def test_in_lockstep_the_values_are_those_of_the_fmu_to_the_bit(fmus, clocked):
    fmu = fmus / "ProximitySensor.fmu"
    gaps = [0.1 / 3 ** (k / 7) for k in range(40)]
    it = clocked(fmu, Service(lockstep=True))
    found = it.proxy.begin(1, starts(fmu, gap=gaps[0], reflectance=0.57))
    for k, gap in enumerate(gaps[1:]):
        found = found + it.proxy.step(k * STEP, STEP, starts(fmu, gap=gap, reflectance=0.57))
    assert found == directly(fmu, gaps, 0.57)
    it.proxy.end()
    assert it.served.counters()["steps"] == 39
    assert it.said == [
        "a session of test begins at t = 0 s",
        "the session is over at t = 0.039 s: the proxy ended the session",
    ]


def test_of_a_server_that_was_started_anew_it_is_said(fmus, clocked):
    fmu, other = fmus / "ProximitySensor.fmu", fmus / "GripperPlant.fmu"
    it, anew = (clocked(fmu, Service(lockstep=True)) for _ in range(2))
    it.proxy.begin(1, starts(fmu))
    anew.served.answer(it.proxy.request(STEP_REQUEST, 0.0, starts(fmu), STEP), "test", anew.now)
    line = "a datagram from test of an unknown session was refused: it began before this"
    assert [said.startswith(line) for said in anew.said] == [True]
    plant = clocked(other, Service(lockstep=True)).proxy
    anew.served.answer(plant.request(STEP_REQUEST, 0.0, starts(other), STEP), "test", anew.now)
    assert anew.said[1].startswith("a datagram from test of another interface was refused: its")


def test_in_initialisation_mode_outputs_follow_the_inputs(fmus, clocked):
    fmu = fmus / "ProximitySensor.fmu"
    it = clocked(fmu, Service(lockstep=True))
    it.proxy.begin(1, starts(fmu))
    for gap in (0.01, 0.02):
        (intensity,) = it.proxy.initialise(0.0, starts(fmu, gap=gap, gain=0.001))
        expected = 0.001 / (gap + 0.005) ** 1.1506
        assert intensity == pytest.approx(expected, rel=1e-12)


def test_lost_requests_are_made_up_for_with_the_newest_values(fmus, clocked):
    fmu = fmus / "GripperPlant.fmu"
    push, rest = {"force[1]": 1.0, "force[2]": 0.0}, {"force[1]": 0.0, "force[2]": 0.0}
    two, one = (clocked(fmu, Service(lockstep=True)) for _ in range(2))
    for it in (two, one):
        it.proxy.begin(1, starts(fmu, **rest))
    for k in range(3):
        whole = two.proxy.step(k * STEP, STEP, starts(fmu, **push))
    assert one.proxy.step(2 * STEP, STEP, starts(fmu, **push)) == whole


def test_lost_requests_are_not_made_up_for_when_the_end_has_come(fmus, clocked):
    fmu = fmus / "ProximitySensor.fmu"
    it, asked = clocked(fmu, Service(lockstep=True)), []

    def over():
        asked.append(1)
        return len(asked) > 10

    it.served.over = over
    it.proxy.begin(1, starts(fmu))
    with pytest.raises(RefusedError, match=r"the FMU ended it after 10 of 99000 lost steps"):
        it.proxy.step(99000 * STEP, STEP, starts(fmu))
    assert len(asked) == 11


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_step_that_is_too_long_ends_its_session_alone(fmus, clocked, lockstep):
    fmu = fmus / "GripperPlant.fmu"
    it = clocked(fmu, Service(lockstep=lockstep))
    it.proxy.begin(1, starts(fmu))
    with pytest.raises(RefusedError, match="the step is too long: must be at most 3600 s"):
        it.proxy.step(0.0, 1e300, starts(fmu))
    assert it.said[-1] == f"the session is over at t = 0 s: {TOO_LONG}"
    it.proxy.begin(2, starts(fmu))
    it.proxy.step(0.0, STEP, starts(fmu))
    assert (it.served.counters()["failures"], it.served.counters()["steps"]) == (1, 1)


def test_a_parameter_that_the_fmu_refuses_is_said(fmus, clocked):
    fmu = fmus / "ProximitySensor.fmu"
    it = clocked(fmu, Service())
    with pytest.raises(RefusedError, match=r"offset_distance = -1\.0 m: must be from"):
        it.proxy.begin(1, starts(fmu, offset_distance=-1.0))


def test_a_tunable_parameter_changes_on_the_way(fmus, clocked):
    fmu = fmus / "ProximitySensor.fmu"
    it = clocked(fmu, Service(lockstep=True))
    it.proxy.begin(1, starts(fmu))
    (bright,) = it.proxy.step(0.0, STEP, starts(fmu))
    (dark,) = it.proxy.step(STEP, STEP, starts(fmu, reflectance=0.5))
    assert float(dark) == pytest.approx(0.5 * float(bright))


def test_a_session_starts_at_its_own_time(fmus, clocked):
    fmu = fmus / "GripperPlant.fmu"
    it = clocked(fmu, Service(lockstep=True))
    it.proxy.begin(1, starts(fmu), time=2.5)
    it.proxy.step(2.5, STEP, starts(fmu))
    assert it.proxy.outputs_time == 2.5 + STEP


def test_by_its_own_clock_the_model_moves_between_requests(fmus, clocked):
    fmu = fmus / "GripperPlant.fmu"
    push = starts(fmu, **{"force[1]": -1.0})
    it = clocked(fmu, Service())
    it.proxy.begin(1, starts(fmu))
    it.wait(500.0)  # it does not start before the first step
    first = it.proxy.step(0.0, STEP, push)
    assert it.proxy.outputs_time == 0.0
    it.wait(20.0)
    later = it.proxy.step(0.02, STEP, push)
    assert it.proxy.outputs_time == pytest.approx(0.02)
    assert it.served.counters()["own_steps"] == 20
    moved = float(later[0]) - float(first[0])  # x = F t^2 / 2m
    assert moved == pytest.approx(-0.5 * 1.0 / 0.5 * 0.02**2, rel=1e-9)


def test_its_own_step_may_be_shorter(fmus, clocked):
    fmu = fmus / "GripperPlant.fmu"
    it = clocked(fmu, Service(step_ns=MS // 4))
    it.proxy.begin(1, starts(fmu))
    it.proxy.step(0.0, STEP, starts(fmu))
    it.wait(5.0)
    assert it.served.counters()["own_steps"] == 20


def test_the_watchdog_puts_the_inputs_to_what_is_safe_until_a_request_comes(fmus, clocked):
    fmu = fmus / "GripperPlant.fmu"
    push = starts(fmu, **{"force[1]": -1.0})
    it = clocked(fmu, Service(watchdog_ns=50 * MS, failsafe={"force[1]": 0.25}))
    it.proxy.begin(1, starts(fmu))
    it.proxy.step(0.0, STEP, push)
    it.wait(49.0)
    assert it.served.counters()["watchdog"] == 0
    it.wait(51.0)
    assert it.served.counters()["watchdog"] == 1
    assert "no request for 0.05 s: the inputs went to their failsafe values" in it.said
    velocity = it.proxy.step(0.1, STEP, push)[2]
    expected = (-1.0 * 0.049 + 0.25 * 0.051) / 0.5  # the watchdog is before the step due with it
    assert float(velocity) == pytest.approx(expected, rel=1e-9)
    it.wait(10.0)
    assert float(it.proxy.step(0.11, STEP, push)[2]) < float(velocity)


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_failure_of_the_fmu_is_said_to_the_proxy(tmp_path, lockstep, clocked):
    fmu = native_fmus.build(tmp_path, "Native", "2.0")
    it = clocked(fmu, Service(lockstep=lockstep))
    values = starts(fmu, error_at=0.0025)
    it.proxy.begin(1, values)
    for k in range(2):
        it.proxy.step(k * STEP, STEP, values)
        it.wait(1.0)
    it.wait(2.0)
    with pytest.raises(RefusedError, match=r"native: Native\.fmu returned error"):
        it.proxy.step(2 * STEP, STEP, values)
    assert it.served.due() is None


def test_every_type_there_and_back(tmp_path, clocked):
    fmu = native_fmus.build(tmp_path, "Native", "2.0")
    values = {
        "u_Real": 0.1,
        "u_Integer": -7,
        "u_Boolean": True,
        "u_Enumeration": 2,
    }
    it = clocked(fmu, Service(lockstep=True))
    it.proxy.begin(1, starts(fmu))
    for found in (
        it.proxy.initialise(0.0, starts(fmu, **values)),
        it.proxy.step(0.0, STEP, starts(fmu, **values)),
    ):
        outputs = dict(zip([v.name for v in it.served.peer.signature.answer], found, strict=True))
        for name, value in values.items():
            assert (outputs[f"y{name[1:]}"], type(outputs[f"y{name[1:]}"])) == (value, type(value))


def test_what_a_proxy_cannot_exchange_is_refused_by_name(tmp_path):
    fmu = native_fmus.build(tmp_path, "Native", "3.0")
    with pytest.raises(InputError, match=r"input u_UInt32 is of type UInt32, which a proxy cannot"):
        link_signature(exchanged(fmu))


def test_an_output_that_is_not_finite_is_a_failure(tmp_path, clocked, monkeypatch):
    fmu = native_fmus.build(tmp_path, "Native", "2.0")
    it = clocked(fmu, Service(lockstep=True))
    it.proxy.begin(1, starts(fmu))
    nothing_finite = [math.nan] * len(it.served.peer.signature.answer)
    monkeypatch.setattr(DrivenFmu, "_get", lambda *_: nothing_finite)
    with pytest.raises(RefusedError, match=r"= nan at t = 0\.001 s: must be finite"):
        it.proxy.step(0.0, STEP, starts(fmu))


def test_a_server_that_is_closed_says_where_its_session_ended(fmus, clocked):
    fmu = fmus / "ProximitySensor.fmu"
    it = clocked(fmu, Service(lockstep=True))
    it.proxy.begin(1, starts(fmu))
    it.proxy.step(0.0, STEP, starts(fmu))
    it.served.close()
    assert it.said[-1] == "the session is over at t = 0.001 s: the server is closed"


def test_wrong_failsafe_values_are_refused(fmus):
    plant = read_interface(fmus / "GripperPlant.fmu")
    with pytest.raises(
        InputError, match=r"failsafe force: no such input .* did you mean force\[1\]"
    ):
        ServedFmu(plant, Service(failsafe={"force": 1.0}))
    with pytest.raises(InputError, match=r"failsafe force\[1\]: force\[1\] = 'x': must be a"):
        ServedFmu(plant, Service(failsafe={"force[1]": "x"}))


def test_a_key_that_is_too_short_is_refused(fmus):
    with pytest.raises(InputError, match="key of 3 bytes: must have 16 or more"):
        ServedFmu(read_interface(fmus / "GripperPlant.fmu"), Service(key=b"abc"))
