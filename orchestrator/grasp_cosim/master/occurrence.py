"""What happens once in a run: an event, the beginning and the end of a fault."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from ..system.parts import Condition


@dataclass(slots=True, eq=False)
class Occurrence:
    """What happens once in a run.

    It happens at the first step from `first` on, before `end` and a multiple of `period`, at which
    the condition `when` holds. `happen` does it and returns lines for the log; `absence` is the
    line where it has not happened. Where it sets values (`sets`), these are to be set again in FMUs
    that are loaded again.
    """

    first: int
    end: float
    period: int
    when: Condition | None
    happen: Callable[[int], Sequence[str]]
    absence: str = ""
    sets: bool = False

    def due(self, step: int) -> float:
        """The first step from this one on at which it can happen."""
        point = -(-max(step, self.first) // self.period) * self.period
        return point if point < self.end else math.inf
