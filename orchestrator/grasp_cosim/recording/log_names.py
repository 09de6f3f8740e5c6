"""What another logger calls the signals of a system: a map from a TOML file.

    [time]
    column = "t"             # by default time
    unit = "ms"              # by default what stands behind the name, else s
    offset = 0.25            # s from the time of the log to that of the run; "fit": found

    [signals]
    "plant.position[1]" = "x_right"
    "controller.force[1]" = { column = "F cmd", unit = "mN", factor = -1.0, offset = 0.0 }

The value of a signal is factor * column + offset, in the unit.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from ..base.checks import as_table, check_keys, is_number, text, toml_table
from ..base.errors import InputError
from ..base.si_units import known_unit

FIT = "fit"


@dataclass(frozen=True, slots=True)
class LogColumn:
    """The column that has a signal, and the unit of factor * column + offset; None: as it says."""

    column: str
    unit: str | None = None
    factor: float = 1.0
    offset: float = 0.0


@dataclass(frozen=True, slots=True)
class LogNames:
    """The map of a log. offset is in s, None where it is to be found; columns are by signal."""

    file: str = ""
    time: str = "time"
    time_unit: str | None = None
    offset: float | None = 0.0
    columns: Mapping[str, LogColumn] = field(default_factory=dict)


AS_THEY_ARE = LogNames()


def read_log_names(path: Path) -> LogNames:
    """Read what another logger calls the signals of a system, from a TOML file.

    Args:
        path: The file.

    Returns:
        The columns by signal, and those of the time.

    Raises:
        InputError: The file cannot be read, or an entry is wrong.
    """
    file = toml_table(path, "map of names")
    check_keys(path.name, file, ("time", "signals"))
    time = as_table(f"{path.name}: [time]", file.get("time", {}))
    check_keys(f"{path.name}: [time]", time, ("column", "unit", "offset"))
    signals = as_table(f"{path.name}: [signals]", file.get("signals", {}))
    offset = time.get("offset", 0.0)
    if offset != FIT and not _finite(offset):
        must = f'must be a number of s, or "{FIT}"'
        raise InputError(f"{path.name}: time.offset = {offset!r}: {must}")
    return LogNames(
        str(path),
        text(f"{path.name}: time.column", time.get("column", "time"), "the name of a column"),
        _unit(f"{path.name}: time.unit", time.get("unit")),
        None if offset == FIT else float(offset),
        {name: _column(f"{path.name}: signals.{name}", entry) for name, entry in signals.items()},
    )


def _column(place: str, entry: Any) -> LogColumn:
    if isinstance(entry, str):
        return LogColumn(entry)
    table = as_table(place, entry)
    check_keys(place, table, ("column", "unit", "factor", "offset"))
    for key in ("factor", "offset"):
        if not _finite(table.get(key, 1.0)):
            raise InputError(f"{place}: {key} = {table[key]!r}: must be a number")
    return LogColumn(
        text(f"{place}: column", table.get("column"), "the name of a column"),
        _unit(f"{place}: unit", table.get("unit")),
        float(table.get("factor", 1.0)),
        float(table.get("offset", 0.0)),
    )


def _finite(value: Any) -> bool:
    return is_number(value) and math.isfinite(value)


def _unit(place: str, unit: Any) -> str | None:
    if unit is None:
        return None
    name = text(place, unit, "the name of a unit, like 'mm'")
    if known_unit(name) is None:
        raise InputError(f"{place} = {name!r}: is no known unit; must be one like 'mm'")
    return name
