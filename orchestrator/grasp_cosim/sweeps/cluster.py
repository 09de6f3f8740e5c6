"""A Dask cluster (the extra `dask`), whose workers must have grasp-cosim, as an executor."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from ..base.checks import extra_module
from ..base.errors import InputError

CONNECT = 10.0
"""s, to find the scheduler and a worker."""


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of the cluster whose scheduler is at an address like tcp://host:8786.

    InputError without the extra, a scheduler or a worker.
    """
    dask = extra_module("distributed", "it talks to Dask clusters", "dask")
    try:
        client = dask.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: {said(error)}; must be one that runs") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT)
        except TimeoutError as error:
            raise InputError(f"--scheduler {address}: no worker; must have at least one") from error
        executor: Executor = client.get_executor(pure=False)
        yield executor


def said(error: BaseException) -> str:
    """The first line of an error, or its name where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]
