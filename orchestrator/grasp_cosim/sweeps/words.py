"""A sweep for a terminal and as JSON."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from typing import Any

from ..numerals import counted
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
    heads = "".join(f"{head:>11s}" for head in ("runs", *STATISTICS))
    lines.append(f"{'':40s}{'':6s}{heads}")
    for name, row in table.summary().items():
        title, factor, unit = table.shown(name)
        numbers = "".join(f"{_number(row[head], factor):>11s}" for head in STATISTICS)
        lines.append(f"{title:40s}{unit:6s}{row['runs']:>11}{numbers}")
    return "\n".join(lines)


def _study_lines(table: Table, found: Mapping[str, Convergence]) -> list[str]:
    """The errors of each metric against the finest step, by step, and the observed order."""
    first = next(iter(found.values()))
    finest = 1e3 * min(table["experiment.step"])
    heads = "".join(f"{1e3 * step:>9.4g} ms" for step in first.steps)
    lines = [f"{f'error against {finest:g} ms':40s}{'':6s}{'value':>12s}{heads}{'order':>8s}"]
    for name, c in found.items():
        title, factor, unit = table.shown(name)
        errors = "".join(f"{_number(e, factor):>12s}" for e in c.errors)
        order = "-" if c.order is None else f"{c.order:.2f}"
        lines.append(f"{title:40s}{unit:6s}{_number(c.finest, factor):>12s}{errors}{order:>8s}")
    return lines


def _number(value: float | None, factor: float) -> str:
    return "-" if value is None else f"{factor * value:.4g}"
