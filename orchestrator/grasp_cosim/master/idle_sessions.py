"""Sessions whose run is over, which run the same system again with other start values.

To load four FMUs and plan their steps takes longer than many a run. Only FMUs that are reset
exactly are kept so: native twins of our own blocks.
"""

import os
import threading
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from functools import partial
from typing import Any

from ..fmi.load import is_reset_exactly
from ..system.description import System
from .engine import Engine
from .session import Finish, Session, differs_in_values_alone

MAX_IDLE = 4
"""Sessions that are kept, of which threads run one each."""

MAX_BYTES = 1 << 25
"""Of the rows of a run whose session is kept."""


class RepeatableSession(Session):
    """A session that may begin again, as a new one would."""

    def is_for(self, system: System, every: int, engine: Engine, metrics: Sequence[Any]) -> bool:
        """Return True if the run of a system would differ from the run here in start values only.

        Args:
            system: The system, with its twins.
            every: Every how many communication points are recorded.
            engine: The engine that was asked for.
            metrics: The metrics that were asked for in addition.
        """
        return (
            (every, engine) == (self._record.every, self.master.engine)
            and differs_in_values_alone(system, self.system)
            and self._record.has_metrics(metrics)
        )

    def repeat(self, system: System, finish: Finish, halt: threading.Event | None) -> None:
        """Begin the run of a system that is_for() holds of, as a new session would.

        Args:
            system: The system.
            finish: Gets its result, as of a new session.
            halt: The event that ends it, as of a new session.

        Raises:
            InputError: An FMU refuses its initialisation. Then the session must be closed.
            SimulationError: An FMU fails. Then the session must be closed.
        """
        self._finish, self._wall_time = finish, 0.0
        self.halt = halt or threading.Event()
        self._record.start_over()
        self._call_fmus(partial(self._initialise_with, system))

    def rest(self) -> bool:
        """Hand the result of a run over that came to its end, with the FMUs loaded.

        Returns:
            False if the session cannot be used again: it must be closed.
        """
        if not (self._can_repeat and self._is_over):
            return False
        self._hand_over()
        self._finish = None
        return True

    @property
    def _can_repeat(self) -> bool:
        """True if all FMUs are reset exactly, nobody else listens, and the rows are few."""
        size = 8 * self.system.total_steps * len(self._record.signals)
        return (
            size <= MAX_BYTES
            and not (self.pacer or self._has_listeners or self._log.is_told or self._requests)
            and all(map(is_reset_exactly, self.system.components))
        )


_idle: list[RepeatableSession] = []
"""The one that ended last comes last."""

_LOCK = threading.Lock()


def _forget() -> None:
    """Forget them in a fork: what they have loaded is the parent's, and so may the lock be."""
    global _LOCK
    _LOCK = threading.Lock()
    _idle.clear()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forget)


def take(fits: Callable[[RepeatableSession], bool]) -> RepeatableSession | None:
    """Take a session that fits, the one that ended last; None where there is none."""
    with _LOCK:
        for i in reversed(range(len(_idle))):
            if fits(_idle[i]):
                return _idle.pop(i)
    return None


def keep(session: RepeatableSession) -> None:
    """Keep a session that rests; the one that ended first is closed where there are too many."""
    with _LOCK:
        _idle.append(session)
        surplus = _idle[:-MAX_IDLE]
        del _idle[:-MAX_IDLE]
    _close(surplus)


def close_all() -> None:
    """Close the sessions that are kept."""
    with _LOCK:
        kept, _idle[:] = [*_idle], []
    _close(kept)


def _close(sessions: Sequence[RepeatableSession]) -> None:
    with ExitStack() as stack:
        for session in sessions:
            stack.callback(session.close)
