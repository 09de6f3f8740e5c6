"""A proxy as a host sees it, through its binary, with a peer that answers as it is told.

Its clock is the real one: steps that are answered may take as long as they like, and those that
are not are all in a row.
"""

import ctypes
import gc
import itertools
import sys
from math import inf, nan
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fmpy import simulate_fmu
from grasp_fmus.description import Experiment
from grasp_fmus.link.message import END, HELLO, INITIALISE, STEP
from grasp_fmus.proxy import Settings
from grasp_fmus.proxy_build import Original
from support import kinds
from support.fmi2 import ERROR, OK, WARNING, Fmu, Instance
from support.kinds import Kind, all_kinds, python_only
from support.ports import kept_port
from support.scripted_peer import VARIABLES, ScriptedPeer, fail

_C: dict[str, Any] = {
    "Real": ctypes.c_double,
    "Integer": ctypes.c_int,
    "Boolean": ctypes.c_int,
    "String": ctypes.c_char_p,
}


pytestmark = all_kinds


@pytest.fixture(scope="module")
def path(kind: Kind, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The proxy of an FMU with variables of each kind."""
    original = Original("Original.fmu", VARIABLES, {}, Experiment(), True)
    settings = Settings(timeout=60.0, connect_timeout=60.0)
    return kinds.build_proxy(original, kind, tmp_path_factory.mktemp("proxy"), settings)


@pytest.fixture(scope="module")
def fmu(path: Path, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    return Fmu(path, tmp_path_factory.mktemp("unpacked"))


def put(instance: Instance, kind: str, name: str, *values: Any) -> int:
    n = len(values)
    first = instance.fmu.references[name]
    references = (ctypes.c_uint * n)(*range(first, first + n))
    return instance.call(f"Set{kind}", references, ctypes.c_size_t(n), (_C[kind] * n)(*values))


def get(instance: Instance, kind: str, name: str) -> Any:
    value = (_C[kind] * 1)()
    reference = (ctypes.c_uint * 1)(instance.fmu.references[name])
    assert instance.call(f"Get{kind}", reference, ctypes.c_size_t(1), value) == OK
    return value[0]


def outputs(instance: Instance) -> list[Any]:
    return [
        get(instance, "Real", "doubled"),
        get(instance, "Integer", "passed"),
        bool(get(instance, "Boolean", "denied")),
        get(instance, "String", "echo").decode(),
    ]


def initialised(instance: Instance, port: int, on_loss: bytes = b"failsafe") -> Instance:
    assert put(instance, "Integer", "proxy.port", port) == OK
    assert put(instance, "String", "proxy.on_loss", on_loss) == OK
    return instance.initialise()


START = [3.0, 3, False, "start"]


def test_values_of_all_kinds_go_to_and_fro(fmu: Fmu) -> None:
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        initialised(instance, peer.port)
        assert outputs(instance) == START
        assert put(instance, "Real", "force", -0.125) == OK
        assert put(instance, "Integer", "mode", -(2**31)) == OK
        assert put(instance, "Boolean", "armed", 0) == OK
        assert put(instance, "String", "label", "Größe".encode()) == OK
        assert outputs(instance) == START
        assert instance.step(0.0, 0.5) == OK
        assert outputs(instance) == [-0.25, -(2**31), True, "Größe"]
        assert get(instance, "Integer", "proxy.state") == 1
        assert get(instance, "Real", "proxy.round_trip_time") > 0.0
        assert instance.call("Terminate") == OK
        assert outputs(instance)[0] == -0.25
        assert instance.log == []
    assert peer.kinds() == [HELLO, INITIALISE, STEP, END]


REFUSED = [
    (lambda i: put(i, "String", "proxy.host", b"\xff"), None),
    (lambda i: put(i, "String", "label", b"x" * 128), "label = 'xxx"),
    (lambda i: put(i, "Integer", "proxy.port", 70000), "proxy.port = 70000: must be from 1 to"),
    (lambda i: put(i, "Integer", "force", 1), "force: accessed as Integer: must be as Real"),
    (lambda i: put(i, "String", "mode", b"1"), "mode: accessed as String: must be as Integer"),
    (lambda i: put(i, "Integer", "passed", 1), "passed: output set: must be an input or a para"),
    (lambda i: put(i, "Real", "gain", nan, 1.0), "gain = nan 1: must be a finite number"),
    (lambda i: put(i, "Real", "force", -inf), "force = -inf N: must be a finite number"),
    (lambda i: i.step(0.0, 0.1), "fmi2DoStep before initialisation: must be in step mode"),
    (
        lambda i: i.call("GetFMUstate", ctypes.byref(ctypes.c_void_p())),
        "fmi2GetFMUstate: a proxy has no state, it is the peer's",
    ),
]


@pytest.mark.parametrize(("act", "reason"), REFUSED)
def test_what_is_refused_has_its_reason_in_the_log(
    fmu: Fmu, kind: Kind, act: Any, reason: str | None
) -> None:
    if not reason and kind != "python":  # pythonfmu itself refuses the first, in words or silence
        reason = "proxy.host = '?': must have 0 to 1023 bytes in UTF-8"
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        assert act(instance) == ERROR
        if reason:
            assert len(instance.log) == 1
            assert instance.log[0].text.startswith(f"bench, t = 0 s: {reason}")
        initialised(instance, peer.port)  # the host may go on
        assert instance.step(0.0, 0.5) == OK
        assert outputs(instance) == START


def test_a_peer_that_is_not_there(fmu: Fmu) -> None:
    with kept_port() as port, Instance(fmu, "bench") as instance:
        assert put(instance, "Integer", "proxy.port", port) == OK
        assert put(instance, "Real", "proxy.connect_timeout", 0.05) == OK
        assert instance.enter() == ERROR
        (said,) = instance.log
        assert said.text == (
            f"bench, t = 0 s: no answer from 127.0.0.1:{port} within 0.05 s: "
            f"is the peer running there, and has it no key? "
            f"e.g. grasp-cosim serve Original.fmu --port {port}"
        )
        assert (said.status, said.category) == (ERROR, "logStatusError")


def test_a_loss_is_a_warning_in_the_log(fmu: Fmu) -> None:
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        initialised(instance, peer.port)
        peer.told(STEP, fail)
        assert instance.step(0.0, 0.5) == OK
        (said,) = instance.log
        assert (said.status, said.category) == (WARNING, "logStatusWarning")
        assert said.text == (
            f"bench, t = 0 s: 127.0.0.1:{peer.port} is lost, 1 missed in a row: "
            "the peer failed: the motor is hot; proxy.on_loss = failsafe"
        )
        assert outputs(instance) == [0.0, 0, False, ""]
        assert instance.step(0.5, 0.5) == OK
        assert len(instance.log) == 1


def test_a_loss_may_stop_the_host(fmu: Fmu) -> None:
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        initialised(instance, peer.port, b"stop")
        peer.told(STEP, fail)
        assert instance.step(0.0, 0.5) == ERROR
        (said,) = instance.log
        assert said.text.startswith(f"bench, t = 0 s: 127.0.0.1:{peer.port} is lost, 1 missed")
        assert get(instance, "Integer", "proxy.state") == 3
        assert instance.call("Terminate") == OK


def test_a_silent_peer_by_the_real_clock(fmu: Fmu) -> None:
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        assert put(instance, "Real", "proxy.timeout", 1e-3) == OK
        initialised(instance, peer.port)
        peer.told(STEP, *[lambda p, m: None] * 10)
        states = []
        for k in range(6):
            assert instance.step(0.5 * k, 0.5) == OK
            states.append(get(instance, "Integer", "proxy.state"))
        assert states == [2, 2, 2, 3, 3, 3]
        assert get(instance, "Integer", "proxy.missed") == 4
        assert instance.call("Terminate") == OK
    assert peer.kinds().count(STEP) == 4


def test_reset_ends_the_session_and_another_begins(fmu: Fmu) -> None:
    with ScriptedPeer() as peer, Instance(fmu, "bench") as instance:
        for _ in range(5):
            initialised(instance, peer.port)
            assert put(instance, "Real", "force", 9.0) == OK
            assert instance.step(0.0, 0.5) == OK
            assert outputs(instance)[0] == 18.0
            assert instance.call("Reset") == OK
            assert get(instance, "Real", "force") == 1.5
            assert get(instance, "Integer", "proxy.state") == 0
    assert peer.kinds() == [HELLO, INITIALISE, STEP, END] * 5
    assert len({m.session for m in peer.got}) == 5


def test_an_instance_that_is_freed_without_an_end_says_end(fmu: Fmu) -> None:
    with ScriptedPeer() as peer:
        for _ in range(20):
            with Instance(fmu) as instance:
                initialised(instance, peer.port)
        gc.collect()
    assert peer.kinds() == [HELLO, INITIALISE, END] * 20


def test_many_instances_side_by_side(fmu: Fmu) -> None:
    peers = [ScriptedPeer() for _ in range(8)]
    instances = [Instance(fmu, f"bench {k}") for k in range(len(peers))]
    try:
        for k, (instance, peer) in enumerate(zip(instances, peers, strict=True)):
            initialised(instance, peer.port)
            assert put(instance, "Real", "force", float(k)) == OK
        for step in range(3):
            for k, instance in enumerate(instances):
                assert instance.step(0.5 * step, 0.5) == OK
                assert outputs(instance)[0] == 2.0 * k
    finally:
        for instance in instances:
            instance.call("FreeInstance")
        for peer in peers:
            peer.__exit__()


@python_only
@pytest.mark.slow
def test_strings_fill_no_memory(fmu: Fmu) -> None:
    with ScriptedPeer() as peer, Instance(fmu) as instance:
        initialised(instance, peer.port)

        def exchange(times: int) -> int:
            for k in range(times):
                assert put(instance, "String", "label", f"text {k}".encode()) == OK
                assert get(instance, "String", "label") == f"text {k}".encode()
            gc.collect()
            return sys.getallocatedblocks()

        blocks = [exchange(1000) for _ in range(5)]
        # One string lost per exchange adds 1,000 each time; other threads add now and then.
        assert min(later - earlier for earlier, later in itertools.pairwise(blocks)) < 100


def test_plain_fmpy_simulates_it(path: Path) -> None:
    with ScriptedPeer() as peer:
        force = np.array([(0.0, 1.0), (1.0, 2.0)], [("time", "f8"), ("force", "f8")])
        result: Any = simulate_fmu(
            str(path), validate=True, stop_time=1.0, step_size=0.125, output_interval=0.125,
            start_values={"proxy.port": peer.port, "gain": 4.0, "label": "bench"}, input=force,
            output=["doubled", "passed", "proxy.state", "proxy.missed"],
        )  # fmt: skip
    inputs = [peer.values(m)[0] for m in peer.got if m.kind == STEP]
    assert len(inputs) == 8
    np.testing.assert_array_equal(result["doubled"][1:], [4.0 * force for force in inputs])
    assert set(result["passed"]) == {3}
    assert set(result["proxy.state"]) == {1}
    assert set(result["proxy.missed"]) == {0}
    assert {m.time for m in peer.got if m.kind == STEP} == {k / 8 for k in range(8)}
