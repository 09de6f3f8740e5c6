"""Where the runs of a sweep are done: threads or processes here, or an executor of any kind.

Threads take runs of native FMUs made here, which cannot end the process: no process is started,
and what a script or a notebook defines is there. The loop does not hold Python's lock, but the rest
of a run does, so that many threads would wait for one another. All else goes to processes: a crash
takes its own run only.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Generator, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from contextlib import closing, contextmanager
from dataclasses import replace
from functools import partial, wraps
from itertools import islice
from typing import Any, TypeVar

from ..base.checks import extra_module
from ..base.errors import InputError, SimulationError
from ..base.parallel import Crew, Lost
from ..metrics.metric import Function, Signals, check_portable
from ..recording.memory import writing
from .run import Job, Packed, Task, packed, run_packed, run_row, run_there
from .table import Outcome

MAX_RUNS_IN_THREADS = 100
"""Runs that threads do: about so many take as long as processes take to start."""

MAX_THREADS = 4
"""Threads that do any number of runs: of a run of 3 s they hold Python's lock for a tenth."""

MAX_PENDING = 100
"""Runs that an executor is given before others have ended."""

DASK_ERROR_OF_LOST_RUN = "KilledWorker"
"""The name of Dask's error where a run ended its worker, several times; the others go on."""

CONNECT_TIMEOUT = 10.0
"""s, to find the scheduler and a worker of a cluster."""

Outcomes = Generator[Outcome, None, None]

Result = TypeVar("Result")


def on_this_machine(task: Task, jobs: Sequence[Job], workers: int | None) -> Outcomes:
    """The outcomes of this machine, in the order in which they end.

    InputError where processes are needed, and a metric cannot go to one.
    """
    count = min(workers or os.cpu_count() or 1, len(jobs))
    few = len(jobs) <= MAX_RUNS_IN_THREADS or count <= MAX_THREADS
    if few and may_be_threads(task, jobs):
        return in_threads(task, jobs, count)
    check_portable(task.metrics)
    return in_processes(task, jobs, count)


def may_be_threads(task: Task, jobs: Sequence[Job]) -> bool:
    """True where all FMUs are native and made here, in every row."""
    swapped = any(place.endswith(".fmu") for _, row in jobs for place in row)
    return not swapped and all(
        c.loaded.ours and not c.loaded.python and c.isolation == "none"
        for c in task.system.components
    )


def in_threads(task: Task, jobs: Sequence[Job], count: int) -> Outcomes:
    """The outcomes of so many threads; closing it ends the runs that go on.

    Functions of the user's are called one at a time, as they are in a process.
    """
    halt, lock = threading.Event(), threading.Lock()
    serialised = tuple(replace(m, function=one_by_one(m.function, lock)) for m in task.metrics)
    run = partial(run_row, replace(task, metrics=serialised), halt=halt)
    with ThreadPoolExecutor(max(count, 1), "sweep") as pool:
        try:
            for _, outcome in _results(pool, lambda job: run(*job), jobs):
                assert outcome is not None  # noqa: S101 - threads are not lost
                yield outcome
        finally:
            halt.set()


def one_by_one(function: Function, lock: threading.Lock) -> Function:
    """The function, which is called while nobody else has the lock."""

    @wraps(function)
    def locked(signals: Signals) -> Any:
        with lock:
            return function(signals)

    return locked


def in_processes(task: Task, jobs: Sequence[Job], count: int) -> Outcomes:
    """The outcomes of so many processes of this machine, in the order in which they end."""
    run = partial(run_packed, packed(task, with_fmus=False))
    with Crew(count) as crew, closing(crew.results(run, jobs)) as results:
        for (index, _), outcome in results:
            if isinstance(outcome, Lost):
                yield Outcome(index, {}, f"the process of the run {outcome.end}")
            else:
                yield outcome


def on_executor(executor: Executor, task: Task, jobs: Sequence[Job]) -> Outcomes:
    """The outcomes of an executor, to which the FMUs go; closing it cancels the rest.

    Signals come back with them. SimulationError where these cannot be written.
    """
    check_portable(task.metrics)
    shared: Any = packed(task, with_fmus=True)
    if client := getattr(executor, "_client", None):
        # Dask: it goes to each worker once, and again if the one that has it dies
        shared = client.submit(Packed._make, shared, pure=False)
    with closing(_results(executor, run_there, jobs, shared)) as results:
        for index, result in results:
            if result is None:
                yield Outcome(index, {}, "the worker of the run died, several times")
                continue
            outcome, blocks = result
            if task.signals:
                with writing(task.signals.folder):
                    task.signals.write(index, blocks)
            yield outcome


def _results(
    executor: Executor, run: Callable[..., Result], jobs: Sequence[Job], *shared: Any
) -> Generator[tuple[int, Result | None], None, None]:
    """What run(*shared, job) returns, by the number of the job, as they end; None of a lost one.

    Those found ended at the same time come in their order. Closing it cancels the rest.
    """
    remaining = iter(jobs)
    pending: dict[Future[Result], int] = {}
    try:
        while True:
            for job in islice(remaining, MAX_PENDING - len(pending)):
                pending[executor.submit(run, *shared, job)] = job[0]
            if not pending:
                break
            ended = wait(pending, return_when=FIRST_COMPLETED).done
            for future in sorted(ended, key=pending.__getitem__):
                index, failure = pending.pop(future), future.exception()
                if failure is None:
                    yield index, future.result()
                elif type(failure).__name__ == DASK_ERROR_OF_LOST_RUN:
                    yield index, None
                else:
                    raise SimulationError(
                        f"sweep: run {index}: {_message_of(failure)}"
                    ) from failure
    finally:
        for future in pending:
            future.cancel()


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of the Dask cluster whose scheduler is at an address like tcp://host:8786."""
    dask = extra_module("distributed", "it talks to Dask clusters", "dask")
    try:
        client = dask.Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"--scheduler {address}: {_message_of(error)}; must be one that runs"
        ) from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT_TIMEOUT)
        except TimeoutError as error:
            raise InputError(f"--scheduler {address}: no worker; must have at least one") from error
        executor: Executor = client.get_executor(pure=False)
        yield executor


def _message_of(error: BaseException) -> str:
    """The first line of an error, or its name where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]
