"""The picture of a sweep: curves over one number, maps over two, else distributions."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import cycle
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..base.errors import InputError
from ..base.text import counted
from ..metrics.metric import Metric
from ..report.plot import BLUE, COLORS, STYLES, finish, headed, kept, new_figure
from ..report.tables import Caption
from .table import Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

MAX_PANELS = 12
"""Panels of a picture at most."""

MAX_LINEAR_DECADES = 1.5
"""A metric above 0 that spans more has a logarithmic scale of colours."""


def draw_sweep(
    table: Table, path: str | Path | None = None, *, of: Sequence[str] = (), title: str = ""
) -> Figure:
    """Draw metrics of a sweep, those `of` these names or the first MAX_PANELS, over what varies.

    With a `path` the figure is written there in the format of its suffix. InputError without
    matplotlib, or where there is nothing to draw.
    """
    metrics = [m for m in table.measured if any(c in table.metrics for c in m.columns)]
    metrics = [m for m in metrics if m.name in of] if of else metrics[:MAX_PANELS]
    numbers = [name for name in table.varied if len(set(table[name])) > 1]
    if not metrics:
        raise InputError(f"{path or 'sweep'}: nothing to draw; no run has a metric")
    if len(numbers) == 1:
        figure = _curves(table, numbers[0], metrics)
    else:
        figure = _each_column(table, numbers, metrics)
    subtitle = f"{counted(len(table), 'run')}, {len(table.errors)} of them failed"
    headed(figure, Caption(title or f"Sweep of {', '.join(table.varied)}", subtitle))
    return kept(figure, None if path is None else Path(path))


def _curves(table: Table, over: str, metrics: Sequence[Metric]) -> Figure:
    """A panel for each metric, in which its entries are lines."""
    figure, panels = _grid(len(metrics))
    order = np.argsort(table[over], kind="stable")
    for axes, metric in zip(panels, metrics, strict=True):
        for column, style, color in zip(metric.columns, cycle(STYLES), cycle(COLORS), strict=False):
            title, factor, _ = table.shown(column)
            values = factor * table[column][order]
            axes.plot(table[over][order], values, style, color=color, marker=".", label=title)
        finish(axes, _label(table, metric.name), legend=len(metric.columns) > 1)
        axes.set_xlabel(_label(table, over))
    return figure


def _each_column(table: Table, numbers: Sequence[str], metrics: Sequence[Metric]) -> Figure:
    """A panel for each column of the metrics: a map over two numbers, else a histogram."""
    columns = [c for m in metrics for c in m.columns if c in table.metrics][:MAX_PANELS]
    figure, panels = _grid(len(columns))
    for axes, column in zip(panels, columns, strict=True):
        values = table.shown(column)[1] * table[column]
        if len(numbers) == 2:
            drawn = _map(axes, table, numbers[0], numbers[1], values)
            axes.set_xlabel(_label(table, numbers[0]))
            axes.set_ylabel(_label(table, numbers[1]))
            figure.colorbar(drawn, ax=axes, label=_label(table, column))
        else:
            axes.hist(values[np.isfinite(values)], bins="auto", color=BLUE)
            finish(axes, "runs", legend=False)
            axes.set_xlabel(_label(table, column))
    return figure


def _map(axes: Axes, table: Table, x: str, y: str, values: Any) -> Any:
    """Cells where the runs are a grid, else points."""
    norm = _norm(values)
    across, along = np.unique(table[x]), np.unique(table[y])
    if len(across) * len(along) != len(table):
        return axes.scatter(table[x], table[y], c=values, norm=norm, s=16)
    order = np.lexsort((table[x], table[y]))
    cells = values[order].reshape(len(along), len(across))
    axes.set_facecolor("#dddddd")  # of cells without a value
    return axes.pcolormesh(across, along, cells, norm=norm, shading="nearest", rasterized=True)


def _norm(values: Any) -> Any:
    """The scale of the colours."""
    from matplotlib.colors import LogNorm, Normalize

    finite = values[np.isfinite(values)]
    if not len(finite):
        return Normalize(0.0, 1.0)
    low, high = finite.min(), finite.max()
    is_wide = 0.0 < low < high * 10.0**-MAX_LINEAR_DECADES
    return LogNorm(low, high) if is_wide else Normalize(low, high)


def _grid(count: int) -> tuple[Figure, list[Axes]]:
    """A figure with so many panels, two beside each other."""
    across = 1 if count == 1 else 2
    along = -(-count // across)
    figure = new_figure(0.8 + 4.6 * across, 3.2 * along)
    panels = list(figure.subplots(along, across, squeeze=False).flat)
    for axes in panels[count:]:
        axes.set_axis_off()
    return figure, panels[:count]


def _label(table: Table, column: str) -> str:
    title, _, unit = table.shown(column)
    return f"{title} in {unit}" if unit else title
