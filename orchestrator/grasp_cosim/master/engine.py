"""The two engines: the loop as plain Python, and the same loop compiled.

Which one "auto" takes is known before the run: a process runs the loop in plain Python until what
compiled code could have saved, with the run to come, exceeds its time to load.
"""

from collections.abc import Callable, Sequence
from importlib.util import find_spec
from typing import Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from ..checks import choice
from . import loop
from .compiled import buffer_table, call_table, compiled_loop
from .plan import Plan

Engine = Literal["auto", "python", "compiled"]
ENGINES: tuple[str, ...] = get_args(Engine)

Loop = Callable[[Any, int, int, int, int], tuple[int, int, int]]
"""loop.run() over a plan: takes rows, operation, start, stop and step_ns."""

START_UP = 1.0
"""s that importing numba and loading the compiled loop take, measured as 0.7 to 1.2 s; at the first
time on a machine more, when it is compiled, but the result is kept.
"""

SAVED = 1e-6
"""s that a native call takes less in a compiled step, with the connections and casts around it:
0.7 us measured over 4 native FMUs with 23 calls a step, 1.2 us over the 13 calls of the grasp.
"""

_forgone = 0.0
"""s that compiled code could have saved in this process until now."""


def make_loop(plan: Plan, engine: Engine, steps: int | None = None) -> Loop:
    """Return the loop over a plan, for a run of so many `steps`, None for one in real time.

    InputError where it is to be compiled and numba is not installed.
    """
    choice("engine", engine, ENGINES)
    if engine == "compiled" or (engine == "auto" and has_numba() and _pays(plan, steps)):
        return _compiled(plan)
    return _interpreted(plan)


def has_numba() -> bool:
    """Return True if the loop can be compiled."""
    return find_spec("numba") is not None


def _pays(plan: Plan, steps: int | None) -> bool:
    """Return True if the compiled loop is there already, or will have saved more than it costs."""
    global _forgone
    if steps is None or compiled_loop.cache_info().currsize:
        return True
    rates = [
        1.0 / period
        for kind, call, _, period, _ in plan.operations
        if kind >= loop.CALL and plan.calls[call].native
    ]
    _forgone += SAVED * steps * sum(rates)
    return _forgone > START_UP


def _interpreted(plan: Plan) -> Loop:
    program = loop.Program(*_columns(plan.operations, 5))
    connections = loop.Connections(*_columns(plan.connections, 4))
    casts = loop.Casts(*_columns(plan.casts, 3))
    calls = [call.python for call in plan.calls]
    buffers = [memoryview(b) for b in plan.buffers]  # type: ignore[arg-type]
    values, clock = memoryview(plan.values), memoryview(plan.clock)  # type: ignore[arg-type]
    tables = program, connections, casts, calls, buffers, values, clock

    def run(rows: Any, operation: int, start: int, stop: int, step_ns: int) -> tuple[int, int, int]:
        flat = memoryview(rows.reshape(-1))
        return loop.run(*tables, flat, operation, start, stop, step_ns)

    return run


def _compiled(plan: Plan) -> Loop:
    compiled = compiled_loop()
    whole, real = np.int64, np.float64
    program = loop.Program(*_arrays(plan.operations, [whole] * 5))
    connections = loop.Connections(*_arrays(plan.connections, [whole, whole, real, real]))
    casts = loop.Casts(*_arrays(plan.casts, [whole] * 3))
    calls = call_table(plan.calls)
    buffers = buffer_table(plan.buffers)

    def run(rows: Any, operation: int, start: int, stop: int, step_ns: int) -> tuple[int, int, int]:
        return compiled(
            program, connections, casts, calls[0], buffers, plan.values, plan.clock,
            rows.reshape(-1), operation, start, stop, step_ns,
        )  # fmt: skip

    return run


def _columns(table: Sequence[Sequence[Any]], width: int) -> list[list[Any]]:
    return [[row[i] for row in table] for i in range(width)]


def _arrays(table: Sequence[Sequence[Any]], types: Sequence[Any]) -> list[npt.NDArray[Any]]:
    return [np.array(c, t) for c, t in zip(_columns(table, len(types)), types, strict=True)]
