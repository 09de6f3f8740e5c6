"""Jobs spread over processes of this machine, each of which has one pipe to us.

A process that dies takes its own run with it and no other: the run has failed, and a new process
takes the place. Where we die, the pipes end, and the processes with them.
"""

import os
import signal
import threading
from collections.abc import Generator, Iterable, Iterator
from contextlib import contextmanager, suppress
from itertools import islice
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess

from ..errors import SimulationError
from .run import Job, Outcome, Task, run_job

PATIENCE = 5.0
"""s; a process that has not ended so long after it was to is killed."""


def run_here(task: Task, jobs: Iterable[Job], workers: int) -> Generator[Outcome, None, None]:
    """The outcomes of the jobs, in the order in which they end.

    The processes are new ones: a fork of one that has loaded FMUs would share their state. Closing
    the iterator ends the runs. SimulationError where a process cannot start.
    """
    left = iter(jobs)
    crew: list[_Worker] = []
    try:
        for job in islice(left, workers):
            crew.append(_Worker(task, job))
        while crew:
            heard = wait([worker.pipe for worker in crew])
            for worker in [w for w in crew if w.pipe in heard]:
                outcome = worker.received()
                if outcome is None:
                    continue
                next_job = next(left, None)
                if worker.dead or next_job is None:
                    crew.remove(worker)
                    worker.end()
                    if next_job is not None:
                        crew.append(_Worker(task, next_job))
                else:
                    worker.give(next_job)
                yield outcome
    finally:
        for worker in crew:
            worker.end()


class _Worker:
    """A process with a job, and whether it has died."""

    def __init__(self, task: Task, job: Job) -> None:
        context = get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.dead = False
        self._started = False
        self._process: BaseProcess = context.Process(target=_work, args=(theirs, task))
        with _deaf_to_ctrl_c(), theirs:
            self._process.start()
        self.give(job)

    def received(self) -> Outcome | None:
        """The outcome of its job; None where it says that it has started."""
        try:
            outcome: Outcome | None = self.pipe.recv()
            self._started = True
            return outcome
        except (EOFError, OSError):
            self.dead = True
        self._process.join(PATIENCE)
        end = _end_of(self._process.exitcode)
        if not self._started:
            raise SimulationError(f"a process for the runs did not start: it {end}")
        return Outcome(self._job.index, {}, f"the process of the run {end}")

    def give(self, job: Job) -> None:
        """Have it do a job; where it has died meanwhile, received() says so."""
        self._job = job
        with suppress(OSError):
            self.pipe.send(job)

    def end(self) -> None:
        """End the process; a run it is at ends early, which frees its FMUs."""
        self.pipe.close()
        if self._process.is_alive() and self._process.pid:
            os.kill(self._process.pid, signal.SIGINT)
        self._process.join(PATIENCE)
        if self._process.is_alive():
            self._process.kill()
            self._process.join()
        self._process.close()


def _work(pipe: Connection, task: Task) -> None:
    """The life of a process: say that it has started, then a job after the other."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a run collects it itself, and ends early
    with suppress(EOFError, OSError, KeyboardInterrupt):
        pipe.send(None)
        while True:
            pipe.send(run_job(task, pipe.recv()))


@contextmanager
def _deaf_to_ctrl_c() -> Iterator[None]:
    """A process begun inside ignores Ctrl-C, which is for us; only the main thread can do so."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    previous = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, previous)


def _end_of(code: int | None) -> str:
    if code is None:
        return "closed its pipe"
    if code < 0:
        return f"ended by signal {-code}, {signal.strsignal(-code)}"
    return f"ended with exit code {code}"
