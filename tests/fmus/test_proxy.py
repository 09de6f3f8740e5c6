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


# Initialisation


def test_a_get_after_a_set_exchanges_in_initialisation_mode_and_nothing_else_does():
    with ScriptedPeer() as peer, hosted(peer.port, peer.clock) as host:
        host.setup(2.5)
        assert host.outputs() == ZEROS
        assert (host.state(), peer.kinds()) == (0, [])
        host.enter()
        assert host.outputs() == START
        assert peer.got[0].body == SIGNATURE.text.encode().ljust(link.SHORTEST_HELLO, b"\0")
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

    with connected() as (host, peer):
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
    """Nothing is sent but the end any more, and nothing is taken."""
    with connected(**settings) as (host, peer):
        lost(host, peer)
        assert host.outputs() == outputs
        assert host.counts() == {"missed": 4, "consecutive_missed": 4}
        before = peer.kinds()
        peer.send(peer.outputs(peer.got[-1]))
        host.step()
        assert (host.state(), host.outputs(), peer.kinds()) == (3, outputs, before)
        assert host.log() == [
            f"proxy, t = 0.75 s: 127.0.0.1:{peer.port} is lost, 4 missed in a row: "
            f"no answer within 100 s; proxy.on_loss = {settings['on_loss']}"
        ]
    assert peer.kinds() == [*before, END]


def test_the_host_may_be_stopped():
    with connected(on_loss="stop", misses_tolerated=1) as (host, peer):
        peer.told(STEP, answer, miss, miss)
        host.step()
        host.step()
        for _ in range(2):  # and it stays so
            assert host.refused(host.do_step, 0.5, 0.25) == (
                f"proxy, t = 0.5 s: 127.0.0.1:{peer.port} is lost, 2 missed in a row: "
                "no answer within 100 s"
            )
        assert (host.state(), peer.kinds().count(STEP)) == (3, 3)
        assert host.counts() == {"missed": 2, "consecutive_missed": 2}


@pytest.mark.parametrize(
    ("act", "tolerated", "reason"),
    [
        (miss, 0, "1 missed in a row: no answer within 100 s;"),
        (fail, 3, "1 missed in a row: the peer failed: the motor is hot;"),
        (forget, 1, "2 missed in a row: the peer does not know this session;"),
    ],
)
def test_when_a_peer_is_lost(act, tolerated, reason):
    with connected(misses_tolerated=tolerated) as (host, peer):
        peer.told(STEP, act, act)
        host.step()
        if act is forget:
            assert (host.state(), host.outputs()) == (2, START)
            host.step()
        assert (host.state(), host.outputs()) == (3, ZEROS)
        assert f"is lost, {reason}" in host.log()[0]


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
    with connected(misses_tolerated=tolerated, resume=resume, **failsafe) as (host, peer):
        is_lost, in_a_row, missed, shown = False, 0, 0, 3.0
        for _ in range(40):
            force = random.uniform(-9.0, 9.0)
            host.set(force=force)
            if resume or not is_lost:
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


def test_a_lost_peer_may_come_back_but_not_by_a_late_answer():
    with connected(resume=True) as (host, peer):
        lost(host, peer)
        peer.told(STEP, keep, send_kept_and_miss, answer)
        for _ in range(2):
            host.step()
            assert (host.state(), host.outputs()) == (3, ZEROS)
        host.step()
        assert (host.state(), host.get("doubled")) == (1, 100.0)
        assert host.counts() == {"missed": 6, "late": 1}
        assert host.log()[1:] == [
            f"proxy, t = 1.5 s: 127.0.0.1:{peer.port}: the peer answers again"
        ]


@pytest.mark.parametrize(
    ("steps", "hellos", "initialisations", "kinds"),
    [
        ([forget, forget], [], [], [[STEP], [STEP, HELLO, INITIALISE, STEP]]),
        ([forget, forget], [miss], [miss, miss],  # longer than a step may take
         [[STEP], [STEP, HELLO], [HELLO, INITIALISE], [INITIALISE], [INITIALISE, STEP]]),
        ([forget, forget], [], [refuse(link.UNKNOWN), miss],
         [[STEP], [STEP, *[HELLO, INITIALISE] * 2], [INITIALISE, STEP]]),
        ([fail, forget], [], [fail],
         [[STEP], [STEP, HELLO, INITIALISE], [HELLO, INITIALISE, STEP]]),
    ],
    ids=["at once", "slowly", "with another between", "after one more failure"],
)  # fmt: skip
def test_a_peer_that_was_started_anew_is_greeted_anew(steps, hellos, initialisations, kinds):
    with connected(resume=True, misses_tolerated=0) as (host, peer):
        peer.told(STEP, *steps)
        peer.told(HELLO, *hellos)
        peer.told(INITIALISE, *initialisations)
        host.set(force=20.0)
        for expected in kinds:
            before = len(peer.got)
            host.step()
            assert peer.kinds()[before:] == expected
            assert host.state() == (1 if expected is kinds[-1] else 3)
        assert host.get("doubled") == 40.0
        assert host.get("proxy.missed") == len(kinds) - 1
        assert host.get("proxy.sessions") >= 2
        assert "in a new session, its model set up anew" in host.log()[-1]
        assert peer.values(peer.got[-2]) == peer.values(peer.got[-1])
        assert peer.got[-1].session != peer.got[0].session


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
