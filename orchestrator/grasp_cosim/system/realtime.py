"""Options of a run that is paced by the clock."""

import math
from dataclasses import dataclass
from fractions import Fraction
from numbers import Real
from typing import Literal, get_args

from ..base.checks import choice, whole
from ..base.errors import InputError

Overrun = Literal["catch-up", "continue", "stop"]
OVERRUNS: tuple[str, ...] = get_args(Overrun)


@dataclass(frozen=True, slots=True)
class Realtime:
    """How a run keeps to the clock; InputError where a value is none of those given here."""

    factor: float = 1.0
    """Speed relative to real time, > 0."""
    overrun: Overrun = "catch-up"
    """Treatment of a step that ends after the next one should have begun: "catch-up" keeps to the
    schedule, late steps are done without waiting; "continue" shifts the schedule by the delay;
    "stop" ends the run with a SimulationError.
    """
    priority: int | None = None
    """Priority of SCHED_FIFO, 1 to 99; None leaves the scheduling as it is."""
    cpu: int | None = None
    """The number of the CPU to stay on; None leaves it to the operating system."""
    lock_memory: bool = False
    """Keep the memory of the process from being swapped out."""

    def __post_init__(self) -> None:
        factor = self.factor
        if isinstance(factor, bool) or not isinstance(factor, Real) or not 0 < factor < math.inf:
            raise InputError(f"factor = {factor!r}: must be a finite number > 0")
        choice("overrun", self.overrun, OVERRUNS)
        if self.priority is not None:
            whole("priority", self.priority, 1, 99, must="a whole number from 1 to 99")
        if self.cpu is not None:
            whole("cpu", self.cpu, 0, 2**16, must=f"a whole number from 0 to {2**16}")
        if not isinstance(self.lock_memory, bool):
            raise InputError(f"lock_memory = {self.lock_memory!r}: must be True or False")

    def period(self, step_ns: int) -> Fraction:
        """The wall time in ns between the beginnings of two steps of step_ns; it is exact.

        InputError where that is less than 1 ns, or more than a year.
        """
        period = step_ns / Fraction(repr(float(self.factor)))  # 0.1 is meant to be a tenth
        if not 1 <= period <= YEAR_NS:
            raise InputError(
                f"factor = {self.factor!r}: a step of {step_ns / 1e9:g} s would begin every "
                f"{float(period) / 1e9:g} s; must be from 1 ns to a year"
            )
        return period


YEAR_NS = 366 * 24 * 3600 * 10**9
"""The longest period."""
