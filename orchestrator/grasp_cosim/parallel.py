"""Runs spread over processes: the same results, to the bit, on any number of workers."""

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import contextmanager
from multiprocessing import get_context
from typing import TypeVar

from tqdm import tqdm

Job = TypeVar("Job")
Run = TypeVar("Run")


def run_all(
    run: Callable[[Job], Run], jobs: Sequence[Job], workers: int, progress: bool, what: str
) -> Iterator[Run]:
    """The results of run(job), in the order of the jobs; run is a function of a module.

    progress shows a bar, labelled what, on standard error if that is a terminal.
    """
    bar = tqdm(total=len(jobs), desc=what, unit="run", disable=None if progress else True)
    with bar, processes(workers) as pool:
        for result in pool.map(run, jobs):
            bar.update()
            yield result


@contextmanager
def processes(workers: int) -> Iterator[ProcessPoolExecutor]:
    """Processes for several batches of runs; after an error, what has not begun is dropped.

    They are new ones: a fork of one that has loaded FMUs would share their state.
    """
    with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as pool:
        try:
            yield pool
        except BaseException:
            pool.shutdown(cancel_futures=True)
            raise
