"""What varies: a row for each run, values by their places in the system file, in SI units."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Mapping, Sequence
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np

from ..base.checks import point_advice
from ..base.errors import InputError
from ..base.si_units import known_unit
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

MOST = 100_000
"""Runs of a sweep at most."""

FORM = "PLACE=START:END:COUNT or PLACE=VALUE,VALUE,..."


def grid(varied: Mapping[str, Iterable[Value]]) -> list[dict[str, Value]]:
    """A row for every combination of the values of each place; the last place varies fastest."""
    values = [list(each) for each in varied.values()]
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


def as_rows(given: Any) -> list[dict[str, Value]]:
    """The rows of a table, read or in a file, of columns by place, of a DataFrame, or of rows.

    A cell that is None, NaN or empty leaves that place as the system has it. InputError where
    nothing varies, or there are more than MOST rows.
    """
    if isinstance(given, str | Path):
        given = read_rows(Path(given))
    if isinstance(given, Table):
        rows = _rows_in(given)
    elif hasattr(given, "to_dict"):
        rows = given.to_dict("records")
    elif isinstance(given, Mapping):
        columns = [list(column) for column in given.values()]
        rows = [dict(zip(given, row, strict=True)) for row in zip(*columns, strict=True)]
    else:
        rows = [dict(row) for row in given]
    if not 1 <= len(rows) <= MOST:
        raise InputError(f"sweep: {len(rows)} rows; must be 1 to {MOST}")
    if not any(rows):
        raise InputError("sweep: nothing varies; the rows must have at least one column")
    plain_rows = [{place: _plain(place, value) for place, value in row.items()} for row in rows]
    return [{k: value for k, value in row.items() if value is not None} for row in plain_rows]


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
    plain_value = value.item() if isinstance(value, np.generic) else value
    if plain_value is None or plain_value == "" or plain_value != plain_value:
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
