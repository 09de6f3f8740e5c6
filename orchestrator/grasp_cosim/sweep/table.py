"""The runs of a study as a table, and as a Parquet file (pyarrow, in the extra `sweep`)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..checks import extra_module
from ..errors import InputError, nearest
from ..files import in_one_piece
from .run import Outcome
from .study import STATISTICS, Study

Column = Sequence[Any]


@dataclass(frozen=True)
class Table:
    """Columns of equal length by name, None where there is no value; a row per run, by index."""

    columns: Mapping[str, Column]
    parameters: tuple[str, ...]
    """The columns of what varied."""
    metrics: tuple[str, ...]
    """The columns of what came out."""

    def numbers(self, name: str) -> npt.NDArray[np.float64]:
        """A column as numbers, NaN where there is none; InputError where there is no such one."""
        if name not in self.columns:
            found = nearest(name, [*self.parameters, *self.metrics])
            raise InputError(f"{name!r}: no such column of the results; {found}")
        values = self.columns[name]
        return np.array([np.nan if v is None or isinstance(v, str) else float(v) for v in values])

    def summary(self) -> dict[str, dict[str, float | int | None]]:
        """For each metric: how many runs have a finite one, its least and greatest, its mean, and
        the values below which 5 %, 50 % and 95 % lie.
        """
        return {name: summarized(self.numbers(name)) for name in self.metrics}


def make_table(study: Study, outcomes: Sequence[Outcome]) -> Table:
    """The table of outcomes, which are in the order of their indices."""
    points = [study.point(outcome.index) for outcome in outcomes]
    parameters = tuple(points[0]) if points else ()
    metrics = tuple(dict.fromkeys(name for o in outcomes for name in o.metrics))
    columns: dict[str, Column] = {"index": [o.index for o in outcomes]}
    columns |= {name: [point[name] for point in points] for name in parameters}
    columns |= {name: [o.metrics.get(name) for o in outcomes] for name in metrics}
    columns["error"] = [o.error for o in outcomes]
    return Table(columns, parameters, metrics)


def write_parquet(table: Table, study: Study, path: Path) -> None:
    """Write the table in one piece; equal tables make equal bytes. InputError without pyarrow,
    OSError where it cannot be written.
    """
    arrow, parquet = check_parquet()
    arrays = {name: _array(arrow, name, column) for name, column in table.columns.items()}
    made = arrow.table(arrays).replace_schema_metadata(
        {"grasp_cosim": json.dumps({"study": study.name, **study.identity})}
    )
    with in_one_piece(path) as part:
        parquet.write_table(made, part)


def check_parquet() -> tuple[Any, Any]:
    """The modules pyarrow and pyarrow.parquet; InputError without them."""
    names = ("pyarrow", "pyarrow.parquet")
    arrow, parquet = (extra_module(n, "it writes the results of studies", "sweep") for n in names)
    return arrow, parquet


def _array(arrow: Any, name: str, column: Column) -> Any:
    """The column with the narrowest type that holds all values; numbers where there is none."""
    there = [value for value in column if value is not None]
    kinds = {type(value) for value in there}
    if name == "error" or str in kinds:
        return arrow.array(column, type=arrow.string())
    if kinds == {bool}:
        return arrow.array(column, type=arrow.bool_())
    if kinds == {int} and min(there) >= -(2**63) and max(there) < 2**63:
        return arrow.array(column, type=arrow.int64())
    if kinds == {int} and min(there) >= 0 and max(there) < 2**64:
        return arrow.array(column, type=arrow.uint64())
    numbers = [None if value is None else float(value) for value in column]
    return arrow.array(numbers, type=arrow.float64())


def summarized(values: npt.NDArray[np.float64]) -> dict[str, float | int | None]:
    """How many of the values are finite, and the STATISTICS of those."""
    there = values[np.isfinite(values)]
    if not len(there):
        return {"runs": 0, **dict.fromkeys(STATISTICS)}
    found = (there.min(), *np.percentile(there, (5.0, 50.0, 95.0)), there.max(), there.mean())
    return {"runs": len(there), **dict(zip(STATISTICS, map(float, found), strict=True))}
