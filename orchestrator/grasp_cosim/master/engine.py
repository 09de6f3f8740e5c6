"""The two engines: the loop as plain Python, and the same loop in C.

Which one "auto" takes is known before the run: that in C where it is there already, which it is
once it was built on this machine; a long run, or one in real time, builds it.
"""

import logging
from collections.abc import Callable, Sequence
from typing import Any, Literal, get_args

from ..base.checks import choice
from ..base.errors import InputError
from . import compiled, loop
from .plan import Plan

Engine = Literal["auto", "python", "compiled"]
LOGGER = logging.getLogger(__name__)
"""Gets which engine runs, and why, at the level INFO."""

ENGINES: tuple[str, ...] = get_args(Engine)

Loop = Callable[[Any, int, int, int, int, int], tuple[int, int, int]] | compiled.CompiledLoop
"""loop.run() over a plan: takes rows, operation, start, stop, start_ns and step_ns."""

LONG = 20_000
"""Steps of a run for which the loop is built in C where it is not there: that takes 0.1 to 0.3 s
once on a machine, and saves about 20 us a step of the grasp.
"""


def make_loop(plan: Plan, engine: Engine, steps: int | None = None) -> Loop:
    """Return the loop over a plan, for a run of so many `steps`, None for one in real time.

    InputError where it is to be compiled and cannot be.
    """
    choice("engine", engine, ENGINES)
    why = "as asked"
    if engine == "compiled":
        return _compiled(plan, why)
    if engine == "auto":
        there = compiled.is_there()
        why = "as the run is short, or there is no compiler"
        if there or ((steps is None or steps >= LONG) and compiled.has_compiler()):
            try:
                return _compiled(plan, "built before" if there else "as the run is long enough")
            except InputError as error:  # of a compiler that does not work
                why = str(error)
    LOGGER.info("engine: the loop in Python, %s", why)
    return _interpreted(plan)


def _compiled(plan: Plan, why: str) -> Loop:
    made = compiled.CompiledLoop(plan)
    LOGGER.info("engine: the loop in C, %s", why)
    return made


def _interpreted(plan: Plan) -> Loop:
    program = loop.Program(*_columns(plan.operations, 5))
    connections = loop.Connections(*_columns(plan.connections, 4))
    casts = loop.Casts(*_columns(plan.casts, 3))
    calls = [call.python for call in plan.calls]
    buffers = [memoryview(b) for b in plan.buffers]  # type: ignore[arg-type]
    values, clock = memoryview(plan.values), memoryview(plan.clock)  # type: ignore[arg-type]
    tables = program, connections, casts, plan.drives, calls, buffers, values, clock

    def run(
        rows: Any, operation: int, start: int, stop: int, start_ns: int, step_ns: int
    ) -> tuple[int, int, int]:
        flat = memoryview(rows.reshape(-1))
        return loop.run(*tables, flat, operation, start, stop, start_ns, step_ns)

    return run


def _columns(table: Sequence[Sequence[Any]], width: int) -> list[list[Any]]:
    return [[row[i] for row in table] for i in range(width)]
