"""A bench stand-in at a UDP port."""

import select
import socket
import time
from typing import Self

from grasp_fmus.link.message import LARGEST, PORT

from ..system.parts import NANOSECONDS
from .address import Address, listening, resolved, text
from .bench import Bench, Say

DEFAULT_ADDRESS: Address = ("127.0.0.1", PORT)
"""Where a bench listens if nobody says otherwise: where a proxy looks for it."""

BURST = 64
"""The most datagrams that are taken before the bench's clock is looked at again."""


class Server:
    """Serves a bench, which it closes. A context manager; serve() returns after stop()."""

    def __init__(
        self, bench: Bench, address: Address = ("127.0.0.1", 0), say: Say = lambda _: None
    ) -> None:
        """Bind the port, 0 for any that is free; InputError where that is not possible."""
        self.bench = bench
        self._say = say
        try:
            self._socket = listening(resolved(*address))
        except BaseException:
            bench.close()
            raise
        self._wake, self._woken = socket.socketpair()

    @property
    def address(self) -> Address:
        """Where it listens."""
        host, port = self._socket.getsockname()
        return host, port

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close the server."""
        self.close()

    def close(self) -> None:
        """Free the FMU and the port."""
        self.bench.close()
        for s in (self._socket, self._wake, self._woken):
            s.close()

    def stop(self) -> None:
        """Have serve() return; from another thread or from a signal handler."""
        self._wake.send(b"\0")

    def serve(self, sessions: int | None = None, duration_ns: int | None = None) -> None:
        """Serve until stop(), or for so many sessions or so long."""
        end = None if duration_ns is None else time.monotonic_ns() + duration_ns
        while sessions is None or self.bench.served.sessions < sessions:
            now = time.monotonic_ns()
            if end is not None and now >= end:
                return
            moments = [m for m in (end, self.bench.due()) if m is not None]
            wait = max(0, min(moments) - now) / NANOSECONDS if moments else None
            # Not poll(), which rounds up to whole milliseconds
            ready, _, _ = select.select((self._socket, self._woken), (), (), wait)
            if self._woken in ready:
                return
            if ready:
                self._receive()
            self.bench.look(time.monotonic_ns())

    def _receive(self) -> None:
        """Take what has come, at most a burst of it."""
        for _ in range(BURST):
            try:
                datagram, source = self._socket.recvfrom(LARGEST + 1)
            except (BlockingIOError, ConnectionError):  # nothing there; or an answer found nobody
                return
            answer = self.bench.answer(datagram, text(source), time.monotonic_ns())
            if answer is not None:
                self._send(answer, source)

    def _send(self, answer: bytes, source: Address) -> None:
        try:
            self._socket.sendto(answer, source)
        except OSError as error:  # to the proxy it is a lost datagram
            self._say(f"{text(source)}: not sent: {error.strerror or error}")
