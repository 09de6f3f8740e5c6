"""A peer that answers as it is told, in a thread.

The clock is the test's: a step is missed because the peer puts the clock past the deadline, and
then wakes the proxy with a datagram that means nothing. So nothing depends on how fast things go.
"""

import socket
from collections import deque
from collections.abc import Callable, Iterable, Sequence
from itertools import count
from threading import Thread
from typing import Any

from grasp_fmus.link.message import (
    BUSY,
    END,
    FAILED,
    HELLO,
    INITIALISE,
    LARGEST,
    OUTPUTS,
    REFUSE,
    STEP,
    UNKNOWN,
    WELCOME,
    Codec,
    Message,
    Sealer,
)
from grasp_fmus.link.signature import Signature
from grasp_fmus.proxy import shared_signature
from grasp_fmus.variable import Variable

Act = Callable[["ScriptedPeer", Message], None]

VARIABLES = (
    Variable("force", float, "input", "N", 1.5),
    Variable("mode", int, "input", "", 3, "discrete"),
    Variable("armed", bool, "input", "", True, "discrete"),
    Variable("gain", float, "parameter", "1", 2.0, "tunable"),
    Variable("mass", float, "parameter", "kg", 0.5, "fixed"),
    Variable("doubled", float, "output", "N"),
    Variable("passed", int, "output", "", None, "discrete"),
    Variable("denied", bool, "output", "", None, "discrete"),
)
"""One of each kind and causality; what the peer answers is in answers()."""

SIGNATURE = shared_signature(VARIABLES)


def answers(values: Sequence[Any]) -> list[Any]:
    """The outputs to a request."""
    force, mode, armed, gain, _ = values
    return [gain * force, mode, not armed]


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
        body = Codec(self.signature.answer).pack(*self._outputs(self.values(m)))
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


def refuse(code: int, reason: bytes = b"", **changed: Any) -> Act:
    return lambda peer, m: peer.send(peer.pack(m, REFUSE, reason, code, **changed))


def datagrams(first: Iterable[bytes], then: Act = answer) -> Act:
    """Send these first."""

    def act(peer: ScriptedPeer, m: Message) -> None:
        for datagram in first:
            peer.send(datagram)
        then(peer, m)

    return act
