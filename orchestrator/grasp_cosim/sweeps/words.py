"""A sweep for a terminal and as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ..base.columns import columns
from ..base.numerals import counted, significant
from .convergence import Convergence, convergence, is_study
from .table import STATISTICS, Table


def as_json(table: Table) -> dict[str, Any]:
    """The object of `sweep --json`: the summary of each metric, and the orders of a study."""
    study = convergence(table) if is_study(table) else {}
    return {
        "runs": len(table),
        "failed": len(table.errors),
        "errors": {str(i): text for i, text in table.errors.items()},
        "varied": list(table.varied),
        "metrics": table.summary(),
        "convergence": {name: asdict(c) for name, c in study.items()},
        "units": dict(table.units),
    }


def as_text(table: Table) -> str:
    """How many runs there are, what failed, and a line for each metric."""
    lines = [f"{counted(len(table), 'run')}, {len(table.errors)} failed"]
    for index, error in list(table.errors.items())[:1]:
        lines.append(f"the first that failed, {index}: {error}")
    if is_study(table):
        return "\n".join([*lines, *_study_lines(table, convergence(table))])
    rows = [["", "", "runs", *STATISTICS]]
    for name, row in table.summary().items():
        title, factor, unit = table.shown(name)
        numbers = [_scaled(row[head], factor) for head in STATISTICS]
        rows.append([title, unit, str(row["runs"]), *numbers])
    return "\n".join([*lines, *columns(rows, (0, 1))])


def _study_lines(table: Table, found: Mapping[str, Convergence]) -> list[str]:
    """The errors of each metric against the finest step, by step, and the observed order."""
    first = next(iter(found.values()))
    finest = 1e3 * min(table["experiment.step"])
    heads = [f"{1e3 * step:.4g} ms" for step in first.steps]
    rows = [[f"error against {finest:g} ms", "", "value", *heads, "order"]]
    for name, c in found.items():
        title, factor, unit = table.shown(name)
        numbers = [_scaled(x, factor) for x in (c.finest, *c.errors)]
        rows.append([title, unit, *numbers, significant(c.order, 3, "-")])
    return columns(rows, (0, 1))


def _scaled(value: float | None, factor: float) -> str:
    return significant(None if value is None else factor * value, 4, "-")
