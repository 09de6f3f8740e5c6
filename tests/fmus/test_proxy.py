"""A proxy with a peer that answers as it is told, by the clock and the network of the test."""

import math
import struct
from random import Random
from threading import Event

import pytest
from grasp_cosim.fmu_export import link
from grasp_cosim.fmu_export.link import (
    END,
    HELLO,
    INITIALISE,
    OUTPUTS,
    STEP,
    VERSION,
    Codec,
    Message,
    Sealer,
)
from support.native_proxies import connected, hosted
from support.processes import kept_port
from support.scripted_peer import (
    SIGNATURE,
    Clock,
    ScriptedPeer,
    answer,
    busy,
    fail,
    forget,
    keep,
    miss,
    refuse,
    send_kept_and_answer,
    send_kept_and_miss,
)

START = [3.0, 3, False]
"""The outputs to the start values."""
ZEROS = [0.0, 0, False]
FOR_EVER = Clock(tick=40_000_000)
"""A clock by which 0.1 s are soon over."""


def tripped(peer, m):
    peer.send(peer.pack(m, OUTPUTS, Codec(SIGNATURE.answer).pack(1.0, 1, True), counted=1))


def still_busy(peer, m):
    """For longer than a step of a lost proxy waits."""
    peer.clock.now += 10**12
    peer.send(peer.pack(m, link.REFUSE, b"", link.BUSY))


def shifted(lead):
    """Outputs that belong to another time."""

    def act(peer, m):
        before, peer.offset = peer.offset, -lead
        answer(peer, m)
        peer.offset = before

    return act


def introduced(name="", build=""):
    """A welcome by a peer that says who it is."""
    body = name.encode().ljust(link.NAME_SIZE, b"\0") + build.encode().ljust(link.BUILD_SIZE, b"\0")
    return lambda peer, m: peer.send(peer.pack(m, link.WELCOME, body, cookie=next(peer.cookies)))


# Initialisation


def test_a_get_after_a_set_exchanges_in_initialisation_mode_and_nothing_else_does():
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock) as host:
        host.setup(2.5)
        assert host.outputs() == ZEROS
        assert (host.state(), peer.kinds()) == (0, [])
        host.enter()
        assert host.outputs() == START
        assert peer.got[0].body == link.pack_hello("proxy", *SIGNATURE.parts())
        assert peer.values(peer.got[1]) == [1.5, 3, True, 2.0, 0.5]
        diagnostics = host.own()
        host.set(force=-2.0)
        host.set(gain=5.0)
        assert host.get("force") == -2.0
        assert peer.kinds() == [HELLO, INITIALISE]
        assert host.outputs() == [-10.0, 3, False]
        assert host.own() == diagnostics  # or initialisation would not settle
        host.set(mass=4.0)
        host.must("ExitInitializationMode")
        assert [m.time for m in peer.got[1:]] == [2.5, 2.5, 2.5]
        assert [m.sequence for m in peer.got] == [0, 1, 2, 3]
        host.set(force=7.0)
        assert host.outputs() == [-10.0, 3, False]
        assert peer.kinds() == [HELLO, INITIALISE, INITIALISE, INITIALISE]
        assert (host.state(), host.counts()) == (1, {})


def nothing_yet(peer, m):
    peer.clock.now += 60_000_000
    peer.send(peer.pack(m, link.WELCOME, cookie=0))  # wakes, and is none


def test_hello_and_initialise_are_repeated_as_they_are():
    """Until another was there before, when a session is begun anew."""
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock) as host:
        peer.told(HELLO, nothing_yet, busy)  # a busy peer is waited for
        peer.told(INITIALISE, busy, forget)
        host.initialise()
        assert peer.kinds() == [HELLO] * 3 + [INITIALISE] * 2 + [HELLO, INITIALISE]
        assert len(set(peer.datagrams[:3])) == len(set(peer.datagrams[3:5])) == 1
        assert host.outputs() == START


@pytest.mark.parametrize(
    ("act", "reason"),
    [
        (busy, "the peer is busy with another proxy"),
        (refuse(link.OTHER_INTERFACE, b"the proxy has one\n%d, the peer an\xc3\xb6ther\x7f"),
         "another interface: the proxy has one %d, the peer an??ther?"),
        (refuse(link.OTHER_INTERFACE, b"x" * 2000), f"another interface: {'x' * 1024}"),
        (refuse(link.OTHER_VERSION, version=9999),
         f"the peer speaks protocol 9999: must be {VERSION}"),
        (refuse(link.FAILED, b"hot"), "the peer failed: hot"),
    ],
)  # fmt: skip
def test_a_peer_that_refuses_is_named_with_its_reason(act, reason):
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock, connect_timeout=0.2) as host:
        peer.told(HELLO, *[act] * 4)
        line = host.refused(host.enter)
        said = reason.replace("%", "%%")
        assert line == f"proxy, t = 0 s: 127.0.0.1:{peer.port}: {said}"


def test_a_peer_that_refuses_the_start_values_may_get_others():
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock) as host:
        peer.told(INITIALISE, fail)
        host.enter()
        line = host.refused(host.outputs)
        assert line.endswith(f":{peer.port}: the peer failed: the motor is hot")
        host.set(mass=0.7)
        assert host.outputs() == START
        assert peer.kinds() == [HELLO, INITIALISE, HELLO, INITIALISE]  # that session is over


def test_settings_may_change_in_initialisation_mode():
    with (
        ScriptedPeer() as first,
        ScriptedPeer(first.clock) as second,
        hosted(first.port, first.clock, host="localhost") as host,
    ):
        host.enter()
        assert host.outputs() == START
        host.set(**{"proxy.port": second.port})
        host.must("ExitInitializationMode")
        host.step()
    assert second.kinds() == [HELLO, INITIALISE, STEP, END]
    assert first.kinds() == [HELLO, INITIALISE, END]


AT_ONCE = [
    ("proxy.port", 0, "proxy.port = 0: must be from 1 to 65535"),
    ("force", math.inf, "force = inf N: must be a finite number"),
    ("proxy.key_file", "k" * 1024, "proxy.key_file: too long: must have 0 to 1023 bytes"),
]
LATER = [
    ("proxy.on_loss", "panic", "proxy.on_loss = panic: must be hold, failsafe, stop"),
    ("proxy.key_file", "/no/such", "proxy.key_file = /no/such: No such file or directory"),
    ("proxy.key_file", __file__, f"proxy.key_file = {__file__}: file of more than 4096 bytes"),
    ("proxy.host", "no such host", "no such host:9: no connection: "),
]


@pytest.mark.parametrize(("name", "value", "reason"), [*AT_ONCE, *LATER])
def test_values_and_settings_that_are_none(name, value, reason):
    """Those that are refused when they are needed have been taken."""
    with hosted(9) as host:
        before = host.get(name)
        line = host.refused(lambda: (host.set(**{name: value}), host.enter()))
        assert line.startswith(f"proxy, t = 0 s: {reason}")
        assert host.get(name) == (value if (name, value, reason) in LATER else before)


# Keys


@pytest.mark.parametrize(
    ("text", "mode", "said"),
    [
        (b"0123456789abcdef\n", 0o600, ""),
        (b"\x000123456789abcdef\n", 0o640, "others have access to this key: must be chmod 600"),
    ],
)  # fmt: skip
def test_a_shared_key(tmp_path, text, mode, said):
    key = tmp_path / "key"
    key.write_bytes(text)
    key.chmod(mode)
    with (
        ScriptedPeer(key=text.rstrip() if text[0] else text) as peer,
        hosted(peer.port, peer.clock, key_file=str(key)) as host,
    ):
        host.initialise()
        host.step()
        assert (host.outputs(), host.state()) == (START, 1)
        assert host.log() == ([f"proxy, t = 0 s: {key}: {said}"] if said else [])


def test_a_key_must_be_long_enough_and_the_same(tmp_path):
    key = tmp_path / "key"
    key.write_bytes(b"0123456789abcde")
    with kept_port() as port, hosted(port, FOR_EVER, key_file=str(key)) as host:
        line = host.refused(host.enter)
        assert line.endswith(f"{key}: key of 15 bytes: must have 16 or more")
        key.write_bytes(b"0123456789abcdef")
        key.chmod(0o600)
        host.set(**{"proxy.connect_timeout": 0.1})
        line = host.refused(host.enter)
        assert "is the peer running there, and has it the same key? e.g." in line


# Steps


def test_outputs_follow_a_step_and_tunable_parameters_may_change():
    """To the bit what the host has; the least number is one, and zero has a sign."""
    with connected() as (host, peer):
        for name in ("mass", "proxy.timeout"):
            line = host.refused(lambda name=name: host.set(**{name: 1.0}))
            assert f"{name}: fixed parameter set in step mode" in line
        for force, size in ((4.0, 0.25), (-5e-324, 1e-6), (-0.0, 1.0)):
            shown, time = host.get("doubled"), host.time
            host.set(force=force, gain=10.0, mode=-(2**31), armed=False)
            assert host.get("doubled") == shown
            host.step(size)
            m = peer.got[-1]
            assert (m.kind, m.time, m.step) == (STEP, time, size)
            assert repr(peer.values(m)) == repr([force, -(2**31), False, 10.0, 0.5])
            assert repr(host.outputs()) == repr([10.0 * force, -(2**31), True])
        assert host.counts() == {}


def test_round_trip_and_age():
    def after_a_while(peer, m):
        peer.clock.now += 3_000_000
        answer(peer, m)

    with connected(greatest_lead=1.0) as (host, peer):
        peer.offset = 0.125
        peer.told(STEP, after_a_while, miss)
        host.step()
        assert host.get("proxy.round_trip_time") == 3e-3
        assert host.get("proxy.age") == 0.125
        host.step()
        assert host.get("proxy.age") == 0.375


# Misses


def lost(host, peer):
    """Step until the peer is lost."""
    peer.told(STEP, *[miss] * 4)
    host.set(force=50.0)
    for _ in range(4):
        assert host.state() < 3
        host.step()
    assert host.state() == 3


@pytest.mark.parametrize(
    ("settings", "outputs"),
    [
        ({"on_loss": "failsafe", "failsafe.doubled": -1.0, "failsafe.passed": 7}, [-1.0, 7, False]),
        ({"on_loss": "failsafe", "hold.doubled": True, "hold.denied": True}, [3.0, 0, False]),
        ({"on_loss": "hold", "failsafe.doubled": -1.0}, START),
    ],
)
def test_a_lost_peer(settings, outputs):
    """The end is said, at once. Nothing is sent any more, and nothing is taken."""
    with connected(**settings) as (host, peer):
        lost(host, peer)
        assert host.outputs() == outputs
        assert host.counts() == {"missed": 4, "consecutive_missed": 4}
        last = next(m for m in reversed(peer.got) if m.kind == STEP)
        peer.send(peer.outputs(last))
        host.step()
        assert (host.state(), host.outputs()) == (3, outputs)
        assert host.log() == [
            f"proxy, t = 0.75 s: 127.0.0.1:{peer.port} is lost: 4 missed in a row: "
            f"no answer within 100 s; proxy.on_loss = {settings['on_loss']}"
        ]
    assert peer.kinds() == [HELLO, INITIALISE, *[STEP] * 4, END]


def test_the_host_may_be_stopped():
    with connected(on_loss="stop", misses_tolerated=1) as (host, peer):
        peer.told(STEP, answer, miss, miss)
        host.step()
        host.step()
        for _ in range(2):  # and it stays so
            assert host.refused(host.do_step, 0.5, 0.25) == (
                f"proxy, t = 0.5 s: 127.0.0.1:{peer.port} is lost: 2 missed in a row: "
                "no answer within 100 s"
            )
        assert (host.state(), peer.kinds().count(STEP)) == (3, 3)
        assert host.counts() == {"missed": 2, "consecutive_missed": 2}


@pytest.mark.parametrize(
    ("act", "tolerated", "reason"),
    [
        (miss, 0, "1 missed in a row: no answer within 100 s;"),
        (fail, 3, "the peer failed: the motor is hot;"),
        (forget, 3, "the peer does not know this session: it was started again, or another proxy"),
        (tripped, 3, "its watchdog or a limit of its own tripped, it is in its safe state;"),
        (shifted(0.25), 3, "its clock is 0.25 s ahead: must be within 0.1 s (proxy.greatest_lead)"),
        (shifted(-0.25), 3, "its clock is 0.25 s behind; does the run keep to the clock: must be"),
    ],
)
def test_when_a_peer_is_lost(act, tolerated, reason):
    with connected(misses_tolerated=tolerated) as (host, peer):
        peer.told(STEP, act)
        host.step()
        assert (host.state(), host.outputs()) == (3, ZEROS)
        assert f"is lost: {reason}" in host.log()[0]
        host.step()
        assert host.state() == 3
    assert peer.kinds() == [HELLO, INITIALISE, STEP, END]


def test_a_peer_may_be_ahead_and_behind_as_far_as_is_said():
    with connected(greatest_lead=0.5) as (host, peer):
        for lead in (0.5, -0.5):
            peer.told(STEP, shifted(lead))
            host.step()
            assert (host.state(), host.get("proxy.lead")) == (1, lead)


def test_requests_tell_which_answers_have_arrived():
    """That of INITIALISE, in time, late; what is lost is counted back to it."""
    with connected() as (host, peer):
        peer.told(STEP, answer, miss, keep, send_kept_and_miss, answer)
        for _ in range(6):
            host.step()
        assert [m.counted for m in peer.got] == [0, 0, 0, 0, 1, 2, 1, 0]


# Limits


def sent(peer):
    """The force of the last request."""
    return peer.values(peer.got[-1])[0]


def test_commands_are_kept_within_their_limits_and_counted():
    """By value, and by rate from what was sent last; the start is 1.5 N, a step 0.25 s."""
    limits = {"min.force": -10.0, "max.force": 4.0, "rate.force": 8.0}
    with connected(**limits) as (host, peer):
        forces = {2.0: 2.0, 5.0: 4.0, -3.0: 2.0, -1e300: 0.0, 1.0: 1.0}
        for force, limited in forces.items():
            host.set(force=force)
            host.step()
            assert sent(peer) == limited
        assert (host.get("proxy.limited"), host.state()) == (3, 1)


def test_a_command_beyond_its_limits_may_end_the_session():
    with connected(**{"max.force": 4.0, "on_limit": "trip"}) as (host, peer):
        host.set(force=5.0)
        host.step()
        assert host.state() == 3
        assert "is lost: a command was beyond its limits" in host.log()[0]
    assert peer.kinds() == [HELLO, INITIALISE, END]


def test_what_cannot_have_been_measured_is_a_miss():
    """By value and by rate; outputs stay, and a peer that goes on so is lost."""
    limits = {"lowest.doubled": -50.0, "highest.doubled": 50.0, "fastest.doubled": 40.0}
    with connected(**limits) as (host, _):
        for force, doubled, implausible in (
            (5.0, 10.0, 0), (26.0, 10.0, 1), (-1.0, -2.0, 1), (5.0, -2.0, 2), (4.0, 8.0, 2),
        ):  # fmt: skip
            host.set(force=force)
            host.step()
            found = host.get("doubled"), host.get("proxy.implausible")
            assert found == (doubled, implausible), force
        host.set(force=100.0)
        for _ in range(4):
            host.step()
        assert (host.state(), host.get("proxy.missed")) == (3, 6)


# Names


@pytest.mark.parametrize(
    ("settings", "act", "line"),
    [
        ({}, introduced("bench 2"), "the peer's name is bench 2: must be proxy"),
        ({"name": "b"}, introduced("bench 2"), "the peer's name is bench 2: must be b"),
        ({"build": "abc"}, introduced(build="abd"), "the peer's build is abd: must be abc"),
        ({}, refuse(link.OTHER_NAME, b"the peer is b, the proxy wants a"),
         "another name: the peer is b, the proxy wants a; are two ports swapped?"),
    ],
)  # fmt: skip
def test_the_peer_must_be_the_one_that_is_wanted(settings, act, line):
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock, **settings) as host:
        peer.told(HELLO, act)
        assert host.refused(host.enter) == f"proxy, t = 0 s: 127.0.0.1:{peer.port}: {line}"


def test_who_the_peer_is_can_be_read():
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock, name="b1") as host:
        peer.told(HELLO, introduced("b1", "0123abcd"))
        host.initialise()
        assert peer.got[0].body == link.pack_hello("b1", *SIGNATURE.parts())
        assert (host.get("proxy.name"), host.get("proxy.build")) == ("b1", "0123abcd")


# What comes late, twice, or from elsewhere


def test_a_late_answer_is_the_newest_there_is_unless_a_newer_one_was_before():
    with connected() as (host, peer):
        peer.told(STEP, keep, send_kept_and_miss, answer, keep, answer, send_kept_and_miss, answer)
        for force, doubled in (
            (11.0, 3.0), (12.0, 22.0), (13.0, 26.0), (14.0, 26.0), (15.0, 30.0), (16.0, 30.0),
            (17.0, 34.0),
        ):  # fmt: skip
            host.set(force=force)
            host.step()
            assert host.get("doubled") == doubled
        assert host.counts() == {"missed": 4, "late": 2, "out_of_order": 1, "duplicated": 1}
        assert [m.sequence for m in peer.got] == [*range(9)]
        assert host.log() == []


def test_what_is_none_of_the_session_is_counted_and_changes_nothing():
    other = Message(OUTPUTS, 0, SIGNATURE.hash, 5, 5, 1, 0.0, 0.0, 0, b"")
    whole, older = (Sealer().pack(other._replace(version=v)) for v in (VERSION, VERSION - 1))
    many = [b"", b"x", bytes(80), whole, older, whole[:-1], whole * 800, *[b"x"] * 80]
    no_values = [(0, "<d", math.nan), (0, "<d", -math.inf), (8, "<q", 2**31), (16, "<Q", 2)]

    def odd(peer, m):
        for at, kind, value in no_values:
            body = bytearray(24)
            struct.pack_into(kind, body, at, value)
            peer.send(peer.pack(m, OUTPUTS, bytes(body)))
        for datagram in (peer.pack(m, link.REFUSE, b"", 99), *many):
            peer.send(datagram)
        answer(peer, m)

    with connected() as (host, peer):
        peer.told(STEP, odd)
        host.step()
        assert (host.outputs(), host.state()) == (START, 1)
        assert host.counts() == {"rejected": len(many) + 5}
        for datagram in many:  # between two steps
            peer.send(datagram)
        host.step()
        assert host.counts() == {"rejected": 2 * len(many) + 5}


def test_a_flood_does_not_put_off_the_deadline():
    """However much comes, with each look at the clock a step is nearer to its end."""
    clock, over = Clock(), Event()

    def flood(peer, m):
        while not over.is_set():
            peer.send(bytes(80))

    with connected(clock, timeout=1e-3) as (host, peer):
        peer.told(STEP, flood)
        begin, clock.tick = clock.now, 20_000
        try:
            host.step()
        finally:
            over.set()
        looks = (clock.now - begin) // clock.tick
        clock.tick = 0
        assert looks <= 56
        assert host.get("proxy.missed") == 1
        assert 0 < host.get("proxy.rejected") <= looks


# All of that in any order


@pytest.mark.parametrize("seed", range(12))
def test_state_counts_and_outputs_are_what_the_answers_make_them(seed):
    """Against a model of a few lines."""
    random = Random(seed)
    tolerated, resume = random.randrange(4), random.random() < 0.5
    failsafe = {"failsafe.doubled": -1.0}
    acts = [answer, answer, miss, miss, keep, send_kept_and_answer, fail]
    busy_for_ever = [still_busy] * 40
    with connected(misses_tolerated=tolerated, resume=resume, **failsafe) as (host, peer):
        peer.told(HELLO, *busy_for_ever)
        is_lost, in_a_row, missed, shown = False, 0, 0, 3.0
        for _ in range(40):
            force = random.uniform(-9.0, 9.0)
            host.set(force=force)
            if not is_lost:
                act = random.choice(acts)
                peer.told(STEP, act)
                if act in (answer, send_kept_and_answer):
                    is_lost, in_a_row, shown = False, 0, 2.0 * force
                else:
                    missed, in_a_row = missed + 1, in_a_row + 1
                    is_lost = is_lost or act is fail or in_a_row > tolerated
                    shown = -1.0 if is_lost else shown
            host.step()
            assert host.get("doubled") == shown
            assert host.state() == (3 if is_lost else 2 if in_a_row else 1)
            counts = host.counts()
            assert counts.get("missed", 0) == missed
            assert counts.get("consecutive_missed", 0) == in_a_row
            assert counts.get("out_of_order", 0) <= counts.get("late", 0) <= len(peer.kept)
            assert "rejected" not in counts


# Coming back


def wait_for(host, peer, state):
    """Step until the proxy is in a state: it does not wait for its peer."""
    for _ in range(10_000):
        if host.state() == state:
            return
        peer.clock.now += 60_000_000  # HELLO is repeated
        host.step()
    raise AssertionError(f"never in state {state}")


def test_a_lost_peer_gets_no_command_before_its_host_initialises_it_anew():
    """Probes are HELLOs. A peer that welcomes is back, and that is all."""
    with connected(resume=True) as (host, peer):
        lost(host, peer)
        peer.told(HELLO, nothing_yet, busy, still_busy)
        wait_for(host, peer, 4)
        for _ in range(3):
            host.step()
        assert (host.state(), host.outputs()) == (4, ZEROS)
        assert host.log()[-1].endswith(
            "the peer answers again; it gets no commands before the loop is initialised again"
        )
        kinds = peer.kinds()
        assert kinds.count(STEP) == 4
        assert kinds.index(END) == len(kinds) - 1 - kinds[::-1].count(HELLO) + 1
        assert {m.body for m in peer.got if m.kind == HELLO} == {peer.got[0].body}
        host.must("Reset")
        host.set(**{"proxy.port": peer.port, "proxy.on_loss": "hold"})
        host.set(**{"proxy.timeout": 100.0, "proxy.connect_timeout": 100.0, "force": 2.0})
        host.setup(host.time)
        host.enter()
        host.must("ExitInitializationMode")
        host.step()
        assert (host.state(), host.get("doubled")) == (1, 4.0)
    assert peer.kinds()[len(kinds) :] == [HELLO, INITIALISE, STEP, END]


# The end


def test_the_end_is_said_once_and_values_stay():
    with connected() as (host, peer):
        host.step()
        line = host.refused(host.must, "SetFMUstate", None)
        assert line.endswith(": is not supported by this FMU")
        host.terminate()
        assert (host.outputs(), host.state()) == (START, 0)
        assert "force: set after fmi" in host.refused(lambda: host.set(force=1.0))
        assert "after fmi" in host.refused(host.do_step, 0.25, 0.25)
    assert peer.kinds() == [HELLO, INITIALISE, STEP, END]
