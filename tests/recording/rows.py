"""What the tests of the listeners share: signals of each kind, and a run that is only rows."""

from contextlib import contextmanager

import numpy as np
import pytest
from grasp_cosim.exchange.listener import Experiment, Signal

EXPERIMENT = Experiment.of({"system": "bare", "scheme": "sequential", "step": 1e-4, "stop": 1.0})
SIGNALS = (
    Signal("a.x[1]", "m", "Real", "Where it is"),
    Signal("a.n", None, "Integer"),
    Signal("a.on", None, "Boolean", "Whether <it> is & was"),
)


def rows(count, seed=1):
    """Values for SIGNALS."""
    random = np.random.default_rng(seed)
    return np.column_stack(
        (
            random.standard_normal(count) * 10.0 ** random.integers(-300, 300, count),
            random.integers(-(2**53), 2**53, count),
            random.integers(0, 2, count),
        )
    )


def play(
    listener, table, steps=None, block=1000, signals=SIGNALS, complete=True, experiment=EXPERIMENT
):
    """A run of these rows. Like the master, it reuses the arrays that it hands on."""
    numbers = np.arange(len(table)) if steps is None else steps
    listener.begin(experiment, signals)
    for first in range(0, len(table), block):
        part = numbers[first : first + block].copy(), table[first : first + block].copy()
        listener.block(*part)
        for array in part:
            array.fill(-1)
    listener.end(complete)


@contextmanager
def full_disk(size):
    """No file can grow beyond size bytes."""
    resource = pytest.importorskip("resource", reason="NO limits of processes on this system")
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
