"""A served FMU: stepped by requests or by a clock that the test moves, then at its port."""

import json
import math
import re
import signal
from contextlib import ExitStack
from hashlib import sha256

import pytest
from grasp_cosim import cli
from grasp_cosim.base.errors import InputError
from grasp_cosim.fmu_export.link import STEP as STEP_REQUEST
from grasp_cosim.fmu_export.link import TOO_LONG
from grasp_cosim.hil.driven_fmu import DrivenFmu
from grasp_cosim.hil.proxy_of_fmu import exchanged, link_signature
from grasp_cosim.hil.served import MAX_BACKLOG_NS, ServedFmu, Service
from grasp_cosim.hil.server import Server
from grasp_cosim.interface.read import read_interface
from grasp_cosim.interface.values import parse_value
from support import native_fmus
from support.proxies import HandProxy, RefusedError, UdpAsk, serving, wait_until

MS = 1_000_000
STEP = 1e-3
KEY = b"a key of 16 byte"
LOCKSTEP = Service(lockstep=True)


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

        def make(fmu, serving=LOCKSTEP):
            it = Clocked(fmu, serving)
            stack.callback(it.served.close)
            return it

        yield make


@pytest.fixture
def sensor(fmus):
    return fmus / "ProximitySensor.fmu"


@pytest.fixture
def plant(fmus):
    return fmus / "GripperPlant.fmu"


def starts(fmu, **values):
    """A request's values: the start values, but for those given by name."""
    interface = read_interface(fmu)
    signature, _ = link_signature(interface)
    declared = {v.name: interface.by_name[v.name].start or "" for v in signature.request}
    return [
        values.get(name, parse_value(interface, "", name, start, text=True))
        for name, start in declared.items()
    ]


def pushed(fmu, force=-1.0):
    return starts(fmu, **{"force[1]": force})


def test_it_initialises_steps_and_says_when_sessions_begin_and_end(sensor, clocked):
    """In initialisation mode outputs follow inputs and parameters, on the way tunable ones."""
    it = clocked(sensor)
    it.proxy.begin(1, starts(sensor))
    for gap in (0.01, 0.02):
        (intensity,) = it.proxy.initialise(0.0, starts(sensor, gap=gap, gain=0.001))
        assert intensity == pytest.approx(0.001 / (gap + 0.005) ** 1.1506, rel=1e-12)
    (bright,) = it.proxy.step(0.0, STEP, starts(sensor, gain=0.001))
    (dark,) = it.proxy.step(STEP, STEP, starts(sensor, gain=0.001, reflectance=0.5))
    assert dark == pytest.approx(0.5 * bright)
    it.proxy.end()
    it.proxy.begin(2, starts(sensor), time=2.5)
    it.proxy.step(2.5, STEP, starts(sensor))
    assert it.proxy.outputs_time == 2.5 + STEP
    it.wait(1000.0)  # as long as a session may be silent before another one takes its place
    it.proxy.begin(3, starts(sensor))
    it.served.close()
    assert it.said == [
        "a session of test begins at t = 0 s",
        "the session is over at t = 0.002 s: the proxy ended the session",
        "a session of test begins at t = 2.5 s",
        "the session is over at t = 2.501 s: another session takes its place",
        "a session of test begins at t = 0 s",
        "the session is over at t = 0 s: the server is closed",
    ]
    counters = it.served.counters()
    assert (counters["sessions"], counters["steps"], counters["failures"]) == (3, 3, 0)


def test_of_a_server_that_was_started_anew_it_is_said(sensor, plant, clocked):
    it, anew = clocked(sensor), clocked(sensor)
    it.proxy.begin(1, starts(sensor))
    plants = clocked(plant).proxy
    for proxy, fmu in ((it.proxy, sensor), (it.proxy, sensor), (plants, plant)):
        anew.served.answer(proxy.request(STEP_REQUEST, 0.0, starts(fmu), STEP), "test", anew.now)
    assert anew.said == [
        "a datagram from test of an unknown session was refused: it began before this server did",
        "a datagram from test of another interface was refused: its proxy must be made of the FMU "
        "served here",
    ]


@pytest.mark.parametrize("steps", [1, 3.0004])
def test_lost_requests_are_made_up_for_with_the_newest_values(plant, clocked, steps):
    """The last one shorter where they are no whole number."""
    two, one = clocked(plant), clocked(plant)
    for it in (two, one):
        it.proxy.begin(1, starts(plant))
    for k in range(int(steps)):
        two.proxy.step(k * STEP, STEP, pushed(plant))
    if steps % 1:
        two.proxy.step(int(steps) * STEP, steps % 1 * STEP, pushed(plant))
    whole = two.proxy.step(steps * STEP, STEP, pushed(plant))
    assert one.proxy.step(steps * STEP, STEP, pushed(plant)) == pytest.approx(whole, rel=1e-12)


@pytest.mark.parametrize("time", [-STEP, 100_001 * STEP])
def test_a_step_from_before_or_from_far_away_is_refused(sensor, clocked, time):
    it = clocked(sensor)
    it.proxy.begin(1, starts(sensor))
    said = "must be from 0 s, or at most 100000 steps later"
    with pytest.raises(RefusedError, match=rf"ProximitySensor\.fmu: step from .* s: {said}"):
        it.proxy.step(time, STEP, starts(sensor))


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_step_that_is_too_long_ends_its_session_alone(plant, clocked, lockstep):
    it = clocked(plant, Service(lockstep=lockstep))
    it.proxy.begin(1, starts(plant))
    with pytest.raises(RefusedError, match="the step is too long: must be at most 3600 s"):
        it.proxy.step(0.0, 1e300, starts(plant))
    assert it.said[-1] == f"the session is over at t = 0 s: {TOO_LONG}"
    it.proxy.end()
    it.proxy.begin(2, starts(plant))
    it.proxy.step(0.0, STEP, starts(plant))
    assert (it.served.counters()["failures"], it.served.counters()["steps"]) == (1, 1)


def test_what_the_fmu_refuses_is_said(sensor, clocked):
    it = clocked(sensor, Service())
    with pytest.raises(RefusedError, match=r"offset_distance = -1\.0 m: must be from"):
        it.proxy.begin(1, starts(sensor, offset_distance=-1.0))
    it.proxy.begin(2, starts(sensor))
    with pytest.raises(RefusedError, match="step of 1e-10 s: must be 1 ns or more, to be the own"):
        it.proxy.step(0.0, 1e-10, starts(sensor))


def test_its_own_clock_keeps_to_thirty_steps_a_second(sensor, clocked):
    it = clocked(sensor, Service(watchdog_ns=10**13, silence_ns=10**13))
    it.proxy.begin(1, starts(sensor))
    it.proxy.step(0.0, 1 / 30, starts(sensor))
    it.wait(1000_000.0)
    assert it.served.counters()["own_steps"] == 30_000


def test_by_its_own_clock_the_model_moves_between_requests(plant, clocked):
    it = clocked(plant, Service(watchdog_ns=10 * MAX_BACKLOG_NS))
    it.proxy.begin(1, starts(plant))
    it.wait(500.0)  # it does not start before the first step
    first = it.proxy.step(0.0, STEP, pushed(plant))
    assert it.proxy.outputs_time == 0.0
    it.wait(20.0)
    later = it.proxy.step(0.02, STEP, pushed(plant))
    assert it.proxy.outputs_time == pytest.approx(0.02)
    moved = later[0] - first[0]  # x = F t^2 / 2m
    assert moved == pytest.approx(-0.5 * 1.0 / 0.5 * 0.02**2, rel=1e-9)
    assert (it.served.counters()["own_steps"], it.served.counters()["skipped"]) == (20, 0)
    it.now += MAX_BACKLOG_NS + 10 * MS  # held up for longer than it makes up for
    it.served.look(it.now)
    it.served.look(it.now)
    assert (it.served.counters()["own_steps"], it.served.counters()["skipped"]) == (22, 1008)


def test_the_watchdog_puts_the_inputs_to_what_is_safe_until_the_next_session(plant, clocked):
    """It is told, and forces that still come do nothing, though the answers arrive."""
    it = clocked(plant, Service(watchdog_ns=50 * MS, failsafe={"force[1]": 0.25}))
    it.proxy.begin(1, starts(plant))
    it.proxy.step(0.0, STEP, pushed(plant))
    it.wait(49.0)
    assert it.served.counters()["watchdog"] == 0
    it.wait(51.0)
    assert it.served.counters()["watchdog"] == 1
    assert it.said[-1] == (
        "no request for 0.05 s that told of an answer: the inputs are at their failsafe values "
        "until the next session"
    )
    velocity = it.proxy.step(0.1, STEP, pushed(plant))[2]
    expected = (-1.0 * 0.049 + 0.25 * 0.051) / 0.5  # the watchdog is before the step due with it
    assert velocity == pytest.approx(expected, rel=1e-9)
    it.wait(10.0)
    later = it.proxy.step(0.11, STEP, pushed(plant))[2]
    assert later == pytest.approx(velocity + 0.25 * 0.01 / 0.5, rel=1e-9)
    assert it.proxy.trips == 1
    it.proxy.end()
    it.proxy.begin(2, starts(plant))
    it.proxy.step(0.0, STEP, pushed(plant))
    it.wait(10.0)
    assert it.proxy.step(0.01, STEP, pushed(plant))[2] < 0.0
    assert it.proxy.trips == 0


def test_requests_of_a_proxy_that_gets_no_answers_do_not_keep_the_inputs(plant, clocked):
    it = clocked(plant, Service(watchdog_ns=50 * MS))
    it.proxy.begin(1, starts(plant))
    for k in range(60):
        request = it.proxy.request(STEP_REQUEST, 1e-3 * k, pushed(plant), STEP, counted=k)
        it.served.answer(request, "test", it.now)
        it.wait(1.0)
    assert it.served.counters()["watchdog"] == 1
    velocity = it.proxy.step(0.06, STEP, pushed(plant))[2]
    assert velocity == pytest.approx(-1.0 * 0.05 / 0.5, rel=0.03)


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_session_that_says_nothing_is_over(plant, clocked, lockstep):
    it = clocked(plant, Service(lockstep=lockstep, silence_ns=200 * MS))
    it.proxy.begin(1, starts(plant))
    it.wait(199.0)
    assert it.served.counters()["sessions"] == 0
    it.wait(2.0)
    assert it.served.counters()["sessions"] == 1
    assert it.said[-1] == "the session is over at t = 0 s: nothing came for 0.2 s"
    assert it.served.due() is None


def test_a_server_with_a_name_and_the_hash_of_its_fmu(plant, clocked):
    it = clocked(plant, Service(name="left"))
    it.proxy.begin(1, starts(plant))
    assert (it.proxy.name, it.proxy.build) == ("left", sha256(plant.read_bytes()).hexdigest())
    other = it.served.answer(it.proxy.hello(2, "right"), "test", it.now)
    with pytest.raises(RefusedError, match="the peer is left, the proxy wants right"):
        it.proxy.take(other)
    assert it.said[-1].endswith("another name was refused: the two ports may be swapped")


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


def test_every_type_there_and_back(tmp_path, clocked, monkeypatch):
    fmu = native_fmus.build(tmp_path, "Native", "2.0")
    values = {"u_Real": 0.1, "u_Integer": -7, "u_Boolean": True, "u_Enumeration": 2}
    it = clocked(fmu)
    it.proxy.begin(1, starts(fmu))
    names = [v.name for v in it.served.peer.signature.answer]
    for found in (
        it.proxy.initialise(0.0, starts(fmu, **values)),
        it.proxy.step(0.0, STEP, starts(fmu, **values)),
    ):
        outputs = dict(zip(names, found, strict=True))
        for name, value in values.items():
            assert (outputs[f"y{name[1:]}"], type(outputs[f"y{name[1:]}"])) == (value, type(value))
    monkeypatch.setattr(DrivenFmu, "_get", lambda *_: [math.nan] * len(names))
    with pytest.raises(RefusedError, match=r"= nan at t = 0\.002 s: must be finite"):
        it.proxy.step(STEP, STEP, starts(fmu))


def test_what_a_proxy_cannot_exchange_is_refused_by_name(tmp_path):
    fmu = native_fmus.build(tmp_path, "Native", "3.0")
    with pytest.raises(InputError, match=r"input u_UInt32 is of type UInt32, which a proxy cannot"):
        link_signature(exchanged(fmu))


@pytest.mark.parametrize("lockstep", [True, False])
def test_a_session_over_udp(plant, lockstep):
    """By its own clock it goes on without requests."""
    signature, _ = link_signature(read_interface(plant))
    with (
        serving(plant, Service(lockstep=lockstep, key=KEY)) as server,
        UdpAsk(server.address) as ask,
    ):
        proxy = HandProxy(signature, ask, KEY)
        assert server.address[0] == "127.0.0.1"
        proxy.begin(1, starts(plant))
        for k in range(20):
            proxy.step(k * STEP, STEP, starts(plant))
        if not lockstep:
            wait_until(lambda: server.fmu.counters()["own_steps"] >= 20)
            proxy.step(20 * STEP, STEP, starts(plant))
            assert proxy.outputs_time >= 20 * STEP
        proxy.end()
        wait_until(lambda: server.fmu.counters()["sessions"] == 1)
    assert server.fmu.counters()["steps"] == (20 if lockstep else 21)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ("--watchdog -1", "--watchdog = -1.0 s: must be a number greater than 0"),
        ("--failsafe gap", "--failsafe 'gap': must be INPUT=VALUE"),
        ("--failsafe gap=wide", "failsafe gap: gap = 'wide': must be a finite number"),
        (
            "--failsafe gap[1]=1",
            "failsafe gap[1]: no such input of ProximitySensor.fmu; did you me",
        ),
        ("--key-file {}", "key of 5 bytes: must have 16 or more"),
        ("--host 192.0.2.1", "192.0.2.1:5501: cannot listen there"),
        ("--host=", ":5501: no such address; must be an IP address or a name that has one"),
    ],
)
def test_wrong_input_is_one_line(sensor, tmp_path, capsys, arguments, message):
    (tmp_path / "short").write_text("short", encoding="utf-8")
    given = arguments.format(tmp_path / "short").split()
    assert cli.main(["serve", str(sensor), *given]) == 2
    captured = capsys.readouterr()
    assert (captured.out, captured.err.count("\n")) == ("", 1)
    assert message in captured.err


@pytest.mark.parametrize(
    ("host", "key", "who"),
    [
        ("localhost", False, "any program here"),
        ("0.0.0.0", False, "whoever can reach it"),
        ("0.0.0.0", True, ""),
    ],
)
def test_it_says_who_may_take_part_and_what_is_left(
    sensor, tmp_path, capsys, monkeypatch, host, key, who
):
    monkeypatch.setattr(Server, "serve", lambda *_: signal.raise_signal(signal.SIGINT))
    (tmp_path / "key").write_bytes(KEY)
    given = ["--host", host, *(["--key-file", str(tmp_path / "key")] if key else [])]
    command = ["serve", str(sensor), "--port", "0", *given]
    assert cli.main(command) == 0
    out, err = capsys.readouterr()
    assert re.search(r"^serving ProximitySensor\.fmu at [0-9.]+:\d+, real time$", err, re.M)
    said = f" without a key: {who} may take part, and take over a session that is silent for 1 s; "
    assert err.count(said) == err.count("without a key") == bool(who)
    assert out == "nothing came\n"
    assert cli.main([*command, "--sessions", "1", "--json"]) == 130
    out, err = capsys.readouterr()
    assert json.loads(out)["sessions"] == 0
    assert err.endswith("grasp-cosim: interrupted; 0 of 1 sessions served\n")
