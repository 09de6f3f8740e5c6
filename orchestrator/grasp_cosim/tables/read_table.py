"""The one reader of tables: logs, stimuli, the rows of a sweep, and what runs have recorded.

Names are in the first line, each with a unit in brackets where it has one: `plant.force [kN]`. A
column that nobody uses may hold whatever it likes: comments, empty cells, words among numbers.
"""

from __future__ import annotations

from array import array
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

from ..base.errors import InputError
from ..base.text import from_cell
from .arrow_file import IPC_SUFFIXES, PARQUET_SUFFIXES, arrow_table, numbers_of, texts_of
from .column import Column, FileTable, Values, split_head
from .delimited import BLOCK_ROWS, Numbers, TextFile

ARROW_SUFFIXES = (*IPC_SUFFIXES, *PARQUET_SUFFIXES)
TEXT_SUFFIXES = (".csv", ".tsv")
"""The suffixes of tables; a file of any other name is read as text."""


def read_table(path: Path, label: str = "", torn: bool = False) -> FileTable:
    """The table in a file, which messages call by its label, or without one by its path.

    With `torn`, a last line that has no end does not count. InputError where the file is missing,
    damaged or empty, or a row has more or fewer cells than there are names.
    """
    label = label or str(path)
    if path.suffix.lower() in ARROW_SUFFIXES:
        return _from_arrow(path, label)
    return _from_text(path, label, torn)


def names_in(path: Path) -> list[str]:
    """The names of the columns of a table; none where the file is no table."""
    try:
        if path.suffix.lower() in ARROW_SUFFIXES:
            return [column.name for column in _from_arrow(path, str(path)).columns]
        _, heads = next(TextFile(path, str(path)).rows(), (0, []))
    except (InputError, OSError):
        return []
    return [split_head(from_cell(head.strip()))[0] for head in heads]


def _from_text(path: Path, label: str, torn: bool) -> FileTable:
    try:
        file = TextFile(path, label, torn)
    except OSError as error:
        raise InputError(f"{label}: {error.strerror}; must be a CSV file") from error
    rows = file.rows()
    first_row = next((row for _, row in rows), None)
    if first_row is None:
        raise InputError(f"{label}: is empty; must have names in its first line")
    heads = [from_cell(cell.strip()) for cell in first_row]
    read_texts: list[Callable[[], Sequence[str]]]
    read_texts = [partial(file.texts, index) for index in range(len(heads))]
    values: list[Values | None]
    lines = array("q")
    columns_of_large = file.columns_of_large(len(heads))
    if columns_of_large is None:
        values, lines = _numbers(rows, len(heads))
        row_count = len(lines)
    else:
        row_count = len(columns_of_large[0])
        values = [None if column.dtype == object else column for column in columns_of_large]
        for index, column in enumerate(columns_of_large):
            if column.dtype == object:
                read_texts[index] = column.tolist
    one_line_each = not lines or lines[-1] == len(lines) + 1
    if one_line_each:
        lines = array("q")
    columns = []
    for index, head in enumerate(heads):
        name, unit = split_head(head)
        column = Column(label, index + 1, head, name, unit, values[index], read_texts[index], lines)
        columns.append(column)
    return FileTable(label, columns, row_count)


def _numbers(
    rows: Iterator[tuple[int, list[str]]], width: int
) -> tuple[list[Values | None], array[int]]:
    """The numbers of each column, None where a cell is no number; and the lines of the rows."""
    numbers = [Numbers() for _ in range(width)]
    lines = array("q")
    while block := [*islice(rows, BLOCK_ROWS)]:
        lines.extend(line for line, _ in block)
        cells_by_column = zip(*(row for _, row in block), strict=True)
        for column, cells in zip(numbers, cells_by_column, strict=True):
            column.add(cells)
    return [column.values for column in numbers], lines


def _from_arrow(path: Path, label: str) -> FileTable:
    table = arrow_table(path, label)
    columns = []
    for index, field in enumerate(table.schema):
        name, unit_of_head = split_head(field.name)
        metadata = field.metadata or {}
        unit = metadata.get(b"unit", b"").decode("utf-8", "replace") or unit_of_head
        cells = table.column(index)
        column = Column(
            label,
            index + 1,
            field.name,
            name,
            unit,
            numbers_of(cells),
            partial(texts_of, cells),
            is_text_file=False,
        )
        columns.append(column)
    return FileTable(label, columns, table.num_rows)
