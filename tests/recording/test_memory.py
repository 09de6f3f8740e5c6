"""Keeps a run in memory."""

from dataclasses import replace

import numpy as np
import pytest
from grasp_cosim import InputError
from grasp_cosim.exchange.listener import Signal
from grasp_cosim.recording.memory import MemoryListener
from recording.rows import EXPERIMENT, SIGNALS, peak, play, rows


@pytest.mark.parametrize("block", [1, 7, 1000])
def test_columns_have_the_values_and_the_types_of_their_signals(block):
    table, memory = rows(100), MemoryListener()
    play(memory, table, block=block)
    assert list(memory.columns()[1]) == ["a.x[1]", "a.n", "a.on"]
    types = [np.float64, np.int64, np.bool_]
    for column, expected, element in zip(memory.columns()[1].values(), table.T, types, strict=True):
        assert column.dtype == element
        assert column.tolist() == expected.tolist()


def test_time_is_that_of_the_step_numbers():
    """Decimated to every third point and the last."""
    steps, memory = np.array([0, 3, 6, 9, 10]), MemoryListener(every=3)
    play(memory, rows(5), steps)
    assert memory.columns()[0].tolist() == [k * 100_000 / 1e9 for k in (0, 3, 6, 9, 10)]


@pytest.mark.parametrize("stop", [10**18, 10**13])
def test_a_run_that_does_not_fit_is_refused_at_the_start(stop):
    long = replace(EXPERIMENT, step_ns=1, stop_ns=stop)
    many = [Signal(f"a.x[{i}]", None, "Real") for i in range(1000)]
    with pytest.raises(InputError, match=rf"^bare: {stop} steps do not fit into memory; must"):
        MemoryListener().begin(long, many)


def test_a_decimated_run_takes_memory_for_what_is_kept_only():
    long = replace(EXPERIMENT, step_ns=1, stop_ns=10**13)
    assert peak(lambda: MemoryListener(every=10**9).begin(long, SIGNALS)) < 2e6
