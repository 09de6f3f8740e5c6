"""Tables of Apache Arrow: files of the IPC format (Feather 2), and Parquet; by pyarrow.

The unit of a column is in the metadata of its field, as ours have it, or behind its name. An IPC
file is a stream of whole batches behind eight bytes, until its end is written; so a file is read
that a kill left behind.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from ..base.checks import extra_module
from ..base.errors import InputError
from ..base.files import not_its_fault

MAGIC_BYTES = 8
"""Bytes of a file of the IPC format before its stream of batches."""

IPC_SUFFIXES, PARQUET_SUFFIXES = (".arrow", ".feather"), (".parquet",)


def pyarrow() -> Any:
    """The library; InputError where it is not installed."""
    extra_module("pyarrow.ipc", "it writes and reads Arrow", "arrow")
    return extra_module("pyarrow", "it writes and reads Arrow", "arrow")


def arrow_table(path: Path, label: str) -> Any:
    """The pyarrow.Table of a file, which messages call by its label.

    Of an IPC file that was cut off it has the whole batches. InputError without pyarrow, or where
    the file is missing or damaged.
    """
    arrow = pyarrow()
    file_format = "Parquet" if path.suffix.lower() in PARQUET_SUFFIXES else "Arrow"
    try:
        if file_format == "Parquet":
            parquet = extra_module("pyarrow.parquet", "it reads Parquet", "parquet")
            table = parquet.read_table(path)
        else:
            with path.open("rb") as file:
                file.seek(MAGIC_BYTES)
                stream = arrow.ipc.open_stream(file)
                table = arrow.Table.from_batches(_whole_batches(arrow, stream), stream.schema)
        table.validate(full=True)  # lengths of texts, which would be read from anywhere
        return table
    except (OSError, ValueError, MemoryError, arrow.ArrowException) as error:
        if limit := not_its_fault(error):
            raise InputError(f"{label}: cannot be read: {limit}") from error
        reason = " ".join(f"{error}".split())
        raise InputError(f"{label}: is damaged, or no {file_format} file: {reason}") from error


def _whole_batches(arrow: Any, stream: Any) -> Iterator[Any]:
    while True:
        try:
            yield stream.read_next_batch()
        except (StopIteration, OSError, arrow.ArrowException):  # the last one is not whole
            return


def numbers_of(column: Any) -> Any:
    """The values of a column of numbers or Booleans as an array of its type; None of any other.

    A value that is missing is NaN.
    """
    types, cell_type = pyarrow().types, column.type
    is_number = types.is_integer(cell_type) or types.is_floating(cell_type)
    if not is_number and not types.is_boolean(cell_type):
        return None
    values = column.to_numpy()
    if values.dtype == object:  # Booleans of which some are missing
        return None
    return values.astype("float64") if values.dtype.kind == "f" else values


def texts_of(column: Any) -> list[str]:
    """The values of a column as a CSV file would have them; empty where there is none."""
    return [_text(value) for value in column.to_pylist()]


def _text(value: Any) -> str:
    """A value as a CSV file would have it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else str(value)
