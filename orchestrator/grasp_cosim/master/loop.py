"""The hot loop: every step of every run goes through run() here, or through its twin, loop.c.

The plan turns a system into a program, a short list of operations that make up one macro step. The
loop knows nothing of components or FMI; it moves numbers in one vector and makes calls.
"""

from collections.abc import Callable, Sequence
from ctypes import c_float
from typing import Any

from ..base import checks

COPY, SCALE, STORE, LOAD, LOAD_LONG, DRIVE, WATCH, EXCHANGE, CALL, STEP = range(10)  # calls last
"""Operations: over connections COPY and SCALE; over casts STORE into a buffer of another type, LOAD
from one, LOAD_LONG with a check; over drives DRIVE; over watches WATCH; over exchanges of energy
EXCHANGE; over calls CALL and STEP, which sets the clock before it.
"""

SLOT, RELATION, VALUE, FACTOR, OFFSET, ARMED, HELD = range(7)
"""The columns of a watch: of which signal, compared how with what, after factor and offset; whether
the loop ends where it holds, which it does once; in how many steps it has held.
"""

HELD_FORCE, POSITION, FORCE, RECEIVED, ENERGY, PERIOD, SCALE_TO_J = range(7)
FORCE_FACTOR, FORCE_OFFSET, POSITION_FACTOR, POSITION_OFFSET = range(7, 11)
LAST_POSITION, LAST_FORCE, LAST_RECEIVED = range(11, 14)
"""The columns of an exchange: the slots of F_held, x, F, s and E of exchange/energy.py, the step of
the source in base steps, and J of one unit; what converts its force and position to the units of
the component that moves; x, F and s of the last step that counted.
"""

TOO_LONG = 100
"""The status of an integer that a float64 does not hold exactly."""

RAISED = 101
"""The status of a Python call that raised; the exception waits in the plan."""

FULL, HALTED, OVERRUN = 102, 103, 104
"""Of the compiled loop only: the rows have no space left; it was halted; a late step ends it."""

WATCHED, STALLED = 105, 106
"""A condition that is watched holds; a step begins so late that all that is measured is of old."""

EXACT = float(checks.EXACT)
"""Integers of a smaller magnitude are exact as a float64."""

WORST = 1
"""The highest status, an FMI warning, with which the loop goes on."""


def run(
    operations: Sequence[tuple[int, int, int, int, int]],
    connections: Sequence[tuple[int, int, float, float]],
    casts: Sequence[tuple[int, int, int]],
    drives: Sequence[Any],
    watches: Sequence[Sequence[float]],
    exchanges: Sequence[Any],
    calls: Sequence[Callable[[], int]],
    buffers: Sequence[Any],
    values: Any,
    clock: Any,
    warned: Any,
    rows: Any,
    operation: int,
    start: int,
    stop: int,
    grid_start: int,
    grid_step: int,
    per_second: int,
) -> tuple[int, int, int]:
    """Do the steps from start to stop, the first from the given operation on.

    The tables are those of a plan; values, clock, buffers, warned and rows are memory views. Step 0
    begins at grid_start, and there are per_second of these. After step k the values go into rows,
    one row of len(values) after the other. clock holds the time in s at which the component that
    steps now begins, the step number, and the time at which the step ends. Returns the step
    reached, and where a call's status is a bad one, the operation and the status (else 0 and 0).
    """
    width, size, counts = len(values), len(operations), float(per_second)
    for k in range(start, stop):
        clock[1] = k
        clock[2] = (grid_start + (k + 1) * grid_step) / counts
        while operation < size:
            kind, begin, end, period, phase = operations[operation]
            if k % period == phase:
                if kind >= CALL:
                    if kind == STEP:
                        clock[0] = (grid_start + (k + 1 - period) * grid_step) / counts
                    status = calls[begin]()
                    if status:
                        if status > WORST:
                            return k, operation, status
                        note_warning(warned, begin, clock[0])
                elif kind == COPY:
                    for source, target, _, _ in connections[begin:end]:
                        values[target] = values[source]
                elif kind == SCALE:
                    for source, target, factor, offset in connections[begin:end]:
                        values[target] = factor * values[source] + offset
                elif kind == STORE:
                    for buffer, index, slot in casts[begin:end]:
                        store(buffers[buffer], index, values[slot])
                elif kind == DRIVE:
                    time = grid_start + (k - phase) * grid_step
                    for drive in drives[begin:end]:
                        values[drive.slot] = drive.at(time)
                elif kind == WATCH:
                    if holds(watches[begin], values):
                        return k, operation, WATCHED
                elif kind == EXCHANGE:
                    for exchange in exchanges[begin:end]:
                        account(exchange, values, k + 1)
                else:
                    for buffer, index, slot in casts[begin:end]:
                        value = float(buffers[buffer][index])
                        if kind == LOAD_LONG and (value >= EXACT or value <= -EXACT):
                            return k, operation, TOO_LONG
                        values[slot] = value
            operation += 1
        operation = 0
        row = (k - start) * width
        rows[row : row + width] = values
    return stop, 0, 0


def holds(watch: Any, values: Any) -> bool:
    """Count it where a watch's condition holds; True where it is armed, which it is no more."""
    slot, relation, value = int(watch[SLOT]), int(watch[RELATION]), watch[VALUE]
    signal = values[slot]
    if watch[FACTOR] != 1.0 or watch[OFFSET] != 0.0:
        signal = watch[FACTOR] * signal + watch[OFFSET]
    relations = (signal < value, signal <= value, signal > value, signal >= value)
    if not (*relations, signal == value, signal != value)[relation]:
        return False
    armed = bool(watch[ARMED])
    watch[ARMED] = 0.0
    watch[HELD] += 1.0
    return armed


def account(exchange: Any, values: Any, step: int) -> None:
    """Add what an exchange has created by the end of a step: the sum of exchange/energy.py."""
    position = values[int(exchange[POSITION])]
    earned = values[int(exchange[HELD_FORCE])] * (position - exchange[LAST_POSITION])
    exchange[LAST_POSITION] = position
    if step % int(exchange[PERIOD]) == 0:
        force, received = answered(exchange, values)
        moved = received - exchange[LAST_RECEIVED]
        earned += -0.5 * (force + exchange[LAST_FORCE]) * moved
        exchange[LAST_FORCE], exchange[LAST_RECEIVED] = force, received
    values[int(exchange[ENERGY])] += exchange[SCALE_TO_J] * earned


def answered(exchange: Any, values: Any) -> tuple[float, float]:
    """Force and position of the source, in the units of the component that moves."""
    force = exchange[FORCE_FACTOR] * values[int(exchange[FORCE])] + exchange[FORCE_OFFSET]
    received = values[int(exchange[RECEIVED])] - exchange[POSITION_OFFSET]
    return force, received / exchange[POSITION_FACTOR]


def note_warning(warned: Any, call: int, time: float) -> None:
    """Count a warning that a call returned; of the first one the time of the step is kept."""
    if not warned[2 * call]:
        warned[2 * call + 1] = time
    warned[2 * call] += 1.0


def store(buffer: Any, index: int, value: float) -> None:
    """Put a number into a buffer, in its type."""
    buffer[index] = c_float(value).value if buffer.format == "f" else int(value)
