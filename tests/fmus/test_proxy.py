"""The slave of a proxy with a peer that answers as it is told: one that Python runs, and in C."""

import errno
import gc
import math
import os
import resource
import socket
import struct
from pathlib import Path
from random import Random
from threading import Event
from typing import Any

import pytest
from grasp_fmus import connection
from grasp_fmus.base import LoggedError
from grasp_fmus.connection import STALE
from grasp_fmus.link.message import (
    END,
    FAILED,
    HEAD,
    HELLO,
    INITIALISE,
    OUTPUTS,
    REFUSE,
    STEP,
    WELCOME,
    Codec,
    Message,
)
from grasp_fmus.link.signature import Kind, LinkVariable, Signature
from support.kinds import all_kinds
from support.scripted_peer import (
    SIGNATURE,
    VARIABLES,
    Clock,
    Host,
    ScriptedPeer,
    answer,
    busy,
    connected,
    datagrams,
    fail,
    forget,
    keep,
    miss,
    on_each_kind,
    other,
    send_kept_and_answer,
    send_kept_and_miss,
)

__all__ = ("on_each_kind",)

pytestmark = all_kinds

START = [3.0, 3, False, "start"]
"""The outputs to the start values."""

ZEROS = [0.0, 0, False, ""]


# Initialisation


def test_values_go_to_the_peer_and_come_back() -> None:
    with connected() as (host, peer):
        assert host.outputs() == START
        assert peer.kinds() == [HELLO, INITIALISE]
        assert peer.got[0].body == SIGNATURE.text.encode()
        assert peer.values(peer.got[1]) == [1.5, 3, True, "start", 2.0, 0.5]
        assert (host.state(), host.counts()) == (1, {})


def test_a_get_after_a_set_exchanges_in_initialisation_mode_and_nothing_else_does() -> None:
    with ScriptedPeer() as peer:
        host = Host(peer.port, peer.clock)
        host.slave.setup_experiment(2.5)
        assert host.outputs() == ZEROS
        assert (host.state(), peer.kinds()) == (0, [])
        host.slave.enter_initialization_mode()
        assert host.outputs() == START
        assert host.outputs() == START
        host.set(force=-2.0, label="Größe")
        host.set(gain=5.0)
        assert host.get("force") == -2.0
        assert peer.kinds() == [HELLO, INITIALISE]
        assert host.outputs() == [-10.0, 3, False, "Größe"]
        host.set(mass=4.0)
        host.slave.exit_initialization_mode()
        assert peer.kinds() == [HELLO, INITIALISE, INITIALISE, INITIALISE]
        assert [m.time for m in peer.got[1:]] == [2.5, 2.5, 2.5]
        assert [m.sequence for m in peer.got] == [0, 1, 2, 3]
        host.set(force=7.0)
        assert host.outputs() == [-10.0, 3, False, "Größe"]
        assert peer.kinds()[4:] == []
        host.slave.terminate()


def test_diagnostics_settle_in_initialisation_mode() -> None:
    with ScriptedPeer(Clock(tick=1000)) as peer:
        host = Host(peer.port, peer.clock)
        host.slave.enter_initialization_mode()
        names = [n for n in host.references if n.startswith("proxy.")]
        seen = []
        for force in (1.0, 2.0):
            host.set(force=force)
            seen.append([host.get(n) for n in names])
        assert seen[0] == seen[1]
        host.slave.terminate()


def test_hello_and_initialise_are_repeated_as_they_are() -> None:
    def nothing_yet(peer: ScriptedPeer, m: Message) -> None:
        peer.clock.now += 60_000_000
        peer.send(peer.pack(m, WELCOME, cookie=0))  # wakes, and is none

    with ScriptedPeer() as peer:
        peer.told(HELLO, nothing_yet, nothing_yet)
        peer.told(INITIALISE, nothing_yet)
        host = Host(peer.port, peer.clock).initialise()
        assert peer.kinds() == [HELLO] * 3 + [INITIALISE] * 2
        assert len(set(peer.datagrams[:3])) == len(set(peer.datagrams[3:])) == 1
        assert host.outputs() == START
        host.slave.terminate()


def test_a_busy_peer_is_waited_for() -> None:
    with ScriptedPeer() as peer:
        peer.told(HELLO, busy, busy)
        peer.told(INITIALISE, busy)
        host = Host(peer.port, peer.clock).initialise()
        assert host.outputs() == START
        host.slave.terminate()


def refused(host: Host, call: Any, *arguments: Any) -> str:
    """The line in the log about a call that is refused."""
    before = len(host.log())
    with pytest.raises(LoggedError):
        call(*arguments)
    (line,) = host.log()[before:]
    assert "\n" not in line
    return str(line)


def test_a_peer_that_stays_busy() -> None:
    with ScriptedPeer() as peer:
        peer.told(HELLO, *[busy] * 4)
        host = Host(peer.port, peer.clock, connect_timeout=0.2)
        line = refused(host, host.slave.enter_initialization_mode)
        place = f"127.0.0.1:{peer.port}"
        assert line == f"proxy, t = 0 s: {place}: the peer is busy with another proxy"


def test_nobody_there() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as silent:
        silent.bind(("127.0.0.1", 0))
        port = silent.getsockname()[1]
        host = Host(port, Clock(tick=40_000_000), connect_timeout=0.1)
        line = refused(host, host.slave.enter_initialization_mode)
    assert line == (
        f"proxy, t = 0 s: no answer from 127.0.0.1:{port} within 0.1 s: "
        f"is the peer running there, and has it no key? "
        f"e.g. grasp-cosim serve Original.fmu --port {port}"
    )


def test_the_host_may_try_again() -> None:
    with ScriptedPeer() as peer:
        host = Host(1, Clock(tick=40_000_000), connect_timeout=0.1)
        refused(host, host.slave.enter_initialization_mode)
        assert host.state() == 0
        host.set(**{"proxy.port": peer.port, "proxy.connect_timeout": 100.0})
        host.initialise()
        assert host.outputs() == START
        host.slave.terminate()


def test_another_interface_is_named() -> None:
    theirs = Signature((*SIGNATURE.variables[:-1],))
    with ScriptedPeer() as peer:
        peer.told(HELLO, other(theirs))
        host = Host(peer.port, peer.clock)
        line = refused(host, host.slave.enter_initialization_mode)
        assert line == (
            f"proxy, t = 0 s: 127.0.0.1:{peer.port}: the peer has another interface: "
            "there is no output echo, String"
        )


def test_a_peer_that_refuses_the_start_values_may_get_others() -> None:
    with ScriptedPeer() as peer:
        peer.told(INITIALISE, fail)
        host = Host(peer.port, peer.clock)
        host.slave.enter_initialization_mode()
        line = refused(host, host.outputs)
        assert line.endswith(f":{peer.port}: the peer failed: the motor is hot")
        host.set(mass=0.7)
        assert host.outputs() == START
        assert peer.kinds() == [HELLO, INITIALISE, HELLO, INITIALISE]  # that session is over
        host.slave.terminate()


def test_settings_may_change_in_initialisation_mode() -> None:
    with ScriptedPeer() as first, ScriptedPeer(first.clock) as second:
        host = Host(first.port, first.clock)
        host.slave.enter_initialization_mode()
        assert host.outputs() == START
        host.set(**{"proxy.port": second.port})
        host.slave.exit_initialization_mode()
        host.step()
        assert second.kinds() == [HELLO, INITIALISE, STEP]
        host.slave.terminate()
    assert first.kinds() == [HELLO, INITIALISE, END]


def drawn_signature(random: Random) -> Signature:
    """Another one, with some lines of ours, changed or not, and others."""
    kinds: list[Kind] = ["Real", "Integer", "Boolean", "String"]
    found = []
    for v in SIGNATURE.variables:
        if random.random() < 0.7:
            kind = random.choice(kinds) if random.random() < 0.3 else v.kind
            unit = random.choice(["N", "Größe %d", None]) if random.random() < 0.3 else v.unit
            found.append(LinkVariable(v.name, kind, v.causality, unit))
    found += [LinkVariable(f"new {i}", "Real", "output") for i in range(random.randrange(3))]
    random.shuffle(found)
    return Signature(tuple(found))


@pytest.mark.parametrize("seed", range(8))
def test_any_other_interface_is_named(seed: int) -> None:
    theirs = drawn_signature(Random(seed))
    with ScriptedPeer() as peer:
        peer.told(HELLO, other(theirs))
        host = Host(peer.port, peer.clock)
        line = refused(host, host.slave.enter_initialization_mode)
        difference = SIGNATURE.difference(theirs.text) or "unnamed"
        assert line.endswith(f": the peer has another interface: {difference}".replace("%", "%%"))


@pytest.mark.parametrize(
    "reason",
    [b"", b" hot \n\t motor\r\n", "\u2003 at\u00a0100 %\u3000".encode(), b"\xff\xe2\x80 x\xc3",
     "Größe € 𝄞 \ufeff".encode(), b"x" * 3000],
)  # fmt: skip
def test_any_reason_is_one_line(reason: bytes) -> None:
    def fail_so(peer: ScriptedPeer, m: Message) -> None:
        peer.send(peer.pack(m, REFUSE, reason, FAILED))

    with ScriptedPeer() as peer:
        peer.told(INITIALISE, fail_so)
        host = Host(peer.port, peer.clock)
        host.slave.enter_initialization_mode()
        line = refused(host, host.outputs)
        words = " ".join(reason.decode(errors="replace").split())
        assert line.endswith(f": the peer failed: {words}".replace("%", "%%"))


def test_a_host_with_a_name() -> None:
    with connected(host="localhost") as (host, peer):
        host.step()
        assert (host.outputs(), host.state(), len(peer.got)) == (START, 1, 3)


def test_a_name_that_is_not_resolved_in_time() -> None:
    """The resolver is left alone with it; what it finds in the end is of no account."""
    over = Event()
    host = Host(9, Clock(tick=10_000_000), host="localhost", connect_timeout=0.05)

    def hang() -> None:
        over.wait(60.0)

    try:
        with host.looking_up(hang):
            line = refused(host, host.slave.enter_initialization_mode)
    finally:
        over.set()
    assert line == ("proxy, t = 0 s: localhost:9: no connection: its name was not resolved in time")


@pytest.mark.parametrize(
    ("setting", "reason"),
    [
        ({"on_loss": "panic"}, "proxy.on_loss = 'panic': must be hold, failsafe, stop"),
        ({"key_file": "/no/such"}, "proxy.key_file = '/no/such': No such file or directory"),
        ({"host": "no such host"}, "no such host:PORT: no connection: "),
    ],
)
def test_settings_that_are_none(setting: dict[str, Any], reason: str) -> None:
    host = Host(9, Clock(), **setting)
    line = refused(host, host.slave.enter_initialization_mode)
    assert line.startswith(f"proxy, t = 0 s: {reason.replace('PORT', '9')}")


@pytest.mark.parametrize("name", [".", "a..b", "ä.invalid", "h" * 64])
def test_a_name_is_given_to_the_resolver_as_it_is(name: str) -> None:
    """So that both kinds of proxy say the same of one that there cannot be."""
    with pytest.raises(socket.gaierror) as known:
        socket.getaddrinfo(name.encode(), 9, socket.AF_INET, socket.SOCK_DGRAM)
    host = Host(9, Clock(), host=name)
    line = refused(host, host.slave.enter_initialization_mode)
    assert line == f"proxy, t = 0 s: {name}:9: no connection: {known.value.strerror}"


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("proxy.port", 0, "proxy.port = 0: must be from 1 to 65535"),
        ("proxy.port", 65536, "proxy.port = 65536: must be from 1 to 65535"),
        ("proxy.timeout", 0.0, "proxy.timeout = 0.0 s: must be from 1e-06 to 3600 s"),
        ("proxy.timeout", math.nan, "proxy.timeout = nan s: must be from 1e-06 to 3600 s"),
        ("proxy.misses_tolerated", -1, "proxy.misses_tolerated = -1: must be from 0 to"),
        ("proxy.state", 1, "proxy.state: output set: must be an input or a parameter"),
        ("force", math.inf, "force = inf N: must be a finite number"),
        ("proxy.key_file", "k" * 1024, f"proxy.key_file = '{'k' * 1024}': must have 0 to 1023"),
        ("proxy.failsafe.echo", "x" * 128, f"proxy.failsafe.echo = '{'x' * 128}': must have 0 to"),
        ("label", "ä" * 64, f"label = '{'ä' * 64}': must have 0 to 127 bytes in UTF-8"),
    ],
)
def test_values_that_are_refused(name: str, value: Any, reason: str) -> None:
    host = Host(9, Clock())
    before = host.get(name)
    line = refused(host, lambda: host.set(**{name: value}))
    assert line.startswith(f"proxy, t = 0 s: {reason}")
    assert host.get(name) == before


def test_a_string_as_long_as_can_be() -> None:
    with connected() as (host, peer):
        text = "ä" * 63 + "x"
        host.set(label=text)
        host.step()
        assert peer.values(peer.got[-1])[3] == host.get("echo") == text


def test_a_host_with_more_files_open_than_can_be_watched() -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if hard != resource.RLIM_INFINITY and hard < 1200:
        pytest.skip(f"NO {hard} files: must be 1200")
    resource.setrlimit(resource.RLIMIT_NOFILE, (max(soft, 1200), hard))
    host = Host(9, Clock())
    opened = [os.open(os.devnull, os.O_RDONLY)]
    try:
        while opened[-1] < connection.DESCRIPTORS:
            opened.append(os.dup(opened[0]))
        line = refused(host, host.slave.enter_initialization_mode)
    finally:
        for descriptor in opened:
            os.close(descriptor)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert line.endswith(
        "127.0.0.1:9: no connection: the host has 1024 files open: must have fewer"
    )


# Keys


def test_a_shared_key(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(b"0123456789abcdef\n")
    key.chmod(0o600)
    with ScriptedPeer(key=b"0123456789abcdef") as peer:
        host = Host(peer.port, peer.clock, key_file=str(key)).initialise()
        host.step()
        assert (host.outputs(), host.state()) == (START, 1)
        host.slave.terminate()


def test_a_peer_without_the_key_is_not_listened_to(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(b"0123456789abcdef")
    key.chmod(0o600)
    with connected(key_file="") as (_, peer):
        host = Host(peer.port, Clock(tick=40_000_000), key_file=str(key), connect_timeout=0.1)
        line = refused(host, host.slave.enter_initialization_mode)
        assert "no answer from" in line
        assert "is the peer running there, and has it the same key? e.g." in line
        assert peer.failures.pop(0)  # it could not read what came
        peer.failures.clear()


def test_a_key_must_be_long_enough(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(b"0123456789abcde")
    host = Host(9, Clock(), key_file=str(key))
    line = refused(host, host.slave.enter_initialization_mode)
    assert line.endswith(f"proxy.key_file = {str(key)!r}: key of 15 bytes: must have 16 or more")


def test_a_key_file_may_be_too_long(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(bytes(4097))
    host = Host(9, Clock(), key_file=str(key))
    line = refused(host, host.slave.enter_initialization_mode)
    assert line.endswith(f"proxy.key_file = {str(key)!r}: file of more than 4096 bytes: is no key")


def test_a_key_that_others_can_read_is_said(tmp_path: Path) -> None:
    key = tmp_path / "key"
    key.write_bytes(b"\x000123456789abcdef\n")
    key.chmod(0o640)
    with ScriptedPeer(key=key.read_bytes()) as peer:
        host = Host(peer.port, peer.clock, key_file=str(key)).initialise()
        assert host.log() == [
            f"proxy, t = 0 s: {key}: others have access to this key, mode 640; "
            f"must be 600: chmod 600 {key}"
        ]
        host.slave.terminate()


# Steps


def test_a_step_carries_the_hosts_numbers_to_the_bit() -> None:
    with connected() as (host, peer):
        random = Random(1)
        time = 0.0
        for _ in range(50):
            values = [random.gauss(0.0, 1e300), random.gauss(0.0, 5e-324), -0.0, 5e-324]
            host.set(force=random.choice(values), gain=random.uniform(1.0, 2.0))
            host.set(mode=random.randrange(-(2**31), 2**31), armed=random.random() < 0.5)
            size = random.uniform(1e-6, 1.0)
            sent = [host.get(v.name) for v in VARIABLES if v.causality != "output"]
            if not math.isfinite(sent[0] * sent[4]):
                continue
            assert host.slave.do_step(time, size)
            m = peer.got[-1]
            assert (m.kind, m.time, m.step) == (STEP, time, size)
            assert m.body == Codec(SIGNATURE.request).pack(sent)
            assert host.outputs() == [sent[0] * sent[4], sent[1], not sent[2], sent[3]]
            assert math.copysign(1.0, host.get("doubled")) == math.copysign(1.0, sent[0] * sent[4])
            time += size
        assert host.counts() == {}


def test_outputs_do_not_follow_a_set_but_a_step() -> None:
    with connected() as (host, _):
        host.set(force=4.0)
        assert host.get("doubled") == 3.0
        host.step()
        assert host.get("doubled") == 8.0


def test_a_fixed_parameter_is_fixed_and_a_tunable_one_is_not() -> None:
    with connected() as (host, _):
        assert "mass: fixed parameter set in step mode" in refused(host, lambda: host.set(mass=1.0))
        assert "proxy.timeout: fixed parameter set in step mode" in refused(
            host, lambda: host.set(**{"proxy.timeout": 1.0})
        )
        host.set(gain=10.0)
        host.step()
        assert host.get("doubled") == 15.0


@pytest.mark.parametrize(
    ("time", "size", "reason"),
    [
        (0.0, 0.0, "step size = 0.0 s: must be a finite number above 0"),
        (0.0, math.nan, "step size = nan s: must be a finite number above 0"),
        (0.5, 0.25, "step from 0.5 s: must be from 0.0 s"),
    ],
)
def test_steps_that_are_refused_are_not_sent(time: float, size: float, reason: str) -> None:
    with connected() as (host, peer):
        assert reason in refused(host, host.slave.do_step, time, size)
        assert peer.kinds() == [HELLO, INITIALISE]
        host.step()


def test_round_trip_and_age() -> None:
    with connected() as (host, peer):
        peer.offset = 0.125

        def after_a_while(peer: ScriptedPeer, m: Message) -> None:
            peer.clock.now += 3_000_000
            answer(peer, m)

        peer.told(STEP, after_a_while, miss)
        host.step()
        assert host.get("proxy.round_trip_time") == 3e-3
        assert host.get("proxy.age") == 0.125
        host.step()
        assert host.get("proxy.age") == 0.375


# Misses


def test_misses_that_are_tolerated_hold_the_outputs() -> None:
    with connected() as (host, peer):
        peer.told(STEP, answer, miss, miss, miss, answer)
        for force, doubled, state, missed in (
            (5.0, 10.0, 1, 0), (6.0, 10.0, 2, 1), (7.0, 10.0, 2, 2), (8.0, 10.0, 2, 3),
            (9.0, 18.0, 1, 0),
        ):  # fmt: skip
            host.set(force=force)
            host.step()
            assert (host.get("doubled"), host.state()) == (doubled, state)
            assert host.get("proxy.consecutive_missed") == missed
        assert host.counts() == {"missed": 3}
        assert host.log() == []
        assert [m.sequence for m in peer.got if m.kind == STEP] == [2, 3, 4, 5, 6]


def lost(host: Host, peer: ScriptedPeer) -> None:
    """Step until the peer is lost."""
    peer.told(STEP, *[miss] * 4)
    host.set(force=50.0)
    for _ in range(4):
        assert host.state() < 3
        host.step()
    assert host.state() == 3


def test_a_lost_peer_takes_the_outputs_to_their_failsafe_values() -> None:
    failsafe: dict[str, Any] = {
        "failsafe.doubled": -1.0,
        "failsafe.passed": 7,
        "failsafe.echo": "lost",
    }
    with connected(**failsafe) as (host, peer):
        lost(host, peer)
        assert host.outputs() == [-1.0, 7, False, "lost"]
        assert host.counts() == {"missed": 4, "consecutive_missed": 4}
        place = f"127.0.0.1:{peer.port}"
        assert host.log() == [
            f"proxy, t = 0.75 s: {place} is lost, 4 missed in a row: "
            "no answer within 100 s; proxy.on_loss = failsafe"
        ]


def test_an_output_may_be_held_for_itself() -> None:
    hold: dict[str, Any] = {"hold.doubled": True, "hold.denied": True}
    with connected(**hold) as (host, peer):
        lost(host, peer)
        assert host.outputs() == [3.0, 0, False, ""]


def test_all_outputs_may_be_held() -> None:
    failsafe: dict[str, Any] = {"failsafe.doubled": -1.0}
    with connected(on_loss="hold", **failsafe) as (host, peer):
        lost(host, peer)
        assert host.outputs() == START
        assert host.log()[-1].endswith("; proxy.on_loss = hold")


def test_the_host_may_be_stopped() -> None:
    with connected(on_loss="stop", misses_tolerated=1) as (host, peer):
        peer.told(STEP, answer, miss, miss)
        host.step()
        host.step()
        for _ in range(2):  # and it stays so
            line = refused(host, host.slave.do_step, 0.5, 0.25)
            assert line == (
                f"proxy, t = 0.5 s: 127.0.0.1:{peer.port} is lost, 2 missed in a row: "
                "no answer within 100 s"
            )
        assert (host.state(), peer.kinds().count(STEP)) == (3, 3)
        assert host.counts() == {"missed": 2, "consecutive_missed": 2}


def test_none_tolerated() -> None:
    with connected(misses_tolerated=0) as (host, peer):
        peer.told(STEP, miss)
        host.step()
        assert (host.state(), host.outputs()) == (3, ZEROS)


def test_a_peer_that_fails_is_lost_at_once() -> None:
    with connected() as (host, peer):
        peer.told(STEP, answer, fail)
        host.step()
        host.step()
        assert (host.state(), host.outputs()) == (3, ZEROS)
        assert "is lost, 1 missed in a row: the peer failed: the motor is hot" in host.log()[0]


def test_a_peer_that_forgot_the_session_is_missing_then_lost() -> None:
    with connected(misses_tolerated=1) as (host, peer):
        peer.told(STEP, forget, forget)
        host.step()
        assert (host.state(), host.outputs()) == (2, START)
        host.step()
        assert host.state() == 3
        assert "2 missed in a row: the peer does not know this session" in host.log()[0]


def test_once_lost_nothing_is_sent_but_the_end_and_nothing_is_taken() -> None:
    with connected() as (host, peer):
        lost(host, peer)
        before = peer.kinds()
        peer.send(peer.outputs(peer.got[-1]))
        for _ in range(5):
            host.step()
        assert peer.kinds() == before
        assert (host.state(), host.outputs()) == (3, ZEROS)
        assert len(host.log()) == 1
    assert peer.kinds() == [*before, END]


# What comes late, twice, or from elsewhere


def test_a_late_answer_is_the_newest_there_is() -> None:
    with connected() as (host, peer):
        peer.told(STEP, keep, send_kept_and_miss)
        host.set(force=11.0)
        host.step()
        assert host.get("doubled") == 3.0
        host.set(force=12.0)
        host.step()
        assert (host.get("doubled"), host.state()) == (22.0, 2)
        assert host.counts() == {"missed": 2, "consecutive_missed": 2, "late": 1}
        assert host.get("proxy.age") == 0.25


def test_a_late_answer_after_a_newer_one_is_dropped() -> None:
    with connected() as (host, peer):
        peer.told(STEP, keep, answer, send_kept_and_answer, send_kept_and_miss)
        for force in (11.0, 12.0):
            host.set(force=force)
            host.step()
        assert host.get("doubled") == 24.0
        host.set(force=13.0)
        host.step()
        assert host.get("doubled") == 26.0
        host.step()
        assert host.get("doubled") == 26.0
        assert host.counts() == {
            "missed": 2, "consecutive_missed": 1, "late": 1, "out_of_order": 1, "duplicated": 1,
        }  # fmt: skip


def junk() -> list[bytes]:
    """Datagrams that are none of this session."""
    message = Message(OUTPUTS, 0, SIGNATURE.hash, 5, 5, 1, 0.0, 0.0, 0, b"")
    fields = (b"GRSP", 1, *message[:-1], 0, 0)
    return [
        b"",
        b"x",
        bytes(80),
        HEAD.pack(*fields),
        HEAD.pack(b"GRSP", 2, *fields[2:]),
        HEAD.pack(*fields)[:-1],
        HEAD.pack(*fields) * 800,
    ]


def test_what_is_none_of_the_session_is_counted_and_changes_nothing() -> None:
    with connected() as (host, peer):
        peer.told(STEP, datagrams(junk()))
        host.step()
        assert (host.outputs(), host.state()) == (START, 1)
        assert host.counts() == {"rejected": len(junk())}


@pytest.mark.parametrize(
    ("place", "value"),
    [(0, struct.pack("<d", math.nan)), (0, struct.pack("<d", -math.inf)),
     (1, struct.pack("<q", 2**31)), (2, struct.pack("<Q", 2)), (3, b"\xff" * 8)],
)  # fmt: skip
def test_values_that_are_none_are_a_miss(place: int, value: bytes) -> None:
    def damaged(peer: ScriptedPeer, m: Message) -> None:
        body = bytearray(Codec(SIGNATURE.answer).pack([1.0, 2, True, "x"]))
        body[8 * place : 8 * place + 8] = value
        peer.send(peer.pack(m, OUTPUTS, bytes(body)))
        miss(peer, m)

    with connected() as (host, peer):
        peer.told(STEP, damaged)
        host.step()
        assert host.outputs() == START
        assert host.counts() == {"missed": 1, "consecutive_missed": 1, "rejected": 1}


def test_what_came_between_two_steps_does_not_hide_the_answer() -> None:
    with connected() as (host, peer):
        n = STALE + 20

        def then_junk(peer: ScriptedPeer, m: Message) -> None:
            for _ in range(n):
                peer.send(b"x")
            answer(peer, m)

        peer.told(STEP, then_junk)
        host.step()
        assert host.counts() == {"rejected": n}
        assert host.state() == 1
        for _ in range(n):
            peer.send(b"x")
        host.set(force=10.0)
        host.step()
        assert (host.state(), host.get("doubled")) == (1, 20.0)
        assert host.counts() == {"rejected": 2 * n}


def test_a_flood_does_not_put_off_the_deadline() -> None:
    """However much comes, with each look at the clock a step is nearer to its end."""
    clock = Clock()
    with connected(clock=clock, timeout=1e-3) as (host, peer):
        over = False

        def flood(peer: ScriptedPeer, m: Message) -> None:
            while not over:
                peer.send(bytes(80))

        peer.told(STEP, flood)
        clock.tick = 20_000
        begin = clock.now
        try:
            host.step()
        finally:
            over = True
        looks = (clock.now - begin) // clock.tick
        assert looks <= 1e-3 * 1e9 / clock.tick + 6
        assert host.get("proxy.missed") == 1
        assert 0 < host.get("proxy.rejected") <= looks
        clock.tick = 0


def test_what_came_before_a_step_does_not_put_off_its_deadline() -> None:
    clock = Clock()
    with connected(clock=clock, timeout=1e-3) as (host, peer):
        for _ in range(STALE):
            peer.send(b"x")
        clock.tick = 100_000
        begin = clock.now
        host.step()
        assert clock.now - begin <= 1_000_000 + 6 * clock.tick
        assert host.get("proxy.missed") == 1
        clock.tick = 0


def down(datagram: bytes) -> None:
    """A cable was pulled."""
    raise OSError(errno.ENETUNREACH, "Network is unreachable")


def test_a_network_that_is_down_is_a_peer_that_is_silent() -> None:
    with connected(misses_tolerated=0, timeout=1e-3) as (host, peer):
        with host.intercepted(down):
            peer.clock.tick = 400_000
            host.step()
        assert (host.state(), host.counts()) == (3, {"missed": 1, "consecutive_missed": 1})
        assert "no answer within 0.001 s (Network is unreachable)" in host.log()[0]


@pytest.mark.parametrize("at", ["greeting", "initialising"])
def test_a_network_that_is_down_at_the_start_is_named(at: str) -> None:
    with ScriptedPeer() as peer:
        host = Host(peer.port, peer.clock, connect_timeout=0.1)
        call: Any = host.slave.enter_initialization_mode
        if at == "initialising":
            call()
            call = host.outputs
        with host.intercepted(down):
            peer.clock.tick = 40_000_000
            line = refused(host, call)
        assert f":{peer.port} within 0.1 s (Network is unreachable): is the peer running" in line


class Reporting:
    """A network that first says that nobody took an earlier datagram, and sends none."""

    def __init__(self, reports: int) -> None:
        self.reports = reports
        self.sent: list[int] = []

    def __call__(self, datagram: bytes) -> None:
        self.sent.append(datagram[6])
        if len(self.sent) <= self.reports:
            raise OSError(errno.ECONNREFUSED, "Connection refused")


def test_a_step_that_only_reported_an_earlier_datagram_is_sent_again() -> None:
    """Once, as a report is of one datagram; the peer gets it once."""
    with connected(misses_tolerated=0, timeout=2.0) as (host, peer):
        reporting = Reporting(1)
        peer.clock.tick = 50_000_000  # so that it does not wait for ever in vain
        with host.intercepted(reporting):
            host.step()
        assert (host.state(), host.counts()) == (1, {})
        assert reporting.sent == [STEP, STEP]
        assert peer.kinds() == [HELLO, INITIALISE, STEP]


def test_that_nobody_listens_is_no_trouble_of_the_network() -> None:
    with connected(misses_tolerated=0, timeout=1e-3) as (host, peer):
        reporting = Reporting(2)
        peer.clock.tick = 400_000
        with host.intercepted(reporting):
            host.step()
        assert reporting.sent == [STEP, STEP]
        assert host.state() == 3
        assert "no answer within 0.001 s; proxy.on_loss" in host.log()[0]
        peer.clock.tick = 0


# All of that in any order


@pytest.mark.parametrize("seed", range(12))
def test_state_counts_and_outputs_are_what_the_answers_make_them(seed: int) -> None:
    """Against a model of a few lines."""
    random = Random(seed)
    tolerated, resume = random.randrange(4), random.random() < 0.5
    failsafe: dict[str, Any] = {"failsafe.doubled": -1.0}
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


def test_a_lost_peer_may_come_back() -> None:
    with connected(resume=True) as (host, peer):
        lost(host, peer)
        peer.told(STEP, miss, answer)
        host.step()
        assert (host.state(), host.outputs()) == (3, ZEROS)
        host.step()
        assert (host.state(), host.get("doubled")) == (1, 100.0)
        assert host.counts() == {"missed": 5}
        assert host.log()[1:] == [
            f"proxy, t = 1.25 s: 127.0.0.1:{peer.port}: the peer answers again"
        ]


def test_a_late_answer_does_not_bring_a_lost_peer_back() -> None:
    with connected(resume=True) as (host, peer):
        lost(host, peer)
        peer.told(STEP, keep, send_kept_and_miss)
        host.step()
        host.step()
        assert (host.state(), host.outputs()) == (3, ZEROS)


def test_a_peer_that_was_started_anew_is_greeted_anew() -> None:
    with connected(resume=True, misses_tolerated=0) as (host, peer):
        peer.told(STEP, forget, forget)
        host.step()
        assert host.state() == 3
        host.set(force=20.0)
        host.step()
        assert (host.state(), host.get("doubled")) == (1, 40.0)
        assert peer.kinds() == [HELLO, INITIALISE, STEP, STEP, HELLO, INITIALISE, STEP]
        first, second = peer.got[0], peer.got[4]
        assert first.session != second.session
        assert (peer.got[5].time, peer.got[6].time) == (0.25, 0.25)
        assert peer.values(peer.got[5])[0] == 20.0
        assert host.counts() == {"missed": 1}


def test_a_peer_that_takes_longer_to_start_than_a_step_may() -> None:
    """Its HELLO and INITIALISE go on, step by step; each is a miss."""
    with connected(resume=True, misses_tolerated=0) as (host, peer):
        peer.told(STEP, forget, forget)
        peer.told(HELLO, miss)
        peer.told(INITIALISE, miss, miss)
        for _ in range(4):
            host.step()
            assert host.state() == 3
        host.step()
        assert host.state() == 1
        assert peer.kinds()[2:] == [STEP, STEP, HELLO, HELLO, *[INITIALISE] * 3, STEP]
        assert len(set(peer.datagrams[6:9])) == 1
        assert host.counts() == {"missed": 4, "rejected": 1}  # a WELCOME without a cookie


def test_an_answer_to_initialise_between_two_steps_is_taken() -> None:
    with connected(resume=True, misses_tolerated=0) as (host, peer):
        peer.told(STEP, forget, forget)
        peer.told(INITIALISE, keep)
        host.step()
        host.step()
        assert host.state() == 3
        peer.send(peer.kept[0])
        host.step()
        assert host.state() == 1
        assert peer.kinds()[2:] == [STEP, STEP, HELLO, INITIALISE, STEP]


def test_a_peer_that_fails_at_its_new_start_is_greeted_once_more() -> None:
    with connected(resume=True, misses_tolerated=0) as (host, peer):
        peer.told(STEP, fail, forget)
        peer.told(INITIALISE, fail)
        host.step()
        host.step()
        assert host.state() == 3
        host.step()
        assert host.state() == 1
        assert peer.kinds()[2:] == [STEP, STEP, HELLO, INITIALISE, HELLO, INITIALISE, STEP]


# The end


def test_the_end_is_said_once_and_values_stay() -> None:
    with ScriptedPeer() as peer:
        host = Host(peer.port, peer.clock).initialise()
        host.step()
        host.slave.terminate()
        assert (host.outputs(), host.state()) == (START, 0)
        assert "force: set after fmi2Terminate" in refused(host, lambda: host.set(force=1.0))
        assert "after fmi2Terminate" in refused(host, host.slave.do_step, 0.25, 0.25)
        host.slave.terminate()
    assert peer.kinds() == [HELLO, INITIALISE, STEP, END]


@pytest.mark.slow
def test_a_slave_that_goes_says_so() -> None:
    """pythonfmu drops it on fmi2Reset and fmi2FreeInstance, and does not tell it."""
    with ScriptedPeer() as peer:
        host = Host(peer.port, peer.clock).initialise()
        del host
        gc.collect()
    assert peer.kinds() == [HELLO, INITIALISE, END]


def test_before_a_session_there_is_nothing_to_end() -> None:
    with ScriptedPeer() as peer:
        Host(peer.port, peer.clock).slave.terminate()
        peer.told(HELLO, lambda p, m: None)
        host = Host(peer.port, Clock(tick=40_000_000), connect_timeout=0.1)
        peer.told(HELLO, *[lambda p, m: None] * 5)
        refused(host, host.slave.enter_initialization_mode)
    assert set(peer.kinds()) == {HELLO}


def test_there_are_no_states() -> None:
    host = Host(9, Clock())
    for call in ("_get_fmu_state", "_set_fmu_state", "state_to_bytes", "state_from_bytes"):
        arguments = [] if call == "_get_fmu_state" else [b""]
        line = refused(host, getattr(host.slave, call), *arguments)
        assert line.endswith(": a proxy has no state, it is the peer's")


def test_an_original_without_outputs() -> None:
    inputs = [v for v in VARIABLES if v.causality == "input"]
    wire = Signature(tuple(v for v in SIGNATURE.variables if v.causality == "input"))
    with ScriptedPeer(signature=wire, outputs=lambda values: []) as peer:
        host = Host(peer.port, peer.clock, inputs).initialise()
        peer.told(STEP, answer, fail)
        host.step()
        assert host.state() == 1
        host.step()
        assert host.state() == 3
        host.slave.terminate()


def test_refuse_with_an_unknown_code_is_rejected() -> None:
    def odd(peer: ScriptedPeer, m: Message) -> None:
        peer.send(peer.pack(m, REFUSE, b"", 99))
        answer(peer, m)

    with connected() as (host, peer):
        peer.told(STEP, odd)
        host.step()
        assert (host.state(), host.counts()) == (1, {"rejected": 1})
