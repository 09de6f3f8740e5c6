"""A relay of UDP datagrams between clients and one peer, through a nasty network.

Knows nothing of what is in a datagram. Every client has a socket of its own towards the peer, so
that the peer can tell them apart; the peer sees the addresses of these.
"""

import socket
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from typing import Any

from ..base.columns import columns
from ..base.errors import InputError
from .address import Address, connected, is_loopback, resolved, text
from .event_loop import EventLoop, received
from .network import Direction, Network
from .traffic import Counters, Held, Log, Traffic

MOST_CLIENTS = 16
"""Clients remembered; a further one takes the place of the one that was silent for longest."""

ANY = "0.0.0.0"  # noqa: S104  compared with, not listened on
"""Stands for all addresses of this machine."""


@dataclass(frozen=True, slots=True)
class _Client:
    address: Address
    towards_peer: socket.socket


class Relay(EventLoop):
    """Relays between its port and a peer while it runs; what is under way at the end stays so.

    InputError where host or peer have no IPv4 address, the port is taken, the peer is out of reach
    or is the relay itself. `log` gets an Entry per datagram, and one per copy; what it raises ends
    the relay. `clock` gives ns.
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
        network = network or Network()
        self._seed = network.seed
        self._traffic = Traffic[_Client](network, log)
        self._clients: dict[Address, _Client] = {}
        self.peer = resolved(*peer, lowest_port=1)
        super().__init__((host, port), self._traffic.next_due, self._send_due, clock)
        self._stack.callback(self._forget_clients)
        self.register(self.port_socket, self._request)
        try:
            self._refuse_itself()
        except InputError:
            self._stack.close()
            raise

    @property
    def counters(self) -> dict[Direction, Counters]:
        """The counters of both directions now; may be asked from any thread, also after the end."""
        with self._lock:
            return self._traffic.snapshot()

    def as_json(self) -> dict[str, Any]:
        """Where it is, and its counters, by direction."""
        return {
            "listening": text(self.address),
            "to": text(self.peer),
            "seed": self._seed,
            **{d: {**asdict(c), "dropped": c.dropped} for d, c in self.counters.items()},
        }

    def as_text(self) -> str:
        """Its counters as a table, a line for each direction."""
        rows = {direction: asdict(c) for direction, c in self.counters.items()}
        names = list(rows["request"])
        lines = columns(
            [["", *names], *([d, *(str(r[n]) for n in names)] for d, r in rows.items())]
        )
        return "\n".join(lines)

    def _send_due(self, now: int) -> None:
        while held := self._traffic.take(now):
            self._traffic.settle(held, self._sent(held))

    def _request(self) -> None:
        """Take one request, so that no client keeps others waiting."""
        if found := received(self.port_socket):
            data, address = found
            self._traffic.receive("request", data, self._client(address), self._clock())

    def _client(self, address: Address) -> _Client:
        """The client of an address, new where it is; it becomes the one heard last."""
        client = self._clients.pop(address, None)
        if client is None:
            if len(self._clients) == MOST_CLIENTS:
                self._forget(next(iter(self._clients)))
            client = _Client(address, connected(self.peer))

            def reply() -> None:
                if found := received(client.towards_peer):
                    self._traffic.receive("reply", found[0], client, self._clock())

            self.register(client.towards_peer, reply)
        self._clients[address] = client
        return client

    def _forget(self, address: Address) -> None:
        client = self._clients.pop(address)
        del self._handlers[client.towards_peer]
        client.towards_peer.close()

    def _forget_clients(self) -> None:
        for address in list(self._clients):
            self._forget(address)

    def _sent(self, held: Held[_Client]) -> bool:
        client = held.route
        try:
            if held.direction == "reply":
                self.port_socket.sendto(held.data, client.address)
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
        with connected(self.peer) as probe:
            source, peer = probe.getsockname()[0], probe.getpeername()
        here = peer[0] == source or is_loopback(peer)
        if here and peer[1] == self.address[1] and self.address[0] in (ANY, peer[0]):
            raise InputError(f"{text(self.peer)}: is the relay itself; must be the peer")
