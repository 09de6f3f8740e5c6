"""What came from the peers, what is missing, and when they are lost, without ROS or a clock.

As in a proxy of FMUs: a step without a sample goes on with the values that it has, a miss; after
`tolerated` misses in a row the next one is the loss of the peers.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

Values = Mapping[str, float]


@dataclass(slots=True)
class Counters:
    """How often what has happened since the node was activated."""

    steps: int = 0
    misses: int = 0
    misses_in_row: int = 0
    late: int = 0
    """Samples that came after their step had been given up; they were taken as the newest ones."""
    skipped: int = 0
    """Samples that a newer one replaced before the step began."""
    refused: int = 0
    """Messages that lacked something, or had what is no number."""
    losses: int = 0
    overruns: int = 0
    """Steps that were left out because the computer was late, by its own clock."""


@dataclass(slots=True)
class Samples:
    """The newest samples of some topics.

    Args:
        topics: The names of the topics.
        tolerated: How many steps in a row may miss a sample.
        longest_age_ns: None in lockstep, where each step takes a new sample of each topic. By the
            clock a step takes samples of at most this age.
    """

    topics: Sequence[str]
    tolerated: int
    longest_age_ns: int | None = None
    count: Counters = field(default_factory=Counters)
    values: dict[str, float] = field(default_factory=dict)
    """The newest value of each variable."""
    _arrived: dict[str, int] = field(default_factory=dict)
    _fresh: set[str] = field(default_factory=set)
    _owed: dict[str, int] = field(default_factory=dict)

    def take(self, topic: str, values: Values, now_ns: int) -> None:
        """Take a sample that has arrived."""
        self.values.update(values)
        self._arrived[topic] = now_ns
        if self._owed.get(topic):
            self.count.late += 1
            self._owed[topic] -= 1
            if self.longest_age_ns is None:
                return  # the sample of a step that was given up
        if topic in self._fresh:
            self.count.skipped += self.longest_age_ns is None
        self._fresh.add(topic)

    @property
    def complete(self) -> bool:
        """True if there is a new sample of each topic."""
        return len(self._fresh) == len(self.topics)

    def missing(self, now_ns: int) -> list[str]:
        """The topics whose sample a step that begins now has to do without."""
        if self.longest_age_ns is None:
            return [topic for topic in self.topics if topic not in self._fresh]
        oldest = now_ns - self.longest_age_ns
        return [
            topic
            for topic in self.topics
            if topic not in self._fresh and self._arrived.get(topic, oldest - 1) < oldest
        ]

    def begin_step(self, now_ns: int) -> list[str]:
        """Begin a step with what there is.

        Returns:
            What is missing if the peers are lost: one miss more in a row than is tolerated.
            Else nothing.
        """
        missing = self.missing(now_ns)
        self._fresh.clear()
        count = self.count
        count.steps += 1
        if not missing:
            count.misses_in_row = 0
            return []
        count.misses += 1
        count.misses_in_row += 1
        for topic in missing:
            most = 1 if self.longest_age_ns is not None else count.misses_in_row
            self._owed[topic] = min(self._owed.get(topic, 0) + 1, most)
        if count.misses_in_row <= self.tolerated:
            return []
        return missing

    def lose(self) -> None:
        """Give the peers up: from now on each sample is that of a peer that has come back."""
        self.count.losses += 1
        self.forget()

    def forget(self) -> None:
        """Wait for new samples of all topics, as at the start."""
        self.count.misses_in_row = 0
        self._fresh.clear()
        self._owed.clear()
