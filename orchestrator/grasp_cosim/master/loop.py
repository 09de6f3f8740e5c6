"""The hot loop: every step of every run goes through run(), interpreted or compiled.

The plan turns a system into a program, a short list of operations that make up one macro step. The
loop knows nothing of components or FMI; it moves numbers in one vector and makes calls. The same
source is interpreted on lists and memory views, and compiled on arrays (compiled.py), where the
four functions below it have counterparts of the same meaning. Keep it in that subset.
"""

from collections.abc import Sequence
from ctypes import c_float
from typing import Any, NamedTuple

from ..base import checks

COPY, SCALE, STORE, LOAD, LOAD_LONG, DRIVE, CALL, STEP = range(8)  # calls last
"""Operations: over connections COPY and SCALE; over casts STORE into a buffer of another type, LOAD
from one, LOAD_LONG with a check; over drives DRIVE; over calls CALL and STEP, which sets the clock
before it.
"""

TOO_LONG = 100
"""The status of an integer that a float64 does not hold exactly."""

RAISED = 101
"""The status of a Python call that raised; the exception waits in the plan."""

FULL, HALTED, OVERRUN = 102, 103, 104
"""Of the compiled loop alone: the rows have no room left; it was halted; a late step ends it."""

EXACT = float(checks.EXACT)
"""Integers of a smaller magnitude are exact as a float64."""

WORST = 1
"""The highest status, an FMI warning, with which the loop goes on."""


class Program(NamedTuple):
    """Operations: kind, range in its table, and the steps k it runs in: k % period == phase."""

    kind: Any
    first: Any
    last: Any
    period: Any
    phase: Any


class Connections(NamedTuple):
    """values[target] = factor * values[source] + offset."""

    source: Any
    target: Any
    factor: Any
    offset: Any


class Casts(NamedTuple):
    """values[slot] is element index of a buffer of another type than float64."""

    buffer: Any
    index: Any
    slot: Any


def run(
    program: Program,
    connections: Connections,
    casts: Casts,
    drives: Any,
    calls: Any,
    buffers: Any,
    values: Any,
    clock: Any,
    rows: Any,
    operation: int,
    start: int,
    stop: int,
    start_ns: int,
    step_ns: int,
) -> tuple[int, int, int]:
    """Do the steps from start to stop, the first from the given operation on.

    Step 0 begins at start_ns.
    After step k the values go into rows, one row of len(values) after the other. clock holds the
    time in s at which the component that steps now begins, and the step number. Returns the step
    reached, and where a call's status is a bad one, the operation and the status (else 0 and 0).
    """
    kind, first, last, period, phase = program
    source, target, factor, offset = connections
    buffer, index, slot = casts
    width, size = len(values), len(kind)
    for k in range(start, stop):
        clock[1] = k
        while operation < size:
            if k % period[operation] == phase[operation]:
                what, begin = kind[operation], first[operation]
                if what >= CALL:
                    if what == STEP:
                        clock[0] = (start_ns + (k + 1 - period[operation]) * step_ns) / 1e9
                    status = invoke(calls, begin, clock)
                    if status > WORST:
                        return k, operation, status
                elif what == COPY:
                    for i in range(begin, last[operation]):
                        values[target[i]] = values[source[i]]
                elif what == SCALE:
                    for i in range(begin, last[operation]):
                        values[target[i]] = factor[i] * values[source[i]] + offset[i]
                elif what == STORE:
                    for i in range(begin, last[operation]):
                        store(buffers, buffer[i], index[i], values[slot[i]])
                elif what != DRIVE:
                    for i in range(begin, last[operation]):
                        value = load(buffers, buffer[i], index[i])
                        if what == LOAD_LONG and (value >= EXACT or value <= -EXACT):
                            return k, operation, TOO_LONG
                        values[slot[i]] = value
                else:
                    time = start_ns + (k - phase[operation]) * step_ns
                    for i in range(begin, last[operation]):
                        drive(drives, i, time, values)
            operation += 1
        operation = 0
        row = (k - start) * width
        rows[row : row + width] = values
    return stop, 0, 0


def invoke(calls: Sequence[Any], i: int, clock: Any) -> int:
    """Make call i; its FMI status."""
    return calls[i]()  # type: ignore[no-any-return]


def drive(drives: Sequence[Any], i: int, time: int, values: Any) -> None:
    """Put the value that drive i has at a time in ns into its place."""
    values[drives[i].slot] = drives[i].at(time)


def load(buffers: Sequence[Any], i: int, index: int) -> float:
    """An element of buffer i as a float."""
    return float(buffers[i][index])


def store(buffers: Sequence[Any], i: int, index: int, value: float) -> None:
    """Put a number into buffer i, in its type."""
    buffer = buffers[i]
    buffer[index] = c_float(value).value if buffer.format == "f" else int(value)
