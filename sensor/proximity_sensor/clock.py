"""The sampling instants: k / rate after the start, k = 0, 1, 2, ..., whatever the steps are.

The time to the next one is counted in periods, so that nothing adds up over a run but the rounding
of the steps: a millionth of a period is room for ten thousand million of them.
"""

from dataclasses import dataclass
from math import ceil
from typing import Annotated

from block_variables import Group, Parameter

TOLERANCE = 1e-6
"""How near, in periods, an instant counts as reached; a nanosecond at 1 kHz."""


@dataclass(frozen=True, slots=True)
class Params(Group, name="sampling"):
    """10 kHz is the sampling rate of the paper's bench, Sec. IV.B."""

    rate: Annotated[
        float, Parameter("sampling rate, where a stage is on", unit="Hz", low=1.0, high=1e6)
    ] = 10_000.0


def due(wait: float) -> bool:
    """True if the next instant, wait periods away, is now."""
    return wait <= TOLERANCE


def samples(p: Params, wait: float, h: float) -> tuple[int, float]:
    """How many instants lie in a step of h s, its end excluded, and the wait at its end.

    wait is the time to the next instant in periods. That of a state from bytes which were damaged
    may be any: no instant is further behind than a period, or the step would not end.
    """
    periods = h * p.rate
    wait = max(wait, -1.0)
    n = max(0, ceil(periods - wait - TOLERANCE))
    return n, wait + n - periods
