"""Keeps a run in memory, as NumPy columns."""

import sys
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryFile, gettempdir
from typing import Any, Generic, TypeVar
from weakref import finalize

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError, SimulationError
from ..base.files import unwritable
from ..base.system_calls import memory
from ..exchange.listener import Experiment, Signal, Window

BEYOND = 2.0**63
"""From this magnitude on an int64 holds no whole number."""

TYPES = {"Real": np.float64, "Integer": np.int64, "Boolean": np.bool_}
"""The element type of a column of numbers by its signal's kind."""

Rows = tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]]
"""Steps, and their rows of values."""

Columns = tuple[npt.NDArray[np.float64], Mapping[str, npt.NDArray[Any]]]
"""Time in s, and columns by name."""


@contextmanager
def writing(path: Path, failure: type[Exception] = SimulationError) -> Iterator[None]:
    """What fails meanwhile is the writing of the file at path."""
    try:
        yield
    except OSError as error:
        raise failure(unwritable(path, error)) from error


class Batch:
    """Rows that wait until there are enough of them."""

    def __init__(self) -> None:
        self._parts: list[Rows] = []
        self.count = 0

    def add(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Keep a copy of these."""
        self._parts.append((steps.copy(), rows.copy()))
        self.count += len(steps)

    def take(self) -> Rows:
        """All that wait, which are at least one row."""
        steps, rows = (np.concatenate(parts) for parts in zip(*self._parts, strict=True))
        self._parts, self.count = [], 0
        return steps, rows


Medium = TypeVar("Medium")


@dataclass(slots=True, weakref_slot=True, eq=False)
class _Storage(Generic[Medium]):
    """A table or a file with rows; the first, to which saved states refer, stay as they are."""

    medium: Medium
    shared_rows: int = 0

    def share(self, rows: int) -> None:
        """Have a saved state refer to the first so many rows."""
        self.shared_rows = max(self.shared_rows, rows)


def _references(storage: _Storage[npt.NDArray[np.float64]]) -> int:
    return sys.getrefcount(storage.medium)


OWN_REFERENCES = _references(_Storage(np.empty(0)))
"""To a table that nothing but its storage has; what Python adds to it differs between versions."""


class MemoryListener:
    """Copies each n-th row of a run into a table that has space for the whole run.

    Only what is filled of it takes up memory.
    """

    def __init__(self, every: int = 1, paced: bool = False) -> None:
        self._every, self._paced = every, paced
        self._rows = 0

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Make space; InputError where the run does not fit into memory."""
        self._experiment, self._signals = experiment, tuple(signals)
        total = experiment.total_steps
        rows = total // self._every + 2  # t = 0, and the last one in addition to every n-th
        try:
            self._steps, shape = np.empty(rows, np.int64), (len(signals), rows)
            in_shared_memory = self._paced and signals
            buffer = memory(8 * len(signals) * rows) if in_shared_memory else None
            self._storage = _Storage(np.ndarray(shape, np.float64, buffer))
        except (MemoryError, ValueError, OverflowError, OSError):  # more bytes than there can be
            raise InputError(
                f"{experiment.name}: {total} steps do not fit into memory; "
                "must have a longer step or an earlier stop, or record fewer of them"
            ) from None

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Copy the rows."""
        end = self._rows + len(steps)
        self._steps[self._rows : end] = steps
        self._storage.medium[:, self._rows : end] = rows.T
        self._rows = end

    def end(self, complete: bool) -> None:
        """Nothing is left to do."""

    def saved(self) -> "tuple[_Storage[npt.NDArray[np.float64]], int]":
        """What was recorded until now, for restore()."""
        self._storage.share(self._rows)
        return self._storage, self._rows

    def restore(self, saved: "tuple[_Storage[npt.NDArray[np.float64]], int]") -> None:
        """Go back to what was saved; other states, and columns that were given out, stay."""
        self._storage, self._rows = saved
        if self._rows < self._storage.shared_rows:
            table = np.empty_like(self._storage.medium)
            table[:, : self._rows] = self._storage.medium[:, : self._rows]
            self._storage = _Storage(table, self._rows)

    def start_over(self) -> None:
        """Give up all rows. Memory to which no result refers any more is used again.

        To be given memory by the system takes as long as to fill it takes several times.
        """
        self._rows = 0
        is_free = _references(self._storage) == OWN_REFERENCES
        table = self._storage.medium
        self._storage = _Storage(table if is_free else np.empty_like(table))

    def columns(self, next_row: Rows | None = None) -> Columns:
        """The recorded communication points in s and the columns by name, so far.

        Rows that come later do not change them. Real columns are views, Strings arrays of str
        objects. An Integer is exact up to 2**53, as the rows are float64. With the step and values
        of a row that is not recorded, it is their last.
        """
        steps, table = self._steps[: self._rows], self._storage.medium[:, : self._rows]
        self._storage.share(self._rows)
        if next_row:
            steps, table = np.append(steps, next_row[0]), np.append(table, next_row[1].T, axis=1)
        by_signal = zip(self._signals, table, strict=True)
        return self._experiment.times(steps), {s.name: typed(s, c) for s, c in by_signal}


class _RowsInFile:
    """Rows in a temporary file, one after the other.

    `lost` says why they are not kept any more, as on a full disk: the run goes on.
    """

    _width: int
    """The values of a row."""

    def __init__(self) -> None:
        self._rows, self.lost = 0, ""

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Open the file."""
        self._experiment = experiment
        self._signals = tuple(signals)
        self._width = len(signals)
        self._open()

    def _open(self, rows: int = 0) -> None:
        file = TemporaryFile(prefix="grasp_rows_", buffering=0)  # noqa: SIM115 - open as long as this
        self._storage = _Storage(file, rows)
        finalize(self._storage, file.close)

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Write the rows."""
        unwritten = memoryview(b"" if self.lost else rows.tobytes())
        try:
            while unwritten:
                unwritten = unwritten[self._storage.medium.write(unwritten) :]
        except OSError as error:
            self.lost = unwritable(Path(gettempdir()), error)
            self._storage.medium.truncate(0)
        self._rows += len(steps)

    def end(self, complete: bool) -> None:
        """The file goes with the last name of it."""

    def saved(self) -> tuple[Any, ...]:
        """What was kept until now, for restore()."""
        self._storage.share(self._rows)
        return self._storage, self._rows

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved; other states stay."""
        self._storage, self._rows = saved
        size = 8 * self._rows * self._width
        if self.lost:
            return
        if self._rows < self._storage.shared_rows:
            self._storage.medium.seek(0)
            rows = self._storage.medium.read(size)
            self._open(self._rows)
            self._storage.medium.write(rows)
        self._storage.medium.seek(size)

    def _table(self) -> npt.NDArray[np.float64]:
        """All rows so far, mapped from the file."""
        shape = 0 if self.lost else self._rows, self._width
        if not all(shape):
            return np.empty(shape)
        return np.memmap(self._storage.medium, np.float64, "r", shape=shape)


class EveryRow(_RowsInFile):
    """Keeps signals at every step of a run that records fewer, for its metrics."""

    def __init__(self, names: Collection[str]) -> None:
        super().__init__()
        self.names = names

    def columns(self) -> Columns:
        """All communication points in s so far, and the columns."""
        by_signal = zip(self._signals, self._table().T, strict=True)
        times = self._experiment.times(np.arange(self._rows))
        return times, {s.name: typed(s, column) for s, column in by_signal}


class WindowRows(_RowsInFile):
    """Keeps the rows of a triggered run, behind their steps, and where its windows begin.

    So their memory does not grow with the time of the run.
    """

    def __init__(self) -> None:
        super().__init__()
        self._windows: list[tuple[Window, int]] = []

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Open the file."""
        super().begin(experiment, signals)
        self._width = 1 + len(signals)

    def begin_run(self) -> None:
        """Nothing is kept yet."""

    def begin_window(self, window: Window) -> None:
        """Note where it begins."""
        self._windows.append((window, self._rows))

    def end_window(self, window: Window) -> None:
        """Note what it came to."""
        self._windows[-1] = window, self._windows[-1][1]

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Write the rows behind their steps, which a float64 holds exactly."""
        super().block(steps, np.column_stack((steps, rows)))

    def saved(self) -> tuple[Any, ...]:
        """What was kept until now, for restore()."""
        return super().saved(), tuple(self._windows)

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved; other states stay."""
        rows, windows = saved
        super().restore(rows)
        self._windows = [*windows]

    def start_over(self) -> None:
        """Give up all rows."""
        self._rows, self._windows = 0, []
        self._open()

    def columns(self, next_row: Rows | None = None) -> Columns:
        """As MemoryListener.columns()."""
        table = self._table()
        steps = table[:, 0].astype(np.int64)
        table = table[:, 1:]
        if next_row:
            steps, table = np.append(steps, next_row[0]), np.append(table, next_row[1], axis=0)
        by_signal = zip(self._signals, table.T, strict=True)
        return self._experiment.times(steps), {s.name: typed(s, c) for s, c in by_signal}

    def windows(self, count: int) -> list[tuple[Window, slice]]:
        """The windows until now, and where their rows are in so many."""
        if self.lost:
            return []
        ends = [*(begin for _, begin in self._windows[1:]), count]
        return [
            (window, slice(begin, end))
            for (window, begin), end in zip(self._windows, ends, strict=False)
        ]


def typed(signal: Signal, column: npt.NDArray[np.float64]) -> npt.NDArray[Any]:
    """The values of a signal in rows in its own type, Strings as str objects.

    Whole numbers beyond an int64 stay as they are in rows.
    """
    if signal.kind == "String":
        return signal.texts.column(column)
    if signal.wide and (column >= BEYOND).any():
        return column
    return column.astype(TYPES[signal.kind], copy=False)
