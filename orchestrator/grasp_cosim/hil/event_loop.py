"""A loop at a UDP port that waits for datagrams and for time, until it is stopped."""

import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from select import select
from typing import Any, Self

from ..system.parts import NANOSECONDS
from .address import Address, listening, resolved

LARGEST = 65_536
"""Bytes to take of a datagram; no UDP datagram has as many."""


class EventLoop:
    """Listens at a port once it is made; `run` calls the handlers. Leaving the context closes it.

    `due` returns when there is something to do next, in ns of the clock, None for not by time;
    `look` does what is due at a time. InputError where the address has no IPv4 address of this
    machine, or the port is taken.
    """

    def __init__(
        self,
        address: Address,
        due: Callable[[], int | None],
        look: Callable[[int], None],
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._due, self._look, self._clock = due, look, clock
        self._lock = threading.Lock()  # handlers work on what other threads may read
        self._stopping = False
        self._end: int | None = None
        with ExitStack() as stack:
            self._handlers: dict[socket.socket, Callable[[], Any]] = {}
            self._wake, woken = (stack.enter_context(end) for end in socket.socketpair())
            self._wake.setblocking(False)
            self.register(woken, lambda: woken.recv(LARGEST))
            self.port_socket = stack.enter_context(listening(resolved(*address)))
            self.address: Address = self.port_socket.getsockname()
            self._stack = stack.pop_all()

    def register(self, readable: socket.socket, handler: Callable[[], Any]) -> None:
        """Have `handler` called whenever there is something to receive at a socket."""
        self._handlers[readable] = handler

    def run(self, duration_ns: int | None = None, done: Callable[[], bool] = lambda: False) -> None:
        """Go on until `stop`, until `done`, or for a duration in ns.

        Whatever a handler raises ends it.
        """
        self._end = None if duration_ns is None else self._clock() + duration_ns
        while not (self.over() or done()):
            self.turn(None if self._end is None else self._end - self._clock())

    def over(self) -> bool:
        """Return True once `run` has to return: what takes long must not go on then."""
        return self._stopping or (self._end is not None and self._clock() >= self._end)

    def turn(self, wait_ns: int | None) -> None:
        """Wait for a datagram, for what is due, for `stop` or `wait_ns`; then do what there is."""
        waits = [] if wait_ns is None else [wait_ns]
        if (due := self._due()) is not None:
            waits.append(max(due - self._clock(), 0))
        most = max(min(waits), 0) / NANOSECONDS if waits else None
        # to the microsecond, where epoll() and poll() wait to the millisecond
        ready, _, _ = select([*self._handlers], [], [], most)
        with self._lock:
            # the port last: its handler may close another socket that is ready, too
            for readable in sorted(ready, key=lambda r: r is self.port_socket):
                self._handlers[readable]()
            self._look(self._clock())

    def stop(self) -> None:
        """Make `run` return; may be called from any thread, a signal handler, and repeatedly."""
        self._stopping = True
        with suppress(BlockingIOError):  # full of earlier calls: that wakes it, too
            self._wake.send(b"\0")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close all sockets. Must not be called while `run` goes on."""
        self._stack.close()


def received(readable: socket.socket) -> tuple[bytes, Address] | None:
    """Return a datagram and its sender; None where what made the socket readable was none."""
    try:
        return readable.recvfrom(LARGEST)
    except (BlockingIOError, ConnectionError):  # a broken datagram; nobody took an earlier one
        return None
