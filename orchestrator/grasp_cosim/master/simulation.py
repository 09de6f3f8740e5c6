"""simulate(): a whole run of a system; simulate.session() is the same run, step by step."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import ParamSpec, Protocol, TypeVar, cast

from ..base.errors import InputError, RunInterruptedError, SimulationError
from ..base.interruption import raised
from ..base.progress import DELAY, Progress, phase
from ..exchange.listener import Listener
from ..metrics.metric import Function, Metric
from ..recording.result import Result
from ..system.description import System
from ..system.parts import Realtime
from ..system.times import TimeInput, in_seconds
from .engine import Engine
from .session import Finish, Session, State

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

    def __call__(self, *args: Arguments.args, **kwargs: Arguments.kwargs) -> Returned:
        """Call the function."""


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
) -> Result:
    """Run a system, or that of a system file, to its stop time; return what it records at every
    communication point.

    These are its outputs, or what System.with_record() names.

    step and stop in s and the scheme replace those of the system. progress shows on standard
    error how far it is, by the name of the system or the one given. every keeps only each n-th
    communication point, and the last. listeners get what is kept while it is recorded. engine
    is "python", "compiled" (needs a C compiler) or "auto", compiled where that pays; the
    results have the same bits. realtime paces the run by the clock, as the system says, or as
    it says itself: the result has a timing, and the same bits.

    metrics are worked out beside those of the system: from @metric, or functions of their own
    name; a name among them says that the result must have that metric. diverging, "stop" or
    "continue", replaces that of the system. note gets the lines of the log but for
    system.notes: what is known of the system and of t = 0 before the first step, the others at
    the end, also after a failure. finish gets the result, and the error that ended the run if
    there is one, before the FMUs are terminated and freed, in which they may crash.

    until is asked at each communication point, of the session, and ends the run there where it
    is true: ended_at of the result is that time, and the log has a line. A limit does the same
    for a condition that is known before, in the loop itself.

    Ctrl-C ends the run in good order, then is a KeyboardInterrupt: once FMUs are loaded a
    RunInterruptedError, with what was recorded as its result.
    InputError where an FMU does not load or refuses its parameters; SimulationError, with what
    was recorded as its result, where one fails on the way, or a signal runs away.
    """
    if until is not None and not callable(until):
        raise InputError(f"until = {until!r}: must be a function of the session")
    results: list[Result] = []

    def keep(result: Result, error: SimulationError | None) -> None:
        results.append(result)
        if finish is not None:
            finish(result, error)

    try:
        with (
            Session(
                system,
                step=step,
                stop=stop,
                scheme=scheme,
                every=every,
                listeners=listeners,
                engine=engine,
                realtime=realtime,
                metrics=metrics,
                diverging=diverging,
                note=note,
                finish=keep,
                steered=False,
            ) as session,
            phase(f"{session.system.name} to {in_seconds(session.system.stop_ns):g} s"),
        ):
            _run_to_end(session, progress, until)
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
        now = time.perf_counter()
        if now - shown_at > LOOK_INTERVAL:
            show()
            shown_at = now
