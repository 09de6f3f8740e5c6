"""Keeps a run in memory, as NumPy columns."""

import mmap
import sys
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError, SimulationError
from .listener import Experiment, Signal, times

TYPES = {"Real": np.float64, "Integer": np.int64, "Boolean": np.bool_}
"""The element type of a column of numbers by its signal's kind."""


class MemoryListener:
    """Copies the rows into one table, which has room for the whole run from the start.

    every is the decimation of the run, from 1 on; paced says that it is to be in real time. The
    table takes up memory only as far as it is filled.
    """

    def __init__(self, every: int = 1, paced: bool = False) -> None:
        self._every, self._paced = every, paced
        self._rows = 0

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Make room; InputError where the run does not fit into memory."""
        self._experiment, self._signals = experiment, tuple(signals)
        self._steps = np.empty(0, np.int64)
        self._table = np.empty((len(signals), 0))
        total = experiment.total_steps
        try:
            self._grow(total // self._every + 2)  # t = 0, and the last one besides every n-th
        except MemoryError:
            raise InputError(
                f"{experiment.name}: {total} steps do not fit into memory; "
                "must have a longer step or an earlier stop, or record fewer of them"
            ) from None

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Copy the rows; SimulationError where there are more than fit into memory."""
        end = self._rows + len(steps)
        if end > len(self._steps):
            try:
                self._grow(max(end, 2 * len(self._steps)))
            except MemoryError:
                raise SimulationError(
                    f"{self._experiment.name}: {end} recorded rows do not fit into memory"
                ) from None
        self._steps[self._rows : end] = steps
        self._table[:, self._rows : end] = rows.T
        self._rows = end

    def end(self, complete: bool) -> None:
        """Nothing is left to do."""

    @property
    def time(self) -> npt.NDArray[np.float64]:
        """The recorded communication points in s, so far."""
        return times(self._steps[: self._rows], self._experiment.step_ns)

    @property
    def signals(self) -> dict[str, npt.NDArray[Any]]:
        """The recorded columns by name, so far. Rows that come later do not change them.

        Real ones are views, Strings arrays of str objects. An Integer is exact up to 2**53, as the
        rows are float64.
        """
        columns = self._table[:, : self._rows]
        return {
            s.name: s.texts.column(column)
            if s.kind == "String"
            else column.astype(TYPES[s.kind], copy=False)
            for s, column in zip(self._signals, columns, strict=True)
        }

    def _grow(self, rows: int) -> None:
        """Have room for so many rows; MemoryError where there is none."""
        try:
            steps, shape = np.empty(rows, np.int64), (len(self._signals), rows)
            table = _small_pages(*shape) if self._paced else np.empty(shape)
        except (ValueError, OverflowError, OSError) as error:  # more bytes than there can be
            raise MemoryError from error
        steps[: self._rows] = self._steps[: self._rows]
        table[:, : self._rows] = self._table[:, : self._rows]
        self._steps, self._table = steps, table


def _small_pages(columns: int, rows: int) -> npt.NDArray[np.float64]:
    """Return a table without a huge page, of which each column would make the system clear one,
    every now and then, in the middle of a run.
    """
    if sys.platform == "win32" or not columns * rows:
        return np.empty((columns, rows))
    private = mmap.MAP_PRIVATE | mmap.MAP_ANONYMOUS
    memory = mmap.mmap(-1, columns * rows * np.dtype(np.float64).itemsize, flags=private)
    return np.frombuffer(memory, np.float64).reshape(columns, rows)
