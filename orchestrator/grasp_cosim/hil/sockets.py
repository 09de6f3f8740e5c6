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

LARGEST = 65_536
"""Bytes to take of a datagram; no UDP datagram has as many."""

NOT_HERE = "cannot listen there: {}; must be an address of this machine and a free port, or 0"


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
            self.register(woken, lambda: woken.recv(LARGEST))
            made = _socket(socket.socket.bind, resolved(*address), NOT_HERE)
            self.port_socket = stack.enter_context(made)
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
        data, source = readable.recvfrom(LARGEST)
    except (BlockingIOError, ConnectionError):  # a broken datagram; nobody took an earlier one
        return None
    return data, _address(source)


def connected(peer: Address) -> socket.socket:
    """Return a socket that receives from the peer alone; InputError where there is no way to it."""
    return _socket(socket.socket.connect, peer, "no way to the peer: {}")


def _socket(
    attach: Callable[[socket.socket, Address], None], address: Address, wrong: str
) -> socket.socket:
    """Return a socket that does not block, attached to `address`; `wrong` is said if it cannot."""
    family = socket.AF_INET6 if ":" in address[0] else socket.AF_INET
    made = socket.socket(family, socket.SOCK_DGRAM)
    try:
        attach(made, address)
    except OSError as error:
        made.close()
        raise InputError(f"{text(address)}: {wrong.format(error.strerror)}") from error
    made.setblocking(False)
    return made


def resolved(host: str, port: int, lowest_port: int = 0) -> Address:
    """Return address and port; InputError where the host has none or the port is wrong.

    A name that has an address of IPv4 stands for that.
    """
    if not lowest_port <= port <= 65_535:
        raise InputError(f"{text((host, port))}: port must be from {lowest_port} to 65535")
    plain = host[1:-1] if host.startswith("[") and host.endswith("]") else host
    try:
        if not plain:
            raise OSError("no name")
        found = socket.getaddrinfo(plain, port, socket.AF_UNSPEC, socket.SOCK_DGRAM)
    except (OSError, UnicodeError) as error:
        raise InputError(
            f"{text((host, port))}: no such host; must be an address or a name that has one"
        ) from error
    chosen = next((f for f in found if f[0] == socket.AF_INET), found[0])
    return _address(chosen[4])[0], port


def _address(found: tuple[Any, ...]) -> Address:
    """The address as the system tells it: of one on this link with the number of the interface."""
    host, port, *more = found
    scope = more[1] if len(more) > 1 else 0
    plain = str(host).partition("%")[0]
    return (f"{plain}%{scope}" if scope else plain), int(port)


def read_address(place: str, given: str) -> Address:
    """The address that a text says, HOST:PORT, [ADDRESS]:PORT, or PORT of this machine.

    place says whose. InputError where it is none.
    """
    found = re.fullmatch(r"(?:(\[[^][]+\]|[^:]+):)?([0-9]{1,5})", given)
    if not found:
        must = "must be HOST:PORT, as in 127.0.0.1:5501 or [::1]:5501, or PORT"
        raise InputError(f"{place} {given!r}: {must}")
    return found[1] or "127.0.0.1", int(found[2])


def text(address: Address) -> str:
    """Return an address as in a command line, 127.0.0.1:5501 or [::1]:5501."""
    host, port = address
    return f"[{host}]:{port}" if ":" in host and not host.startswith("[") else f"{host}:{port}"


def is_loopback(address: Address) -> bool:
    """Return True if only this machine can send there."""
    return ipaddress.ip_address(address[0].partition("%")[0]).is_loopback
