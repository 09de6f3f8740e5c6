"""Tables in text: CSV as any tool writes it.

The first line has the names. Cells are separated by commas, semicolons or tabs, whichever of them
the lines show; a name or a cell that holds one stands in double quotes. Numbers have a point.
"""

import codecs
import csv
import os
from array import array
from collections.abc import Iterator, Sequence
from contextlib import suppress
from io import BytesIO, TextIOWrapper
from itertools import islice
from pathlib import Path
from typing import Any

from ..base.checks import extra_module, real
from ..base.errors import InputError, reason
from ..base.text import counted

SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}

LINES_FOR_SEPARATOR = 5
"""Lines that show which separator it is, where the names hold several."""

BLOCK_ROWS = 1024
"""Rows that are made numbers at once."""

MIN_BYTES_FOR_ARROW = 5_000_000
"""Bytes of a file from which pyarrow reads it, where that is installed: it takes time to load."""

BYTE_ORDER_MARKS = {
    codecs.BOM_UTF8: "utf-8-sig",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
"""The encodings by the bytes with which a file begins; without any it is UTF-8."""


class TextFile:
    """The rows of a file of text, as often as they are asked for; a stream is kept in memory."""

    def __init__(self, path: Path, label: str, torn: bool = False) -> None:
        """Messages call the file by its label; with `torn`, a last line without an end is ignored.

        OSError where there is no such file.
        """
        self.label = label
        self._path, self._torn = path, torn
        self._stream_content = None if path.is_file() else path.read_bytes()
        with self._bytes() as file:
            begin = file.read(max(map(len, BYTE_ORDER_MARKS)))
        encodings = [name for mark, name in BYTE_ORDER_MARKS.items() if begin.startswith(mark)]
        self.encoding = encodings[0] if encodings else "utf-8"
        self.separator = self._separator()

    def rows(self) -> Iterator[tuple[int, list[str]]]:
        """The lines and the cells of the rows, that of the names first, without empty ones.

        InputError at a row that has more or fewer cells than there are names.
        """
        width = 0
        for line, row in self._split(self.separator):
            width = width or len(row)
            if len(row) != width:
                raise InputError(
                    f"{self.label}: line {line} has {counted(len(row), 'cell')}; must have "
                    f"{width}, as line 1"
                )
            yield line, row

    def texts(self, index: int) -> list[str]:
        """The cells of a column, by its index from 0."""
        return [row[index] for _, row in islice(self.rows(), 1, None)]

    def columns_of_large(self, width: int) -> list[Any] | None:
        """The columns of a large file in a tenth of the time, if pyarrow is here and they are good.

        Those whose first cell is no number are texts. None where the slower way is to be taken.
        """
        if self._stream_content is not None or self.encoding.startswith("utf-16"):
            return None
        if self._path.stat().st_size < MIN_BYTES_FOR_ARROW or (self._torn and not self._is_whole()):
            return None
        try:
            arrow = extra_module("pyarrow", "it reads large files", "arrow")
            reader = extra_module("pyarrow.csv", "it reads large files", "arrow")
        except InputError:
            return None
        names = [str(index) for index in range(width)]
        column_types = {}
        for _, first_row in islice(self.rows(), 1, 2):
            for name, cell in zip(names, first_row, strict=True):
                column_types[name] = arrow.float64() if is_number(cell) else arrow.string()
        try:
            table = reader.read_csv(
                self._path,
                reader.ReadOptions(skip_rows=1, column_names=names),
                reader.ParseOptions(delimiter=self.separator),
                reader.ConvertOptions(column_types=column_types, null_values=[]),
            )
        except arrow.ArrowInvalid:  # which the slower way says better
            return None
        return [column.to_numpy() for column in table]

    def _is_whole(self) -> bool:
        """True where the last line has its end."""
        with self._bytes() as file:
            file.seek(-1, os.SEEK_END)
            return bool(file.read() == b"\n")

    def _bytes(self) -> Any:
        return (
            self._path.open("rb") if self._stream_content is None else BytesIO(self._stream_content)
        )

    def _separator(self) -> str:
        """The separator that the lines show; InputError where they fit several."""
        widths: dict[str, list[int]] = {}
        for separator in SEPARATORS:
            with suppress(InputError):  # where it does not separate; else the error comes later
                rows = islice(self._split(separator), LINES_FOR_SEPARATOR)
                widths[separator] = [len(row) for _, row in rows]
        candidates = [s for s, of_lines in widths.items() if of_lines and of_lines[0] > 1]
        if len(candidates) < 2:
            return candidates[0] if candidates else ","
        even = [s for s in candidates if len(set(widths[s])) == 1 and len(widths[s]) > 1]
        if len(even) != 1:
            names = " and ".join(SEPARATORS[s] for s in candidates)
            raise InputError(
                f"{self.label}: line 1 holds {names}; must be separated by one of them, with "
                "names that hold another one in double quotes"
            )
        return even[0]

    def _split(self, separator: str) -> Iterator[tuple[int, list[str]]]:
        """The rows that are not empty, split at a separator, and their lines.

        InputError where that is no text, or a quote is not closed.
        """
        line = 0
        try:
            with TextIOWrapper(self._bytes(), self.encoding, newline="") as file:
                lines = (text for text in file if text.endswith("\n")) if self._torn else file
                reader = csv.reader(lines, strict=True, skipinitialspace=True, delimiter=separator)
                for row in reader:
                    line = reader.line_num
                    if any(map(str.strip, row)):
                        yield line, row
        except (OSError, UnicodeDecodeError, csv.Error) as error:
            place = f"{self.label}: after line {line}" if line else self.label
            raise InputError(f"{place}: {reason(error)}; must be a CSV file") from error


class Numbers:
    """The numbers of a column, as its cells come; None once one of them is no number."""

    def __init__(self) -> None:
        self.values: array[float] | None = array("d")

    def add(self, cells: Sequence[str]) -> None:
        """Take the cells of further rows."""
        if self.values is None:
            return
        try:
            self.values.extend(map(float, cells))
            together = "".join(cells)
            if "_" in together or not together.isascii():  # which float() takes, and real() not
                self.values = None
        except ValueError:
            self.values = None


def is_number(cell: str) -> bool:
    """True for a text that stands for a number."""
    try:
        real(cell)
    except ValueError:
        return False
    return True
