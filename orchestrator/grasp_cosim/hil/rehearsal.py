"""Failures of a bench that a server rehearses: which one, and when after the first step."""

from __future__ import annotations

import math
import os
import re
from dataclasses import dataclass
from typing import Literal, get_args

from ..base.errors import InputError, choices
from ..system.times import NANOSECONDS

Failure = Literal["kill", "stop", "mute", "deaf", "restart", "replace", "fail", "trip"]
MAX_DELAY = 1e6
"""s until a failure, at most."""

FAILURES: tuple[Failure, ...] = get_args(Failure)
FAILURES_OF_A_SESSION: tuple[Failure, ...] = ("fail", "trip")
"""Those that need a session to happen in."""

MEANINGS = (
    "kill: the process ends at once. stop: the process stands still. mute: the server sends no "
    "more answers. deaf: the server receives no more requests. restart: the server starts again "
    "and knows no link session. replace: a server with another name takes over. fail: the model "
    "fails. trip: the inputs get their safe values"
)


@dataclass(frozen=True, slots=True)
class Rehearsed:
    """A failure, and the time in s after the first step at which it happens."""

    failure: Failure
    at: float

    @classmethod
    def read(cls, text: str) -> Rehearsed:
        """The failure that a text describes, like mute@0.9; InputError where it says none."""
        name, _, seconds = text.partition("@")
        failure = next((failure for failure in FAILURES if failure == name), None)
        try:
            at = float(seconds) if re.fullmatch(r"[0-9.]+", seconds) else math.nan
        except ValueError:
            at = math.nan
        if failure is None or not at <= MAX_DELAY:
            must = (
                f"must be FAILURE@SECONDS, of {choices(FAILURES)}, up to {MAX_DELAY:g} s after "
                "the first step"
            )
            raise InputError(f"--fault {text!r}: {must}")
        return cls(failure, at)


class Rehearsal:
    """A failure on its way; times are in ns of the server's clock."""

    def __init__(self, rehearsed: Rehearsed | None) -> None:
        self._rehearsed = rehearsed
        self._at: int | None = None
        self.happened: Failure | None = None

    def note_step(self, now_ns: int) -> None:
        """Take note of a step: the first one starts the clock."""
        if self._rehearsed and self._at is None:
            self._at = now_ns + round(self._rehearsed.at * NANOSECONDS)

    def due(self, in_session: bool) -> int | None:
        """Return when it happens; None where that is not known, or it has, or has to wait."""
        return None if self.happened or self._waits(in_session) else self._at

    def _waits(self, in_session: bool) -> bool:
        """True where the failure needs a session, and there is none."""
        if self._rehearsed is None or in_session:
            return False
        return self._rehearsed.failure in FAILURES_OF_A_SESSION

    def happens(self, now_ns: int, in_session: bool) -> Failure | None:
        """Return the failure that happens now, once; some need a session to happen in."""
        if self._rehearsed is None or self.happened or self._at is None or now_ns < self._at:
            return None
        if self._waits(in_session):
            return None
        self.happened = self._rehearsed.failure
        return self.happened


def end_at_once() -> None:
    """End this process as SIGKILL does: nobody gets a message."""
    os._exit(KILLED)


KILLED = 128 + 9
"""The exit code of a shell for a process that SIGKILL has ended."""
