"""A peer that answers as it is told, in a thread.

The clock is the test's: a step is missed because the peer puts the clock past the deadline, and
then wakes the proxy with a datagram that means nothing. So nothing depends on how fast things go.
"""

import socket
from collections import deque
from collections.abc import Callable
from itertools import count
from threading import Thread

from grasp_cosim.fmu_export.contract import Variable
from grasp_cosim.fmu_export.link import (
    BUILD_SIZE,
    BUSY,
    END,
    FAILED,
    HELLO,
    INITIALISE,
    LARGEST,
    NAME_SIZE,
    OUTPUTS,
    REFUSE,
    STEP,
    UNKNOWN,
    WELCOME,
    Codec,
    Message,
    Sealer,
)
from grasp_cosim.fmu_export.proxy import shared_signature

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
"""One of each kind and causality; what the peer answers is in outputs()."""

SIGNATURE = shared_signature(VARIABLES)


class Clock:
    """A clock that stands still but for tick ns with each look at it."""

    def __init__(self, tick=0):
        self.now = 0
        self.tick = tick

    def __call__(self):
        self.now += self.tick
        return self.now


class ScriptedPeer:
    """Answers requests by outputs(), but for those for which something else is in the script."""

    def __init__(self, clock=None, key=None):
        self.clock = clock or Clock()
        self.got = []
        self.datagrams = []
        self.script = {kind: deque() for kind in (HELLO, INITIALISE, STEP)}
        self.kept = []
        self.failures = []
        self.offset = 0.0
        """s by which the outputs belong to another time."""
        self._sealer = Sealer(key)
        self.cookies = count(1000)
        self._source = None
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.bind(("127.0.0.1", 0))
        self.port = self._socket.getsockname()[1]
        self._thread = Thread(target=self._run)
        self._thread.start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as s:
            s.sendto(b"", ("127.0.0.1", self.port))
        self._thread.join()
        self._socket.close()
        assert not self.failures

    def kinds(self):
        """The kinds of the requests so far."""
        return [m.kind for m in self.got]

    def values(self, m):
        """What a request holds."""
        return Codec(SIGNATURE.request).unpack(m.body)

    def told(self, kind, *acts):
        """Put acts into the script for the next requests of a kind."""
        self.script[kind].extend(acts)

    def send(self, datagram):
        self._socket.sendto(datagram, self._source)

    def pack(self, m, kind, body=b"", code=0, **changed):
        """The datagram of an answer to m."""
        answer = m._replace(kind=kind, code=code, interface=SIGNATURE.hash, body=body)
        return self._sealer.pack(answer._replace(**{"step": 0.0, "counted": 0, **changed}))

    def outputs(self, m):
        """The OUTPUTS to m."""
        force, mode, armed, gain, _ = self.values(m)
        body = Codec(SIGNATURE.answer).pack(gain * force, mode, not armed)
        return self.pack(m, OUTPUTS, body, time=m.time + m.step - self.offset)

    def _run(self):
        while True:
            datagram, self._source = self._socket.recvfrom(LARGEST)
            if not datagram:
                return
            try:
                self._receive(datagram)
            except BaseException as error:  # shown when the test is over
                self.failures.append(error)

    def _receive(self, datagram):
        m = self._sealer.open(datagram)
        assert isinstance(m, Message), m
        self.datagrams.append(datagram)
        self.got.append(m)
        if m.kind == END:
            return
        script = self.script[m.kind]
        act = script.popleft() if script else welcome if m.kind == HELLO else answer
        act(self, m)


# What a peer may do


NOBODY = bytes(NAME_SIZE + BUILD_SIZE)
"""What a peer without a name and a build says of itself."""


def welcome(peer, m):
    peer.send(peer.pack(m, WELCOME, NOBODY, cookie=next(peer.cookies)))


def answer(peer, m):
    peer.send(peer.outputs(m))


def miss(peer, m):
    """Let the deadline pass."""
    peer.clock.now += 10**12
    peer.send(peer.pack(m, WELCOME, NOBODY))  # again, which means nothing


def keep(peer, m):
    """Have the answer ready, but let the deadline pass."""
    peer.kept.append(peer.outputs(m))
    miss(peer, m)


def send_kept_and_miss(peer, m):
    """The answers that were kept come now, the one to this step does not."""
    for datagram in peer.kept:
        peer.send(datagram)
    miss(peer, m)


def send_kept_and_answer(peer, m):
    for datagram in peer.kept:
        peer.send(datagram)
    answer(peer, m)


def fail(peer, m):
    peer.send(peer.pack(m, REFUSE, b"the motor\nis hot", FAILED))


def forget(peer, m):
    """As after a new start."""
    peer.send(peer.pack(m, REFUSE, b"", UNKNOWN))


def busy(peer, m):
    peer.clock.now += 60_000_000
    peer.send(peer.pack(m, REFUSE, b"", BUSY))


def refuse(code, reason=b"", **changed):
    return lambda peer, m: peer.send(peer.pack(m, REFUSE, reason, code, **changed))
