"""The two engines: the loop as plain Python, and the same loop in C.

Which one "auto" takes is known before the run: that in C where it is there already, which it is
once it was built on this machine. A process builds it as soon as what it could have saved, with the
run to come, exceeds the time that takes.
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

BUILDING = 0.3
"""s that compiling the loop takes, once on a machine: 0.1 to 0.3 s measured."""

SAVED = 1e-6
"""s that a native call takes less in a compiled step, with the connections and casts around it:
0.7 us measured over 4 native FMUs with 23 calls a step, 1.2 us over the 13 calls of the grasp.
"""

_forgone = 0.0
"""s that compiled code could have saved in this process until now."""


def make_loop(plan: Plan, engine: Engine, steps: int | None = None) -> Loop:
    """Return the loop over a plan, for a run of so many `steps`, None for one in real time.

    InputError where it is to be compiled and cannot be.
    """
    choice("engine", engine, ENGINES)
    why = "as asked"
    if engine == "compiled":
        return _compiled(plan, why)
    if engine == "auto":
        why = "as a loop in C would save less time than its build takes, or there is no compiler"
        there = compiled.is_there()
        if _pays(plan, steps):
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


def _pays(plan: Plan, steps: int | None) -> bool:
    """Return True if the compiled loop is there already, or will have saved more than it costs."""
    global _forgone
    if compiled.is_there():
        return True
    rates = [
        1.0 / period
        for kind, call, _, period, _ in plan.operations
        if kind >= loop.CALL and plan.calls[call].native
    ]
    _forgone += SAVED * sum(rates) * (steps or 0)
    return (steps is None or _forgone > BUILDING) and compiled.has_compiler()


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
