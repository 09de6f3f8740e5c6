"""Calls that are bound once: as a Python function, and as the compiled loop makes them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

TRANSFER_2, TRANSFER_3, STEP_2, STEP_3, PYTHON, CLOCK, PACE, READ = range(8)
"""The shapes of a call, as the compiled loop makes it: see master/loop.c."""


class Native(NamedTuple):
    """A C function with its arguments, all of them addresses or sizes but for the time.

    TRANSFER_2: f(instance, references, size, data). TRANSFER_3: the same and, last, how many values
    there are: more than references where some are of arrays.
    STEP_2: f(instance, time, step, 1). STEP_3: f(instance, time, step, 1, &event, &terminate,
    &early, &last). flags is the address of three bytes for the first three, last that of a double
    for the last; no call where the end of the step is not before the time in s at the
    address limit. CLOCK: time.monotonic_ns(), less size, goes to data, a double. PACE: wait
    for the beginning of a step; instance is what realtime/pacer.py keeps for it, data its times.
    READ: no call; size doubles are copied from the address instance to data.
    """

    shape: int
    function: int
    instance: int
    references: int = 0
    size: int = 0
    data: int = 0
    step: float = 0.0
    flags: int = 0
    last: int = 0
    values: int = 0
    limit: int = 0


@dataclass(frozen=True, slots=True)
class Call:
    """A bound call that returns an FMI status: as a Python function, and natively if possible.

    Made natively it keeps_lock (Python's, the GIL) if what it calls would take that back at once.
    """

    python: Callable[[], int]
    native: Native | None = None
    keeps_lock: bool = False
