"""What varies: a row for each run, values by their places in the system file, in SI units."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ..base.checks import point_advice
from ..base.errors import InputError
from ..base.si_units import known_unit
from ..base.text import counted, on_one_line
from ..interface.interface import Value
from ..interface.units import IDENTITY, Conversion
from ..system.description import System
from ..system.parts import Port
from ..system.structure import parameter_in_si
from ..system.times import LONGEST, in_nanoseconds, in_seconds
from ..system.toml import place_of, plain
from ..tables.column import Column, Table
from ..tables.table import read_table
from ..tables.text import is_number

Row = Mapping[str, Value]

TIMES = tuple(f"experiment.{key}" for key in ("start", "step", "stop"))
"""The places of times, which may be fractions like 1/30."""

STOP = "experiment.stop"

MOST = 100_000
"""Runs of a sweep at most."""

FEW = 60
"""Characters of a value in a message."""

ROWS = "must be rows, mappings of places to values, or columns by place, or a data frame"

FORM = "PLACE=START:END:COUNT or PLACE=VALUE,VALUE,..."


def grid(varied: Mapping[str, Iterable[Value] | Value]) -> list[dict[str, Value]]:
    """A row for every combination of the values of each place; the last place varies fastest.

    A single value is that of each row.
    """
    values = [_values(each) for each in varied.values()]
    return [dict(zip(varied, row, strict=True)) for row in itertools.product(*values)]


def varied(text: str) -> tuple[str, list[Value]]:
    """The place and the values of a text in the FORM; InputError where it is none."""
    place, equals, said = text.partition("=")
    where = f"--vary {text!r}"
    if not equals or place.startswith(".") or not place:
        raise InputError(f"{where}: must be {FORM}")
    bounds = said.split(":")
    if len(bounds) == 1:
        values = [plain(part.strip()) for part in said.split(",")]
        if "" in values:
            raise InputError(f"{where}: an empty value; must be {FORM}")
        return place, values
    try:
        start, end, count = float(bounds[0]), float(bounds[1]), int(bounds[2])
        if len(bounds) > 3 or not np.isfinite([start, end]).all():
            raise ValueError
    except (ValueError, IndexError) as error:
        raise InputError(f"{where}: must be {FORM}, with finite numbers") from error
    if not 2 <= count <= MOST:
        raise InputError(f"{where}: {count} values; must be 2 to {MOST}")
    return place, [float(value) for value in np.linspace(start, end, count)]


def as_rows(given: Any, alike: bool = False) -> list[dict[str, Value]]:
    """The rows of a table, read or in a file, of columns by place, of a data frame, or of rows.

    A data frame is one of pandas or polars, a table of pyarrow, a structured array of NumPy, or a
    Dataset of xarray. Beside columns a single value is that of each row. A cell that is None, NaN
    or empty leaves that place as the system has it. InputError where these are no rows, nothing
    varies, unless they may be `alike`, or there are more than MOST.
    """
    if isinstance(given, str | Path):
        given = read_rows(Path(given))
    rows = [*map(_row, count(), _listed(given))]
    if not 1 <= len(rows) <= MOST:
        raise InputError(f"sweep: {len(rows)} rows; must be 1 to {MOST}")
    if not (alike or any(rows)):
        raise InputError("sweep: nothing varies; the rows must have at least one column")
    return rows


def labels_of(given: Any) -> Any:
    """The index of a pandas DataFrame, under which the runs come back; None of other rows."""
    return given.index if hasattr(given, "iloc") else None


def _listed(given: Any) -> Iterable[Any]:
    """What should be rows, of whatever has them."""
    if isinstance(given, Table):
        return _rows_in(given)
    if hasattr(given, "to_dataframe"):  # a Dataset of xarray, whose coordinates vary as well
        given = given.to_dataframe().reset_index()
    if hasattr(given, "to_dicts"):
        return given.to_dicts()  # type: ignore[no-any-return]  # of polars
    if hasattr(given, "to_pylist"):
        return given.to_pylist()  # type: ignore[no-any-return]  # of pyarrow
    if hasattr(given, "iloc"):  # of pandas
        if given.ndim == 1:
            raise InputError("sweep: a Series; must be a DataFrame, with a column for each place")
        return given.to_dict("records")  # type: ignore[no-any-return]
    if names := getattr(getattr(given, "dtype", None), "names", None):
        return [dict(zip(names, row, strict=True)) for row in given.ravel().tolist()]
    if isinstance(given, Mapping):
        return _of_columns(given)
    if isinstance(given, Iterable):
        return given
    raise InputError(f"sweep: rows = {_short(given)}: {ROWS}")


def _of_columns(given: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The rows of columns by place, a single value being that of each row."""
    columns = {place: _values(column) for place, column in given.items()}
    long = {place: len(columns[place]) for place in columns if not _single(given[place])}
    if len({*long.values()}) > 1:
        said = ", ".join(f"{place} has {counted(n, 'value')}" for place, n in long.items())
        raise InputError(f"sweep: {said}; must all have as many, or a single one")
    length = next(iter(long.values()), 1)
    whole = [columns[place] if place in long else columns[place] * length for place in columns]
    return [dict(zip(columns, row, strict=True)) for row in zip(*whole, strict=True)]


def _single(given: Any) -> bool:
    """True for one value, where several may be, too."""
    listed = isinstance(given, Iterable) and not isinstance(given, str)
    return not listed or getattr(given, "ndim", 1) == 0


def _values(given: Any) -> list[Any]:
    """The values of a column, or the single one."""
    return [given] if _single(given) else list(given)


def _row(number: int, given: Any) -> dict[str, Value]:
    """A row by place, without the places that it leaves; InputError where it is none."""
    if not isinstance(given, Mapping):
        raise InputError(f"sweep: row {number} = {_short(given)}: {ROWS}")
    row = {}
    for place, value in given.items():
        if not isinstance(place, str):
            raise InputError(f"sweep: {place!r}: must be a place in the system, a text")
        if (found := _plain(place, value)) is not None:
            row[place] = found
    return row


def _short(value: Any) -> str:
    """A value in a message."""
    text = on_one_line(repr(value))
    return f"{text[:FEW]}..." if len(text) > FEW else text


def read_rows(path: Path) -> Table:
    """The table of rows in a file, which may be a stream; InputError where it is damaged."""
    return read_table(path, f"--table {path}")


def _rows_in(table: Table) -> list[dict[str, Value]]:
    """The rows of a table whose head has places, with a unit in brackets if it is not of SI.

    A cell that is empty has no value. InputError at the first one that is not as it must be.
    """
    rows: list[dict[str, Value]] = [{} for _ in range(table.count)]
    columns = [column for column in table.columns if column.name]
    for column in columns:
        table.named(column.name)  # there is one alone
        to_si = _to_si(column)
        for row, cell in enumerate(column.texts()):
            text = cell.strip()
            if not text:
                continue
            if to_si == IDENTITY:
                rows[row][column.name] = plain(text)
            elif is_number(text):
                rows[row][column.name] = to_si(float(text))
            else:
                advice = point_advice(text)
                raise InputError(f"{column.place(row)} = {text!r}: must be a number{advice}")
    return [row for row in rows if row]


def check_units(system: System, table: Table) -> None:
    """InputError at the first column of a table that is in a unit of something else than its place.

    What has no unit in the system takes the values as they are in SI units.
    """
    for column in table.columns:
        unit = unit_of(system, column.name) if column.unit else None
        if unit and known_unit(unit):
            column.to_unit(unit)


def settings_of(system: System, rows: Sequence[Row]) -> list[dict[str, Value]]:
    """The rows in the units of the system's FMUs; InputError where the first one does not fit."""
    back: dict[str, Any] = {}
    for place in {place for row in rows for place in row}:
        to_si = _in_si(system, place)
        back[place] = IDENTITY if to_si == IDENTITY else to_si.back
    found = [{p: _converted(v, back[p]) for p, v in row.items()} for row in rows]
    system.with_settings(found[0], "sweep: {}".format)
    return found


def unit_of(system: System, place: str) -> str | None:
    """The SI unit in which the values of a place are; None where they have none."""
    if place in system.inputs:
        connector_unit = system.inputs[place].unit
        return connector_unit.base if connector_unit else None
    port = _port(system, place)
    if port is None:
        return "s" if place in TIMES else None
    interface = system.component(port.component, place).interface
    variable = interface.by_name.get(port.variable)
    unit = interface.unit(variable) if variable else None
    if unit and not unit.si:
        return unit.base
    return variable.unit if variable else None


def _in_si(system: System, place: str) -> Conversion:
    """The conversion of the values of a place to SI base units."""
    if place in system.inputs:
        unit = system.inputs[place].unit
        return Conversion(unit.factor, unit.offset) if unit else IDENTITY
    port = _port(system, place)
    return parameter_in_si(system, place, port) if port else IDENTITY


def _to_si(column: Column) -> Conversion:
    """The conversion of the values of a column to SI base units; InputError where it has none."""
    if column.unit is None:
        return IDENTITY
    unit = known_unit(column.unit)
    if unit is None:
        raise InputError(
            f"{column.heading} = {column.head!r}: {column.unit!r} is no known unit; must be one, "
            "like mm"
        )
    return IDENTITY if unit.si else Conversion(unit.factor, unit.offset)


def _plain(place: str, value: Any) -> Value | None:
    """A value without NumPy's types, a time like "1/30" in s; None where there is none."""
    plain_value = value.tolist() if isinstance(value, np.ndarray | np.generic) else value
    if type(plain_value).__name__ == "NAType" or plain_value is None or plain_value == "":
        return None
    if plain_value != plain_value:
        return None
    is_fraction = isinstance(plain_value, Fraction) or "/" in str(plain_value)
    if is_fraction and place in TIMES:
        return in_seconds(in_nanoseconds(f"sweep: {place}", plain_value, zero=True, low=-LONGEST))
    return plain_value  # type: ignore[no-any-return]


def _converted(value: Value, change: Any) -> Value:
    changed: Value = value if change is IDENTITY else change(float(value))
    return changed


def _port(system: System, place: str) -> Port | None:
    """The variable of a place, if it is the place of a value of one."""
    entries = place_of([c.name for c in system.components], place, f"sweep: {place}")
    return Port(entries[1], entries[3]) if entries[2:3] == ("values",) else None
