"""Signals as CSV, in the form of the FMI cross-check, written while a run goes on."""

from collections.abc import Sequence
from contextlib import ExitStack, nullcontext
from io import FileIO
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..base.one_piece import in_one_piece
from ..base.text import to_cell
from ..exchange.listener import Experiment, Signal
from .memory import writing

PIECE = 1024
"""Rows turned into text at once; a block may be long."""


class CsvListener:
    """Writes time and signals with full precision, a line per recorded communication point.

    The file has a temporary name next to path until the run ends, in whatever way: what was
    recorded is kept, in whole lines. There is no file where nothing was. A Real is the shortest
    text that reads back as the same number. A Boolean is 0 or 1. Names and Strings are quoted texts
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
        target = nullcontext(self._place) if self._at_once else in_one_piece(self._place)
        with writing(self._path, InputError), ExitStack() as stack:
            self._part = stack.enter_context(target)
            self._file = stack.enter_context(FileIO(self._part, "w"))
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
            for i, texts_of_signal in self._texts.items():
                texts[i] = map(quoted, texts_of_signal.column(rows[piece, i - 1]))
            with writing(self._path):
                self._append("\n".join(map(",".join, zip(*texts, strict=True))) + "\n")
            self._empty = False

    def end(self, complete: bool) -> None:
        """Give the file its name, or remove it where it has no row; SimulationError on failure."""
        with writing(self._path), self._finish:
            if self._empty and not self._at_once:
                self._file.close()  # Windows removes no file that is open
                self._part.unlink()

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
