"""Writes a run as CSV while it goes on, in the form of the FMI cross-check."""

from collections.abc import Sequence
from contextlib import ExitStack, nullcontext, suppress
from io import FileIO
from pathlib import Path

import numpy as np
import numpy.typing as npt
from one_piece import in_one_piece

from ..base.errors import InputError, SimulationError
from ..base.files import unwritable
from ..base.plain_text import to_cell
from ..exchange.listener import Experiment, Signal

PIECE = 1024
"""Rows turned into text at once; a block may be long."""


class CsvListener:
    """Writes time and signals with full precision, a line per recorded communication point.

    The file has a temporary name beside path until the run ends, in whatever way: what was
    recorded is kept, in whole lines. There is no file where nothing was. A Real is the shortest
    text that reads back as the same number, a Boolean is 0 or 1, names and Strings are quoted texts
    as plain.to_cell() makes them. In place, the file has its name from the start: whoever wants
    that sees to it that it gets rows.
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
        try:
            for first in range(0, len(steps), PIECE):
                piece = slice(first, first + PIECE)
                time = self._experiment.times(steps[piece])
                columns = [time.tolist(), *rows[piece].T.tolist()]
                for i in self._whole:
                    columns[i] = [*map(int, columns[i])]
                texts = [map(repr, column) for column in columns]
                for i, own in self._texts.items():
                    texts[i] = map(quoted, own.column(rows[piece, i - 1]))
                self._append("\n".join(map(",".join, zip(*texts, strict=True))) + "\n")
                self._empty = False
        except OSError as error:
            raise SimulationError(unwritable(self._said, error)) from error

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


def quoted(text: str) -> str:
    """Return a text as a cell of a CSV that is neither a formula nor a line break."""
    return '"{}"'.format(to_cell(text).replace('"', '""'))


class _NothingRecordedError(Exception):
    """Has the temporary file removed."""
