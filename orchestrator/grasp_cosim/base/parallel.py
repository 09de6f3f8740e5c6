"""Jobs spread over processes of this machine: the same results, to the bit, on any number of them.

The processes are new ones: a fork of one that has loaded FMUs would share their state. One that
dies takes its own job with it and no other, and a new one takes its place. Where we die, they die,
whatever they are at. From the current folder they import nothing, and a user's script they do not
run again: it needs no `if __name__ == "__main__"`. What goes to them is as of `pickles.py`.
"""

import os
import sys
from collections.abc import Callable, Generator, Iterable, Iterator
from contextlib import closing, contextmanager, suppress
from functools import partial
from itertools import islice
from multiprocessing import get_context, parent_process
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from tempfile import gettempdir
from types import ModuleType
from typing import Any, NamedTuple, Self, TypeVar

from . import interruption
from .errors import SimulationError, ended
from .progress import Progress
from .scratch import sweep
from .system_calls import held_back

Job = TypeVar("Job")
Run = TypeVar("Run")

_SAFE_PATH = "PYTHONSAFEPATH"

PATIENCE = 1.0
"""s to wait for the end of a process whose pipe has ended."""


class Lost(NamedTuple):
    """A job whose process died: `end` says how, "ended with exit code 1"."""

    end: str


class _Early(NamedTuple):
    """The result of a job that is not over yet."""

    result: Any


class Crew:
    """At most so many processes, for one batch of jobs after the other. Its context ends them."""

    def __init__(self, workers: int) -> None:
        self._most = workers
        self._idle: list[_Worker] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """End the processes."""
        _end(self._idle)

    def map(self, run: Callable[[Job], Run], jobs: Iterable[Job], bar: Progress) -> list[Run]:
        """Return the results of run(job), in the order of the jobs; `bar` counts them.

        `run` is a function of a module. What it raises is raised, and ends the other jobs;
        SimulationError where a process dies or cannot start.
        """
        results_by_index: dict[int, Run] = {}
        with closing(self.results(partial(_caught, run), enumerate(jobs))) as results:
            for (index, _), result in results:
                if isinstance(result, Lost):
                    raise SimulationError(f"a process for the runs {result.end}")
                if isinstance(result, _Raised):
                    raise result.error
                results_by_index[index] = result
                bar.update()
        return [results_by_index[index] for index in sorted(results_by_index)]

    def results(
        self, run: Callable[[Job], Run], jobs: Iterable[Job]
    ) -> Generator[tuple[Job, Run | Lost], None, None]:
        """Yield each job with its result, in the order in which they end.

        `run` is a function of a module; where it raises, its process dies; what it has delivered
        before, see deliver(), is then its result. Closing the iterator ends the jobs.
        SimulationError where a process cannot start.
        """
        remaining = iter(jobs)
        busy: dict[_Worker, Job] = {}
        early: dict[_Worker, Any] = {}
        try:
            while True:
                for job in islice(remaining, self._most - len(busy)):
                    worker = self._idle.pop() if self._idle else _Worker()
                    busy[worker] = job
                    worker.give(run, job)
                if not busy:
                    break
                heard = wait([worker.pipe for worker in busy])
                for worker in [w for w in busy if w.pipe in heard and w.started()]:
                    result = worker.received()
                    if isinstance(result, _Early):
                        early[worker] = result.result
                        continue
                    job = busy.pop(worker)
                    if isinstance(result, Lost):
                        result = early.get(worker, result)
                        _end([worker])
                    else:
                        self._idle.append(worker)
                    early.pop(worker, None)
                    yield job, result
        finally:
            _end(busy)


class _Raised(NamedTuple):
    error: BaseException


def _caught(run: Callable[[Job], Run], numbered: tuple[int, Job]) -> Run | _Raised:
    """Return the result of a numbered job, or its error, which map() raises."""
    try:
        return run(numbered[1])
    except (Exception, KeyboardInterrupt) as error:
        return _Raised(error)


class _Worker:
    """A process that does one job after the other."""

    def __init__(self) -> None:
        context = get_context("spawn")
        self.pipe, workers_end = context.Pipe()
        self._started = False
        self.process: BaseProcess = context.Process(target=_work, args=(workers_end,))
        try:
            # signals are for us
            with closing(workers_end), _safe_path(), _no_script(), held_back(interruption.SIGNALS):
                self.process.start()
        except BaseException:  # of a signal that came meanwhile
            _end([self])
            raise

    def give(self, run: Callable[[Job], Any], job: Job) -> None:
        """Have it do a job; where it has died meanwhile, received() says so."""
        with suppress(OSError):
            self.pipe.send((run, job))

    def started(self) -> bool:
        """Return False if what it has to say is only that it has started."""
        if self._started:
            return True
        with suppress(EOFError, OSError):
            self.pipe.recv()
            self._started = True
            return False
        raise SimulationError(f"a process for the runs did not start: it {self._end()}")

    def received(self) -> Any:
        """Return the result of its job, or how it was lost."""
        try:
            return self.pipe.recv()
        except (EOFError, OSError):
            return Lost(self._end())

    def _end(self) -> str:
        """Return how the process, whose pipe has ended, came to its end."""
        self.process.join(PATIENCE)
        code = self.process.exitcode
        return "closed its pipe" if code is None else ended(code)


@contextmanager
def _safe_path() -> Iterator[None]:
    """Have processes started meanwhile not look in the current folder, as `python -c` does."""
    variable_before = {name: value for name, value in os.environ.items() if name == _SAFE_PATH}
    os.environ[_SAFE_PATH] = "1"
    try:
        yield
    finally:
        del os.environ[_SAFE_PATH]
        os.environ.update(variable_before)


@contextmanager
def _no_script() -> Iterator[None]:
    """Have processes started meanwhile not import the script that runs here, as they would."""
    script = sys.modules["__main__"]
    sys.modules["__main__"] = ModuleType("__main__")
    try:
        yield
    finally:
        sys.modules["__main__"] = script


def _end(workers: Iterable[_Worker]) -> None:
    """End processes, all at once."""
    ended = list(workers)
    for worker in ended:
        worker.pipe.close()
    processes = [worker.process for worker in ended if worker.process.pid]  # which has started
    for process in processes:
        process.kill()
    for process in processes:
        process.join()
        process.close()
    if ended:  # a process that is killed leaves its folders
        sweep.cache_clear()
        sweep(gettempdir())


_pipe: Connection | None = None
"""In a process of a Crew, the way to its master."""


def deliver(result: Any) -> None:
    """Give away the result of the job that this process does, which may die before it is over.

    Does nothing outside of a Crew.
    """
    if _pipe is not None:
        _pipe.send(_Early(result))


def _work(pipe: Connection) -> None:
    """The life of a process: say that it has started, then a job after the other."""
    global _pipe
    _pipe = pipe
    if starter := parent_process():
        interruption.worker(starter.sentinel)
    with suppress(EOFError, OSError):
        pipe.send(None)
        while True:
            run, job = pipe.recv()
            pipe.send(run(job))
