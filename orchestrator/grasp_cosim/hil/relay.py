"""A relay of UDP datagrams between clients and one peer, through a nasty network.

The fate of a datagram is a pure function of seed, direction and number, so the same seed gives the
same fates on every machine, however fast the datagrams come; Traffic, of those under way, knows no
socket and no clock. The relay knows nothing of what is in a datagram. Every client has a socket of
its own towards the peer, so that the peer can tell them apart; these are what the peer sees.
"""

import csv
import hashlib
import heapq
import math
import re
import socket
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import partial
from itertools import count
from pathlib import Path
from typing import Any, Literal, NamedTuple

from ..base.checks import number, whole
from ..base.errors import InputError
from ..base.text import columns
from ..system.times import NANOSECONDS
from .sockets import Address, EventLoop, connected, is_loopback, received, resolved, text

Direction = Literal["request", "reply"]
"""From a client to the peer, and from the peer back."""

DIRECTIONS: tuple[Direction, ...] = ("request", "reply")

WORDS: Mapping[str, Direction] = {"requests": "request", "answers": "reply"}
"""The directions as a command line names them."""

LONGEST = 1e6
"""s, longest time of any kind: eleven days."""

MOST_CLIENTS, MOST_HELD = 16, 4096
"""Clients remembered; a further one takes the place of the one that was silent for longest. And
the datagrams under way at once.
"""


@dataclass(frozen=True, slots=True)
class Conditions:
    """The conditions in one direction. Probabilities hold for each datagram by itself.

    A datagram that is not lost takes between delay and delay + jitter, uniformly distributed; with
    the probability reorder it is held back by reorder_by longer, so that later ones overtake it.
    With the probability duplicate it comes twice, and each of the two has its own delay. With the
    probability corrupt a bit of it is another one.
    InputError where a probability is not within 0 and 1, or a time, in s, not within 0 and LONGEST.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    reorder_by: float = 0.02
    corrupt: float = 0.0

    def __post_init__(self) -> None:
        for name in ("loss", "duplicate", "reorder", "corrupt"):
            number(name, getattr(self, name), 0.0, 1.0, must="a probability, from 0 to 1")
        must = f"from 0 to {LONGEST:g} s"
        for name in ("delay", "jitter", "reorder_by"):
            number(name, getattr(self, name), 0.0, LONGEST, must=must, unit="s")


@dataclass(frozen=True, slots=True)
class Outage:
    """A window, from start on and before until, in which nothing that arrives gets through.

    By requests: begins when the request of number start arrives and ends when that of number until
    does; the first one is 1. That repeats exactly, whatever the timing. By s: time since the first
    datagram. What was under way before still arrives. With a direction it is of that alone.
    InputError where there is no such window.
    """

    start: float
    until: float
    by: Literal["requests", "s"] = "requests"
    direction: Direction | None = None

    def __post_init__(self) -> None:
        text, lowest = f"outage from {self.start!r} until {self.until!r} {self.by}", 0
        if self.by == "requests":
            lowest = 1
            if self.start % 1 or (self.until % 1 and self.until < math.inf):
                raise InputError(f"{text}: must be whole numbers")
        if not lowest <= self.start < self.until:
            raise InputError(f"{text}: must begin at {lowest} or later, and end after that")

    @classmethod
    def read(cls, given: str) -> "Outage":
        """The outage that a text says; InputError for none.

        100:200 is in requests, 0.5s:2s in s; without an end it does not end; answers:0.5s: is of
        the answers alone.
        """
        end = r"([0-9]+(?:\.[0-9]+)?)"
        found = re.fullmatch(rf"(?:(requests|answers):)?{end}(s?):(?:{end}\3)?", given)
        if not found:
            raise InputError(
                f"outage {given!r}: must be FROM:UNTIL, in numbers of requests, as in 100:200, or "
                "in s, as in 0.5s:2s, without an end as in 2s:, and of one direction as in "
                "answers:2s:"
            )
        which, start, unit, until = found.groups()
        return cls(
            float(start),
            math.inf if until is None else float(until),
            "s" if unit else "requests",
            None if which is None else WORDS[which],
        )

    def is_of(self, direction: Direction, requests: int, seconds: float) -> bool:
        """True if a datagram of a direction does not get through, after so many requests and s."""
        now = requests if self.by == "requests" else seconds
        return self.direction in (None, direction) and self.start <= now < self.until


class Passage(NamedTuple):
    """One way through the network: how long it takes, and whether reorder is in that."""

    delay_ns: int
    held_back: bool


@dataclass(frozen=True, slots=True)
class Network:
    """Both directions, the outages, and the seed; InputError where that is no number from 0 on."""

    conditions: Mapping[Direction, Conditions] = field(
        default_factory=lambda: dict.fromkeys(DIRECTIONS, Conditions())
    )
    outages: tuple[Outage, ...] = ()
    seed: int = 0

    def __post_init__(self) -> None:
        whole("seed", self.seed, 0, must="a whole number, at least 0")

    def fate(self, direction: Direction, number: int) -> tuple[Passage, ...]:
        """Return the ways through of the datagram of a number, 1, 2, ...: none where it is lost.

        Two are the datagram and its copy. Outages are not in it.
        """
        conditions, u = self.conditions[direction], _uniforms(self.seed, direction, number)
        ways = [_passage(conditions, u[1], u[2]), _passage(conditions, u[4], u[5])]
        return () if u[0] < conditions.loss else tuple(ways[: 1 + (u[3] < conditions.duplicate)])

    def damage(self, direction: Direction, number: int) -> float | None:
        """Return which part of a datagram is before the bit that is damaged, if one is."""
        u = _uniforms(self.seed, direction, number, "damage")
        return u[1] if u[0] < self.conditions[direction].corrupt else None


def damaged(data: bytes, part: float | None) -> bytes:
    """Return a datagram with the bit behind a part of them another one; as it is for None."""
    if part is None or not data:
        return data
    bit = int(part * 8 * len(data))
    return data[: bit // 8] + bytes([data[bit // 8] ^ 1 << bit % 8]) + data[bit // 8 + 1 :]


def _passage(conditions: Conditions, position: float, chance: float) -> Passage:
    held_back = chance < conditions.reorder
    delay = conditions.delay + conditions.jitter * position
    return Passage(round((delay + conditions.reorder_by * held_back) * NANOSECONDS), held_back)


def _uniforms(seed: int, direction: Direction, number: int, what: str = "") -> list[float]:
    """Six independent numbers, uniform in [0, 1), each always used for the same thing.

    A hash (BLAKE2b) of what they are for, as in a counter-based generator: there is no state that
    the order of arrival could change, and a higher loss leaves the delays of the rest as they were.
    """
    purpose = repr((seed, direction, number, *([what] if what else []))).encode()
    digest = hashlib.blake2b(purpose, digest_size=48).digest()
    return [(int.from_bytes(digest[i : i + 8], "little") >> 11) * 2.0**-53 for i in range(0, 48, 8)]


@dataclass(slots=True)
class Counters:
    """One direction, exact at any time: received + duplicated = delivered + dropped + held.

    Copies are delivered, too; reordered is what is delivered after a later one, corrupted what is
    delivered with another bit; lost or in an
    outage what does not get through, overflow what finds MOST_HELD under way, unsent what this
    machine refuses to send, held what is still under way.
    """

    received: int = 0
    delivered: int = 0
    duplicated: int = 0
    reordered: int = 0
    corrupted: int = 0
    lost: int = 0
    outage: int = 0
    overflow: int = 0
    unsent: int = 0
    held: int = 0

    @property
    def dropped(self) -> int:
        """All that did not and will not get through."""
        return self.lost + self.outage + self.overflow + self.unsent


class Entry(NamedTuple):
    """The decision on a datagram of a number in its direction, or on its copy 1, as it arrived.

    The delay is in s, None where it does not get through.
    """

    direction: Direction
    number: int
    copy: int
    fate: Literal["passed", "held back", "corrupted", "lost", "outage", "overflow"]
    delay: float | None


Log = Callable[[Entry], object]


Send = Callable[[bytes], bool]
"""Sends a datagram on, and says whether this machine took it."""


class Traffic:
    """The datagrams under way in both directions; times in ns of a clock that never goes back."""

    def __init__(self, network: Network, log: Log | None = None) -> None:
        self.counters = {direction: Counters() for direction in DIRECTIONS}
        self._network = network
        self._log: Log = log or (lambda _: None)
        self._begin: int | None = None
        self._newest = dict.fromkeys(DIRECTIONS, 0)
        self._arrivals = count()  # makes the earlier one the first of two that are due at once
        self._held: list[tuple[int, int, Direction, int, Send, bytes]] = []

    def receive(self, direction: Direction, data: bytes, send: Send, now: int) -> None:
        """A datagram has arrived: decide what becomes of it, and count and log that.

        `send` sends it on, as it then is, and says whether this machine took it.
        """
        self._begin = now if self._begin is None else self._begin
        counters = self.counters[direction]
        counters.received += 1
        number, requests = counters.received, self.counters["request"].received
        seconds = (now - self._begin) / NANOSECONDS
        if any(o.is_of(direction, requests, seconds) for o in self._network.outages):
            counters.outage += 1
            self._log(Entry(direction, number, 0, "outage", None))
            return
        passages = self._network.fate(direction, number)
        if not passages:
            counters.lost += 1
            self._log(Entry(direction, number, 0, "lost", None))
        counters.duplicated += len(passages) > 1
        part = self._network.damage(direction, number)
        data = damaged(data, part)
        for copy, (delay_ns, held_back) in enumerate(passages):
            if len(self._held) >= MOST_HELD:
                counters.overflow += 1
                self._log(Entry(direction, number, copy, "overflow", None))
                continue
            counters.held += 1
            counters.corrupted += part is not None
            due = (now + delay_ns, next(self._arrivals), direction, number, send, data)
            heapq.heappush(self._held, due)
            fate: Literal["held back", "passed", "corrupted"] = (
                "held back" if held_back else "passed"
            )
            if part is not None:
                fate = "corrupted"
            self._log(Entry(direction, number, copy, fate, delay_ns / NANOSECONDS))

    def next_due(self) -> int | None:
        """The time at which the next datagram has to go on; None where none is under way."""
        return self._held[0][0] if self._held else None

    def send_due(self, now: int) -> None:
        """Send on what is due by now, the earliest first."""
        while self._held and self._held[0][0] <= now:
            *_, direction, number, send, data = heapq.heappop(self._held)
            counters, sent = self.counters[direction], send(data)
            counters.held -= 1
            counters.unsent += not sent
            if sent:
                counters.delivered += 1
                counters.reordered += number < self._newest[direction]
                self._newest[direction] = max(number, self._newest[direction])


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
            source, to = probe.getsockname()[0], probe.getpeername()
        here = to[0] == source or is_loopback(to)
        everywhere = "0.0.0.0", "::"  # noqa: S104  compared with, not listened on
        if here and to[1] == port and host in (*everywhere, to[0]):  # it would send to itself
            raise InputError(f"{text(self.peer)}: is the relay itself; must be the peer")
        super().__init__((host, port), self._traffic.next_due, self._traffic.send_due)
        self._stack.callback(lambda: [*map(self._forget, [*self._clients])])
        self.register(self.port_socket, self._request)

    @property
    def counters(self) -> dict[Direction, Counters]:
        """The counters of both directions now; may be asked from any thread, also after the end."""
        with self._lock:
            return {direction: replace(c) for direction, c in self._traffic.counters.items()}

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
            data, client = found
            towards_peer = self._clients.pop(client, None)
            if towards_peer is None:
                if len(self._clients) == MOST_CLIENTS:
                    self._forget(next(iter(self._clients)))
                towards_peer = connected(self.peer)
                self.register(towards_peer, partial(self._reply, towards_peer, client))
            self._clients[client] = towards_peer  # the one heard last
            send = partial(_sent, towards_peer, None)
            self._traffic.receive("request", data, send, time.monotonic_ns())

    def _reply(self, towards_peer: socket.socket, client: Address) -> None:
        if found := received(towards_peer):
            send = partial(_sent, self.port_socket, client)
            self._traffic.receive("reply", found[0], send, time.monotonic_ns())

    def _forget(self, client: Address) -> None:
        towards_peer = self._clients.pop(client)
        del self._handlers[towards_peer]
        towards_peer.close()


def _sent(via: socket.socket, client: Address | None, data: bytes) -> bool:
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
