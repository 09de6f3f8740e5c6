"""The table of a sweep in a file: CSV, or Parquet by pyarrow; equal tables make equal bytes.

The unit of a column is in brackets in the head of CSV, and in the metadata of a field of Parquet.
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ..base.checks import extra_module
from ..base.errors import InputError
from ..base.one_piece import in_one_piece
from ..tables.column import head_of

SUFFIXES = (".csv", ".parquet")

Columns = Mapping[str, Sequence[Any]]
"""The values by the name of the column; None where there is none."""


def check_format(path: Path) -> None:
    """InputError where a table cannot be written to a file of that name."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: must end in {' or '.join(SUFFIXES)}")
    if path.suffix == ".parquet":
        _pyarrow()


def write_table(path: Path, columns: Columns, units: Mapping[str, str | None]) -> None:
    """Write columns in one piece; InputError for another suffix, or without pyarrow."""
    check_format(path)
    write = _write_parquet if path.suffix == ".parquet" else _write_csv
    with in_one_piece(path) as part:
        write(part, columns, units)


def cell_of(value: Any) -> Any:
    """A value as a cell of CSV: numbers in full, Booleans as true and false."""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else value


def _write_csv(path: Path, columns: Columns, units: Mapping[str, str | None]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(head_of(name, units.get(name)) for name in columns)
        for row in zip(*columns.values(), strict=True):
            writer.writerow(cell_of(value) for value in row)


def _write_parquet(path: Path, columns: Columns, units: Mapping[str, str | None]) -> None:
    arrow, parquet = _pyarrow()
    arrays = [_array(arrow, name, column) for name, column in columns.items()]
    fields = [
        arrow.field(name, array.type, metadata={"unit": units.get(name) or ""})
        for name, array in zip(columns, arrays, strict=True)
    ]
    with path.open("wb") as file:  # pyarrow closes its own when it likes; Windows minds
        parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), file)


def _array(arrow: Any, name: str, column: Sequence[Any]) -> Any:
    """The column with the narrowest type that holds all values; numbers where there is none."""
    types = {type(value) for value in column if value is not None}
    if name == "error" or str in types:
        texts = [None if value is None else str(value) for value in column]
        return arrow.array(texts, type=arrow.string())
    if types in ({bool}, {int}):
        return arrow.array(column)
    numbers = [None if value is None else float(value) for value in column]
    return arrow.array(numbers, type=arrow.float64())


def _pyarrow() -> tuple[Any, Any]:
    arrow = extra_module("pyarrow", "it writes Parquet", "parquet")
    return arrow, extra_module("pyarrow.parquet", "it writes Parquet", "parquet")
