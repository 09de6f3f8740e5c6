"""A relay of UDP datagrams between clients and one peer, through a nasty network.

Knows nothing of what is in a datagram. Every client has a socket of its own towards the peer, so
that the peer can tell them apart; the peer sees the addresses of these.
"""

import csv
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.text import columns
from .network import Counters, Direction, Entry, Log, Network, Traffic
from .sockets import Address, EventLoop, connected, is_loopback, received, resolved, text

MOST_CLIENTS = 16
"""Clients remembered; a further one takes the place of the one that was silent for longest."""

ANY = "0.0.0.0"  # noqa: S104  compared with, not listened on
"""Stands for all addresses of this machine."""


class Relay(EventLoop):
    """Relays between its port and a peer while it runs; what is under way at the end stays so.

    InputError where host or peer have no IPv4 address, the port is taken, the peer is out of reach
    or is the relay itself. `log` gets an Entry per datagram, and one per copy; what it raises ends
    the relay.
    """

    def __init__(
        self,
        peer: Address,
        network: Network | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        log: Log | None = None,
    ) -> None:
        network = network or Network()
        self._seed = network.seed
        self._traffic = Traffic(network, log)
        self._clients: dict[Address, socket.socket] = {}  # and their sockets towards the peer
        self.peer = resolved(*peer, lowest_port=1)
        host, port = resolved(host, port)
        with connected(self.peer) as probe:
            source, to = probe.getsockname()[0], probe.getpeername()
        here = to[0] == source or is_loopback(to)
        if here and to[1] == port and host in (ANY, to[0]):  # it would send to itself for ever
            raise InputError(f"{text(self.peer)}: is the relay itself; must be the peer")
        super().__init__((host, port), self._traffic.next_due, self._traffic.send_due)
        self._stack.callback(lambda: [*map(self._forget, [*self._clients])])
        self.register(self.port_socket, self._request)

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
        rows = [[d, *map(str, asdict(c).values())] for d, c in self.counters.items()]
        return "\n".join(columns([["", *asdict(Counters())], *rows]))

    def _request(self) -> None:
        """Take one request, so that no client keeps others waiting."""
        if found := received(self.port_socket):
            data, address = found
            send = partial(_sent, self._towards_peer(address), data)
            self._traffic.receive("request", send, time.monotonic_ns())

    def _reply(self, towards_peer: socket.socket, client: Address) -> None:
        if found := received(towards_peer):
            send = partial(_sent, self.port_socket, found[0], client)
            self._traffic.receive("reply", send, time.monotonic_ns())

    def _towards_peer(self, client: Address) -> socket.socket:
        """The socket of a client, new where it is; it becomes the one heard last."""
        if client in self._clients:
            found = self._clients.pop(client)
        else:
            if len(self._clients) == MOST_CLIENTS:
                self._forget(next(iter(self._clients)))
            found = connected(self.peer)
            self.register(found, lambda: self._reply(found, client))
        self._clients[client] = found
        return found

    def _forget(self, client: Address) -> None:
        towards_peer = self._clients.pop(client)
        del self._handlers[towards_peer]
        towards_peer.close()


def _sent(via: socket.socket, data: bytes, client: Address | None = None) -> bool:
    """Send a datagram, to the peer where there is no client; False where this machine refuses."""
    try:
        if client:
            via.sendto(data, client)
        else:
            # A connected socket reports here that nobody took an earlier datagram, and does not
            # send this one then. Asked for the error before, it has forgotten it.
            via.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            via.send(data)
    except OSError:  # too large for the way, no route, no room; or its client was forgotten
        return False
    return True


@contextmanager
def csv_log(path: Path | None) -> Iterator[Log | None]:
    """A log that writes a row of a CSV file for each entry; None without a path."""
    if path is None:
        yield None
        return
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            table = csv.writer(file, lineterminator="\n")
            table.writerow(Entry._fields)
            yield table.writerow
    except OSError as error:
        error.filename = error.filename or str(path)  # a full disk does not say where
        raise
