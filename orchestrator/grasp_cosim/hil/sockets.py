"""UDP: addresses, sockets there, and a loop at a port that waits for datagrams and time.

An address is of IPv4 or IPv6. In a text with a port one of IPv6 is in brackets, as in [::1]:5501.
"""

import ipaddress
import re
import socket
import threading
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from select import select
from typing import Any, Self

from ..base.errors import InputError
from ..system.times import NANOSECONDS

Address = tuple[str, int]
"""Address, in numbers, and port."""

MAX_DATAGRAM = 65_536
"""Bytes to take of a datagram; no UDP datagram has as many."""

NOT_LOCAL = "cannot listen there: {}; must be an address of this machine and a free port, or 0"


class EventLoop:
    """Listens at a port once it is made; `run` calls the handlers. Leaving the context closes it.

    `due` returns when there is something to do next, in ns of the clock, None for not by time;
    `look` does what is due at a time. InputError where the address is none of this machine, or the
    port is taken.
    """

    def __init__(
        self, address: Address, due: Callable[[], int | None], look: Callable[[int], None]
    ) -> None:
        self._due, self._look = due, look
        self._lock = threading.Lock()  # handlers work on what other threads may read
        self._stopping = False
        with ExitStack() as stack:
            self._handlers: dict[socket.socket, Callable[[], Any]] = {}
            self._wake, woken = (stack.enter_context(end) for end in socket.socketpair())
            self._wake.setblocking(False)
            self.register(woken, lambda: woken.recv(MAX_DATAGRAM))
            bound = _socket(socket.socket.bind, resolved(*address), NOT_LOCAL)
            self.port_socket = stack.enter_context(bound)
            self.address: Address = _address(self.port_socket.getsockname())
            self._stack = stack.pop_all()

    def register(self, readable: socket.socket, handler: Callable[[], Any]) -> None:
        """Have `handler` called whenever there is something to receive at a socket."""
        self._handlers[readable] = handler

    def run(self, done: Callable[[], bool] = lambda: False) -> None:
        """Go on until `stop`, or until `done`. Whatever a handler raises ends it."""
        while not (self._stopping or done()):
            due, wait = self._due(), None
            if due is not None:
                wait = max(due - time.monotonic_ns(), 0) / NANOSECONDS
            # to the microsecond, where epoll() and poll() wait to the millisecond
            ready, _, _ = select([*self._handlers], [], [], wait)
            with self._lock:
                # the port last: its handler may close another socket that is ready, too
                for readable in sorted(ready, key=lambda r: r is self.port_socket):
                    self._handlers[readable]()
                self._look(time.monotonic_ns())

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
        data, source = readable.recvfrom(MAX_DATAGRAM)
    except (BlockingIOError, ConnectionError):  # a broken datagram; nobody took an earlier one
        return None
    return data, _address(source)


def connected(peer: Address) -> socket.socket:
    """Return a socket that receives from the peer only; InputError where there is no way to it."""
    return _socket(socket.socket.connect, peer, "no way to the peer: {}")


def _socket(
    attach: Callable[[socket.socket, Address], None], address: Address, message: str
) -> socket.socket:
    """Return a socket that does not block, attached to `address`; InputError if it cannot be.

    The `message` has a place for the reason.
    """
    family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
    new_socket = socket.socket(family, socket.SOCK_DGRAM)
    try:
        attach(new_socket, address)
    except OSError as error:
        new_socket.close()
        raise InputError(f"{text(address)}: {message.format(error.strerror)}") from error
    new_socket.setblocking(False)
    return new_socket


def resolved(host: str, port: int, lowest_port: int = 0) -> Address:
    """Return address and port; InputError where the host has none or the port is wrong.

    A name that has an address of IPv4 stands for that.
    """
    if not lowest_port <= port <= 65_535:
        raise InputError(f"{text((host, port))}: port must be from {lowest_port} to 65535")
    name = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    try:
        if not name:
            raise OSError("no name")
        candidates = socket.getaddrinfo(name, port, socket.AF_UNSPEC, socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"{text((host, port))}: no such address; must be an IP address or a name that has one"
        ) from error
    of_ipv4 = (entry for entry in candidates if entry[0] == socket.AF_INET)
    *_, socket_address = next(of_ipv4, candidates[0])
    return _address(socket_address)[0], port


def _address(socket_address: tuple[Any, ...]) -> Address:
    """The address as the system tells it: of one on this link with the number of the interface."""
    host, port, *of_ipv6 = socket_address
    scope = of_ipv6[1] if len(of_ipv6) > 1 else 0  # behind the flow information
    number = str(host).partition("%")[0]
    return (f"{number}%{scope}" if scope else number), int(port)


def read_address(place: str, address: str) -> Address:
    """The address that a text gives, HOST:PORT, [ADDRESS]:PORT, or PORT of this machine.

    place says whose. InputError where it is none.
    """
    match = re.fullmatch(r"(?:(\[[^][]+\]|[^:]+):)?([0-9]{1,5})", address)
    if not match:
        must = "must be HOST:PORT, as in 127.0.0.1:5501 or [::1]:5501, or PORT"
        raise InputError(f"{place} {address!r}: {must}")
    return match[1] or "127.0.0.1", int(match[2])


def text(address: Address) -> str:
    """Return an address as in a command line, 127.0.0.1:5501 or [::1]:5501."""
    host, port = address
    return f"[{host}]:{port}" if ":" in host and not host.startswith("[") else f"{host}:{port}"


def is_loopback(address: Address) -> bool:
    """Return True if only this machine can send there."""
    return ipaddress.ip_address(address[0].partition("%")[0]).is_loopback
