"""The one reader of tables: logs, stimuli, the rows of a sweep, and what runs have recorded.

Names are in the first line, each with a unit in brackets where it has one: `plant.force [kN]`. A
column that nobody uses may hold whatever it likes: comments, empty cells, words among numbers.
"""

import re
from array import array
from collections.abc import Callable, Sequence
from functools import partial
from itertools import islice
from pathlib import Path

from ..base.errors import InputError
from ..base.text import from_cell
from .arrow_file import IPC, PARQUET, arrow_table, numbers_of, texts_of
from .column import Column, Table, Values
from .delimited import PIECE, Numbers, TextFile

ARROW = (*IPC, *PARQUET)
TEXT = (".csv", ".tsv")
"""The suffixes of tables; a file of any other name is read as text."""

_HEAD = re.compile(r"(.*\S)\s+\[([^\[\]]*)\]", re.DOTALL)
_TIME = re.compile(r"(time)\s*\[([^\[\]]*)\]", re.IGNORECASE)


def read_table(path: Path, called: str = "", torn: bool = False) -> Table:
    """The table in a file, which messages call by its path or so.

    With `torn`, a last line that has no end does not count. InputError where the file is missing,
    damaged or empty, or a row has more or fewer cells than there are names.
    """
    called = called or str(path)
    if path.suffix.lower() in ARROW:
        return _from_arrow(path, called)
    return _from_text(path, called, torn)


def names_in(path: Path) -> list[str]:
    """The names of the columns of a table; none where the file is no table."""
    try:
        if path.suffix.lower() in ARROW:
            return [column.name for column in _from_arrow(path, str(path)).columns]
        _, heads = next(TextFile(path, str(path)).rows(), (0, []))
    except (InputError, OSError):
        return []
    return [split_head(from_cell(head.strip()))[0] for head in heads]


def split_head(head: str) -> tuple[str, str | None]:
    """The name and the unit in the head of a column; `u[1]` is a name without a unit."""
    match = _HEAD.fullmatch(head) or _TIME.fullmatch(head)
    return (match[1], match[2]) if match else (head, None)


def _from_text(path: Path, called: str, torn: bool) -> Table:
    try:
        file = TextFile(path, called, torn)
    except OSError as error:
        raise InputError(f"{called}: {error.strerror}; must be a CSV file") from error
    rows = file.rows()
    names = next((row for _, row in rows), None)
    if names is None:
        raise InputError(f"{called}: is empty; must have names in its first line")
    heads = [from_cell(name.strip()) for name in names]
    large = file.columns_of_large(len(heads))
    lines = array("q")
    read_texts: list[Callable[[], Sequence[str]]]
    read_texts = [partial(file.texts, place) for place in range(len(heads))]
    if large is None:
        numbers = [Numbers() for _ in heads]
        while piece := [*islice(rows, PIECE)]:
            lines.extend(line for line, _ in piece)
            cells_by_column = zip(*(row for _, row in piece), strict=True)
            for column, cells in zip(numbers, cells_by_column, strict=True):
                column.add(cells)
        values: list[Values | None] = [column.values for column in numbers]
        count = len(lines)
    else:
        values = [None if column.dtype == object else column for column in large]
        count = len(large[0])
        for place, column in enumerate(large):
            if column.dtype == object:
                read_texts[place] = column.tolist
    one_by_one = not lines or lines[-1] == len(lines) + 1
    columns = [
        Column(
            called, place + 1, head, *split_head(head), values[place], read_texts[place],
            () if one_by_one else lines,
        )
        for place, head in enumerate(heads)
    ]  # fmt: skip
    return Table(called, columns, count)


def _from_arrow(path: Path, called: str) -> Table:
    table = arrow_table(path, called)
    columns = []
    for place, field in enumerate(table.schema):
        name, unit = split_head(field.name)
        metadata = field.metadata or {}
        unit = metadata.get(b"unit", b"").decode("utf-8", "replace") or unit
        column = table.column(place)
        columns.append(
            Column(
                called,
                place + 1,
                field.name,
                name,
                unit,
                numbers_of(column),
                partial(texts_of, column),
                is_text_file=False,
            )
        )
    return Table(called, columns, table.num_rows)
