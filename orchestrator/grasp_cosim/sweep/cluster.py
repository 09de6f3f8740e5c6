"""Jobs spread over a Dask cluster (the optional extra `dask`), which must have grasp-cosim.

The FMUs travel with the task: the cluster needs no folder of ours.
"""

from __future__ import annotations

import threading
from collections.abc import Generator, Iterable
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import Any

from ..checks import extra_module
from ..errors import InputError, SimulationError
from ..scratch import ScratchFolder
from .run import Job, Outcome, Task, run_job
from .study import hash_of

CONNECT = 10.0
"""s, to find the scheduler and a worker."""

AHEAD = 1000
"""Jobs the scheduler is given before others have ended."""


@dataclass(frozen=True, slots=True)
class Shipment:
    """A task with the contents of its FMUs, one per component."""

    task: Task
    contents: tuple[bytes, ...]
    key: str
    """The hash of the contents."""


def ship(task: Task) -> Shipment:
    """The task with its FMUs."""
    contents = tuple((c.native or c.fmu).read_bytes() for c in task.system.components)
    return Shipment(task, contents, hash_of(contents))


def run_on_cluster(address: str, task: Task, jobs: Iterable[Job]) -> Generator[Outcome, None, None]:
    """The outcomes of the jobs, in the order in which they end; address like tcp://host:8786.

    A worker does a run at a time: start it with --nthreads 1. Closing the iterator cancels the
    rest. InputError without the extra, a scheduler or a worker; SimulationError where it is lost.
    """
    dask = extra_module("distributed", "it talks to Dask clusters", "dask")
    try:
        client = dask.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: {_said(error)}; must be one that runs") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT)
        except TimeoutError as error:
            raise InputError(f"--scheduler {address}: no worker; must have at least one") from error
        shipment = client.scatter(ship(task), broadcast=True, hash=False)
        left = iter(jobs)
        indices: dict[str, int] = {}

        def submit(job: Job) -> Any:
            future = client.submit(run_shipped, shipment, job, pure=False)
            indices[future.key] = job.index
            return future

        first = [submit(job) for job in islice(left, AHEAD)]
        done = dask.as_completed(first, loop=client.loop, raise_errors=False)
        try:
            for future in done:
                index = indices.pop(future.key)
                failure = future.exception()
                if isinstance(failure, dask.KilledWorker):
                    yield Outcome(index, {}, "the worker of the run died, several times")
                elif failure is not None:
                    raise SimulationError(f"--scheduler {address}: {_said(failure)}")
                else:
                    yield future.result()
                job = next(left, None)
                if job is not None:
                    done.add(submit(job))
        finally:
            client.cancel(list(done.futures))


def _said(error: BaseException) -> str:
    """The first line of an error, or its name where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]


_unpacked: dict[str, ScratchFolder] = {}
"""The folders of FMUs that this process has unpacked, by the key of their shipment."""

_one_at_a_time = threading.Lock()
"""All Python FMUs of a process share its modules, and a compiled loop keeps the others waiting."""


def run_shipped(shipment: Shipment, job: Job) -> Outcome:
    """Do a job in a worker of the cluster."""
    with _one_at_a_time:
        return run_job(unpacked(shipment), job)


def unpacked(shipment: Shipment) -> Task:
    """The task with FMUs in a folder of this process, which goes with it."""
    components = shipment.task.system.components
    known = _unpacked.get(shipment.key)
    folder = known or ScratchFolder()
    paths = [Path(folder.name, str(i), c.fmu.name) for i, c in enumerate(components)]
    if not known:
        for path, content in zip(paths, shipment.contents, strict=True):
            path.parent.mkdir()
            path.write_bytes(content)
        _unpacked[shipment.key] = folder
    moved = tuple(
        replace(c, fmu=path, native=None) for c, path in zip(components, paths, strict=True)
    )
    return replace(shipment.task, system=replace(shipment.task.system, components=moved))
