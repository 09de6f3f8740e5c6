"""The changes from one recorded run to another: settings and metrics side by side, no verdict."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.text import columns, in_milli, significant
from ..metrics.metric import Metric
from ..recording.read_back import load_run
from ..recording.result import Result
from .side import Difference, differences

MAX_SETTINGS = 12
"""The most settings that the text lists; the JSON has all."""

DIGITS = 4
"""The digits of a number in the text."""

Number = float | bool | None


@dataclass(frozen=True, slots=True)
class MetricChange:
    """One value of a metric before and after, in its SI unit."""

    name: str
    """The name of the metric, with [1], [2], ... if it has several values."""
    unit: str | None
    """The unit of both values; None for true or false."""
    before: Number
    """The value of the first run; None if it has none."""
    after: Number
    """The value of the second run; None if it has none."""

    @property
    def change(self) -> float | None:
        """The value after less the value before; None unless both are numbers."""
        if isinstance(self.before, bool) or isinstance(self.after, bool):
            return None
        if self.before is None or self.after is None:
            return None
        return self.after - self.before


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Changes:
    """How the settings and the metrics of two runs differ."""

    names: tuple[str, str]
    """The names of the two runs."""
    settings: tuple[Difference, ...]
    """The settings that differ, with units."""
    metrics: tuple[MetricChange, ...]
    """All metrics that either run has, in the order of the first."""

    def as_dict(self) -> dict[str, Any]:
        """The changes as types that JSON has, in SI units.

        Returns:
            A dictionary with the keys `before`, `after`, `settings` and `metrics`.
        """
        metrics = [{**asdict(metric), "change": metric.change} for metric in self.metrics]
        settings = [{"setting": d.setting, "before": d.a, "after": d.b} for d in self.settings]
        before, after = self.names
        return {"before": before, "after": after, "settings": settings, "metrics": metrics}

    def __repr__(self) -> str:
        before, after = self.names
        lines = [f"before: {before}", f"after:  {after}", ""]
        rows = [["setting", "before", "after"]]
        rows += [[d.setting, d.a, d.b] for d in self.settings[:MAX_SETTINGS]]
        if len(rows) == 1:
            lines.append("The settings of both runs are the same.")
        else:
            lines += columns(rows, {0})
        if (remaining := len(self.settings) - MAX_SETTINGS) > 0:
            lines.append(f"{remaining} more settings differ; --json lists all")
        table = [["metric", "before", "after", "change", "unit"], *map(_row, self.metrics)]
        return "\n".join([*lines, "", *columns(table, {0, 4})])


def _row(metric: MetricChange) -> list[str]:
    """A row of the table of metrics, in the unit that people read: mm for m."""
    factor, unit = in_milli(metric.unit)
    values = [_words(value, factor) for value in (metric.before, metric.after)]
    change = "" if metric.change is None else _signed(factor * metric.change)
    return [metric.name, *values, change, unit]


def _words(value: Number, factor: float) -> str:
    if value is None:
        return "none"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return significant(factor * value, DIGITS)


def _signed(change: float) -> str:
    text = significant(change, DIGITS)
    return text if text.startswith("-") or text == "0" else f"+{text}"


def diff(before: Result | str | Path, after: Result | str | Path) -> Changes:
    """Show how the settings and the metrics changed from one recorded run to another.

    There is no verdict: compare() judges signals and metrics by bands.

    Args:
        before: A result, or the folder of a run that `run --out` or Result.save() wrote.
        after: The other run, as `before`.

    Returns:
        The changes. They print as two tables.

    Raises:
        InputError: A folder contains no run.

    Example:
        >>> from grasp_cosim import diff, grasp_system, simulate
        >>> wide = grasp_system()
        >>> narrow = wide.with_values({"plant.object_width": "60 mm"})
        >>> changes = diff(simulate(wide, step=1e-3), simulate(narrow, step=1e-3))
        >>> print(changes.settings[0].setting, changes.settings[0].b)
        plant.object_width 0.06 m
        >>> [round(m.after, 2) for m in changes.metrics if m.name == "steady_contact_force[1]"]
        [2.83]
    """
    first, second = _run(before), _run(after)
    return Changes(
        (_name(before, "before"), _name(after, "after")),
        differences(first, second),
        tuple(_metric_changes(first, second)),
    )


def _run(run: Result | str | Path) -> Result:
    """The result itself, or the one in a folder."""
    return run if isinstance(run, Result) else load_run(run)


def _name(run: Result | str | Path, otherwise: str) -> str:
    return otherwise if isinstance(run, Result) else str(run)


def _metric_changes(before: Result, after: Result) -> Iterator[MetricChange]:
    """A row for each value of each metric; a metric of a run that has another unit is refused."""
    for metric in _all_metrics(before, after):
        first, second = before.measured.values, after.measured.values
        units = [run.measured.units.get(metric.name, metric.unit) for run in (before, after)]
        if units[0] != units[1]:
            raise InputError(
                f"{metric.name}: is in {units[0]!r} before and in {units[1]!r} after; must be one "
                "unit: measure both runs with the same metrics"
            )
        columns_of_runs = [_values(values, metric.name) for values in (first, second)]
        count = max(map(len, columns_of_runs))
        for i in range(count):
            name = metric.name if count == 1 else f"{metric.name}[{i + 1}]"
            pair = [values[i] if i < len(values) else None for values in columns_of_runs]
            yield MetricChange(name, units[0], *pair)


def _all_metrics(before: Result, after: Result) -> Sequence[Metric]:
    """The metrics that either run has, each once."""
    by_name: dict[str, Metric] = {}
    for run in (before, after):
        for metric in run.measured.metrics:
            by_name.setdefault(metric.name, metric)
    return tuple(by_name.values())


def _values(values: Mapping[str, Any], name: str) -> list[Number]:
    """The values of a metric as a list; empty if the run has none."""
    if name not in values:
        return []
    value = values[name]
    return list(value) if isinstance(value, list) else [value]
