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

COLOURS = "viridis"
"""The colours of a map, by the name that matplotlib knows them by."""

MISSING = "#cccccc"
"""The colour of runs without a value."""

CONSTANT = 1e-9
"""Values that are so near to each other, as a share of the greatest, are drawn as one."""

DECADES = 1.5
"""A metric above 0 that spans more has a logarithmic colour scale."""


def draw_sweep(sweeps: Sequence[Sweep], folder: Path) -> list[Path]:
    """Draw the pictures that a study asks for, as PNGs in folder; where they are.

    The variants of a study are beside each other. A metric that no run has is drawn as that.
    InputError without matplotlib.
    """
    drawn = []
    pictures = sweeps[0].study.pictures
    remove_parts(folder, "map.png", "distributions.png")
    if pictures.maps:
        drawn.append(folder / "map.png")
        _draw_maps(sweeps, pictures.maps, drawn[-1])
    if pictures.distributions:
        drawn.append(folder / "distributions.png")
        _draw_distributions(sweeps, pictures.distributions, drawn[-1])
    return drawn


def _draw_maps(sweeps: Sequence[Sweep], maps: Sequence[Map], path: Path) -> None:
    """A row for each map, with one scale of colours, a column for each variant."""
    across, along = len(sweeps), len(maps)
    alone = across == along == 1
    figure = new_figure(*((7.2, 5.0) if alone else (1.6 + 3.0 * across, 0.6 + 2.9 * along)))
    rows = figure.subplots(along, across, squeeze=False, sharex=True)
    for wanted, row in zip(maps, rows, strict=True):
        found = [_shown(sweep, wanted) for sweep in sweeps]
        norm = _norm(np.concatenate([np.ma.filled(z, np.nan).ravel() for _, _, z in found]))
        for sweep, axes, points in zip(sweeps, row, found, strict=True):
            _draw_map(axes, sweep, wanted, points, norm)
        if any(np.isfinite(np.ma.filled(z, np.nan)).any() for _, _, z in found):
            label = _what_of_a_cell(sweeps[0], wanted) + _label(sweeps[0].study, wanted.of)
            bar = figure.colorbar(_scale(norm), ax=[*row], label=label)
            if bar.ax.get_yscale() == "log":
                _plain_ticks(bar.ax.yaxis, (1.0, 2.0, 5.0))
        for axes in row[1:]:
            axes.set_ylabel("")
    for axes, sweep in zip(rows[-1], sweeps, strict=True):
        axes.set_xlabel(_label(sweep.study, maps[0].x))
    for axes, sweep in zip(rows[0], sweeps, strict=True):
        axes.set_title(_plain(sweep.study.variant or sweep.study.name), fontsize=10)
    named = [axes.get_legend_handles_labels() for axes in rows.flat]
    keys = {label: handle for pair in named for handle, label in zip(*pair, strict=True)}
    if alone and keys:
        rows[0, 0].legend(fontsize=8, framealpha=0.9)
    elif keys:  # beside small axes, not over their cells
        figure.legend([*keys.values()], [*keys], loc="outside lower left", ncols=4, fontsize=8)
    save(figure, path)


def _shown(sweep: Sweep, wanted: Map) -> tuple[Floats, Floats, npt.NDArray[Any]]:
    """Values of x, of y and of the metric over both: in cells where the design is a grid."""
    x, y, z = (sweep.numbers(name) for name in (wanted.x, wanted.y, wanted.of))
    return _cells(wanted, x, y, z) if sweep.study.design.kind == "grid" else (x, y, z)


def _what_of_a_cell(sweep: Sweep, wanted: Map) -> str:
    """Say which of the runs of a cell is shown, where there are several."""
    cells = _shown(sweep, wanted)[2].size
    return f"{wanted.cell} of " if len(sweep.outcomes) > cells else ""


def _draw_map(
    axes: Axes,
    sweep: Sweep,
    wanted: Map,
    points: tuple[Floats, Floats, npt.NDArray[Any]],
    norm: Any,
) -> None:
    """Cells where the design is a grid, else a dot per run; grey where there is no value."""
    study = sweep.study
    x, y, z = points
    axes.set_axisbelow(True)
    cells = study.design.kind == "grid"
    if cells:
        axes.set_facecolor(MISSING)
        axes.pcolormesh(x, y, z, shading="nearest", norm=norm, cmap=COLOURS)
        for values, scale, axis in (
            (x, axes.set_xscale, axes.xaxis),
            (y, axes.set_yscale, axes.yaxis),
        ):
            if _geometric(values):
                scale("log")
                _plain_ticks(axis)
        if wanted.limit is not None and _crosses(z, wanted.limit):
            axes.contour(x, y, z, levels=[wanted.limit], colors=RED, linewidths=1.5)
            unit = study.unit(wanted.of) or ""
            label = f"{_title(study, wanted.of)} = {wanted.limit:g} {unit}".rstrip()
            axes.plot([], [], color=RED, label=label)
    else:
        there = np.isfinite(z)
        axes.scatter(x[~there], y[~there], s=14, color=MISSING)
        axes.scatter(x[there], y[there], c=z[there], s=14, norm=norm, cmap=COLOURS)
    if not np.isfinite(np.ma.filled(z, np.nan)).all():
        axes.fill([], [], color=MISSING, label=f"no {_title(study, wanted.of)}")
    finish(axes, _label(study, wanted.y), legend=False)
    if cells:
        axes.grid(visible=False)  # which would be on top of them


def _scale(norm: Any) -> Any:
    from matplotlib.cm import ScalarMappable

    return ScalarMappable(norm, COLOURS)


def _cells(wanted: Map, x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, npt.NDArray[Any]]:
    """Values of x, of y and the metric over both; of runs that share a cell, the mean of those with
    a value, or the greatest of all, which is none where one has none.
    """
    across, column = np.unique(x, return_inverse=True)
    along, row = np.unique(y, return_inverse=True)
    shape = len(along), len(across)
    if wanted.cell == "greatest":
        most = np.full(shape, -np.inf)
        np.maximum.at(most, (row, column), np.where(np.isfinite(z), z, np.inf))
        return across, along, np.ma.masked_invalid(most)
    total, count = np.zeros((2, *shape))
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
    """A logarithmic scale where values above 0 span more than DECADES, else a linear one."""
    from matplotlib.colors import LogNorm, Normalize

    there = values[np.isfinite(values)]
    if not len(there):
        return Normalize()
    least, most = float(there.min()), float(there.max())
    if least >= 0.0 and most > 0.0:
        low = max(least, 1e-3 * most)
        if np.log10(most / low) > DECADES:
            return LogNorm(low, most, clip=True)
    return Normalize(least, most)


def _draw_distributions(sweeps: Sequence[Sweep], metrics: Sequence[str], path: Path) -> None:
    """Axes for each metric; with variants a row for each, and a column for each variant."""
    panels = [(name, sweep) for name in metrics for sweep in sweeps]
    columns = len(sweeps) if len(sweeps) > 1 else min(len(metrics), 2)
    rows = -(-len(panels) // columns)
    figure = new_figure(4.6 * columns, 3.2 * rows)
    grid = figure.subplots(rows, columns, squeeze=False).ravel()
    for axes, (name, sweep) in zip(grid, panels, strict=False):
        _draw_distribution(axes, sweep, name)
        axes.set_title(_plain(sweep.study.variant), fontsize=10)
    for axes in grid[len(panels) :]:
        axes.set_visible(False)
    if len(sweeps) == 1:
        name = _plain(sweeps[0].study.name)
        figure.suptitle(f"{name}, {_runs(len(sweeps[0].outcomes))}", fontsize=10)
    save(figure, path)


def _draw_distribution(axes: Axes, sweep: Sweep, name: str) -> None:
    """A histogram, with the median and the span that 90 % of the runs are in."""
    from matplotlib.ticker import MaxNLocator

    values = sweep.numbers(name)
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
