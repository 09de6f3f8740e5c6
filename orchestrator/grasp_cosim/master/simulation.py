"""Runs a system: loads the FMUs, drives the master, keeps what was recorded."""

import signal
import threading
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager

from tqdm import tqdm

from ..errors import InputError, SimulationError
from ..fmi.fmi2 import FmuInstance
from ..recording.result import Recorder, Result
from ..system.description import System
from ..system.parts import NANOSECONDS
from .fixed_step import Master

LOOK = 0.1
"""s of wall time between two looks at the progress bar, at Ctrl-C and for values not finite."""


def simulate(
    system: System,
    *,
    step: float | None = None,
    stop: float | None = None,
    scheme: str | None = None,
    progress: bool = False,
) -> Result:
    """Run a system to its stop time and return every output at every communication point.

    step and stop in s and the scheme replace those of the system. progress shows a bar on standard
    error if that is a terminal. Ctrl-C ends the run early: the result is what was recorded, with
    complete = False. InputError where an FMU does not load or refuses its parameters;
    SimulationError, with what was recorded as its result, where one fails on the way.
    """
    system = system.with_experiment(step, stop, scheme)
    with ExitStack() as stack:
        instances = [
            stack.enter_context(FmuInstance(c.name, c.interface)) for c in system.components
        ]
        master = Master(system, instances)
        recorder = _recorder(master)
        master.listeners.append(recorder)
        master.initialise()
        start = time.perf_counter()
        failure: SimulationError | None = None
        try:
            complete = _drive(master, recorder, progress)
        except SimulationError as error:
            failure, complete = error, False
        result = Result(
            system,
            recorder.time(system.step_ns),
            recorder.signals(),
            {s.name: s.unit for s in master.plan.signals},
            time.perf_counter() - start,
            complete,
        )
    if failure:
        failure.result = result
        raise failure
    return result


def _recorder(master: Master) -> Recorder:
    try:
        return Recorder(master.plan, master.total_steps)
    except MemoryError:
        raise InputError(
            f"{master.system.name}: {master.total_steps} steps do not fit into memory; "
            "must have a longer step or an earlier stop"
        ) from None


def _drive(master: Master, recorder: Recorder, progress: bool) -> bool:
    """Step to the end; False where Ctrl-C came first."""
    unit = master.system.step_ns / NANOSECONDS
    with (
        _interrupts() as interrupted,
        tqdm(
            total=round(master.total_steps * unit, 9),
            unit="s",
            desc="simulated",
            disable=None if progress else True,
            bar_format="{l_bar}{bar}| {n:.2f}/{total:.2f} s [{elapsed}<{remaining}]",
        ) as bar,
    ):
        chunk = 1
        while master.steps_done < master.total_steps:
            done, start = master.steps_done, time.perf_counter()
            master.advance(chunk)
            bar.update((master.steps_done - done) * unit)
            chunk = max(1, min(2 * chunk, int(chunk * LOOK / (time.perf_counter() - start))))
            recorder.check_finite(done)
            if interrupted.is_set():
                return False
    return True


@contextmanager
def _interrupts() -> Iterator[threading.Event]:
    """Collects Ctrl-C instead of raising it, which could happen inside a Python FMU."""
    interrupted = threading.Event()
    if threading.current_thread() is not threading.main_thread():
        yield interrupted
        return

    def remember(*_: object) -> None:
        interrupted.set()
        signal.signal(signal.SIGINT, previous)  # a second Ctrl-C does not wait

    previous = signal.signal(signal.SIGINT, remember)
    try:
        yield interrupted
    finally:
        signal.signal(signal.SIGINT, previous)
