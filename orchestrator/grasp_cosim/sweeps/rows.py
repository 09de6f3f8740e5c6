"""What varies: a row for each run, values by their places in the system file.

A number is in the unit of its variable, as in that file. One with a unit is a Quantity, a pair like
(50, "mm") or a text like "50 mm"; or the head of its column has the unit, plant.object_width [mm].
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ..base.checks import is_number, point_advice
from ..base.errors import InputError
from ..base.quantity import Quantity, as_quantity
from ..base.text import counted, on_one_line
from ..interface.fmi_types import Value
from ..interface.values import in_own_unit
from ..system.connectors import in_unit
from ..system.description import System
from ..system.overrides import as_overrides, parse_place, plain
from ..system.parts import Port
from ..system.times import LONGEST, in_nanoseconds, in_seconds
from ..tables.column import FileTable, split_head
from ..tables.delimited import is_number as spells_number
from ..tables.read_table import read_table

Row = Mapping[str, Any]
"""Values by place, some of them with a unit until in_own_units()."""

TIMES = tuple(f"experiment.{key}" for key in ("start", "step", "stop"))
"""The places of times, which may be fractions like 1/30."""

STOP = "experiment.stop"

MAX_RUNS = 100_000

MAX_SHOWN = 60
"""Characters of a value in a message."""

ROWS_MUST = "must be rows, mappings of places to values, or columns by place, or a data frame"

FORM = "KEY=START:END:COUNT or KEY=VALUE,VALUE,..., and KEY may have a unit: 'a.b [mm]'"


def grid(varied: Mapping[str, Any]) -> list[dict[str, Any]]:
    """A row for every combination of the values of each place; the last place varies fastest.

    A single value is that of each row.
    """
    values = [_values(column) for column in varied.values()]
    return [dict(zip(varied, row, strict=True)) for row in itertools.product(*values)]


def varied(text: str) -> tuple[str, list[Value | Quantity]]:
    """The place and the values of a text in the FORM; InputError where it is none."""
    head, equals, values_text = text.partition("=")
    place, unit = split_head(head.strip())
    option = f"--vary {text!r}"
    if not equals or place.startswith(".") or not place:
        raise InputError(f"{option}: must be {FORM}")
    bounds = values_text.split(":")
    if len(bounds) == 1:
        values = [plain(part.strip()) for part in values_text.split(",")]
        if "" in values:
            raise InputError(f"{option}: an empty value; must be {FORM}")
        return place, [_in_unit(option, value, unit) for value in values]
    try:
        start, end, count = float(bounds[0]), float(bounds[1]), int(bounds[2])
        if len(bounds) > 3 or not np.isfinite([start, end]).all():
            raise ValueError
    except (ValueError, IndexError) as error:
        raise InputError(f"{option}: must be {FORM}, with finite numbers") from error
    if not 2 <= count <= MAX_RUNS:
        raise InputError(f"{option}: {count} values; must be 2 to {MAX_RUNS}")
    points = np.linspace(start, end, count).tolist()
    return place, [_in_unit(option, value, unit) for value in points]


def _in_unit(place: str, value: Any, unit: str | None) -> Any:
    """The value with the unit in the head of its column, if that has one."""
    if not unit:  # the head of a number without one is "name []"
        return value
    if not is_number(value):
        raise InputError(f"{place}: {str(value)!r}: must be a number, as the column is in {unit}")
    return Quantity(value, unit)


def as_rows(source: Any, alike: bool = False) -> list[dict[str, Any]]:
    """The rows of a table, read or in a file, of columns by place, of a data frame, or of rows.

    A data frame is one of pandas or polars, a table of pyarrow, a structured array of NumPy, or a
    Dataset of xarray. Next to columns a single value is that of each row. A cell that is None, NaN
    or empty leaves that place as the system has it. InputError where these are no rows, nothing
    varies, unless they may be `alike`, or there are more than MAX_RUNS.
    """
    if isinstance(source, str | Path):
        source = read_rows(Path(source))
    rows = [_row(number, entry) for number, entry in enumerate(_entries(source))]
    if not 1 <= len(rows) <= MAX_RUNS:
        raise InputError(f"sweep: {len(rows)} rows; must be 1 to {MAX_RUNS}")
    if not (alike or any(rows)):
        raise InputError("sweep: nothing varies; the rows must have at least one column")
    return rows


def labels_of(source: Any) -> Any:
    """The index of a pandas DataFrame, under which the runs come back; None of other rows."""
    return source.index if hasattr(source, "iloc") else None


def _entries(source: Any) -> Iterable[Any]:
    """The entries of a table, a data frame or the like, each of which should be a row."""
    if isinstance(source, FileTable):
        return _rows_in(source)
    if hasattr(source, "to_dataframe"):  # a Dataset of xarray, whose coordinates vary too
        source = source.to_dataframe().reset_index()
    if hasattr(source, "to_dicts"):
        return source.to_dicts()  # type: ignore[no-any-return]  # of polars
    if hasattr(source, "to_pylist"):
        return source.to_pylist()  # type: ignore[no-any-return]  # of pyarrow
    if hasattr(source, "iloc"):  # of pandas
        if source.ndim == 1:
            raise InputError("sweep: a Series; must be a DataFrame, with a column for each key")
        return source.to_dict("records")  # type: ignore[no-any-return]
    dtype = getattr(source, "dtype", None)
    names = getattr(dtype, "names", None)  # of a structured array of NumPy
    if names:
        return [dict(zip(names, row, strict=True)) for row in source.ravel().tolist()]
    if isinstance(source, Mapping):
        return _rows_of_columns(source)
    if isinstance(source, Iterable):
        return source
    raise InputError(f"sweep: rows = {_short(source)}: {ROWS_MUST}")


def _rows_of_columns(columns: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of columns by place, a single value being that of each row."""
    values_by_place = {place: _values(column) for place, column in columns.items()}
    lengths = {
        place: len(values)
        for place, values in values_by_place.items()
        if not _is_single(columns[place])
    }
    if len({*lengths.values()}) > 1:
        counts = ", ".join(f"{place} has {counted(n, 'value')}" for place, n in lengths.items())
        raise InputError(f"sweep: {counts}; must all have as many, or a single one")
    length = next(iter(lengths.values()), 1)
    full_columns = []
    for place, values in values_by_place.items():
        full_columns.append(values if place in lengths else values * length)
    return [dict(zip(columns, row, strict=True)) for row in zip(*full_columns, strict=True)]


def _is_single(column: Any) -> bool:
    """True for one value, where several may be, too."""
    if quantity := as_quantity(column):
        return _is_single(quantity.value)
    has_entries = isinstance(column, Iterable) and not isinstance(column, str)
    return not has_entries or getattr(column, "ndim", 1) == 0


def _values(column: Any) -> list[Any]:
    """The values of a column, or the single one."""
    if isinstance(column, Quantity) and not _is_single(column):
        return [Quantity(value, column.unit) for value in column.value]
    return [column] if _is_single(column) else list(column)


def _row(number: int, entry: Any) -> dict[str, Any]:
    """A row by place, without the places that it leaves; InputError where it is none."""
    if not isinstance(entry, Mapping):
        raise InputError(f"sweep: row {number} = {_short(entry)}: {ROWS_MUST}")
    row: dict[str, Any] = {}
    for head, cell in entry.items():
        if not isinstance(head, str):
            raise InputError(f"sweep: {head!r}: must be a key of the system, a text")
        place, unit = split_head(head)
        value = _plain(place, cell)
        if value is None:
            continue
        if place in row:
            raise InputError(f"sweep: row {number}: {place} has two values; must have one")
        row[place] = _in_unit(f"sweep: row {number}, {head}", value, unit)
    return row


def _short(value: Any) -> str:
    """A value in a message."""
    text = on_one_line(repr(value))
    return f"{text[:MAX_SHOWN]}..." if len(text) > MAX_SHOWN else text


def read_rows(path: Path) -> FileTable:
    """The table of rows in a file, which may be a stream; InputError where it is damaged."""
    return read_table(path, f"--table {path}")


def _rows_in(table: FileTable) -> list[dict[str, Any]]:
    """The rows of a table whose head has places, with a unit in brackets if it has one.

    A cell that is empty has no value. InputError at the first one that is not as it must be.
    """
    rows: list[dict[str, Any]] = [{} for _ in range(table.row_count)]
    columns = [column for column in table.columns if column.name]
    for column in columns:
        table.column(column.name)  # there is only one
        for row, cell in enumerate(column.texts()):
            text = cell.strip()
            if not text:
                continue
            if not column.unit:
                rows[row][column.name] = plain(text)
            elif spells_number(text):
                rows[row][column.name] = Quantity(float(text), column.unit)
            else:
                advice = point_advice(text)
                raise InputError(f"{column.place(row)} = {text!r}: must be a number{advice}")
    return [row for row in rows if row]


def in_own_units(
    system: System, rows: Sequence[Row], place: str = "sweep"
) -> list[dict[str, Value]]:
    """The rows with each number that has a unit in that of its variable, as bare ones are.

    InputError, which `place` begins, at the first one that is in a unit of something else.
    """
    return [
        {key: _in_own_unit(system, key, value, f"{place}: {key}") for key, value in row.items()}
        for row in rows
    ]


def _in_own_unit(system: System, place: str, value: Any, label: str) -> Any:
    """The value of a place as a bare number, where it has a unit; `label` begins the message."""
    quantity = as_quantity(value)
    if quantity is None:
        return value
    if place in TIMES:
        return in_seconds(in_nanoseconds(label, quantity, zero=True, low=-LONGEST))
    if place in system.inputs:
        unit = system.inputs[place].unit
        return in_unit(label, quantity, unit) if unit else value
    port = _port(system, place)
    interface = system.component(port.component, place).interface if port else None
    variable = interface.sample(port.variable) if port and interface else None
    if isinstance(value, str) and (variable is None or variable.kind == "String"):
        return value
    if interface is None:
        raise InputError(f"{label} = {quantity}: must have no unit")
    return in_own_unit(interface, label, variable.name, quantity) if variable else value


def overrides_of(system: System, rows: Sequence[Row]) -> list[dict[str, Value]]:
    """The rows as overrides of the system; InputError where the first one does not fit."""
    overrides = [_with_units(system, row) for row in rows]
    system.with_overrides(as_overrides(overrides[0], "sweep: {place}"))
    return overrides


def _with_units(system: System, row: Row) -> dict[str, Value]:
    """The overrides of a row, with their units where its FMU may have the variable in another."""
    swapped = {c.name for c in system.components if f"components.{c.name}.fmu" in row}
    overrides = dict(row)
    if not swapped:
        return overrides
    for place, value in row.items():
        port, unit = _port(system, place), unit_of(system, place)
        if port and port.component in swapped and unit and isinstance(value, float | int):
            overrides[place] = str(Quantity(float(value), unit))
    return overrides


def unit_of(system: System, place: str) -> str | None:
    """The unit in which the values of a place are; None where they have none."""
    if place in system.inputs:
        unit = system.inputs[place].unit
        return unit.name if unit else None
    port = _port(system, place)
    if port is None:
        return "s" if place in TIMES else None
    variable = system.component(port.component, place).interface.sample(port.variable)
    return variable.unit if variable else None


def _plain(place: str, value: Any) -> Value | None:
    """A value without NumPy's types, a time like "1/30" in s; None where there is none."""
    plain_value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if type(plain_value).__name__ == "NAType" or plain_value is None or plain_value == "":
        return None
    if plain_value != plain_value:  # NaN
        return None
    is_fraction = isinstance(plain_value, Fraction) or "/" in str(plain_value)
    if is_fraction and place in TIMES:
        return in_seconds(in_nanoseconds(f"sweep: {place}", plain_value, zero=True, low=-LONGEST))
    return plain_value  # type: ignore[no-any-return]


def _port(system: System, place: str) -> Port | None:
    """The variable of a place, if it is the place of a value of one."""
    parsed = parse_place([c.name for c in system.components], place, f"sweep: {place}")
    return Port(parsed.component, parsed.name) if parsed.is_value else None
