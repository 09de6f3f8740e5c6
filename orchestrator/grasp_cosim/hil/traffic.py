"""The datagrams on their way through a nasty network: which, until when, and their fates.

No socket and no clock: who calls says what arrived and what time it is.
"""

import csv
import heapq
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import count
from pathlib import Path
from typing import Generic, Literal, NamedTuple, TypeVar

from ..base.files import FULL
from ..system.parts import NANOSECONDS
from .network import DIRECTIONS, Direction, Network, Passage

Route = TypeVar("Route")
"""A value that tells the caller where a datagram has to go."""


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
    except OSError as error:  # a full disk does not say where
        if error.errno in FULL:
            raise OSError(error.errno, error.strerror, str(path)) from error
        raise


class Held(NamedTuple, Generic[Route]):
    """A datagram under way."""

    direction: Direction
    number: int
    data: bytes
    route: Route


class Traffic(Generic[Route]):
    """The datagrams under way in both directions. Times in ns, of a clock that never goes back."""

    def __init__(self, network: Network, log: Log | None = None) -> None:
        self.counters = {direction: Counters() for direction in DIRECTIONS}
        self._network = network
        self._log: Log = log or (lambda _: None)
        self._begin: int | None = None
        self._newest = dict.fromkeys(DIRECTIONS, 0)
        self._arrivals = count()  # makes the earlier one the first of two that are due at once
        self._held: list[tuple[int, int, Held[Route]]] = []

    def snapshot(self) -> dict[Direction, Counters]:
        """The counters as they are now."""
        return {direction: replace(c) for direction, c in self.counters.items()}

    def receive(self, direction: Direction, data: bytes, route: Route, now: int) -> None:
        """A datagram has arrived: decide what becomes of it, and count and log that."""
        counters = self.counters[direction]
        counters.received += 1
        number = counters.received
        if self._is_out(now):
            counters.outage += 1
            self._log(Entry(direction, number, 0, "outage", None))
            return
        passages = self._network.fate(direction, number)
        if not passages:
            counters.lost += 1
            self._log(Entry(direction, number, 0, "lost", None))
        counters.duplicated += len(passages) > 1
        held = Held(direction, number, data, route)
        for copy, passage in enumerate(passages):
            self._let_through(held, copy, passage, now)

    def next_due(self) -> int | None:
        """The time at which the next datagram has to go on; None where none is under way."""
        return self._held[0][0] if self._held else None

    def take(self, now: int) -> Held[Route] | None:
        """The next datagram that is due by now, the earliest first; None where there is none.

        What became of it must then be said, with settle().
        """
        if not self._held or self._held[0][0] > now:
            return None
        return heapq.heappop(self._held)[2]

    def settle(self, held: Held[Route], sent: bool) -> None:
        """Count a datagram that was taken as delivered, or as unsent."""
        counters = self.counters[held.direction]
        counters.held -= 1
        if not sent:
            counters.unsent += 1
            return
        counters.delivered += 1
        counters.reordered += held.number < self._newest[held.direction]
        self._newest[held.direction] = max(held.number, self._newest[held.direction])

    def _let_through(self, held: Held[Route], copy: int, passage: Passage, now: int) -> None:
        direction, number, *_ = held
        if len(self._held) >= self._network.capacity:
            self.counters[direction].overflow += 1
            self._log(Entry(direction, number, copy, "overflow", None))
            return
        self.counters[direction].held += 1
        heapq.heappush(self._held, (now + passage.delay_ns, next(self._arrivals), held))
        fate: Literal["held back", "passed"] = "held back" if passage.held_back else "passed"
        self._log(Entry(direction, number, copy, fate, passage.delay_ns / NANOSECONDS))

    def _is_out(self, now: int) -> bool:
        if self._begin is None:
            self._begin = now
        requests = self.counters["request"].received
        return any(o.covers(requests, now - self._begin) for o in self._network.outages)
