"""The events of an FMU that its master handles, in co-simulation and in model exchange.

In an event clocks tick and inputs arrive, then the discrete states are updated until they settle.
Events that do not settle, or do not come to rest, end the run.
"""

import math
from collections.abc import Callable, Collection
from typing import Any, NamedTuple, Protocol

import numpy.typing as npt

from ..base.calls import Call
from ..base.errors import SimulationError
from .clocks import Clocks

MAX_UPDATES = 1000
"""The most updates of the discrete states in one event."""

DENSE, MAX_DENSE_EVENTS = 0.01, 1000
"""So many events, each within this part of a communication step after the one before, end a run."""

Update = Callable[[], tuple[bool, bool, bool, bool, bool, float]]
"""Updates the discrete states once, and returns five answers and a time in s.

They are whether it wants another update, asks for the end of the simulation, or has changed nominal
values. The last two are whether it has changed states, or named a next event at that time.
"""

Arrive = Callable[[Collection[int]], None]
"""Has the inputs arrive that may be set while the clocks of these references tick."""


class Refuse(Protocol):
    """Gives the error for a reason, what the FMU did in words, at a time in s."""

    def __call__(self, reason: str, time: float, must: str = "") -> SimulationError:
        """`must` says how that must be, as the end of the line."""


class Settled(NamedTuple):
    """What came of an event: the end of the simulation, or the time of the next event in s."""

    ended: bool
    new_nominals: bool
    next: float
    """inf where the FMU names none."""


class Events:
    """The events of one instance."""

    def __init__(self, clocks: Clocks, refuse: Refuse) -> None:
        self._clocks, self._refuse = clocks, refuse
        self._dense_events, self._last_event = 0, -math.inf

    def saved(self) -> tuple[int, float]:
        """What was counted, for restore()."""
        return self._dense_events, self._last_event

    def restore(self, saved: tuple[int, float]) -> None:
        """Go back to what was saved."""
        self._dense_events, self._last_event = saved

    def count(self, time: float, near: float, step: float, following: float = math.inf) -> None:
        """Count an event at a time, which is close upon another that was at most `near` before.

        SimulationError where too many come in a row. All in s: `step` is the communication step,
        `following` the time of the next event that the FMU has named.
        """
        self._dense_events = self._dense_events + 1 if time - self._last_event <= near else 0
        self._last_event = time
        if self._dense_events < MAX_DENSE_EVENTS:
            return
        next_one = f", the next at t = {following:.9g} s" if following < math.inf else ""
        raise self._refuse(
            f"chatters, or does not come to rest ({MAX_DENSE_EVENTS} events in a row, each within "
            f"{DENSE:.0%} of the step after the one before{next_one})",
            time,
            "; must have a hysteresis, name later times for its events, or have a shorter step "
            f"than {step:g} s",
        )

    def settle(self, time: float, update: Update, arrive: Arrive) -> Settled:
        """Tick the clocks that are due at a time in s, and update the discrete states until they
        settle; SimulationError where they do not.
        """
        self._clocks.begin(time)
        ticked = self._clocks.tick()
        arrive(ticked)
        new_nominals = False
        for _ in range(MAX_UPDATES):
            needs_another, ended, renominated, _, has_next, next_time = update()
            new_nominals = new_nominals or renominated
            if ended:
                return Settled(True, new_nominals, math.inf)
            self._clocks.schedule(ticked)
            ticked = self._clocks.tick()
            arrive(ticked)
            if not needs_another and not ticked:
                break
        else:
            raise self._refuse(f"does not settle an event in {MAX_UPDATES} iterations", time)
        if has_next and math.isnan(next_time):
            raise self._refuse("names nan as the time of its next event", time)
        return Settled(False, new_nominals, next_time if has_next else math.inf)


class ConnectedInputs:
    """Connected inputs that arrive by an event: the values to come, and those that the FMU has."""

    def __init__(self, data: npt.NDArray[Any], call: Call) -> None:
        """The call passes data on."""
        self._data, self._call = data, call
        self.last_passed = b""
        """What the FMU has."""

    def values_to_come(self) -> npt.NDArray[Any]:
        """The values to come."""
        return self._data

    def changed(self) -> bool:
        """True if the FMU has other values."""
        return self.values_to_come().tobytes() != self.last_passed

    def pass_on(self) -> int:
        """Set them; the FMI status."""
        self.last_passed = self.values_to_come().tobytes()
        return self._call.python()
