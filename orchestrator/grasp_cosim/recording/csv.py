"""Signals as CSV, in the form of the FMI cross-check: written while a run goes on, and read."""

import csv
import os
from collections.abc import Collection, Iterator, Sequence
from contextlib import ExitStack, nullcontext, suppress
from io import FileIO
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from one_piece import in_one_piece

from ..base.checks import extra_module, real
from ..base.errors import InputError, SimulationError
from ..base.files import unwritable
from ..base.text import counted, from_cell, to_cell
from ..exchange.listener import Experiment, Signal
from .arrow import pyarrow

PIECE = 1024
"""Rows turned into text at once; a block may be long."""

LARGE = 20_000_000
"""Bytes of a file that is worth another reader."""


class CsvListener:
    """Writes time and signals with full precision, a line per recorded communication point.

    The file has a temporary name beside path until the run ends, in whatever way: what was
    recorded is kept, in whole lines. There is no file where nothing was. A Real is the shortest
    text that reads back as the same number, a Boolean is 0 or 1, names and Strings are quoted texts
    as base.text.to_cell() makes them. In place, the file has its name from the start: whoever
    wants that sees to it that it gets rows.
    """

    def __init__(
        self, path: str | Path, said: str | Path | None = None, in_place: bool = False
    ) -> None:
        """`said` is the name in messages, if it is another."""
        self._path, self._said = Path(path), Path(said or path)
        self._in_place = in_place

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Write the line of names; InputError where the file cannot be written."""
        self._experiment = experiment
        self._whole = [i for i, s in enumerate(signals, 1) if s.kind in ("Integer", "Boolean")]
        self._texts = {i: s.texts for i, s in enumerate(signals, 1) if s.kind == "String"}
        names = ("time", *(s.name for s in signals))
        try:
            with ExitStack() as stack:
                named = nullcontext(self._path) if self._in_place else in_one_piece(self._path)
                part = stack.enter_context(named)
                self._file = stack.enter_context(FileIO(part, "w"))
                self._append(",".join(map(quoted, names)) + "\n")
                self._finish = stack.pop_all()
                self._empty = True
        except OSError as error:
            raise InputError(unwritable(self._said, error)) from error

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Append the rows; SimulationError where that fails, the lines until then are whole."""
        for first in range(0, len(steps), PIECE):
            piece = slice(first, first + PIECE)
            columns = [self._experiment.times(steps[piece]).tolist(), *rows[piece].T.tolist()]
            for i in self._whole:
                columns[i] = [*map(int, columns[i])]
            texts = [map(repr, column) for column in columns]
            for i, own in self._texts.items():
                texts[i] = map(quoted, own.column(rows[piece, i - 1]))
            try:
                self._append("\n".join(map(",".join, zip(*texts, strict=True))) + "\n")
            except OSError as error:
                raise SimulationError(unwritable(self._said, error)) from error
            self._empty = False

    def end(self, complete: bool) -> None:
        """Give the file its name; SimulationError where that fails."""
        try:
            with suppress(_NothingRecordedError), self._finish:
                if self._empty:
                    raise _NothingRecordedError
        except OSError as error:
            raise SimulationError(unwritable(self._said, error)) from error

    def _append(self, text: str) -> None:
        """Write all of the text, or none of it and raise OSError; a pipe may have got a part."""
        written = self._file.tell() if self._file.seekable() else None
        data = memoryview(text.encode())
        try:
            while data:
                data = data[self._file.write(data) :]
        except OSError:
            if written is not None:
                self._file.truncate(written)
            raise


class _NothingRecordedError(Exception):
    """Has the temporary file removed."""


def quoted(text: str) -> str:
    """Return a text as a cell of a CSV that is neither a formula nor a line break."""
    return '"{}"'.format(to_cell(text).replace('"', '""'))


def read_csv(
    path: Path, texts: Collection[str] | None = None, torn: bool = False
) -> tuple[npt.NDArray[np.float64], dict[str, npt.NDArray[Any]]]:
    """The time, and the other columns by name: objects where they are texts, else float64.

    `texts` are the names of those, by default of all that begin with something else than a number.
    A last row that is `torn` does not count. InputError where it is missing or damaged.
    """
    names = _names(path, torn)
    count = path.read_bytes().count(b"\n") - 1 if torn else None
    try:
        if texts is None:
            texts = _not_numbers(names, next(_rows(path), [])[1:])
        columns = _texts(path, names, texts, count) if texts else {}
        places = [0, *(i for i, name in enumerate(names, 1) if name not in columns)]
        table = [] if columns or torn else _fast(path, len(places))
        if not table:
            some: dict[str, Any] = {"usecols": places, "quotechar": '"'} if columns else {}
            plain: dict[str, Any] = {"delimiter": ",", "skiprows": 1, "comments": None, "ndmin": 2}
            table = [*np.loadtxt(path, encoding="utf-8", max_rows=count, **plain, **some).T]
    except (ValueError, csv.Error) as error:  # also where it is no UTF-8
        raise InputError(f"{path}: is damaged: {str(error).splitlines()[0]}") from error
    if len(table) != len(places):
        raise InputError(f"{path}: is damaged: {_uneven(len(table), names)}")
    if not (np.diff(table[0], prepend=-np.inf) > 0.0).all():
        raise InputError(f"{path}: is damaged: the time must grow from row to row")
    columns |= {names[i - 1]: table[k] for k, i in enumerate(places[1:], 1)}
    return table[0], {name: columns[name] for name in names}


def _fast(path: Path, width: int) -> list[npt.NDArray[np.float64]]:
    """The columns of a large file, if pyarrow is here, and nothing is wrong with them.

    They have the same bits, in a tenth of the time.
    """
    if path.stat().st_size < LARGE:
        return []
    with suppress(InputError):
        arrow, reader = pyarrow(), extra_module("pyarrow.csv", "it reads CSV", "arrow")
        names = [str(i) for i in range(width)]
        floats = dict.fromkeys(names, arrow.float64())
        with suppress(arrow.ArrowInvalid):  # which the other reader says better
            table = reader.read_csv(
                path,
                reader.ReadOptions(skip_rows=1, column_names=names),
                convert_options=reader.ConvertOptions(column_types=floats, null_values=[]),
            )
            return [column.to_numpy() for column in table]
    return []


def _texts(
    path: Path, names: Sequence[str], wanted: Collection[str], count: int | None
) -> dict[str, npt.NDArray[Any]]:
    """The columns of these names that are texts; ValueError where a row has not all values."""
    places = {i: name for i, name in enumerate(names, 1) if name in wanted}
    cells: dict[str, list[str]] = {name: [] for name in places.values()}
    for row in islice(_rows(path), count):
        if len(row) != len(names) + 1:
            raise ValueError(_uneven(len(row), names))
        for i, name in places.items():
            cells[name].append(from_cell(row[i]))
    return {name: np.array(column, object) for name, column in cells.items()}


def _uneven(values: int, names: Sequence[str]) -> str:
    """What is wrong with a row of so many values, the time among them."""
    return f"{counted(values, 'value')} in a row, {counted(len(names) + 1, 'name')}"


def _rows(path: Path) -> Iterator[list[str]]:
    """The rows after the names."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = csv.reader(file, strict=True)
        next(rows)
        yield from rows


def _not_numbers(names: Sequence[str], cells: Sequence[str]) -> set[str]:
    texts = {*names}
    for name, cell in zip(names, cells, strict=False):
        with suppress(ValueError):
            real(cell)
            texts.remove(name)
    return texts


def _names(path: Path, torn: bool) -> list[str]:
    """The names of the columns after time; InputError where no whole row follows them.

    Where the last one may be `torn`, another one must be before it.
    """
    try:
        with path.open("rb") as file:
            first = file.readline()
            file.seek(max(len(first), file.seek(0, os.SEEK_END) - 1))
            whole = file.read() == b"\n"
            file.seek(len(first))
            whole = whole or (torn and file.readline().endswith(b"\n"))
    except OSError as error:
        raise unreadable(path, error) from error
    try:
        cells = next(csv.reader([first.decode("utf-8")], strict=True), [])
        time, *names = [from_cell(cell) for cell in cells] or ["nothing"]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is damaged: the first line names no columns") from error
    if time != "time":
        raise InputError(f'{path}: the first column is {time!r}; must be "time"')
    if len(set(names)) != len(names):
        raise InputError(f"{path}: is damaged: two columns have the same name")
    if not whole:
        raise InputError(f"{path}: is damaged: the last row is cut off, or there is none")
    return names


def unreadable(path: Path, error: OSError) -> InputError:
    """The error for a file of a run that cannot be read."""
    return InputError(
        f"{path}: {error.strerror}; must be a folder that `grasp-cosim run --out` wrote"
    )
