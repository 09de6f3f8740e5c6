"""A table of runs: what varied and what came out, with the unit of each column.

As text, HTML and JSON, as a table of pandas or xarray, and written to a file by table_files.py. Of
a study of the step size it says how the metrics tend to those of the finest step: convergence.py.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from math import isnan
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError, choices, nearest
from ..base.text import columns, counted, on_a_screen, significant
from ..interface.fmi_types import Value
from ..metrics.metric import Metric
from ..tables.column import head_of
from .convergence import Convergence, convergence_of
from .rows import Row
from .signal_store import RUN, TIME, Recorded, dimension
from .table_files import cell_of, write_table

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

STATISTICS = ("least", "p5", "median", "p95", "greatest", "mean")
"""The statistics of a metric, and how many runs have one."""

MAX_VARIED_NAMES = 4
"""Places that vary which the repr() of a table names."""

MAX_HTML_ROWS = 10
"""Rows of the table that its HTML shows."""

STEP = "experiment.step"

ENDED_AT = "ended at"


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of the run with an index: the metrics by column, or the error, one line.

    ended_at is the time in s of its end where an FMU asked for that before the stop time.
    """

    index: int
    metrics: Mapping[str, Value | None]
    error: str | None = None
    ended_at: float | None = None


@dataclass(frozen=True, repr=False)
class Table:
    """The table of a sweep: columns of equal length by name, a row for each run, in order.

    In addition to the varied values and the metrics there are the columns `index`, `error`, and
    ENDED_AT. `error` is one line of a run that failed; ENDED_AT is the time in s at which an FMU
    ended a run before its stop time.
    """

    columns: Mapping[str, Sequence[Any]] = field(hash=False)
    """The values by the name of the column; None where there is none."""
    varied: tuple[str, ...]
    """The names of the columns that vary."""
    metrics: tuple[str, ...]
    """The names of the columns of metrics."""
    units: Mapping[str, str | None] = field(hash=False)
    """The units of the columns, of metrics those of SI; None where they have none."""
    measured: tuple[Metric, ...] = ()
    """The metrics whose columns there are."""
    labels: Any = field(default=None, compare=False, repr=False)
    """The index of the pandas DataFrame whose rows these are; None of other rows."""
    signals: Recorded | None = field(default=None, compare=False, repr=False)
    """Whole signals of the runs, which to_xarray() has, where they were kept."""

    def __len__(self) -> int:
        return len(self.columns["index"])

    def __getitem__(self, name: str) -> npt.NDArray[np.float64]:
        """A column as numbers.

        Args:
            name: The name of the column.

        Returns:
            The values of the shape (runs,), in the unit of `units`; NaN where there is none.

        Raises:
            InputError: There is no such column.
        """
        if name not in self.columns:
            advice = nearest(name, [*self.varied, *self.metrics])
            raise InputError(f"{name!r}: no such column of the sweep; {advice}")
        numbers = [
            np.nan if value is None or isinstance(value, str) else float(value)
            for value in self.columns[name]
        ]
        return np.array(numbers)

    def __repr__(self) -> str:
        """How many runs there are, what varied, what failed, and a line for each metric."""
        first, *lines = as_text(self).splitlines()
        varied = f"  varied: {choices(self.varied, MAX_VARIED_NAMES)}"
        return on_a_screen([f"Table of {first}", varied, *(f"  {line}" for line in lines)])

    def _repr_html_(self) -> str:
        """The same and the first rows, as notebooks show them."""
        return as_html(self)

    def _ipython_key_completions_(self) -> list[str]:
        """The names of columns, for Tab behind a bracket in a notebook."""
        return [*self.columns]

    @property
    def ended_early(self) -> dict[int, float]:
        """When the runs ended that an FMU ended before their stop time, in s, by index."""
        times = self.columns.get(ENDED_AT, ())
        return {i: time for i, time in enumerate(times) if time is not None}

    @property
    def errors(self) -> dict[int, str]:
        """What became of the runs that failed, by index."""
        return {i: e for i, e in enumerate(self.columns["error"]) if e is not None}

    def shown(self, column: str) -> tuple[str, float, str]:
        """How text and pictures show a column.

        Args:
            column: The name of the column.

        Returns:
            Its title, the factor that its values are shown by, and their unit then.
        """
        for metric in self.measured:
            if column in metric.columns:
                return metric.column_title(column), metric.factor, metric.display_unit
            if column == metric.name:
                return metric.title, metric.factor, metric.display_unit
        unit = self.units.get(column)
        return column, 1.0, "" if unit in (None, "1") else str(unit)

    def summary(self) -> dict[str, dict[str, float | int | None]]:
        """Sum up each metric over the runs.

        Returns:
            By column of a metric, in how many `runs` it is finite, and its STATISTICS in its unit.
        """
        statistics: dict[str, dict[str, float | int | None]] = {}
        for name in self.metrics:
            finite = self[name][np.isfinite(self[name])]
            statistics[name] = {"runs": len(finite), **dict.fromkeys(STATISTICS)}
            if len(finite):
                percentiles = np.percentile(finite, (5.0, 50.0, 95.0))
                values = (finite.min(), *percentiles, finite.max(), finite.mean())
                statistics[name] |= zip(STATISTICS, map(float, values), strict=True)
        return statistics

    def to_pandas(self) -> pd.DataFrame:
        """The table as one of pandas.

        Returns:
            A DataFrame, under the index of the one whose rows these are, if it is one. The units
            are in its `attrs`.

        Raises:
            InputError: pandas is not installed.
        """
        pandas = extra_module("pandas", "it holds tables", "pandas")
        frame = pandas.DataFrame({name: list(values) for name, values in self.columns.items()})
        frame.attrs["units"] = dict(self.units)
        numbered: pd.DataFrame = frame.set_index("index")
        return numbered if self.labels is None else numbered.set_axis(self.labels)

    def to_xarray(self) -> xr.Dataset:
        """The table and the signals of the runs as a data set of xarray.

        Returns:
            A Dataset over run, time and finger, with `units` and `long_name`. What varied are
            coordinates of the runs. Entries of a metric, and elements of an array of signals, are
            along a dimension; what there is none of is NaN.

        Raises:
            InputError: xarray is not installed.
        """
        xarray = extra_module("xarray", "it makes the data set", "xarray")
        data: xr.Dataset = xarray.Dataset(coords={RUN: self.columns["index"]})
        for name, column in self.columns.items():
            if name not in (*self.metrics, "index", "error"):
                data.coords[name] = RUN, _numbers_or_texts(column), self._attributes(name)
        for metric in self.measured:
            _add_metric(data, self, metric)
        for name in self.metrics:
            if name.partition("[")[0] not in data:
                data[name] = RUN, self[name], self._attributes(name)
        data["error"] = RUN, [error or "" for error in self.columns["error"]]
        if self.signals:
            _add_signals(data, self.signals)
        return data

    def _attributes(self, name: str) -> dict[str, str]:
        """The unit of a column, if it has one, as xarray has it."""
        unit = self.units.get(name)
        return {"units": unit} if unit else {}

    def write(self, path: str | Path) -> None:
        """Write the table in one piece; equal tables make equal bytes.

        Args:
            path: The file, .csv, with the unit of a column in brackets in its head, or .parquet,
                with the unit in the metadata of a field.

        Raises:
            InputError: The suffix is another one, pyarrow is needed and not installed, or the file
                cannot be written.
        """
        write_table(Path(path), self.columns, self.units)


def _numbers_or_texts(column: Sequence[Any]) -> npt.NDArray[Any]:
    """A column as numbers, NaN where there is none, or as texts, "" where there is none."""
    if any(isinstance(value, str) for value in column):
        texts = ["" if value is None else str(value) for value in column]
        return np.array(texts)
    if all(isinstance(value, int) for value in column):  # and Booleans
        return np.array(column)
    numbers = [np.nan if value is None else float(value) for value in column]
    return np.array(numbers)


def _add_metric(data: xr.Dataset, table: Table, metric: Metric) -> None:
    """Add what there is of a metric, of several entries along a dimension."""
    present = [name for name in metric.columns if name in table.columns]
    if not present:
        return
    attributes = {"long_name": metric.title}
    if metric.unit:
        attributes["units"] = metric.unit
    if not metric.entries:
        data[metric.name] = RUN, table[metric.name], attributes
        return
    dimension_name, coordinates = dimension(metric)
    no_values = np.full(len(table), np.nan)
    columns = [table[name] if name in present else no_values for name in metric.columns]
    data.coords[dimension_name] = dimension_name, list(coordinates)
    data[metric.name] = (RUN, dimension_name), np.stack(columns, axis=1), attributes


def _add_signals(data: xr.Dataset, recorded: Recorded) -> None:
    """Add the signals of all runs, which are read here."""
    data.coords[TIME] = TIME, recorded.time, {"units": "s", "long_name": TIME}
    for name, array in recorded.store.arrays.items():
        if array.dimension and array.dimension not in data.coords:
            data.coords[array.dimension] = [*range(1, len(array.signals) + 1)]
        attributes = {"units": array.unit, "long_name": array.description}
        attributes = {key: text for key, text in attributes.items() if text}
        values = recorded.store.column(name, len(data[RUN]))
        data[name] = array.dimensions, values, attributes


def table_of(
    rows: Sequence[Row],
    outcomes: Sequence[Outcome],
    units: Mapping[str, str | None],
    metrics: Sequence[Metric],
    labels: Any = None,
    seeds: Sequence[Mapping[str, int]] = (),
    signals: Recorded | None = None,
) -> Table:
    """The table of rows and what came of each; `units` are those of the places that vary.

    `labels` are as those of a Table; where they are whole numbers or texts, `index` has them.
    `seeds` of the runs are columns, and vary nothing.
    """
    varied = tuple(dict.fromkeys(place for row in rows for place in row))
    measured = tuple(dict.fromkeys(name for outcome in outcomes for name in outcome.metrics))
    seeded = dict.fromkeys(place for of_run in seeds for place in of_run)
    all_units = dict(units)
    columns: dict[str, Sequence[Any]] = {"index": _index(labels, len(rows))}
    for place in varied:
        columns[place] = [row.get(place) for row in rows]
    for place in seeded:
        columns[place] = [
            row.get(place, of_run.get(place)) for row, of_run in zip(rows, seeds, strict=True)
        ]
    for name in measured:
        columns[name] = [outcome.metrics.get(name) for outcome in outcomes]
    ends = [outcome.ended_at for outcome in outcomes]
    if any(end is not None for end in ends):
        columns[ENDED_AT] = ends
        all_units[ENDED_AT] = "s"
    columns["error"] = [outcome.error for outcome in outcomes]
    unit_of_metric = {metric.name: metric.unit for metric in metrics}
    for name in measured:
        all_units[name] = unit_of_metric.get(name.partition("[")[0])
    return Table(columns, varied, measured, all_units, tuple(metrics), labels, signals)


def _index(labels: Any, row_count: int) -> Sequence[Any]:
    """The labels where a file can have them; else the numbers of the rows."""
    values = [] if labels is None else labels.tolist()
    types = {type(value) for value in values}
    return values if types in ({int}, {str}) else list(range(row_count))


def is_study(table: Table) -> bool:
    """True if the communication step is all that varies, and there are several."""
    return table.varied == (STEP,) and len(set(table.columns[STEP])) == len(table) > 1


def convergence(table: Table) -> Mapping[str, Convergence]:
    """How each metric of a study of the step tends to that of the finest, by column."""
    rising = np.argsort(table[STEP])
    steps = table[STEP][rising].tolist()
    study = {}
    for name in table.metrics:
        values = table[name][rising].tolist()
        results = [None if isnan(value) else value for value in values]
        study[name] = convergence_of(steps, results)
    return study


def as_json(table: Table) -> dict[str, Any]:
    """The object of `sweep --json`: the summary of each metric, and the orders of a study."""
    study = convergence(table) if is_study(table) else {}
    orders = {name: of_metric._asdict() for name, of_metric in study.items()}
    return {
        "runs": len(table),
        "failed": len(table.errors),
        "errors": {str(i): text for i, text in table.errors.items()},
        "ended_early": {str(i): time for i, time in table.ended_early.items()},
        "varied": list(table.varied),
        "metrics": table.summary(),
        "convergence": orders,
        "units": dict(table.units),
    }


def as_text(table: Table) -> str:
    """How many runs there are, what failed, and a line for each metric."""
    rows = _study_rows(table) if is_study(table) else _statistics(table)
    return "\n".join([*_heads(table), *columns(rows, (0, 1))])


def as_html(table: Table) -> str:
    """The same for a notebook, and the first rows of the table."""
    from ..report.html_tables import text_table  # only here: it takes time to load

    summary, *failures = (f"{escape(line)}<br>" for line in _heads(table))
    rows = _study_rows(table) if is_study(table) else _statistics(table)
    names = [name for name in table.columns if name != "error" or table.errors]
    heads = [head_of(name, table.units.get(name)) for name in names]
    row_count = min(MAX_HTML_ROWS, len(table))
    cells = [[_for_the_eye(table.columns[name][i]) for name in names] for i in range(row_count)]
    return (
        f"<p><b>{summary}</b>{''.join(failures)}</p>{text_table(rows)}"
        f"<details><summary>the first {counted(len(cells), 'row')}</summary>"
        f"{text_table([heads, *cells])}</details>"
    )


def _for_the_eye(value: Any) -> str:
    """A value of the table in as many digits as one reads."""
    if isinstance(value, float):
        return significant(value)
    return "" if value is None else str(cell_of(value))


def _heads(table: Table) -> list[str]:
    """How many runs there are, and the first that failed."""
    early = f", {len(table.ended_early)} ended early by an FMU" if table.ended_early else ""
    lines = [f"{counted(len(table), 'run')}, {len(table.errors)} failed{early}"]
    for index, error in list(table.errors.items())[:1]:
        lines.append(f"the first that failed, {index}: {error}")
    return lines


def _statistics(table: Table) -> list[list[str]]:
    """A head and a row for each metric: its title, unit, count and STATISTICS."""
    rows = [["", "", "runs", *STATISTICS]]
    for name, row in table.summary().items():
        title, factor, unit = table.shown(name)
        numbers = [_scaled(row[head], factor) for head in STATISTICS]
        rows.append([title, unit, str(row["runs"]), *numbers])
    return rows


def _study_rows(table: Table) -> list[list[str]]:
    """The errors of each metric against the finest step, by step, and the observed order."""
    study = convergence(table)
    first_metric = next(iter(study.values()))
    finest_ms = 1e3 * min(table[STEP])
    heads = [f"{1e3 * step:.4g} ms" for step in first_metric.steps]
    rows = [[f"error against {finest_ms:g} ms", "", "value", *heads, "order"]]
    for name, of_metric in study.items():
        title, factor, unit = table.shown(name)
        numbers = [_scaled(value, factor) for value in (of_metric.finest, *of_metric.errors)]
        rows.append([title, unit, *numbers, significant(of_metric.order, 3, "-")])
    return rows


def _scaled(value: float | None, factor: float) -> str:
    """A number times a factor, as the table shows it."""
    return significant(None if value is None else factor * value, 4, "-")
