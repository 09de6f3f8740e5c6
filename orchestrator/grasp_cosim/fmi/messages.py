"""What an FMU logs, and the warnings that its calls return.

An FMU logs at any time, also while the compiled loop calls it, and as often as it likes. The last
of its warnings and errors are kept for the error that may follow; of each severity the first one,
and how many there were, for the log of the run. All warnings and errors go to the logger at the
level INFO, which is --verbose. Where a component has `logging`, whatever it asks for goes there, at
the level WARNING, which the command line shows.
"""

import logging
import re
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

from ..base.scratch import without_scratch
from ..system.parts import Logging
from .instance import DISCARD, ERROR, FATAL, OK, STATUS, WARNING

LOGGER = logging.getLogger(__name__)
"""Gets the messages. A record of it has the Message as `fmu_message`."""

MAX_KEPT = 12
"""The last warnings and errors that are kept for an error: an FMU may log some at every step."""

SEVERE = {
    WARNING: "logStatusWarning",
    DISCARD: "logStatusDiscard",
    ERROR: "logStatusError",
    FATAL: "logStatusFatal",
}
"""The log categories of warnings and errors, as FMI names them."""

_PYTHONFMU_PREFIX = re.compile(r"Fatal py exception encountered: \[\w+\] \w+\s")
"""Begins a message of pythonfmu about an exception; kept only if the FMU logged nothing else."""


class Message(NamedTuple):
    """A message of an FMU: its FMI status, its text, and the time in s of the step that was begun
    last.
    """

    status: int
    text: str
    time: float


class _Tally(NamedTuple):
    """The first message of a severity, and how many there were."""

    first: Message
    number: int


class Messages:
    """The messages of one component."""

    def __init__(self, component: str, logging: Logging, clock: Callable[[], float]) -> None:
        """`logging` are the categories that were asked for, or all; clock() is the time in s."""
        self._component, self._logging, self._clock = component, logging, clock
        self._latest: deque[Message] = deque(maxlen=MAX_KEPT)
        self._tallies: dict[int, _Tally] = {}
        self._is_ignoring = False
        self.count = 0
        """Warnings and errors so far."""
        self.unrequested = 0
        """Messages so far that are neither warnings nor errors, and that nobody asked for."""

    def wants(self, status: int, category: bytes | None) -> bool:
        """True for a message of such a status and category that is to be taken."""
        if status > OK:
            return not self._is_ignoring
        if isinstance(self._logging, bool):
            is_asked_for = self._logging
        else:
            is_asked_for = (category or b"").decode(errors="replace") in self._logging
        self.unrequested += not is_asked_for
        return is_asked_for

    def take(self, status: int, text: bytes | None) -> None:
        """Take a message as the FMU logs it."""
        plain = without_scratch((text or b"").decode(errors="replace"))
        self.keep(Message(status, plain, self._clock()))

    def returned(self, function: str, since: int) -> None:
        """Take the warning that a call of a function returned, if none was logged `since` a count
        of them.
        """
        if self.count == since:
            self.keep(Message(WARNING, f"{function} returned a warning", self._clock()))

    def keep(self, message: Message) -> None:
        """Keep a message, and show it to who wants to see it."""
        level = logging.WARNING if self._logging else logging.INFO
        if LOGGER.isEnabledFor(level):
            line = f"{self._component}: {self._in_words(message)}"
            LOGGER.log(level, "%s", line, extra={"fmu_message": message})
        if message.status > OK:
            self.count += 1
            self._latest.append(message)
            first, number = self._tallies.get(message.status, (message, 0))
            self._tallies[message.status] = _Tally(first, number + 1)

    def saved(self) -> tuple[Any, ...]:
        """What was logged until now, for restore()."""
        return [*self._latest], dict(self._tallies), self.count, self.unrequested

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved: what was logged since is taken back."""
        last, tallies, self.count, self.unrequested = saved
        self._latest, self._tallies = deque(last, MAX_KEPT), dict(tallies)

    def forget(self) -> None:
        """Nothing was logged yet."""
        self.restore(((), {}, 0, 0))

    @contextmanager
    def ignored(self) -> Iterator[None]:
        """What is logged meanwhile says nothing about the run."""
        self._is_ignoring = True
        try:
            yield
        finally:
            self._is_ignoring = False

    def reasons(self) -> list[str]:
        """The texts of the last messages, for an error; they are not told again.

        They are those of one step: what the FMU warned of before is in the log.
        """
        texts = [m.text for m in self._latest if m.time == self._latest[-1].time]
        self._latest.clear()
        self._tallies = {s: tally for s, tally in self._tallies.items() if s <= WARNING}
        texts = [text for text in texts if not _PYTHONFMU_PREFIX.match(text)] or texts
        return [self._bare(text) for text in texts]

    def remarks(self, returned: int = 0, first: float = 0.0) -> list[str]:
        """The lines of the log of a run: the first message of each severity and how many followed.

        So many calls of the loop have returned a warning, the first in the step from that time in
        s on. It is told where the FMU did not log as many.
        """
        lines = [
            f"{self._component}: {self._in_words(tally.first)}{_followed(tally.number)}"
            for _, tally in sorted(self._tallies.items())
        ]
        logged = self._tallies[WARNING].number if WARNING in self._tallies else 0
        if returned > logged:
            lines.append(
                f"{self._component}: a call returned a warning at t = {first:.9g} s"
                f"{_followed(returned)}"
            )
        return lines

    def _in_words(self, message: Message) -> str:
        text = " ".join(self._bare(message.text).split()) or "no text"
        return f"{STATUS[message.status]} at t = {message.time:.9g} s: {text}"

    def _bare(self, text: str) -> str:
        """The text without what pythonfmu, and our own FMUs, put before it."""
        prefix = re.compile(rf"\A{re.escape(self._component)}, t = \S+ s: ")
        return prefix.sub("", _PYTHONFMU_PREFIX.sub("", text), count=1)


def _followed(count: int) -> str:
    """How many messages followed the first of so many, as the end of a line."""
    return f"; {count - 1} more followed" if count > 1 else ""
