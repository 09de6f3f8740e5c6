"""A nasty network: the fate of each datagram, and those that are on their way through it.

No socket and no clock: who calls says what arrived and what time it is, in ns of a clock that never
goes back. A fate is a pure function of seed, direction and number, so the same seed gives the same
fates on every machine, however fast the datagrams come.
"""

import hashlib
import heapq
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from itertools import count
from typing import Literal, NamedTuple, get_args

from ..base.checks import number, whole
from ..base.errors import InputError
from ..system.parts import NANOSECONDS

Direction = Literal["request", "reply"]
"""From a client to the peer, and from the peer back."""

DIRECTIONS: tuple[Direction, ...] = get_args(Direction)

LONGEST = 1e6
"""s, longest time of any kind: eleven days."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """The conditions in one direction. Probabilities hold for each datagram by itself.

    A datagram that is not lost takes between delay and delay + jitter, uniformly distributed; with
    the probability reorder it is held back by reorder_by longer, so that later ones overtake it.
    With the probability duplicate it comes twice, and each of the two has its own delay.
    InputError where a probability is not within 0 and 1, or a time, in s, not within 0 and LONGEST.
    """

    delay: float = 0.0
    jitter: float = 0.0
    loss: float = 0.0
    duplicate: float = 0.0
    reorder: float = 0.0
    reorder_by: float = 0.02

    def __post_init__(self) -> None:
        for name in ("loss", "duplicate", "reorder"):
            number(name, getattr(self, name), 0.0, 1.0, must="a probability, from 0 to 1")
        must = f"from 0 to {LONGEST:g} s"
        for name in ("delay", "jitter", "reorder_by"):
            number(name, getattr(self, name), 0.0, LONGEST, must=must, unit="s")


@dataclass(frozen=True, slots=True)
class Outage:
    """A window, from start on and before until, in which nothing that arrives gets through.

    By requests: begins when the request of number start arrives and ends when that of number until
    does; the first one is 1. That repeats exactly, whatever the timing. By s: time since the first
    datagram. What was under way before still arrives. InputError where there is no such window.
    """

    start: float
    until: float
    by: Literal["requests", "s"] = "requests"

    def __post_init__(self) -> None:
        text = f"outage from {self.start!r} until {self.until!r} {self.by}"
        lowest = 1 if self.by == "requests" else 0
        if not lowest <= self.start < self.until < math.inf:
            raise InputError(f"{text}: must begin at {lowest} or later, and end after that")
        if self.by == "requests" and not (self.start % 1 == 0 == self.until % 1):
            raise InputError(f"{text}: must be whole numbers")

    @classmethod
    def read(cls, given: str) -> "Outage":
        """The outage that a text says, 100:200 in requests, 0.5s:2s in s; InputError for none."""
        found = re.fullmatch(r"([0-9]+(?:\.[0-9]+)?)(s?):([0-9]+(?:\.[0-9]+)?)\2", given)
        if not found:
            raise InputError(
                f"outage {given!r}: must be FROM:UNTIL, in numbers of requests, as in 100:200, or "
                "in s, as in 0.5s:2s"
            )
        return cls(float(found[1]), float(found[3]), "s" if found[2] else "requests")


class Passage(NamedTuple):
    """One way through the network: how long it takes, and whether reorder is in that."""

    delay_ns: int
    held_back: bool


@dataclass(frozen=True, slots=True)
class Network:
    """Both directions, the outages, the seed, and how many datagrams may be under way at once.

    InputError where seed is no whole number from 0 on, or capacity none from 1 on.
    """

    conditions: Mapping[Direction, Conditions] = field(
        default_factory=lambda: dict.fromkeys(DIRECTIONS, Conditions())
    )
    outages: tuple[Outage, ...] = ()
    seed: int = 0
    capacity: int = 4096

    def __post_init__(self) -> None:
        for name, least in (("seed", 0), ("capacity", 1)):
            whole(name, getattr(self, name), least, must=f"a whole number, at least {least}")

    def fate(self, direction: Direction, number: int) -> tuple[Passage, ...]:
        """Return the ways through of the datagram of a number, 1, 2, ...: none where it is lost.

        Two are the datagram and its copy. Outages are not in it.
        """
        conditions = self.conditions[direction]
        u = _uniforms(self.seed, direction, number)
        if u[0] < conditions.loss:
            return ()
        first = _passage(conditions, u[1], u[2])
        if u[3] < conditions.duplicate:
            return first, _passage(conditions, u[4], u[5])
        return (first,)


def _passage(conditions: Conditions, position: float, chance: float) -> Passage:
    held_back = chance < conditions.reorder
    delay = conditions.delay + conditions.jitter * position
    return Passage(round((delay + conditions.reorder_by * held_back) * NANOSECONDS), held_back)


def _uniforms(seed: int, direction: Direction, number: int) -> list[float]:
    """Six independent numbers, uniform in [0, 1), each always used for the same thing.

    A hash (BLAKE2b) of what they are for, as in a counter-based generator: there is no state that
    the order of arrival could change, and a higher loss leaves the delays of the rest as they were.
    """
    purpose = repr((seed, direction, number)).encode()
    digest = hashlib.blake2b(purpose, digest_size=48).digest()
    return [(int.from_bytes(digest[i : i + 8], "little") >> 11) * 2.0**-53 for i in range(0, 48, 8)]


@dataclass(slots=True)
class Counters:
    """One direction, exact at any time: received + duplicated = delivered + dropped + held."""

    received: int = 0
    delivered: int = 0
    """Copies included."""
    duplicated: int = 0
    reordered: int = 0
    """Delivered after a datagram that had arrived later."""
    lost: int = 0
    outage: int = 0
    overflow: int = 0
    """There was no room: network.capacity datagrams were under way."""
    unsent: int = 0
    """This machine refused to send it."""
    held: int = 0
    """Still under way."""

    @property
    def dropped(self) -> int:
        """All that did not and will not get through."""
        return self.lost + self.outage + self.overflow + self.unsent


class Entry(NamedTuple):
    """The decision on a datagram, or on its copy, when it arrived."""

    direction: Direction
    number: int
    """1, 2, 3, ... in its direction."""
    copy: int
    """0, of a copy 1."""
    fate: Literal["passed", "held back", "lost", "outage", "overflow"]
    delay: float | None
    """In s; None where it does not get through."""


Log = Callable[[Entry], object]


class Traffic:
    """The datagrams under way in both directions."""

    def __init__(self, network: Network, log: Log | None = None) -> None:
        self._counters = {direction: Counters() for direction in DIRECTIONS}
        self._network = network
        self._log: Log = log or (lambda _: None)
        self._begin: int | None = None
        self._newest = dict.fromkeys(DIRECTIONS, 0)
        self._arrivals = count()  # makes the earlier one the first of two that are due at once
        self._held: list[tuple[int, int, Direction, int, Callable[[], bool]]] = []

    def snapshot(self) -> dict[Direction, Counters]:
        """The counters as they are now."""
        return {direction: replace(c) for direction, c in self._counters.items()}

    def receive(self, direction: Direction, send: Callable[[], bool], now: int) -> None:
        """A datagram has arrived: decide what becomes of it, and count and log that.

        `send` sends it on, and says whether this machine took it.
        """
        self._begin = now if self._begin is None else self._begin
        counters = self._counters[direction]
        counters.received += 1
        number = counters.received
        since = {
            "requests": self._counters["request"].received,
            "s": (now - self._begin) / NANOSECONDS,
        }
        if any(o.start <= since[o.by] < o.until for o in self._network.outages):
            counters.outage += 1
            self._log(Entry(direction, number, 0, "outage", None))
            return
        passages = self._network.fate(direction, number)
        if not passages:
            counters.lost += 1
            self._log(Entry(direction, number, 0, "lost", None))
        counters.duplicated += len(passages) > 1
        for copy, (delay_ns, held_back) in enumerate(passages):
            if len(self._held) >= self._network.capacity:
                counters.overflow += 1
                self._log(Entry(direction, number, copy, "overflow", None))
                continue
            counters.held += 1
            arrival = next(self._arrivals)
            heapq.heappush(self._held, (now + delay_ns, arrival, direction, number, send))
            fate: Literal["held back", "passed"] = "held back" if held_back else "passed"
            self._log(Entry(direction, number, copy, fate, delay_ns / NANOSECONDS))

    def next_due(self) -> int | None:
        """The time at which the next datagram has to go on; None where none is under way."""
        return self._held[0][0] if self._held else None

    def send_due(self, now: int) -> None:
        """Send on what is due by now, the earliest first."""
        while self._held and self._held[0][0] <= now:
            *_, direction, number, send = heapq.heappop(self._held)
            counters, sent = self._counters[direction], send()
            counters.held -= 1
            counters.unsent += not sent
            if sent:
                counters.delivered += 1
                counters.reordered += number < self._newest[direction]
                self._newest[direction] = max(number, self._newest[direction])
