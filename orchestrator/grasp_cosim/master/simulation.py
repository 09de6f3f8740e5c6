"""simulate(): a whole run of a system; simulate.session() is the same run, step by step."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import ParamSpec, Protocol, TypeVar, cast

from ..base.errors import InputError, RunInterruptedError, SimulationError
from ..base.interruption import raised
from ..base.progress import DELAY, Progress, phase
from ..exchange.listener import Listener
from ..metrics.metric import Function, Metric
from ..recording.result import Result
from ..system.description import System, as_system
from ..system.parts import Realtime
from ..system.times import TimeInput, in_seconds
from . import idle_sessions
from .engine import Engine
from .idle_sessions import RepeatableSession
from .requests import Requests
from .session import Finish, Session, State, with_twins

__all__ = ["Session", "State", "simulate"]

LOOK_INTERVAL = 0.1
"""s of wall time between two looks at the progress bar and at Ctrl-C."""

MAX_GROWTH = 8
"""How many times the steps before one look there are at most before the next."""

Until = Callable[[Session], bool]
"""Looks at a session, and says whether its run ends here."""

Arguments = ParamSpec("Arguments")
Returned = TypeVar("Returned", covariant=True)


class WithSession(Protocol[Arguments, Returned]):
    """A function of these arguments whose attribute `session` is the class of its sessions."""

    session: type[Session]

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Returned: ...


def _with_session(function: Callable[Arguments, Returned]) -> WithSession[Arguments, Returned]:
    """Give a function the attribute `session`, in a way that type checkers know of."""
    with_session = cast(WithSession[Arguments, Returned], function)
    with_session.session = Session
    return with_session


@_with_session
def simulate(
    system: System | str | Path,
    *,
    step: TimeInput | None = None,
    stop: TimeInput | None = None,
    scheme: str | None = None,
    progress: bool | str = False,
    every: int = 1,
    listeners: Sequence[Listener] = (),
    engine: Engine = "auto",
    realtime: Realtime | bool = False,
    metrics: Sequence[Metric | Function | str] = (),
    diverging: str | None = None,
    note: Callable[[str], None] | None = None,
    finish: Finish | None = None,
    until: Until | None = None,
    halt: threading.Event | None = None,
    requests: Requests | None = None,
) -> Result:
    """Run a system to its stop time, and return what was recorded at its communication points.

    Recorded are the outputs of the system, or what System.with_record() names. Ctrl-C ends the run
    in good order. simulate.session() is the same run, advanced step by step by its user.

    Args:
        system: The system, or the path of a system file, .toml or .ssp.
        step: The communication step in s, in place of that of the system. It may also be a text, a
            pair or a Quantity with its unit: "0.5 ms", (0.5, "ms").
        stop: The stop time in s, in place of that of the system.
        scheme: "sequential" or "jacobi", in place of that of the system.
        progress: True shows on standard error how far the run is; a text is the title of that.
        every: Every how many communication points are recorded; the last point always is.
        listeners: Get the recorded rows while the run goes on, like CsvListener: see
            exchange.listener.
        engine: "python", "compiled", which needs a C compiler, or "auto", which is compiled where
            that pays. The results have the same bits.
        realtime: True paces the run by the clock as the system says, a Realtime as it says itself.
            The result then has a timing; its signals have the same bits.
        metrics: Metrics to be worked out in addition to those of the system: from @metric, or
        functions of
            a Signals, whose names they then have. The name of a metric demands that the result has
            it.
        diverging: "stop" or "continue": what follows on a signal that runs away, in place of what
            the system says.
        note: Gets the lines of the log but for system.notes. Those on the system and on t = 0 come
            before the first step, the others at the end, also after a failure.
        finish: Gets the result and the error that ended the run, or None, before the FMUs are
            terminated and freed: in which they may crash.
        until: Gets the session at each communication point and returns True where the run is to
            end. Then ended_at of the result is that time, and the log has a line. A limit in the
            system file does the same for a condition that is known before, in the loop itself.
        halt: Set by another thread, it ends the run at a communication point, in good order. The
            result is then not complete.
        requests: What other threads ask to be set, which are events of the result then: see
            master.requests.

    Returns:
        The result with signals of the shape (rows,) by name, in the units of their FMUs, on
        result.time in s. It has metrics, log and settings, too.

    Raises:
        InputError: An argument is wrong, or an FMU does not load or refuses its parameters.
        SimulationError: An FMU fails on the way, or a signal runs away. Its attribute `result` is
            what was recorded until then.
        RunInterruptedError: Ctrl-C once the FMUs were loaded, a KeyboardInterrupt. Its attribute
            `result` is what was recorded until then.

    Example:
        >>> from grasp_cosim import grasp_system, simulate
        >>> result = simulate(grasp_system(), step=1e-3, stop=2.5)
        >>> round(result.metrics["time_difference"], 2)
        0.01
    """
    if until is not None and not callable(until):
        raise InputError(f"until = {until!r}: must be a function of the session")
    results: list[Result] = []
    system = as_system(system, "simulate").with_experiment(step, stop, scheme, diverging)
    system = with_twins(system, bool(progress))

    def keep(result: Result, error: SimulationError | None) -> None:
        results.append(result)
        if finish is not None:
            finish(result, error)

    def fits(session: RepeatableSession) -> bool:
        return session.is_for(system, every, engine, metrics)

    one_of_a_kind = listeners or realtime or note or until or requests
    idle = None if one_of_a_kind else idle_sessions.take(fits)
    try:
        with ExitStack() as stack:
            session = idle or RepeatableSession(
                system,
                every=every,
                listeners=listeners,
                engine=engine,
                realtime=realtime,
                metrics=metrics,
                note=note,
                finish=keep,
                halt=halt,
                steered=False,
                requests=requests,
            )
            stack.callback(session.close)
            if idle:
                idle.repeat(system, keep, halt)
            with phase(f"{session.system.name} to {in_seconds(session.system.stop_ns):g} s"):
                _run_to_end(session, progress, until)
            if until is None and session.rest():
                stack.pop_all()
                idle_sessions.keep(session)
    except KeyboardInterrupt as interrupt:
        if not results:
            raise
        raise RunInterruptedError(results[0]) from interrupt
    return results[0]


def _run_to_end(session: Session, progress: bool | str, until: Until | None) -> None:
    """Have a session step to its end; KeyboardInterrupt, between two steps, at Ctrl-C."""
    begin, end = in_seconds(session.system.start_ns), in_seconds(session.system.stop_ns)
    title = progress if isinstance(progress, str) else session.system.name
    with (
        raised(session.halt.set),
        Progress(
            title,
            end - begin,
            unit="s",
            shown=bool(progress),
            delay=0.0 if session.pacer else DELAY,
            ticking=False,  # a thread more would be felt in real time
        ) as bar,
    ):

        def show() -> None:
            if session.pacer and not bar.disable:
                bar.set_postfix_str(session.pacer.meter.live(), refresh=False)
            bar.update(session.time - begin - bar.n)

        if until is None:
            _step_in_chunks(session, show)
        else:
            _step_one_by_one(session, until, show)
        if session.pacer:
            bar.set_postfix_str(session.pacer.meter.live(), refresh=False)


def _step_in_chunks(session: Session, show: Callable[[], None]) -> None:
    """Have a session step to its end, so many steps at a time as take one interval of looks."""
    steps = session.shown_by(show)
    start = time.perf_counter()
    while not session.halt.is_set() and session.step(steps):
        show()
        end = time.perf_counter()
        steps_in_interval = int(steps * LOOK_INTERVAL / (end - start))
        steps = max(1, min(MAX_GROWTH * steps, steps_in_interval))
        start = end


def _step_one_by_one(session: Session, until: Until, show: Callable[[], None]) -> None:
    """Have a session step to where `until` is true, which is asked before each, or to its end."""
    shown_at = time.perf_counter()
    while not session.halt.is_set():
        steps_done = session.master.steps_done
        is_end = until(session)
        if session.master.steps_done != steps_done:
            raise InputError(
                "until: has stepped or reset the session; must only look at it, and set values"
            )
        if is_end:
            name = getattr(until, "__name__", "it")
            session.end_here(f"until {name} was true: the run ended")
            return
        if not session.step():
            return
        if time.perf_counter() - shown_at > LOOK_INTERVAL:
            show()
            shown_at = time.perf_counter()
