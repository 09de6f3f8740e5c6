"""A nasty network: what becomes of each datagram in either direction.

The fate of a datagram is a pure function of seed, direction and number. So the same seed gives the
same fates on every machine, at any rate of the datagrams.
"""

import hashlib
import math
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from ..base.checks import number, whole
from ..base.errors import InputError
from ..system.times import NANOSECONDS

Direction = Literal["request", "reply"]
"""From a client to the peer, and from the peer back."""

DIRECTIONS: tuple[Direction, ...] = ("request", "reply")

WORDS: Mapping[str, Direction] = {"requests": "request", "answers": "reply"}
"""The directions as a command line names them."""

MAX_TIME = 1e6
"""s, longest time of any kind: eleven days."""


@dataclass(frozen=True, slots=True)
class Conditions:
    """The conditions in one direction. Probabilities hold for each datagram by itself.

    A datagram that is not lost takes between delay and delay + jitter, uniformly distributed; with
    the probability reorder it is held back by reorder_by longer, so that later ones overtake it.
    With the probability duplicate it comes twice, and each of the two has its own delay. With the
    probability corrupt a bit of it is another one.
    InputError where a probability is not within 0 and 1, or a time, in s, not within 0 and
    MAX_TIME.
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
        must = f"from 0 to {MAX_TIME:g} s"
        for name in ("delay", "jitter", "reorder_by"):
            number(name, getattr(self, name), 0.0, MAX_TIME, must=must, unit="s")


@dataclass(frozen=True, slots=True)
class Outage:
    """A window, from start on and before until, in which nothing that arrives gets through.

    By requests: begins when the request of number start arrives and ends when that of number until
    does; the first one is 1. That repeats exactly, whatever the timing. By s: time since the first
    datagram. What was under way before still arrives. With a direction it is of that only.
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
    def read(cls, text: str) -> "Outage":
        """The outage that a text describes; InputError for none.

        100:200 is in requests, 0.5s:2s in s; without an end it does not end; answers:0.5s: is of
        the answers only.
        """
        end = r"([0-9]+(?:\.[0-9]+)?)"
        match = re.fullmatch(rf"(?:(requests|answers):)?{end}(s?):(?:{end}\3)?", text)
        if not match:
            raise InputError(
                f"outage {text!r}: must be FROM:UNTIL, in numbers of requests, as in 100:200, or "
                "in s, as in 0.5s:2s, without an end as in 2s:, and of one direction as in "
                "answers:2s:"
            )
        word, start, unit, until = match.groups()
        return cls(
            float(start),
            math.inf if until is None else float(until),
            "s" if unit else "requests",
            None if word is None else WORDS[word],
        )

    def is_of(self, direction: Direction, requests: int, seconds: float) -> bool:
        """True if a datagram of a direction does not get through, after so many requests and s."""
        progress = requests if self.by == "requests" else seconds
        return self.direction in (None, direction) and self.start <= progress < self.until


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
        conditions = self.conditions[direction]
        loss, delay, reorder, duplicate, copy_delay, copy_reorder = _uniforms(
            self.seed, direction, number
        )
        if loss < conditions.loss:
            return ()
        passage = _passage(conditions, delay, reorder)
        if duplicate < conditions.duplicate:
            return passage, _passage(conditions, copy_delay, copy_reorder)
        return (passage,)

    def damage(self, direction: Direction, number: int) -> float | None:
        """Return which part of a datagram is before the bit that is damaged, if one is."""
        corrupt, part, *_ = _uniforms(self.seed, direction, number, "damage")
        return part if corrupt < self.conditions[direction].corrupt else None


def damaged(data: bytes, part: float | None) -> bytes:
    """Return a datagram with the bit behind a part of them another one; as it is for None."""
    if part is None or not data:
        return data
    byte, bit = divmod(int(part * 8 * len(data)), 8)
    return data[:byte] + bytes([data[byte] ^ 1 << bit]) + data[byte + 1 :]


def _passage(conditions: Conditions, position: float, chance: float) -> Passage:
    """The way through, by where in the jitter its delay is, and the chance to be held back."""
    held_back = chance < conditions.reorder
    delay = conditions.delay + conditions.jitter * position
    if held_back:
        delay += conditions.reorder_by
    return Passage(round(delay * NANOSECONDS), held_back)


UNIFORMS = 6
"""Random numbers for a datagram."""

WORD_BYTES = 8
"""Bytes of a hash for each of them; a float64 has space for 53 of their bits."""


def _uniforms(seed: int, direction: Direction, number: int, purpose: str = "") -> list[float]:
    """Six independent numbers, uniform in [0, 1), each always used for the same thing.

    A hash (BLAKE2b) of what they are for, as in a counter-based generator: there is no state that
    the order of arrival could change, and a higher loss leaves the delays of the rest as they were.
    """
    key = (seed, direction, number, purpose) if purpose else (seed, direction, number)
    digest = hashlib.blake2b(repr(key).encode(), digest_size=UNIFORMS * WORD_BYTES).digest()
    words = (digest[i : i + WORD_BYTES] for i in range(0, len(digest), WORD_BYTES))
    return [(int.from_bytes(word, "little") >> 11) * 2.0**-53 for word in words]
