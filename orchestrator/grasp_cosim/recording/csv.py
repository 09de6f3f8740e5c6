"""Signals as CSV, in the form of the FMI cross-check: written while a run goes on, and read."""

import csv
import os
import re
from collections.abc import Collection, Sequence
from contextlib import ExitStack, nullcontext, suppress
from io import FileIO
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError
from ..base.one_piece import in_one_piece
from ..base.text import from_cell, to_cell
from ..exchange.listener import Experiment, Signal
from .arrow import pyarrow
from .memory import writing

PIECE = 1024
"""Rows turned into text at once; a block may be long."""

LARGE = 20_000_000
"""Bytes of a file that is worth another reader."""

NUMBER = re.compile(r"\s*[-+]?(\.?\d|nan|inf)", re.IGNORECASE)
"""How a cell begins that is no text."""


class CsvListener:
    """Writes time and signals with full precision, a line per recorded communication point.

    The file has a temporary name beside path until the run ends, in whatever way: what was
    recorded is kept, in whole lines. There is no file where nothing was. A Real is the shortest
    text that reads back as the same number, a Boolean is 0 or 1, names and Strings are quoted texts
    as base.text.to_cell() makes them.
    """

    def __init__(self, path: str | Path, place: Path | None = None) -> None:
        """Where a `place` is given, that is written from the start, by whoever sees to the rest.

        Both are in the folder that is the current one now, wherever an FMU goes later.
        """
        self._path, self._at_once = Path(path), place is not None
        self._place = (place or self._path).absolute()

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Write the line of names; InputError where the file cannot be written."""
        self._experiment, self._empty = experiment, True
        self._whole = [i for i, s in enumerate(signals, 1) if s.kind in ("Integer", "Boolean")]
        self._texts = {i: s.texts for i, s in enumerate(signals, 1) if s.kind == "String"}
        names = ("time", *(s.name for s in signals))
        named = nullcontext(self._place) if self._at_once else in_one_piece(self._place)
        with writing(self._path, InputError), ExitStack() as stack:
            self._file = stack.enter_context(FileIO(stack.enter_context(named), "w"))
            self._append(",".join(map(quoted, names)) + "\n")
            self._finish = stack.pop_all()

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
            with writing(self._path):
                self._append("\n".join(map(",".join, zip(*texts, strict=True))) + "\n")
            self._empty = False

    def end(self, complete: bool) -> None:
        """Give the file its name; SimulationError where that fails."""
        with writing(self._path), suppress(EOFError), self._finish:
            if self._empty:
                raise EOFError  # has the temporary file removed

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
    count = None
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = csv.reader(file, strict=True)
            names = [*map(from_cell, next(rows, []))] or ["nothing"]
            cells = next(filter(None, rows), [])
        if torn:
            count = path.read_bytes().count(b"\n") - 1
        if names[0] != "time":
            raise ValueError(f'the first column is {names[0]!r}; must be "time"')
        if len({*names}) != len(names):
            raise ValueError("two columns have the same name")
        with path.open("rb") as file:
            file.seek(-1, os.SEEK_END)
            whole = bool(count) if torn else file.read() == b"\n"
        if not cells or not whole:
            raise ValueError("the last row is cut off, or there is none")
        if texts is None:
            found = zip(names, cells, strict=False)
            texts = [name for name, cell in found if not NUMBER.match(cell)]
        kinds: list[Any] = [object if name in texts else np.float64 for name in names]
        table = None if torn else _fast(path, kinds)
        if table is None:
            read = np.loadtxt(
                path, [("", kind) for kind in kinds], encoding="utf-8", delimiter=",",
                quotechar='"', comments=None, skiprows=1, max_rows=count, ndmin=1,
            )  # fmt: skip
            table = [read[f"f{i}"] for i in range(len(kinds))]
        if not (np.diff(table[0], prepend=-np.inf) > 0.0).all():
            raise ValueError("the time must grow from row to row")
    except OSError as error:
        raise unreadable(path, error) from error
    except (ValueError, csv.Error) as error:  # also where it is no UTF-8
        said = str(error).replace("the dtype passed requires", "the first line names")
        raise InputError(f"{path}: is damaged: {said.partition('; use ')[0]}") from error
    columns = {
        name: np.array([*map(from_cell, column)], object) if kind is object else column
        for name, kind, column in zip(names, kinds, table, strict=True)
    }
    return columns.pop("time"), columns


def _fast(path: Path, kinds: Sequence[Any]) -> list[npt.NDArray[Any]] | None:
    """The columns of a large file in a tenth of the time, if pyarrow is here and they are good."""
    if path.stat().st_size < LARGE:
        return None
    with suppress(InputError):
        arrow, reader = pyarrow(), extra_module("pyarrow.csv", "it reads CSV", "arrow")
        of = {np.float64: arrow.float64(), object: arrow.string()}
        types = {str(i): of[kind] for i, kind in enumerate(kinds)}
        with suppress(arrow.ArrowInvalid):  # which the other reader says better
            table = reader.read_csv(
                path,
                reader.ReadOptions(skip_rows=1, column_names=[*types]),
                convert_options=reader.ConvertOptions(column_types=types, null_values=[]),
            )
            return [column.to_numpy() for column in table]
    return None


def unreadable(path: Path, error: OSError) -> InputError:
    """The error for a file of a run that cannot be read."""
    return InputError(
        f"{path}: {error.strerror}; must be a folder that `grasp-cosim run --out` wrote"
    )
