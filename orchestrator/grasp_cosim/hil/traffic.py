"""The datagrams that are under way in a nasty network; it knows no socket and no clock."""

import heapq
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Literal, NamedTuple

from ..system.times import NANOSECONDS
from .network_conditions import DIRECTIONS, Direction, Network, damaged

MAX_HELD = 4096
"""Datagrams under way at once."""


@dataclass(slots=True)
class Counters:
    """One direction, exact at any time: received + duplicated = delivered + dropped + held.

    Copies are delivered, too; reordered is what is delivered after a later one, corrupted what is
    delivered with another bit; lost or in an outage are those that do not get through; overflow
    those that find MAX_HELD under way; unsent those that this machine refuses to send; held those
    still under way.
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


Fate = Literal["passed", "held back", "corrupted", "lost", "outage", "overflow"]


class Entry(NamedTuple):
    """The decision on a datagram of a number in its direction, or on its copy 1, as it arrived.

    The delay is in s, None where it does not get through.
    """

    direction: Direction
    number: int
    copy: int
    fate: Fate
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

    def receive(self, direction: Direction, data: bytes, send: Send, now_ns: int) -> None:
        """A datagram has arrived: decide what becomes of it, and count and log that.

        `send` sends it on, as it then is, and says whether this machine took it.
        """
        if self._begin is None:
            self._begin = now_ns
        counters = self.counters[direction]
        counters.received += 1
        number, requests = counters.received, self.counters["request"].received
        seconds = (now_ns - self._begin) / NANOSECONDS
        if any(o.is_of(direction, requests, seconds) for o in self._network.outages):
            counters.outage += 1
            self._log(Entry(direction, number, 0, "outage", None))
            return
        passages = self._network.fate(direction, number)
        if not passages:
            counters.lost += 1
            self._log(Entry(direction, number, 0, "lost", None))
        if len(passages) > 1:
            counters.duplicated += 1
        part = self._network.damage(direction, number)
        data = damaged(data, part)
        for copy, (delay_ns, held_back) in enumerate(passages):
            if len(self._held) >= MAX_HELD:
                counters.overflow += 1
                self._log(Entry(direction, number, copy, "overflow", None))
                continue
            counters.held += 1
            if part is not None:
                counters.corrupted += 1
            due = (now_ns + delay_ns, next(self._arrivals), direction, number, send, data)
            heapq.heappush(self._held, due)
            fate: Fate = "held back" if held_back else "passed"
            if part is not None:
                fate = "corrupted"
            self._log(Entry(direction, number, copy, fate, delay_ns / NANOSECONDS))

    def next_due(self) -> int | None:
        """The time at which the next datagram has to go on; None where none is under way."""
        return self._held[0][0] if self._held else None

    def send_due(self, now_ns: int) -> None:
        """Send on what is due by now, the earliest first."""
        while self._held and self._held[0][0] <= now_ns:
            *_, direction, number, send, data = heapq.heappop(self._held)
            counters = self.counters[direction]
            counters.held -= 1
            if not send(data):
                counters.unsent += 1
                continue
            counters.delivered += 1
            if number < self._newest[direction]:
                counters.reordered += 1
            self._newest[direction] = max(number, self._newest[direction])
