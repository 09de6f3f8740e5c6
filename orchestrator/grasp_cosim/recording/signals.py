"""The signals of runs that were recorded here, and logs of other tools, read from their files."""

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..base.by_name import ByName
from ..base.errors import InputError, nearest
from ..base.text import from_cell
from ..system.times import LONGEST
from ..tables.column import Column, FileTable
from ..tables.read_table import ARROW_SUFFIXES, TEXT_SUFFIXES, read_table
from .log_names import AS_THEY_ARE, LogColumn, LogNames
from .mdf import read_mdf
from .memory import Columns

LOGS = (*TEXT_SUFFIXES, ".mf4", *ARROW_SUFFIXES)
"""The suffixes of logs."""


def read_signals(path: Path, texts: Collection[str]) -> Columns:
    """The time in s and the columns that a run has recorded, or is recording, in a file.

    `texts` are the names of Strings; of CSV all else is float64, of Arrow it has its own type. A
    last line or batch that is not whole does not count. InputError where the file is missing or
    damaged.
    """
    table = read_table(path, torn=True)
    first, *signal_columns = table.columns
    if first.head != "time":
        raise InputError(f'{path}: is damaged: the first column is {first.head!r}; must be "time"')
    if len({column.head for column in table.columns}) != len(table.columns):
        raise InputError(f"{path}: is damaged: two columns have the same name")
    if not table.row_count:
        raise InputError(f"{path}: is damaged: it has no whole row; must have one")
    time = np.asarray(first.numbers(), np.float64)
    grows = (np.diff(time, prepend=-np.inf) > 0.0).all()
    if not grows or not (np.abs(time) <= LONGEST).all():
        raise InputError(
            f"{path}: is damaged: the time must grow from row to row, to at most {LONGEST:g} s"
        )
    signals = {}
    for column in signal_columns:
        if column.head not in texts:
            signals[column.head] = np.asarray(column.numbers())
        elif column.is_text_file:
            signals[column.head] = np.array([*map(from_cell, column.texts())], object)
        else:
            signals[column.head] = np.array(column.texts(), object)
    return time, signals


class Log(ByName[npt.NDArray[np.float64] | npt.NDArray[np.bool_]]):
    """Signals that any tool has recorded, numbers or Booleans by name, on `time` in s.

    A column is read when it is asked for, so that one that nobody uses may hold whatever it likes;
    `units` are as in the file, None where it does not.
    """

    def __init__(self, path: Path, time: npt.NDArray[np.float64], columns: Collection[Column]):
        self.path, self.time = path, time
        self.units = {column.name: column.unit for column in columns if column.name}
        self._columns = {column.name: column for column in columns if column.name}
        names = [column.name for column in columns]
        self._twice = {name for name in self._columns if names.count(name) > 1}

    def __getitem__(self, name: str) -> npt.NDArray[np.float64] | npt.NDArray[np.bool_]:
        """The values of a column; InputError at the first cell that has neither kind of value."""
        if name not in self._columns:
            raise InputError(f"{self.path}: no signal {name!r}; {nearest(name, self)}")
        column = self._columns[name]
        if name in self._twice:
            raise InputError(f"{column.heading} = {column.head!r}: appears twice; must be once")
        if column.values is None:
            words = [cell.strip().lower() for cell in column.texts()]
            if {*words} <= {"true", "false"}:
                return np.array([word == "true" for word in words])
        values = np.asarray(column.numbers())
        return values if values.dtype == np.bool_ else values.astype(np.float64, copy=False)

    def __contains__(self, name: object) -> bool:
        """True for the name of a column, which is not read for that."""
        return name in self._columns

    def check_unit(self, name: str, unit: str) -> None:
        """InputError where the column of that name, if there is one, is in no unit like this."""
        if name in self._columns:
            self._columns[name].to_unit(unit)

    def __iter__(self) -> Iterator[str]:
        return iter(self._columns)

    def __len__(self) -> int:
        return len(self._columns)

    @property
    def numeric(self) -> list[str]:
        """The names of the columns that hold numbers only."""
        return [name for name, column in self._columns.items() if column.values is not None]

    def readable(self, name: str) -> bool:
        """True for a column of numbers or Booleans only, the only one of its name."""
        try:
            self[name]
        except InputError:
            return False
        return True


def read_log(path: Path, names: LogNames = AS_THEY_ARE) -> Log:
    """The log in a CSV, Arrow, Parquet or MDF file, with other names for its columns.

    The time is in the column of that name, in s or in the unit behind it; an offset that is to be
    found is left out. InputError where the file is damaged, has no time or none of the columns that
    are named, or needs a package that is not installed.
    """
    if path.suffix.lower() == ".mf4":
        time, signals, units = read_mdf(path)
        columns = [
            _of_mdf(path, number, name, units[name], values)
            for number, (name, values) in enumerate(signals.items(), start=1)
        ]
        table = FileTable(str(path), columns, len(time))
        return Log(path, time + (names.offset or 0.0), _columns_of_signals(table, columns, names))
    table = read_table(path)
    clocks = [table.column(names.time)] if names.file else []
    clocks = clocks or [column for column in table.columns if column.is_time()]
    if len(clocks) != 1:
        count = "no column" if not clocks else f"{len(clocks)} columns"
        raise InputError(
            f"{path}: {count} of the name 'time'; must be one, in s or as in 'time [ms]'"
        )
    if not table.row_count:
        raise InputError(f"{path}: has no row below its names; must have one")
    clock = clocks[0] if names.time_unit is None else replace(clocks[0], unit=names.time_unit)
    unit, values = clock.time_unit(), np.asarray(clock.numbers(), np.float64)
    time = values * float(unit.numerator) / float(unit.denominator) + (names.offset or 0.0)
    columns = [column for column in table.columns if column is not clocks[0]]
    return Log(path, time, _columns_of_signals(table, columns, names))


def _columns_of_signals(
    table: FileTable, columns: Sequence[Column], names: LogNames
) -> list[Column]:
    """The columns by the names of signals: those of the map, then the others by their own."""
    mapped = [
        _as_signal(table.column(entry.column), signal, entry)
        for signal, entry in names.columns.items()
    ]
    used = {entry.column for entry in names.columns.values()} | {*names.columns}
    return [*mapped, *(column for column in columns if column.name not in used)]


def _as_signal(column: Column, signal: str, entry: LogColumn) -> Column:
    """A column as the signal that it has."""
    as_it_is = (entry.factor, entry.offset) == (1.0, 0.0)
    values = column.values
    if not as_it_is:
        values = entry.factor * np.asarray(column.numbers(), np.float64) + entry.offset
    unit = column.unit if entry.unit is None else entry.unit
    return replace(column, name=signal, unit=unit, values=values)


def _of_mdf(
    path: Path, number: int, name: str, unit: str, values: npt.NDArray[np.float64]
) -> Column:
    def texts() -> list[str]:
        return [repr(value) for value in values.tolist()]

    return Column(str(path), number, name, name, unit or None, values, texts, is_text_file=False)
