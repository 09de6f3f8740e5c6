"""A table of measurements with columns of known names: in units that are asked for."""

import logging
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from ...base.errors import InputError, choices
from ...interface.units import IDENTITY
from ...tables.column import Column
from ...tables.read_table import read_table

LOGGER = logging.getLogger(__name__)
"""Gets as a warning which columns are not used."""


class Row(NamedTuple):
    """A line of a table: its place for a message, and its numbers by column, in the units asked."""

    place: str
    numbers: Mapping[str, float]


def read_rows(
    path: Path, units: Mapping[str, str], contents: str, optional: Sequence[str] = ()
) -> list[Row]:
    """The rows of a table with the columns in `units`, in any order; a unit there is the default.

    A warning names other columns, which are not used. InputError with the line of a cell that is no
    number, where a column is missing, and where there is no row with the contents.
    """
    table = read_table(path)
    names = [column.name for column in table.columns if column.name]
    needed = [name for name in units if name not in optional]
    if missing := [name for name in needed if name not in names]:
        may_be = f", and may be {choices(optional)}" if optional else ""
        raise InputError(
            f"{path}: the columns are {choices(names)}, without {choices(missing)}; must be "
            f"{choices(needed)}{may_be}"
        )
    if not table.row_count:
        raise InputError(f"{path}: has no line below its columns; must have {contents}")
    used = [name for name in units if name in names]
    if unused := [name for name in names if name not in used]:
        LOGGER.warning("%s: not used: the columns %s", path, choices(unused, 6))
    columns = [table.column(name) for name in used]
    numbers = [_numbers_in(units[column.name], column) for column in columns]
    return [
        Row(columns[0].row_place(row), dict(zip(used, values, strict=True)))
        for row, values in enumerate(zip(*numbers, strict=True))
    ]


def _numbers_in(unit: str, column: Column) -> list[float]:
    """The numbers of a column in a unit."""
    change = column.to_unit(unit)
    numbers = [float(value) for value in column.numbers()]
    return numbers if change == IDENTITY else [change(number) for number in numbers]
