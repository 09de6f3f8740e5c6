"""Pictures of a study: a metric over two parameters, and the distributions of metrics."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..files import remove_parts
from ..sweep.study import Map, Study
from ..sweep.sweep import Sweep
from .plot import BLUE, GREY, RED, finish, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis

Floats = npt.NDArray[np.float64]

MISSING = "#cccccc"
"""The colour of runs without a value."""

CONSTANT = 1e-9
"""Values that are so near to each other, as a share of the greatest, are drawn as one."""

DECADES = 1.5
"""A metric above 0 that spans more has a logarithmic colour scale."""


def draw_sweep(sweep: Sweep, folder: Path) -> list[Path]:
    """Draw the pictures that the study asks for, as PNGs in folder; where they are.

    A metric that no run has is drawn as that. InputError without matplotlib.
    """
    drawn = []
    pictures = sweep.study.pictures
    remove_parts(folder, "map.png", "distributions.png")
    if pictures.map:
        drawn.append(folder / "map.png")
        _draw_map(sweep, pictures.map, drawn[-1])
    if pictures.distributions:
        drawn.append(folder / "distributions.png")
        _draw_distributions(sweep, pictures.distributions, drawn[-1])
    return drawn


def _draw_map(sweep: Sweep, wanted: Map, path: Path) -> None:
    """Cells where the design is a grid, else a dot per run; grey where there is no value."""
    x, y, z = (_numbers(sweep, name) for name in (wanted.x, wanted.y, wanted.of))
    figure = new_figure(7.2, 5.0)
    axes = figure.subplots()
    axes.set_axisbelow(True)
    options = {"norm": _norm(z), "cmap": "viridis"}
    cells = _cells(sweep.study, wanted, x, y, z)
    if cells:
        axes.set_facecolor(MISSING)
        shown: Any = axes.pcolormesh(*cells, shading="nearest", **options)
        if _geometric(cells[0]):
            axes.set_xscale("log")
            _plain_ticks(axes.xaxis)
        if _geometric(cells[1]):
            axes.set_yscale("log")
            _plain_ticks(axes.yaxis)
        if wanted.limit is not None and _crosses(cells[2], wanted.limit):
            axes.contour(*cells, levels=[wanted.limit], colors=RED, linewidths=1.5)
            unit = sweep.study.unit(wanted.of) or ""
            label = f"{_title(sweep.study, wanted.of)} = {wanted.limit:g} {unit}".rstrip()
            axes.plot([], [], color=RED, label=label)
    else:
        there = np.isfinite(z)
        axes.scatter(x[~there], y[~there], s=14, color=MISSING)
        shown = axes.scatter(x[there], y[there], c=z[there], s=14, **options)
    if not np.isfinite(z).all():
        axes.fill([], [], color=MISSING, label=f"no {_title(sweep.study, wanted.of)}")
    if np.isfinite(z).any():
        mean = "mean of " if cells and len(z) > cells[2].size else ""
        bar = figure.colorbar(shown, ax=axes, label=mean + _label(sweep.study, wanted.of))
        if bar.ax.get_yscale() == "log":
            _plain_ticks(bar.ax.yaxis, (1.0, 2.0, 5.0))
    axes.set_xlabel(_label(sweep.study, wanted.x))
    finish(axes, _label(sweep.study, wanted.y), bool(axes.get_legend_handles_labels()[0]))
    if cells:
        axes.grid(visible=False)  # which would be on top of them
    axes.set_title(_plain(sweep.study.name), fontsize=10)
    save(figure, path)


def _cells(
    study: Study, wanted: Map, x: Floats, y: Floats, z: Floats
) -> tuple[Floats, Floats, npt.NDArray[Any]] | None:
    """Values of x, of y and the metric over both; of runs that share a cell, the mean."""
    if study.design.kind != "grid":
        return None
    across, column = np.unique(x, return_inverse=True)
    along, row = np.unique(y, return_inverse=True)
    total, count = np.zeros((2, len(along), len(across)))
    there = np.isfinite(z)
    np.add.at(total, (row[there], column[there]), z[there])
    np.add.at(count, (row[there], column[there]), 1.0)
    mean = np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0.0)
    return across, along, np.ma.masked_invalid(mean)


def _crosses(values: npt.NDArray[Any], limit: float) -> bool:
    """True if a line at the limit runs through the cells."""
    wide = min(values.shape) > 1 and bool(np.ma.count(values))
    return bool(wide and values.min() < limit < values.max())


def _plain_ticks(axis: Axis, steps: Sequence[float] = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)) -> None:
    """Numbers like 0.5, 1 and 2 on a logarithmic axis."""
    from matplotlib.ticker import LogLocator, NullLocator

    axis.set_major_locator(LogLocator(10.0, subs=steps))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter("{x:g}")


def _geometric(values: Floats) -> bool:
    """True if rising values have one ratio, and are more than two."""
    if len(values) < 3 or values[0] <= 0.0:
        return False
    ratios = values[1:] / values[:-1]
    return bool(np.ptp(ratios) < 1e-9 * ratios[0])


def _norm(values: Floats) -> Any:
    """A logarithmic scale where values above 0 span more than DECADES, else none."""
    from matplotlib.colors import LogNorm

    there = values[np.isfinite(values)]
    if len(there) and there.min() >= 0.0 and there.max() > 0.0:
        low = max(float(there.min()), 1e-3 * float(there.max()))
        if np.log10(there.max() / low) > DECADES:
            return LogNorm(low, float(there.max()), clip=True)
    return None


def _draw_distributions(sweep: Sweep, metrics: Sequence[str], path: Path) -> None:
    columns = min(len(metrics), 2)
    rows = -(-len(metrics) // columns)
    figure = new_figure(4.6 * columns, 3.2 * rows)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, name in zip(grid, metrics, strict=False):
        _draw_distribution(axes, sweep, name)
    for axes in grid[len(metrics) :]:
        axes.set_visible(False)
    figure.suptitle(f"{_plain(sweep.study.name)}, {_runs(len(sweep.outcomes))}", fontsize=10)
    save(figure, path)


def _draw_distribution(axes: Axes, sweep: Sweep, name: str) -> None:
    """A histogram, with the median and the span that 90 % of the runs are in."""
    from matplotlib.ticker import MaxNLocator

    values = _numbers(sweep, name)
    there = values[np.isfinite(values)]
    axes.set_xlabel(_label(sweep.study, name))
    axes.set_axisbelow(True)
    if len(there):
        low, middle, high = np.percentile(there, (5.0, 50.0, 95.0))
        edges = _edges(there)
        if len(edges) == 2:  # one bar, which is no spread, with room beside it
            axes.set_xlim(edges[0] - 5.0 * np.ptp(edges), edges[1] + 5.0 * np.ptp(edges))
        axes.hist(there, bins=edges.tolist(), color=BLUE, alpha=0.75, zorder=2.0)
        axes.axvline(middle, color=RED, label=f"median {middle:.4g}")
        label = f"90 %: {low:.4g} to {high:.4g}"
        axes.axvspan(low, high, color=GREY, alpha=0.15, linewidth=0.0, zorder=0.0, label=label)
    missing = len(values) - len(there)
    if missing:
        axes.plot([], [], " ", label=f"none in {_runs(missing)}")
    axes.yaxis.set_major_locator(MaxNLocator(integer=True))
    axes.xaxis.set_major_locator(MaxNLocator(5))
    finish(axes, "runs")


def _edges(values: Floats) -> Floats:
    """Of the bins; of values that are all one but for rounding, a narrow bin around them."""
    low, high = float(values.min()), float(values.max())
    size = max(abs(low), abs(high))
    if high - low > CONSTANT * size:
        return np.linspace(low, high, max(10, int(np.sqrt(len(values)))) + 1)
    half = 0.005 * size or 0.005
    return np.array([low - half, high + half])


def _numbers(sweep: Sweep, name: str) -> Floats:
    """A column, NaN throughout where no run came to have it."""
    if name in sweep.table.columns:
        return sweep.table.numbers(name)
    return np.full(len(sweep.outcomes), np.nan)


def _runs(count: int) -> str:
    return f"{count} run" if count == 1 else f"{count} runs"


def _label(study: Study, name: str) -> str:
    """A parameter or metric with its unit."""
    unit, title = study.unit(name), _title(study, name)
    return f"{title} in {unit}" if unit and unit != "1" else title


def _title(study: Study, name: str) -> str:
    metric = study.metric_of(name)
    known = metric is not None and name in metric.columns
    return _plain(metric.column_title(name) if metric and known else name)


def _plain(name: str) -> str:
    """A name of which matplotlib makes no formula."""
    return name.replace("$", r"\$")
