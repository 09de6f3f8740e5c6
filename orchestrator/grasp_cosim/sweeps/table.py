"""A table of runs: what varied and what came out, with the unit of each column; CSV and Parquet."""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from one_piece import in_one_piece

from ..base.checks import extra_module
from ..base.errors import InputError, nearest
from ..metrics.metric import Metric
from .rows import Row
from .run import Outcome

if TYPE_CHECKING:
    import pandas as pd

STATISTICS = ("least", "p5", "median", "p95", "greatest", "mean")
"""The statistics of a metric, besides how many runs have one."""

SUFFIXES = (".csv", ".parquet")


@dataclass(frozen=True)
class Table:
    """Columns of equal length by name, None where there is no value; a row per run, in order.

    Beside what varied and what came out there are `index` and `error`, one line where a run failed.
    `units` are those of SI in which the columns are, None where they have none.
    """

    columns: Mapping[str, Sequence[Any]]
    varied: tuple[str, ...]
    metrics: tuple[str, ...]
    units: Mapping[str, str | None]
    measured: tuple[Metric, ...] = ()
    """The metrics whose columns there are."""

    def __len__(self) -> int:
        return len(self.columns["index"])

    def __getitem__(self, name: str) -> npt.NDArray[np.float64]:
        """A column as numbers, NaN where there is none; InputError where there is no such one."""
        if name not in self.columns:
            found = nearest(name, [*self.varied, *self.metrics])
            raise InputError(f"{name!r}: no such column of the sweep; {found}")
        values = self.columns[name]
        return np.array([np.nan if v is None or isinstance(v, str) else float(v) for v in values])

    @property
    def errors(self) -> dict[int, str]:
        """What became of the runs that failed, by index."""
        return {i: e for i, e in enumerate(self.columns["error"]) if e is not None}

    def shown(self, column: str) -> tuple[str, float, str]:
        """Title, factor and unit in which text and pictures show a column."""
        metric = next((m for m in self.measured if column in (m.name, *m.columns)), None)
        if metric:
            title = metric.column_title(column) if column in metric.columns else metric.title
            return title, metric.factor, metric.display_unit
        unit = self.units.get(column)
        return column, 1.0, "" if unit in (None, "1") else str(unit)

    def summary(self) -> dict[str, dict[str, float | int | None]]:
        """For each metric: how many runs have a finite one, its least and greatest, its mean, and
        the values below which 5 %, 50 % and 95 % lie.
        """
        return {name: _summarized(self[name]) for name in self.metrics}

    def to_pandas(self) -> pd.DataFrame:
        """The table as a DataFrame, with the units in its `attrs`; InputError without pandas."""
        pandas = extra_module("pandas", "it holds tables", "pandas")
        frame = pandas.DataFrame({name: list(values) for name, values in self.columns.items()})
        frame.attrs["units"] = dict(self.units)
        return frame.set_index("index")

    def write(self, path: str | Path) -> None:
        """Write CSV, or Parquet by its suffix, in one piece; equal tables make equal bytes.

        The unit of a column is in brackets in the head of CSV, and in the metadata of a field of
        Parquet. InputError for another suffix, or without pyarrow.
        """
        path = Path(path)
        check_format(path)
        with in_one_piece(path) as part:
            (self._write_parquet if path.suffix == ".parquet" else self._write_csv)(part)

    def _write_csv(self, path: Path) -> None:
        units = {name: unit for name, unit in self.units.items() if unit}
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(f"{n} [{units[n]}]" if n in units else n for n in self.columns)
            for row in zip(*self.columns.values(), strict=True):
                writer.writerow(_cell(value) for value in row)

    def _write_parquet(self, path: Path) -> None:
        arrow, parquet = _pyarrow()
        arrays = [_array(arrow, name, column) for name, column in self.columns.items()]
        fields = [
            arrow.field(name, array.type, metadata={"unit": self.units.get(name) or ""})
            for name, array in zip(self.columns, arrays, strict=True)
        ]
        parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), path)


def made(
    rows: Sequence[Row],
    outcomes: Sequence[Outcome],
    units: Mapping[str, str | None],
    metrics: Sequence[Metric],
) -> Table:
    """The table of rows and what came of each; `units` are those of the places that vary."""
    varied = tuple(dict.fromkeys(place for row in rows for place in row))
    measured = tuple(dict.fromkeys(name for o in outcomes for name in o.metrics))
    columns: dict[str, Sequence[Any]] = {"index": [o.index for o in outcomes]}
    columns |= {place: [row.get(place) for row in rows] for place in varied}
    columns |= {name: [o.metrics.get(name) for o in outcomes] for name in measured}
    columns["error"] = [o.error for o in outcomes]
    of_metrics = {c: m.unit for m in metrics for c in (m.name, *m.columns)}
    found = {
        name: of_metrics.get(name, of_metrics.get(name.partition("[")[0])) for name in measured
    }
    return Table(columns, varied, measured, {**units, **found}, tuple(metrics))


def check_format(path: Path) -> None:
    """InputError where a table cannot be written to a file of that name."""
    if path.suffix not in SUFFIXES:
        raise InputError(f"{path}: must end in {' or '.join(SUFFIXES)}")
    if path.suffix == ".parquet":
        _pyarrow()


def _pyarrow() -> tuple[Any, Any]:
    names = ("pyarrow", "pyarrow.parquet")
    arrow, parquet = (extra_module(n, "it writes Parquet", "parquet") for n in names)
    return arrow, parquet


def _cell(value: Any) -> Any:
    if isinstance(value, bool):
        return str(value).lower()
    return repr(value) if isinstance(value, float) else value


def _array(arrow: Any, name: str, column: Sequence[Any]) -> Any:
    """The column with the narrowest type that holds all values; numbers where there is none."""
    there = [value for value in column if value is not None]
    kinds = {type(value) for value in there}
    if name == "error" or str in kinds:
        return arrow.array([v if v is None else str(v) for v in column], type=arrow.string())
    if kinds in ({bool}, {int}):
        return arrow.array(column)
    numbers = [None if value is None else float(value) for value in column]
    return arrow.array(numbers, type=arrow.float64())


def _summarized(values: npt.NDArray[np.float64]) -> dict[str, float | int | None]:
    there = values[np.isfinite(values)]
    if not len(there):
        return {"runs": 0, **dict.fromkeys(STATISTICS)}
    found = (there.min(), *np.percentile(there, (5.0, 50.0, 95.0)), there.max(), there.mean())
    return {"runs": len(there), **dict(zip(STATISTICS, map(float, found), strict=True))}
