"""A peer that answers as it is told, in a thread; and a proxy's slave without its FMU around it.

The clock is the test's: a step is missed because the peer puts the clock past the deadline, and
then wakes the proxy with a datagram that means nothing. So nothing depends on how fast things go.
"""

import ctypes
import socket
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from itertools import count
from threading import Thread
from typing import Any

import pytest
from grasp_fmus.link.message import (
    BUSY,
    END,
    FAILED,
    HELLO,
    INITIALISE,
    LARGEST,
    OTHER_INTERFACE,
    OUTPUTS,
    REFUSE,
    STEP,
    UNKNOWN,
    WELCOME,
    Codec,
    Message,
    Sealer,
)
from grasp_fmus.link.signature import LinkVariable, Signature
from grasp_fmus.proxy import Fmi2Proxy
from grasp_fmus.variable import TYPES, Variable

from .kinds import NATIVE, Kind
from .native_proxies import NativeSlave

Act = Callable[["ScriptedPeer", Message], None]

VARIABLES = (
    Variable("force", float, "input", "N", 1.5),
    Variable("mode", int, "input", "", 3, "discrete"),
    Variable("armed", bool, "input", "", True, "discrete"),
    Variable("label", str, "input", "", "start", "discrete"),
    Variable("gain", float, "parameter", "1", 2.0, "tunable"),
    Variable("mass", float, "parameter", "kg", 0.5, "fixed"),
    Variable("doubled", float, "output", "N"),
    Variable("passed", int, "output", "", None, "discrete"),
    Variable("denied", bool, "output", "", None, "discrete"),
    Variable("echo", str, "output", "", None, "discrete"),
)
"""One of each kind and causality; what the peer answers is in answers()."""

SIGNATURE = Signature(
    tuple(LinkVariable(v.name, TYPES[v.kind], v.causality, v.unit or None) for v in VARIABLES)
)


def answers(values: Sequence[Any]) -> list[Any]:
    """The outputs to a request."""
    force, mode, armed, label, gain, _ = values
    return [gain * force, mode, not armed, label]


class Clock:
    """A clock that stands still but for tick ns with each look at it."""

    def __init__(self, tick: int = 0) -> None:
        self.now = 0
        self.tick = tick

    def __call__(self) -> int:
        self.now += self.tick
        return self.now


class ScriptedPeer:
    """Answers requests by answers(), but for those for which something else is in the script."""

    def __init__(
        self,
        clock: Clock | None = None,
        signature: Signature = SIGNATURE,
        outputs: Callable[[Sequence[Any]], list[Any]] = answers,
        key: bytes | None = None,
    ) -> None:
        self.clock = clock or Clock()
        self.signature = signature
        self.got: list[Message] = []
        self.datagrams: list[bytes] = []
        self.script: dict[int, deque[Act]] = {kind: deque() for kind in (HELLO, INITIALISE, STEP)}
        self.kept: list[bytes] = []
        self.failures: list[BaseException] = []
        self.offset = 0.0
        """s by which the outputs belong to another time."""
        self._outputs = outputs
        self._sealer = Sealer(key)
        self._cookies = count(1000)
        self._cookie = 0
        self._source: Any = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port: int = self._socket.getsockname()[1]
        self._thread = Thread(target=self._run)
        self._thread.start()

    def __enter__(self) -> "ScriptedPeer":
        return self

    def __exit__(self, *_: object) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            s.sendto(b"", ("127.0.0.1", self.port))
        self._thread.join()
        self._socket.close()
        assert not self.failures

    def kinds(self) -> list[int]:
        """The kinds of the requests so far."""
        return [m.kind for m in self.got]

    def values(self, m: Message) -> list[Any]:
        """What a request holds."""
        values = Codec(self.signature.request).unpack(m.body)
        assert values is not None
        return values

    def told(self, kind: int, *acts: Act) -> None:
        """Put acts into the script for the next requests of a kind."""
        self.script[kind].extend(acts)

    def send(self, datagram: bytes) -> None:
        self._socket.sendto(datagram, self._source)

    def pack(
        self, m: Message, kind: int, body: bytes = b"", code: int = 0, **changed: Any
    ) -> bytes:
        """The datagram of an answer to m."""
        answer = m._replace(kind=kind, code=code, interface=self.signature.hash, body=body)
        return self._sealer.pack(answer._replace(step=0.0, **changed))

    def outputs(self, m: Message) -> bytes:
        """The OUTPUTS to m."""
        body = Codec(self.signature.answer).pack(self._outputs(self.values(m)))
        return self.pack(m, OUTPUTS, body, time=m.time + m.step - self.offset)

    def _run(self) -> None:
        while True:
            datagram, self._source = self._socket.recvfrom(LARGEST)
            if not datagram:
                return
            try:
                self._receive(datagram)
            except BaseException as error:  # shown when the test is over
                self.failures.append(error)

    def _receive(self, datagram: bytes) -> None:
        m = self._sealer.open(datagram)
        assert isinstance(m, Message), m
        self.datagrams.append(datagram)
        self.got.append(m)
        if m.kind == END:
            return
        script = self.script[m.kind]
        act = script.popleft() if script else welcome if m.kind == HELLO else answer
        act(self, m)

    def new_cookie(self) -> int:
        """A cookie for a new session."""
        self._cookie = next(self._cookies)
        return self._cookie


# What a peer may do


def welcome(peer: ScriptedPeer, m: Message) -> None:
    peer.send(peer.pack(m, WELCOME, cookie=peer.new_cookie()))


def answer(peer: ScriptedPeer, m: Message) -> None:
    peer.send(peer.outputs(m))


def miss(peer: ScriptedPeer, m: Message) -> None:
    """Let the deadline pass."""
    peer.clock.now += 10**12
    peer.send(peer.pack(m, WELCOME))  # again, which means nothing


def keep(peer: ScriptedPeer, m: Message) -> None:
    """Have the answer ready, but let the deadline pass."""
    peer.kept.append(peer.outputs(m))
    miss(peer, m)


def send_kept_and_miss(peer: ScriptedPeer, m: Message) -> None:
    """The answers that were kept come now, the one to this step does not."""
    for datagram in peer.kept:
        peer.send(datagram)
    miss(peer, m)


def send_kept_and_answer(peer: ScriptedPeer, m: Message) -> None:
    for datagram in peer.kept:
        peer.send(datagram)
    answer(peer, m)


def fail(peer: ScriptedPeer, m: Message) -> None:
    peer.send(peer.pack(m, REFUSE, b"the motor\nis hot", FAILED))


def forget(peer: ScriptedPeer, m: Message) -> None:
    """As after a new start."""
    peer.send(peer.pack(m, REFUSE, b"", UNKNOWN))


def busy(peer: ScriptedPeer, m: Message) -> None:
    peer.clock.now += 60_000_000
    peer.send(peer.pack(m, REFUSE, b"", BUSY))


def other(signature: Signature) -> Act:
    def act(peer: ScriptedPeer, m: Message) -> None:
        text, own = signature.text.encode(), signature.hash
        peer.send(peer.pack(m, REFUSE, text, OTHER_INTERFACE, interface=own))

    return act


def datagrams(first: Iterable[bytes], then: Act = answer) -> Act:
    """Send these first."""

    def act(peer: ScriptedPeer, m: Message) -> None:
        for datagram in first:
            peer.send(datagram)
        then(peer, m)

    return act


# The slave


KIND: Kind = "python"
"""The kind of proxy that a Host is; a test module chooses it with on_each_kind."""


@pytest.fixture(autouse=True)
def on_each_kind(kind: Kind, monkeypatch: pytest.MonkeyPatch) -> None:
    """To import into a test module: its hosts are of the kind that it runs on."""
    monkeypatch.setattr("support.scripted_peer.KIND", kind)


class PythonSlave:
    """The slave of a proxy that Python runs, without its FMU around it."""

    def __new__(cls, variables: Sequence[Variable], clock: Callable[[], int]) -> Any:
        slave_type: Any = type(Fmi2Proxy)
        slave = slave_type(
            "AnyProxy",
            (Fmi2Proxy,),
            {
                "__module__": "made_by_a_test",
                "original": "Original.fmu",
                "variables": tuple(variables),
                "clock": staticmethod(clock),
            },
        )
        logger = ctypes.create_string_buffer(256)  # where no instance name stands
        made = slave(None, "proxy", "", ctypes.addressof(logger), 0)
        made.logger = logger
        return made


class Intercepted:
    """A socket of which a test sees what is sent, and may raise an OSError instead."""

    def __init__(self, real: socket.socket, act: Callable[[bytes], None]) -> None:
        self._real, self._act = real, act

    def send(self, datagram: bytes) -> int:
        self._act(datagram)
        return self._real.send(datagram)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._real, name)


class Host:
    """A proxy's slave as pythonfmu calls it, by variable name."""

    def __init__(
        self, port: int, clock: Callable[[], int], variables: Sequence[Variable] = VARIABLES,
        **settings: Any,
    ) -> None:  # fmt: skip
        self.slave: Any
        if KIND == "python":
            self.slave = PythonSlave(variables, clock)
        else:
            self.slave = NativeSlave(variables, clock, NATIVE[KIND])
        self.references = {v.name: i for i, v in enumerate(self.slave._variables)}
        self.time = 0.0
        self.set(**{"proxy.port": port, "proxy.timeout": 100.0, "proxy.connect_timeout": 100.0})
        settings = {"on_loss": "failsafe", **settings}
        self.set(**{f"proxy.{name}": value for name, value in settings.items()})

    @contextmanager
    def intercepted(self, act: Callable[[bytes], None]) -> Iterator[None]:
        """What it sends meanwhile is seen by `act`, which may raise an OSError instead."""
        if KIND != "python":
            before, self.slave.intercept = self.slave.intercept, act
            yield
            self.slave.intercept = before
            return
        with pytest.MonkeyPatch.context() as m:
            real = socket.socket
            m.setattr(socket, "socket", lambda *which: Intercepted(real(*which), act))
            if (ours := self.slave._connection) is not None:
                m.setattr(ours, "_socket", Intercepted(ours._socket, act))
            yield

    @contextmanager
    def looking_up(self, act: Callable[[], None]) -> Iterator[None]:
        """Before it looks up a name it calls `act`, in the thread that does so."""
        if KIND != "python":
            self.slave.look_up = act
            yield
            return
        real = socket.getaddrinfo

        def looked_up(*arguments: Any) -> Any:
            if not arguments[-1] & socket.AI_NUMERICHOST:
                act()
            return real(*arguments)

        with pytest.MonkeyPatch.context() as m:
            m.setattr(socket, "getaddrinfo", looked_up)
            yield

    def _kind(self, name: str) -> str:
        return TYPES[self.slave._variables[self.references[name]].kind].lower()

    def set(self, **values: Any) -> None:
        for name, value in values.items():
            put = getattr(self.slave, f"set_{self._kind(name)}")
            put([self.references[name]], [value])

    def get(self, name: str) -> Any:
        return getattr(self.slave, f"get_{self._kind(name)}")([self.references[name]])[0]

    def outputs(self) -> list[Any]:
        return [self.get(v.name) for v in VARIABLES if v.causality == "output"]

    def state(self) -> int:
        return int(self.get("proxy.state"))

    def counts(self) -> dict[str, int]:
        """The counters that are not 0."""
        names = ("missed", "consecutive_missed", "late", "out_of_order", "duplicated", "rejected")
        return {name: n for name in names if (n := self.get(f"proxy.{name}"))}

    def initialise(self) -> "Host":
        self.slave.setup_experiment(0.0)
        self.slave.enter_initialization_mode()
        self.slave.exit_initialization_mode()
        return self

    def step(self, size: float = 0.25) -> None:
        assert self.slave.do_step(self.time, size)
        self.time += size

    def log(self) -> list[str]:
        return [m.msg for m in self.slave._get_log_queue()]


@contextmanager
def connected(
    variables: Sequence[Variable] = VARIABLES, clock: Clock | None = None, **settings: Any
) -> Iterator[tuple[Host, ScriptedPeer]]:
    """A proxy in step mode, and its peer."""
    with ScriptedPeer(clock) as peer:
        host = Host(peer.port, peer.clock, variables, **settings)
        try:
            yield host.initialise(), peer
        finally:
            host.slave.terminate()
