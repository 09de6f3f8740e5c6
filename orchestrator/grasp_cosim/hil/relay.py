"""A relay of UDP datagrams between clients and one peer, through a nasty network.

Knows nothing of what is in a datagram. Every client has a socket of its own towards the peer, so
that the peer can tell them apart; the peer sees the addresses of these.
"""

import selectors
import socket
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass

from ..errors import InputError
from ..system.parts import NANOSECONDS
from .address import Address, is_loopback, listening, resolved, text
from .network import Direction, Network
from .traffic import Counters, Held, Log, Traffic

MOST_CLIENTS = 16
"""Clients remembered; a further one takes the place of the one that was silent for longest."""

ANY = "0.0.0.0"  # noqa: S104  compared with, not listened on
"""Stands for all addresses of this machine."""

LARGEST = 65_535
"""Bytes, more than any UDP datagram has."""


@dataclass(frozen=True, slots=True)
class _Client:
    address: Address
    towards_peer: socket.socket


class Relay:
    """Listens once it is made; run() relays. A context manager: leaving it closes the sockets.

    InputError where host or peer have no IPv4 address, the port is taken, the peer is out of reach
    or is the relay itself. log gets an Entry per datagram, and one per copy; clock gives ns.
    """

    def __init__(
        self,
        peer: Address,
        network: Network | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        log: Log | None = None,
        clock: Callable[[], int] = time.monotonic_ns,
    ) -> None:
        self._traffic = Traffic[_Client](network or Network(), log)
        self._clock = clock
        self._lock = threading.Lock()  # counters are read by other threads
        self._clients: dict[Address, _Client] = {}
        self._stopping = False
        self.peer = resolved(*peer, lowest_port=1)
        with ExitStack() as stack:
            # select() waits to the microsecond, epoll() and poll() to the millisecond
            self._selector = stack.enter_context(selectors.SelectSelector())
            self._wake, woken = (stack.enter_context(end) for end in socket.socketpair())
            self._wake.setblocking(False)
            self._selector.register(woken, selectors.EVENT_READ, self._woken)
            self._listening = stack.enter_context(listening(resolved(host, port)))
            self._selector.register(self._listening, selectors.EVENT_READ, self._request)
            self.address: Address = self._listening.getsockname()
            self._refuse_itself()
            stack.callback(self._forget_clients)
            self._stack = stack.pop_all()

    @property
    def port(self) -> int:
        """The port it listens on."""
        return self.address[1]

    @property
    def counters(self) -> dict[Direction, Counters]:
        """The counters of both directions now; may be asked from any thread, also after the end."""
        with self._lock:
            return self._traffic.snapshot()

    def run(self, duration: float | None = None) -> None:
        """Relay until stop(), or for a duration in s. What is under way then stays so.

        OSError, or whatever log raises, ends it.
        """
        end = None if duration is None else self._clock() + round(duration * NANOSECONDS)
        while not self._stopping:
            now = self._clock()
            if end is not None and now >= end:
                break
            self.turn(None if end is None else end - now)

    def turn(self, wait_ns: int | None) -> None:
        """Wait for a datagram, one to become due, stop(), or wait_ns to pass; relay what there is.

        At most one datagram is taken from each socket, so that none keeps others waiting.
        """
        waits = [] if wait_ns is None else [wait_ns]
        if (due := self._traffic.next_due) is not None:
            waits.append(max(due - self._clock(), 0))
        ready = self._selector.select(min(waits) / NANOSECONDS if waits else None)
        with self._lock:
            # requests last: that of a new client may close the socket of another, also ready
            for key, _ in sorted(ready, key=lambda r: r[0].fileobj is self._listening):
                key.data(key.fileobj)
            now = self._clock()
            while held := self._traffic.take(now):
                self._traffic.settle(held, self._sent(held))

    def stop(self) -> None:
        """Make run() return; may be called from any thread, a signal handler, and repeatedly."""
        self._stopping = True
        with suppress(BlockingIOError):  # full of earlier calls: that wakes it, too
            self._wake.send(b"\0")

    def __enter__(self) -> "Relay":
        return self

    def __exit__(self, *_: object) -> None:
        """Close all sockets. Must not be called while run() goes on."""
        self._stack.close()

    def _woken(self, woken: socket.socket) -> None:
        woken.recv(LARGEST)

    def _request(self, requests: socket.socket) -> None:
        if received := _received(requests):
            data, address = received
            self._traffic.receive("request", data, self._client(address), self._clock())

    def _client(self, address: Address) -> _Client:
        """The client of an address, new where it is; it becomes the one heard last."""
        client = self._clients.pop(address, None)
        if client is None:
            if len(self._clients) == MOST_CLIENTS:
                self._forget(next(iter(self._clients)))
            client = _Client(address, _connected(self.peer))

            def reply(towards_peer: socket.socket) -> None:
                if received := _received(towards_peer):
                    self._traffic.receive("reply", received[0], client, self._clock())

            self._selector.register(client.towards_peer, selectors.EVENT_READ, reply)
        self._clients[address] = client
        return client

    def _forget(self, address: Address) -> None:
        client = self._clients.pop(address)
        self._selector.unregister(client.towards_peer)
        client.towards_peer.close()

    def _forget_clients(self) -> None:
        for address in list(self._clients):
            self._forget(address)

    def _sent(self, held: Held[_Client]) -> bool:
        client = held.route
        try:
            if held.direction == "reply":
                self._listening.sendto(held.data, client.address)
            else:
                # A connected socket reports here that nobody took an earlier datagram, and does not
                # send this one then. Asked for the error before, it has forgotten it.
                client.towards_peer.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
                client.towards_peer.send(held.data)
        except OSError:  # too large for the way, no route, no room; or its client was forgotten
            return False
        return True

    def _refuse_itself(self) -> None:
        """InputError where the peer is the relay, which would send to itself for ever."""
        with _connected(self.peer) as probe:
            source, peer = probe.getsockname()[0], probe.getpeername()
        here = peer[0] == source or is_loopback(peer)
        if here and peer[1] == self.port and self.address[0] in (ANY, peer[0]):
            raise InputError(f"{text(self.peer)}: is the relay itself; must be the peer")


@contextmanager
def relaying(
    peer: Address,
    network: Network | None = None,
    *,
    host: str = "127.0.0.1",
    port: int = 0,
    log: Log | None = None,
) -> Iterator[Relay]:
    """A relay that runs in a thread of its own until the with statement ends.

    Raises what Relay() and run() raise, the latter at the end.
    """
    with (
        Relay(peer, network, host=host, port=port, log=log) as relay,
        ThreadPoolExecutor(1, "relay") as pool,
    ):
        running = pool.submit(relay.run)
        try:
            yield relay
        finally:
            relay.stop()
            running.result()


def _connected(peer: Address) -> socket.socket:
    """A socket that receives from the peer alone; InputError where there is no way to it."""
    towards_peer = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        towards_peer.connect(peer)
    except OSError as error:
        towards_peer.close()
        raise InputError(f"{text(peer)}: no way to the peer: {error.strerror}") from error
    towards_peer.setblocking(False)
    return towards_peer


def _received(readable: socket.socket) -> tuple[bytes, Address] | None:
    """A datagram and its sender; None where what made the socket readable was none."""
    try:
        return readable.recvfrom(LARGEST)
    except (BlockingIOError, ConnectionError):  # a broken datagram; nobody took an earlier one
        return None
