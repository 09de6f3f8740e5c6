"""A table of runs: what varied and what came out, with the unit of each column.

As CSV and Parquet, as text and JSON. Of a study of the step size it says how metrics tend to those
of the finest step: three results with steps h1 < h2 < h3 that err by C h^p determine p (Roache,
Perspective: a method for uniform reporting of grid refinement studies, J. Fluids Engineering
116(3), 1994).
"""

from __future__ import annotations

import csv
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError, choices, nearest
from ..base.one_piece import in_one_piece
from ..base.text import columns, counted, on_a_screen, significant
from ..interface.fmi_types import Value
from ..metrics.metric import Metric
from .rows import Row
from .signal_store import RUN, TIME, Recorded, dimension

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

STATISTICS = ("least", "p5", "median", "p95", "greatest", "mean")
"""The statistics of a metric, besides how many runs have one."""

FEW, ROWS = 4, 10
"""So many places that vary are named in the repr() of a table, and rows are in its HTML."""

SUFFIXES = (".csv", ".parquet")

STEP = "experiment.step"

ENDED_AT = "ended at"

LOWEST, HIGHEST = 0.25, 4.0
"""Orders outside are none: the results do not settle, or what is seen is noise."""


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

    Beside what varied and what came out there are the columns `index`, `error`, one line where a
    run failed, and ENDED_AT, the time in s where an FMU ended a run before its stop time.
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
            found = nearest(name, [*self.varied, *self.metrics])
            raise InputError(f"{name!r}: no such column of the sweep; {found}")
        values = self.columns[name]
        return np.array([np.nan if v is None or isinstance(v, str) else float(v) for v in values])

    def __repr__(self) -> str:
        """How many runs there are, what varied, what failed, and a line for each metric."""
        first, *lines = as_text(self).splitlines()
        varied = f"  varied: {choices(self.varied, FEW)}"
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
        metric = next((m for m in self.measured if column in (m.name, *m.columns)), None)
        if metric:
            title = metric.column_title(column) if column in metric.columns else metric.title
            return title, metric.factor, metric.display_unit
        unit = self.units.get(column)
        return column, 1.0, "" if unit in (None, "1") else str(unit)

    def summary(self) -> dict[str, dict[str, float | int | None]]:
        """Sum up each metric over the runs.

        Returns:
            By column of a metric, in how many `runs` it is finite, and its STATISTICS in its unit.
        """
        found: dict[str, dict[str, float | int | None]] = {}
        for name in self.metrics:
            there = self[name][np.isfinite(self[name])]
            found[name] = {"runs": len(there), **dict.fromkeys(STATISTICS)}
            if len(there):
                middle = np.percentile(there, (5.0, 50.0, 95.0))
                values = (there.min(), *middle, there.max(), there.mean())
                found[name] |= zip(STATISTICS, map(float, values), strict=True)
        return found

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
        beside = {*self.metrics, "index", "error"}
        for name in (n for n in self.columns if n not in beside):
            data.coords[name] = RUN, _numbers_or_texts(self.columns[name]), self._about(name)
        for m in self.measured:
            _add_metric(data, self, m)
        for name in (n for n in self.metrics if n.partition("[")[0] not in data):
            data[name] = RUN, self[name], self._about(name)
        data["error"] = RUN, [error or "" for error in self.columns["error"]]
        if self.signals:
            _add_signals(data, self.signals)
        return data

    def _about(self, name: str) -> dict[str, str]:
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
        path = Path(path)
        check_format(path)
        with in_one_piece(path) as part:
            (self._write_parquet if path.suffix == ".parquet" else self._write_csv)(part)

    def _write_csv(self, path: Path) -> None:
        units = {name: f" [{unit}]" for name, unit in self.units.items() if unit}
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file, lineterminator="\n")
            writer.writerow(name + units.get(name, "") for name in self.columns)
            for row in zip(*self.columns.values(), strict=True):
                writer.writerow(_cell(value) for value in row)

    def _write_parquet(self, path: Path) -> None:
        arrow, parquet = _pyarrow()
        arrays = [_array(arrow, name, column) for name, column in self.columns.items()]
        fields = [
            arrow.field(name, array.type, metadata={"unit": self.units.get(name) or ""})
            for name, array in zip(self.columns, arrays, strict=True)
        ]
        with path.open("wb") as file:  # pyarrow closes its own when it likes; Windows minds
            parquet.write_table(arrow.table(arrays, schema=arrow.schema(fields)), file)


def _numbers_or_texts(column: Sequence[Any]) -> npt.NDArray[Any]:
    """A column as numbers, NaN where there is none, or as texts, "" where there is none."""
    if any(isinstance(value, str) for value in column):
        return np.array(["" if value is None else str(value) for value in column])
    if all(isinstance(value, int) for value in column):  # and Booleans
        return np.array(column)
    return np.array([np.nan if value is None else float(value) for value in column])


def _add_metric(data: xr.Dataset, table: Table, metric: Metric) -> None:
    """Add what there is of a metric, of several entries along a dimension."""
    there = [name for name in metric.columns if name in table.columns]
    if not there:
        return
    about = {"long_name": metric.title, **({"units": metric.unit} if metric.unit else {})}
    if metric.entries:
        along, places = dimension(metric)
        nothing = np.full(len(table), np.nan)
        columns = [table[name] if name in there else nothing for name in metric.columns]
        data.coords[along] = along, list(places)
        data[metric.name] = (RUN, along), np.stack(columns, axis=1), about
    else:
        data[metric.name] = RUN, table[metric.name], about


def _add_signals(data: xr.Dataset, recorded: Recorded) -> None:
    """Add the signals of all runs, which are read here."""
    data.coords[TIME] = TIME, recorded.time, {"units": "s", "long_name": TIME}
    for name, array in recorded.store.arrays.items():
        if array.dimension and array.dimension not in data.coords:
            data.coords[array.dimension] = [*range(1, len(array.signals) + 1)]
        about = {"units": array.unit, "long_name": array.description}
        whole = recorded.store.column(name, len(data[RUN]))
        data[name] = array.dimensions, whole, {key: text for key, text in about.items() if text}


def made(
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
    measured = tuple(dict.fromkeys(name for o in outcomes for name in o.metrics))
    columns: dict[str, Sequence[Any]] = {"index": _index(labels, len(rows))}
    columns |= {place: [row.get(place) for row in rows] for place in varied}
    seeded = dict.fromkeys(place for of_run in seeds for place in of_run)
    columns |= {p: [{**r, **s}.get(p) for r, s in zip(rows, seeds, strict=True)] for p in seeded}
    columns |= {name: [o.metrics.get(name) for o in outcomes] for name in measured}
    if any(o.ended_at is not None for o in outcomes):
        columns[ENDED_AT] = [o.ended_at for o in outcomes]
        units = {**units, ENDED_AT: "s"}
    columns["error"] = [o.error for o in outcomes]
    of_metrics = {m.name: m.unit for m in metrics}
    found = {name: of_metrics.get(name.partition("[")[0]) for name in measured}
    return Table(columns, varied, measured, {**units, **found}, tuple(metrics), labels, signals)


def _index(labels: Any, count: int) -> Sequence[Any]:
    """What a file has of the labels; the numbers of the rows, where it cannot have them."""
    listed = [] if labels is None else labels.tolist()
    kinds = {type(label) for label in listed}
    return listed if kinds in ({int}, {str}) else list(range(count))


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


class Convergence(NamedTuple):
    """How far a metric is from that of the finest step, for each of the coarser `steps` in s.

    They are in its SI unit. order is that of the three finest steps; None where they show none.
    """

    steps: tuple[float, ...]
    finest: float | None
    errors: tuple[float | None, ...]
    order: float | None


def is_study(table: Table) -> bool:
    """True if the communication step is all that varies, and there are several."""
    return table.varied == (STEP,) and len(set(table.columns[STEP])) == len(table) > 1


def convergence(table: Table) -> Mapping[str, Convergence]:
    """How each metric of a study of the step tends to that of the finest, by column."""
    rising = np.argsort(table[STEP])
    steps = table[STEP][rising]
    found = {}
    for name in table.metrics:
        values = [None if np.isnan(v) else float(v) for v in table[name][rising]]
        finest = values[0]
        errors = tuple(None if v is None or finest is None else v - finest for v in values[1:])
        order = observed_order(steps[:3].tolist(), values[:3]) if len(steps) > 2 else None
        found[name] = Convergence(tuple(map(float, steps[1:])), finest, errors, order)
    return found


def observed_order(steps: Sequence[float], results: Sequence[float | None]) -> float | None:
    """The p from LOWEST to HIGHEST of three results that err by C h^p, for rising steps h in s."""
    y_1, y_2, y_3 = results
    if y_1 is None or y_2 is None or y_3 is None or y_2 == y_1:
        return None
    h_1, h_2, h_3 = (h / steps[0] for h in steps)

    def excess(p: float) -> float:
        """Of (h3^p - h2^p) / (h2^p - h1^p), which rises with p, over what was seen."""
        ratio: float = (h_3**p - h_2**p) / (h_2**p - h_1**p)
        return ratio - (y_3 - y_2) / (y_2 - y_1)

    if not excess(LOWEST) <= 0.0 <= excess(HIGHEST):
        return None
    from scipy.optimize import brentq  # only here: it takes time to load

    return float(brentq(excess, LOWEST, HIGHEST))


def as_json(table: Table) -> dict[str, Any]:
    """The object of `sweep --json`: the summary of each metric, and the orders of a study."""
    study = convergence(table) if is_study(table) else {}
    return {
        "runs": len(table),
        "failed": len(table.errors),
        "errors": {str(i): text for i, text in table.errors.items()},
        "ended_early": {str(i): time for i, time in table.ended_early.items()},
        "varied": list(table.varied),
        "metrics": table.summary(),
        "convergence": {name: c._asdict() for name, c in study.items()},
        "units": dict(table.units),
    }


def as_text(table: Table) -> str:
    """How many runs there are, what failed, and a line for each metric."""
    rows = _study_rows(table) if is_study(table) else _statistics(table)
    return "\n".join([*_heads(table), *columns(rows, (0, 1))])


def as_html(table: Table) -> str:
    """The same for a notebook, and the first rows of the table."""
    from ..report.tables import text_table  # only here: it takes time to load

    first, *more = (f"{escape(line)}<br>" for line in _heads(table))
    rows = _study_rows(table) if is_study(table) else _statistics(table)
    shown = [name for name in table.columns if name != "error" or table.errors]
    heads = [f"{n} [{table.units[n]}]" if table.units.get(n) else n for n in shown]
    cells = [[_shown(table.columns[n][i]) for n in shown] for i in range(min(ROWS, len(table)))]
    return (
        f"<p><b>{first}</b>{''.join(more)}</p>{text_table(rows)}"
        f"<details><summary>the first {counted(len(cells), 'row')}</summary>"
        f"{text_table([heads, *cells])}</details>"
    )


def _shown(value: Any) -> str:
    """A value of the table for the eye."""
    if isinstance(value, float):
        return significant(value)
    return "" if value is None else str(_cell(value))


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
    found = convergence(table)
    first = next(iter(found.values()))
    finest = 1e3 * min(table["experiment.step"])
    heads = [f"{1e3 * step:.4g} ms" for step in first.steps]
    rows = [[f"error against {finest:g} ms", "", "value", *heads, "order"]]
    for name, c in found.items():
        title, factor, unit = table.shown(name)
        numbers = [_scaled(x, factor) for x in (c.finest, *c.errors)]
        rows.append([title, unit, *numbers, significant(c.order, 3, "-")])
    return rows


def _scaled(value: float | None, factor: float) -> str:
    return significant(None if value is None else factor * value, 4, "-")
