"""The fate of a datagram in a nasty network: a pure function of seed, direction and number.

Nothing here knows of sockets or clocks, so the same seed gives the same fates on every machine,
however fast the datagrams come.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
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
        for name in ("delay", "jitter", "reorder_by"):
            check_time(name, getattr(self, name))


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

    def covers(self, requests: int, elapsed_ns: int) -> bool:
        """Return True if it is on at this request, and so long after the first datagram."""
        now = requests if self.by == "requests" else elapsed_ns / NANOSECONDS
        return self.start <= now < self.until


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

    def fate(self, direction: Direction, number: int) -> tuple["Passage", ...]:
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


class Passage(NamedTuple):
    """One way through the network: how long it takes, and whether reorder is in that."""

    delay_ns: int
    held_back: bool


def check_time(name: str, value: float) -> None:
    """InputError where a time in s is negative, longer than LONGEST, or no number."""
    number(name, value, 0.0, LONGEST, must=f"from 0 to {LONGEST:g} s", unit="s")


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
