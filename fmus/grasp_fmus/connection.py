"""A proxy's connection to its peer: the socket, and how long an answer is awaited."""

import socket
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from errno import ECONNREFUSED
from secrets import randbits
from select import select
from threading import Thread
from time import monotonic_ns
from typing import Any

from .link.client import Client, Refusal, Verdict
from .link.message import BUSY, FAILED, LARGEST, UNKNOWN, Value

REPEAT = 50_000_000
"""ns after which a HELLO or an INITIALISE without an answer is sent again."""

FILL = 1024
"""Bytes by which a HELLO is longer after an answer that was cut; four times as many the next."""

STALE = 64
"""The most datagrams to take, before a request, of those that came after the last."""

DESCRIPTORS = 1024
"""The descriptors that select() can watch; on Windows it can watch any."""

NEW, GREETING, WELCOME, INITIALISING, READY = range(5)


class Connection:
    """One socket, connected to the peer. Times are ns of the clock, or s of simulation. Close it.

    A request is given up at its deadline, whatever comes meanwhile. `refusal` says why the last one
    was refused, None where it was not; `trouble` is what the network reported, " (in brackets)".
    """

    def __init__(
        self,
        host: str,
        port: int,
        client: Client,
        deadline: int,
        clock: Callable[[], int] = monotonic_ns,
    ) -> None:
        """OSError where no such host was found until the deadline, or no socket is to be had."""
        self.client = client
        self.refusal: Refusal | None = None
        self.trouble = ""
        self.sessions = 0
        """Sessions begun."""
        self._clock = clock
        self._stage = NEW
        self._pending = b""
        address = _address(host, port, lambda: (deadline - clock()) * 1e-9)
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            if sys.platform != "win32" and self._socket.fileno() >= DESCRIPTORS:
                raise OSError(f"the host has {DESCRIPTORS} files open: must have fewer")
            self._socket.setblocking(False)
            self._socket.connect(address)
        except OSError:
            self._socket.close()
            raise

    def close(self) -> None:
        """End the session, if there is one, and close the socket."""
        if self._stage > GREETING:
            with suppress(OSError):  # a peer that is gone needs no end
                self._socket.send(self.client.end(self._clock()))
        self._socket.close()

    def greet(self, deadline: int) -> bool:
        """Begin a session, or go on with what was begun; return True if the peer welcomes it."""
        if self._stage == NEW:
            self._pending = self.client.greet(randbits(64), self._clock())
            self._stage = GREETING
        fill = FILL
        while self._stage == GREETING:
            if self._ask(self._pending, deadline, repeat=True):
                self._stage = WELCOME
                self.sessions += 1
            elif self.refusal and self.refusal.cut and fill <= LARGEST:
                self._pending = self.client.greet(randbits(64), self._clock(), fill)
                fill *= 4
            else:
                break
        return self._stage > GREETING

    def initialise(self, time: float, values: Sequence[Value], deadline: int) -> bool:
        """Set values, or go on with what is under way; return True if the outputs are there."""
        if self._stage != INITIALISING:
            self._pending = self.client.initialise(time, values, self._clock())
            self._stage = INITIALISING
        if self._ask(self._pending, deadline, repeat=True):
            self._stage = READY
        elif self.refusal and self.refusal.code in (UNKNOWN, FAILED):
            self._stage = NEW
        return self._stage == READY

    def step(
        self, time: float, step: float, values: Sequence[Value], deadline: int, anew: bool
    ) -> bool:
        """Step from `time` over `step`, both in s; return True if the outputs came in time.

        With `anew`, begin another session where the peer does not know this one, or there is none.
        """
        for _ in range(2):
            if self._stage != READY and not (
                self.greet(deadline) and self.initialise(time, values, deadline)
            ):
                break
            request = self.client.step(time, step, values, self._clock())
            if self._ask(request, deadline, repeat=False):
                return True
            if not (anew and self.refusal and self.refusal.code == UNKNOWN):
                break
            self._stage = NEW
        if self._stage == READY:
            self.client.miss()
        else:  # what is under way is awaited in the next step as well
            self.client.counters.missed += 1
        return False

    def _ask(self, request: bytes, deadline: int, repeat: bool) -> bool:
        """Send a request and wait for its answer until the deadline; return True if it came."""
        self.refusal, self.trouble = None, ""
        verdict, again = self._drain(deadline), None
        while verdict is Verdict.NOTHING and (now := self._clock()) < deadline:
            if again is None or now >= again:
                self._send(request)
                again = now + REPEAT if repeat else deadline
            if select([self._socket], [], [], (min(again, deadline) - now) * 1e-9)[0]:
                verdict = self._receive() or Verdict.NOTHING
        return verdict is Verdict.ANSWERED

    def _drain(self, deadline: int) -> Verdict:
        """Take what came since the last request, up to an answer to one that is repeated."""
        for _ in range(STALE):
            verdict = self._receive()
            if verdict is not Verdict.NOTHING:
                return verdict or Verdict.NOTHING
            if self._clock() >= deadline:  # large ones with a tag to check take their time
                break
        return Verdict.NOTHING

    def _receive(self) -> Verdict | None:
        """Take one datagram; return None where there is none."""
        try:
            datagram = self._socket.recv(LARGEST + 1)
        except BlockingIOError:
            return None
        except OSError as error:  # of an earlier datagram: that it did not arrive
            self._note(error)
            return Verdict.NOTHING
        verdict = self.client.receive(datagram, self._clock())
        if verdict is Verdict.REFUSED:
            self.refusal = self.client.refusal
            if self.refusal and self.refusal.code == BUSY:
                return Verdict.NOTHING  # it may become free
        return verdict

    def _send(self, request: bytes) -> None:
        for _ in range(2):  # a call that reports what became of an earlier datagram sends nothing
            try:
                self._socket.send(request)
            except OSError as error:
                self._note(error)
            else:
                return

    def _note(self, error: OSError) -> None:
        if error.errno != ECONNREFUSED:  # that nobody listens is what no answer means
            self.trouble = f" ({error.strerror or error})"


def _address(host: str, port: int, left: Callable[[], float]) -> Any:
    """Return the address of a host; OSError where there is none, or not in the s that are left.

    There is no deadline to the resolver: a thread calls it, and is left alone with it.
    """
    try:
        return _found(host, port, socket.AI_NUMERICHOST)
    except OSError:
        pass  # it is a name
    answer: list[Any] = []

    def look_up() -> None:
        try:
            answer.append(_found(host, port))
        except OSError as error:
            answer.append(error)

    thread = Thread(target=look_up, daemon=True)
    thread.start()
    thread.join(max(left(), 0.0))
    if not answer:
        raise OSError("its name was not resolved in time")
    if isinstance(answer[0], Exception):
        raise answer[0]
    return answer[0]


def _found(host: str, port: int, flags: int = 0) -> Any:
    name = host.encode()  # as it is: a text would be in IDNA, or refused where it cannot be
    return socket.getaddrinfo(name, port, socket.AF_INET, socket.SOCK_DGRAM, 0, flags)[0][4]
