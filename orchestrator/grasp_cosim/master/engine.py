"""The two engines: the loop as plain Python, and the same loop compiled."""

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any, Literal, get_args

import numpy as np

from ..errors import InputError, choices
from . import loop
from .compiled import Calls, buffer_table, compiled_loop
from .plan import Plan

Engine = Literal["auto", "python", "compiled"]
ENGINES: tuple[str, ...] = get_args(Engine)

Loop = Callable[[Any, int, int, int, int], tuple[int, int, int]]
"""loop.run() over a plan: takes rows, operation, start, stop and step_ns."""


def make_loop(plan: Plan, engine: Engine) -> Loop:
    """The loop over a plan; "auto" compiles it where numba is installed.

    InputError where it is to be compiled and numba is not installed.
    """
    if engine not in ENGINES:
        raise InputError(f"engine = {engine!r}: must be one of {choices(ENGINES)}")
    if engine == "compiled" or (engine == "auto" and has_numba()):
        return _compiled(plan)
    return _interpreted(plan)


def has_numba() -> bool:
    """Whether the loop can be compiled."""
    return find_spec("numba") is not None


def _columns(table: Sequence[Sequence[Any]], width: int) -> list[list[Any]]:
    return [[row[i] for row in table] for i in range(width)]


def _interpreted(plan: Plan) -> Loop:
    program = loop.Program(*_columns(plan.operations, 5))
    connections = loop.Connections(*_columns(plan.connections, 4))
    casts = loop.Casts(*_columns(plan.casts, 3))
    calls = [call.python for call in plan.calls]
    buffers = [memoryview(b) for b in plan.buffers]  # type: ignore[arg-type]
    values, clock = memoryview(plan.values), memoryview(plan.clock)  # type: ignore[arg-type]

    def run(rows: Any, operation: int, start: int, stop: int, step_ns: int) -> tuple[int, int, int]:
        flat = memoryview(rows.reshape(-1))
        return loop.run(
            program, connections, casts, calls, buffers, values, clock, flat, operation, start,
            stop, step_ns,
        )  # fmt: skip

    return run


def _compiled(plan: Plan) -> Loop:
    compiled = compiled_loop()
    program = loop.Program(*(np.array(c, np.int64) for c in _columns(plan.operations, 5)))
    source, target, factor, offset = _columns(plan.connections, 4)
    connections = loop.Connections(
        np.array(source, np.int64), np.array(target, np.int64),
        np.array(factor, np.float64), np.array(offset, np.float64),
    )  # fmt: skip
    casts = loop.Casts(*(np.array(c, np.int64) for c in _columns(plan.casts, 3)))
    calls = Calls(plan.calls)
    buffers = buffer_table(plan.buffers)

    def run(rows: Any, operation: int, start: int, stop: int, step_ns: int) -> tuple[int, int, int]:
        return compiled(
            program, connections, casts, calls.table, buffers, plan.values, plan.clock,
            rows.reshape(-1), operation, start, stop, step_ns,
        )  # fmt: skip

    return run
