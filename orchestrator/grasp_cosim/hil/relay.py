"""A relay of UDP datagrams between clients and one peer, through a nasty network.

The relay knows nothing of what is in a datagram. Every client has its own socket towards the
peer, so that the peer can tell them apart; these are what the peer sees.
"""

import csv
import socket
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.text import columns
from .network_conditions import Direction, Network
from .sockets import Address, EventLoop, connected, is_loopback, received, resolved, text
from .traffic import Counters, Entry, Log, Traffic

MAX_CLIENTS = 16
"""Clients remembered; a further one takes the place of the one that was silent for longest."""


class Relay(EventLoop):
    """Relays between its port and a peer while it runs; what is under way at the end stays so.

    InputError where host or peer have no address, the port is taken, the peer is out of reach
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
            source_host, target = probe.getsockname()[0], probe.getpeername()
        target_host, target_port = target[:2]
        is_local = target_host == source_host or is_loopback(target)
        everywhere = "0.0.0.0", "::"  # noqa: S104  compared with, not listened on
        is_own_port = target_port == port and host in (*everywhere, target_host)
        if is_local and is_own_port:  # it would send to itself
            raise InputError(f"{text(self.peer)}: is the relay itself; must be the peer")
        super().__init__((host, port), self._traffic.next_due, self._traffic.send_due)
        self._stack.callback(self._forget_all)
        self.register(self.port_socket, self._request)

    def _forget_all(self) -> None:
        for client in [*self._clients]:
            self._forget(client)

    @property
    def counters(self) -> dict[Direction, Counters]:
        """The counters of both directions now; may be asked from any thread, also after the end."""
        with self._lock:
            return {direction: replace(c) for direction, c in self._traffic.counters.items()}

    def as_json(self) -> dict[str, Any]:
        """Where it is, and its counters, by direction."""
        entries: dict[str, Any] = {
            "listening": text(self.address),
            "to": text(self.peer),
            "seed": self._seed,
        }
        for direction, counters in self.counters.items():
            entries[direction] = {**asdict(counters), "dropped": counters.dropped}
        return entries

    def as_text(self) -> str:
        """Its counters as a table, a line for each direction."""
        rows = [[d, *map(str, asdict(c).values())] for d, c in self.counters.items()]
        return "\n".join(columns([["", *asdict(Counters())], *rows]))

    def _request(self) -> None:
        """Take one request, so that no client keeps others waiting."""
        if message := received(self.port_socket):
            data, client = message
            towards_peer = self._clients.pop(client, None)
            if towards_peer is None:
                if len(self._clients) == MAX_CLIENTS:
                    self._forget(next(iter(self._clients)))
                towards_peer = connected(self.peer)
                self.register(towards_peer, partial(self._reply, towards_peer, client))
            self._clients[client] = towards_peer  # the one heard last
            send = partial(_send, towards_peer, None)
            self._traffic.receive("request", data, send, time.monotonic_ns())

    def _reply(self, towards_peer: socket.socket, client: Address) -> None:
        """Take one reply of the peer to a client."""
        if message := received(towards_peer):
            data, _ = message
            send = partial(_send, self.port_socket, client)
            self._traffic.receive("reply", data, send, time.monotonic_ns())

    def _forget(self, client: Address) -> None:
        """Close the socket of a client towards the peer."""
        towards_peer = self._clients.pop(client)
        del self._handlers[towards_peer]
        towards_peer.close()


def _send(via: socket.socket, client: Address | None, data: bytes) -> bool:
    """Send a datagram, to the peer where there is no client; False where this machine refuses."""
    try:
        if client:
            via.sendto(data, client)
        else:
            # A connected socket reports here that nobody took an earlier datagram, and does not
            # send this one then. Asked for the error before, it has forgotten it.
            via.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)
            via.send(data)
    except OSError:  # too large for the way, no route, no space; or its client was forgotten
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
