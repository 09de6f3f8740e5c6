"""The picture of a sweep: curves over one number, maps over two, else distributions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from math import ceil
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.text import counted
from ..metrics.metric import Metric
from ..report.plot import (
    BLUE,
    LINE_COLORS,
    LINE_STYLES,
    add_heading,
    finish_axes,
    new_figure,
    saved_figure,
)
from ..report.wording import Caption
from .table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS = 12
"""Panels of a picture at most."""

MARGIN, PANEL_WIDTH, PANEL_HEIGHT = 0.8, 4.6, 3.2
"""Inches."""

POINT_SIZE = 16
"""Square points of a run that is shown as a point."""

NO_VALUE = "#dddddd"
"""The colour of cells without a value."""

MAX_LINEAR_DECADES = 1.5
"""A metric above 0 that spans more has a logarithmic scale of colours."""


def draw_sweep(
    table: Table, path: str | Path | None = None, *, of: Sequence[str] = (), title: str = ""
) -> Figure:
    """Draw metrics of a sweep, those `of` these names or the first MAX_PANELS, over what varies.

    With a `path` the figure is written there in the format of its suffix. InputError without
    matplotlib, or where there is nothing to draw.
    """
    with_values = [m for m in table.measured if not set(m.columns).isdisjoint(table.metrics)]
    requested = [metric for metric in with_values if metric.name in of]
    metrics = requested if of else with_values[:MAX_PANELS]
    numbers = [name for name in table.varied if len(set(table[name])) > 1]
    if not metrics:
        raise InputError(f"{path or 'sweep'}: nothing to draw; no run has a metric")
    if len(numbers) == 1:
        figure = _curves(table, numbers[0], metrics)
    else:
        figure = _each_column(table, numbers, metrics)
    subtitle = f"{counted(len(table), 'run')}, {len(table.errors)} of them failed"
    add_heading(figure, Caption(title or f"Sweep of {', '.join(table.varied)}", subtitle))
    return saved_figure(figure, None if path is None else Path(path))


def _curves(table: Table, over: str, metrics: Sequence[Metric]) -> Figure:
    """A panel for each metric, in which its entries are lines."""
    figure, panels = _grid(len(metrics))
    order = np.argsort(table[over], kind="stable")
    for axes, metric in zip(panels, metrics, strict=True):
        looks = zip(metric.columns, cycle(LINE_STYLES), cycle(LINE_COLORS), strict=False)
        for column, style, color in looks:
            title, factor, _ = table.shown(column)
            axes.plot(
                table[over][order],
                factor * table[column][order],
                style,
                color=color,
                marker=".",
                label=title,
            )
        finish_axes(axes, _label(table, metric.name), legend=len(metric.columns) > 1)
        axes.set_xlabel(_label(table, over))
    return figure


def _each_column(table: Table, numbers: Sequence[str], metrics: Sequence[Metric]) -> Figure:
    """A panel for each column of the metrics: a map over two numbers, else a histogram."""
    columns = [column for metric in metrics for column in metric.columns]
    columns = [column for column in columns if column in table.metrics][:MAX_PANELS]
    figure, panels = _grid(len(columns))
    for axes, column in zip(panels, columns, strict=True):
        _, factor, _ = table.shown(column)
        values = factor * table[column]
        if len(numbers) == 2:
            colors = _map(axes, table, numbers, values)
            figure.colorbar(colors, ax=axes, label=_label(table, column))
        else:
            axes.hist(values[np.isfinite(values)], bins="auto", color=BLUE)
            finish_axes(axes, "runs", legend=False)
            axes.set_xlabel(_label(table, column))
    return figure


def _map(axes: Axes, table: Table, numbers: Sequence[str], values: Any) -> Any:
    """Values over two numbers as colours: of cells where the runs are a grid, else of points."""
    x_name, y_name = numbers
    axes.set_xlabel(_label(table, x_name))
    axes.set_ylabel(_label(table, y_name))
    x, y = table[x_name], table[y_name]
    norm = _norm(values)
    x_values, y_values = np.unique(x), np.unique(y)
    if len(x_values) * len(y_values) != len(table):
        return axes.scatter(x, y, c=values, norm=norm, s=POINT_SIZE)
    order = np.lexsort((x, y))
    cells = values[order].reshape(len(y_values), len(x_values))
    axes.set_facecolor(NO_VALUE)
    return axes.pcolormesh(x_values, y_values, cells, norm=norm, shading="nearest", rasterized=True)


def _norm(values: Any) -> Any:
    """The scale of the colours."""
    from matplotlib.colors import LogNorm, Normalize

    finite = values[np.isfinite(values)]
    if not len(finite):
        return Normalize(0.0, 1.0)
    low, high = finite.min(), finite.max()
    if 0.0 < low < high * 10.0**-MAX_LINEAR_DECADES:
        return LogNorm(low, high)
    return Normalize(low, high)


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, two next to each other."""
    columns = 1 if count == 1 else 2
    rows = ceil(count / columns)
    figure = new_figure(MARGIN + PANEL_WIDTH * columns, PANEL_HEIGHT * rows)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in panels[count:]:
        axes.set_axis_off()
    return figure, panels[:count]


def _label(table: Table, column: str) -> str:
    """The title of a column with the unit in which its values are drawn."""
    title, _, unit = table.shown(column)
    return f"{title} in {unit}" if unit else title
