"""Pictures of a study: metrics over two parameters or one, and the distributions of metrics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..files import of_any_format, remove_parts
from ..sweep.study import Cell, Curve, Map, Study
from ..sweep.sweep import Sweep
from ..system.made_of import changed
from .caption import Caption, about
from .plot import BLUE, COLORS, GREY, RED, STYLES, finish, headed, new_figure, one_legend, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis
    from matplotlib.figure import Figure
    from matplotlib.patheffects import AbstractPathEffect

Floats = npt.NDArray[np.float64]

COLOURS = "viridis"
"""The colours of a map, by the name that matplotlib knows them by."""

LIMIT = "black"
"""The colour of the line of a limit."""

MISSING, HATCH = "#dddddd", "////"
"""The colour and the hatches of cells without a value."""

MARKERS = ("o", "s", "^", "D", "v")
"""Of the curves of one picture, in turn, beside STYLES: so they differ without colours, too."""

MOST_TICKS = 12
"""So many values at uneven distances each have a mark on their axis."""

CONSTANT = 1e-9
"""Values that are so near to each other, as a share of the greatest, are drawn as one."""

DECADES = 1.5
"""A metric above 0 that spans more has a logarithmic colour scale."""


def draw_sweep(
    sweeps: Sequence[Sweep], folder: Path, suffix: str = "png", title: str = ""
) -> list[Path]:
    """Draw the pictures that a study asks for in folder, in the format of the suffix; where they
    are.

    The variants of a study are beside each other. A metric that no run has is drawn as that. The
    title is by default the study, its runs and what they vary. InputError without matplotlib.
    """
    pictures = sweeps[0].study.pictures
    remove_parts(folder, *of_any_format("map", "curve", "distributions"))
    drawn: dict[str, Figure] = {}
    if pictures.maps:
        drawn["map"] = _maps(sweeps, pictures.maps)
    if pictures.curves:
        drawn["curve"] = _curves(sweeps, pictures.curves)
    if pictures.distributions:
        drawn["distributions"] = _distributions(sweeps, pictures.distributions)
    said = Caption(title or _made_title(sweeps), about(_changed(sweeps)))
    paths = {folder / f"{stem}.{suffix}": figure for stem, figure in drawn.items()}
    for path, figure in paths.items():
        headed(figure, said)
        save(figure, path)
    return [*paths]


# Maps


@dataclass(frozen=True, slots=True)
class _Points:
    """What a map shows, in the units shown: x and y of its cells, or of its runs, and the metric.

    In cells z has a row for each y; a value is NaN where there is none.
    """

    x: Floats
    y: Floats
    z: Floats
    in_cells: bool

    @property
    def missing(self) -> int:
        """The number of cells or runs without a value."""
        return int(np.size(self.z) - np.isfinite(self.z).sum())


def _maps(sweeps: Sequence[Sweep], maps: Sequence[Map]) -> Figure:
    """A row for each map, with one scale of colours, a column for each variant."""
    across, along = len(sweeps), len(maps)
    alone = across == along == 1
    figure = new_figure(*((7.2, 5.0) if alone else (1.8 + 3.0 * across, 0.8 + 2.9 * along)))
    rows = figure.subplots(along, across, squeeze=False, sharex=across > 1)
    for wanted, row in zip(maps, rows, strict=True):
        found = [_points(sweep, wanted) for sweep in sweeps]
        norm = _norm(np.concatenate([points.z.ravel() for points in found]))
        for sweep, axes, points in zip(sweeps, row, found, strict=True):
            _draw_map(axes, sweep, wanted, points, norm)
        if any(np.isfinite(points.z).any() for points in found):
            label = _what_of_a_cell(sweeps[0], found[0].z.size, wanted.cell)
            _colour_bar(figure, row, norm, found, label + _label(sweeps[0].study, wanted.of))
        for axes in row[1:]:
            axes.set_ylabel("")
    for axes, sweep in zip(rows[-1], sweeps, strict=True):
        axes.set_xlabel(_label(sweep.study, maps[-1].x))
    for axes, sweep in zip(rows[0], sweeps, strict=True):
        axes.set_title(_plain(sweep.study.variant), fontsize=10)
    if any(axes.get_legend_handles_labels()[0] for axes in rows.flat):
        one_legend(figure)  # not over the cells
    return figure


def _points(sweep: Sweep, wanted: Map) -> _Points:
    """What a map shows of a study: cells where its design is a grid, else a point for each run."""
    x, y, z = (_numbers(sweep, name) for name in (wanted.x, wanted.y, wanted.of))
    if sweep.study.design.kind != "grid":
        return _Points(x, y, z, False)
    return _Points(*_cells(wanted.cell, x, y, z), True)


def _what_of_a_cell(sweep: Sweep, cells: int, cell: Cell) -> str:
    """Say which of the runs of a cell is shown, where there are several."""
    return f"{cell} of " if len(sweep.outcomes) > cells else ""


def _draw_map(axes: Axes, sweep: Sweep, wanted: Map, points: _Points, norm: Any) -> None:
    """Cells or points; hatched, or crosses, where there is no value. Nothing beyond the runs."""
    study = sweep.study
    axes.set_axisbelow(True)
    if points.in_cells:
        _draw_cells(axes, points, norm)
        if wanted.limit is not None:
            factor, unit = study.shown(wanted.of)
            label = f"{_title(study, wanted.of)} = {factor * wanted.limit:g} {unit}".rstrip()
            _draw_limit(axes, points, factor * wanted.limit, label)
    else:
        there = np.isfinite(points.z)
        axes.scatter(points.x[~there], points.y[~there], s=14, color=GREY, marker="x")
        x, y, z = (values[there] for values in (points.x, points.y, points.z))
        axes.scatter(x, y, c=z, s=16, norm=norm, cmap=COLOURS, edgecolors="black", linewidths=0.3)
    if points.missing:
        of = "cells" if points.in_cells else "runs"
        label = f"no {_title(study, wanted.of)}: {points.missing} of {points.z.size} {of}"
        _name_missing(axes, points.in_cells, label)
    finish(axes, _label(study, wanted.y), legend=False)
    if points.in_cells:
        axes.grid(visible=False)  # which would be on top of them


def _draw_cells(axes: Axes, points: _Points, norm: Any) -> None:
    """A cell around each run, up to halfway to the next; as wide outside as inside."""
    axes.patch.set(facecolor=MISSING, hatch=HATCH, edgecolor=GREY, linewidth=0.0)
    borders = []
    for values, scale, axis in (
        (points.x, axes.set_xscale, axes.xaxis),
        (points.y, axes.set_yscale, axes.yaxis),
    ):
        logarithmic = _geometric(values)
        borders.append(_borders(values, logarithmic))
        if logarithmic:
            scale("log")
            _plain_ticks(axis)
        elif len(values) <= MOST_TICKS and not _even(values):
            axis.set_ticks(values.tolist(), [f"{v:g}" for v in values])
    across, along = borders
    axes.pcolormesh(across, along, np.ma.masked_invalid(points.z), norm=norm, cmap=COLOURS)
    axes.set_xlim(across[0], across[-1])
    axes.set_ylim(along[0], along[-1])
    if not all(_even(v) or _geometric(v) for v in (points.x, points.y)):
        x, y = np.meshgrid(points.x, points.y)
        axes.plot(x.ravel(), y.ravel(), ".", color="white", markeredgecolor="black", markersize=5)


def _draw_limit(axes: Axes, points: _Points, limit: float, label: str) -> None:
    """A line where the metric is at the limit, between the runs, if it runs there at all."""
    from matplotlib.patheffects import withStroke

    z = np.ma.masked_invalid(points.z)
    if min(z.shape) < 2 or not np.ma.count(z) or not z.min() < limit < z.max():
        return
    halo: list[AbstractPathEffect] = [
        withStroke(linewidth=3.5, foreground="white")
    ]  # so that it shows in grey, too
    line = axes.contour(points.x, points.y, z, levels=[limit], colors=LIMIT, linewidths=1.5)
    line.set_path_effects(halo)
    axes.plot([], [], color=LIMIT, label=label, path_effects=halo)


def _name_missing(axes: Axes, in_cells: bool, label: str) -> None:
    if in_cells:
        axes.fill([], [], facecolor=MISSING, hatch=HATCH, edgecolor=GREY, linewidth=0, label=label)
    else:
        axes.plot([], [], "x", color=GREY, markersize=4, label=label)


def _colour_bar(
    figure: Figure, row: Sequence[Axes], norm: Any, found: Sequence[_Points], label: str
) -> None:
    """The scale of a row of maps; an arrow where values are below its lower end."""
    from matplotlib.cm import ScalarMappable

    below = any((points.z < norm.vmin).any() for points in found)
    scale = ScalarMappable(norm, COLOURS)
    bar = figure.colorbar(scale, ax=[*row], label=label, extend="min" if below else "neither")
    if bar.ax.get_yscale() == "log":
        _plain_ticks(bar.ax.yaxis, (1.0, 2.0, 5.0))


def _borders(centres: Floats, logarithmic: bool) -> Floats:
    """The borders of cells around rising centres: halfway, or in ratio, as far outside as in."""
    if logarithmic:
        return np.asarray(np.exp(_borders(np.log(centres), False)))
    halves = 0.5 * np.diff(centres) if len(centres) > 1 else [0.05 * abs(centres[0]) or 0.5]
    return np.concatenate(
        [
            centres[:1] - halves[0],
            centres[:-1] + halves[: len(centres) - 1],
            centres[-1:] + halves[-1],
        ]
    )


# Curves


def _curves(sweeps: Sequence[Sweep], curves: Sequence[Curve]) -> Figure:
    """Axes for each curve, below each other; in each a line for each column and variant."""
    figure = new_figure(7.2, 0.8 + 2.8 * len(curves))
    rows = figure.subplots(len(curves), 1, squeeze=False, sharex=len({c.x for c in curves}) == 1)
    for wanted, axes in zip(curves, rows[:, 0], strict=True):
        lines = [
            (sweep, column)
            for sweep in sweeps
            for column in sweep.study.columns_of(wanted.of, "figures.curve")
        ]
        for i, (sweep, column) in enumerate(lines):
            _draw_curve(axes, sweep, wanted, column, i)
        study = sweeps[0].study
        factor, unit = study.shown(lines[0][1])
        if wanted.limit is not None:
            label = f"limit, {factor * wanted.limit:g} {unit}".rstrip()
            axes.axhline(factor * wanted.limit, color=LIMIT, linestyle=":", label=label)
        cell = _what_of_a_cell(
            sweeps[0], len(_curve(sweeps[0], wanted, lines[0][1])[0]), wanted.cell
        )
        title = _title(study, lines[0][1]).partition(",")[0]
        finish(axes, _plain(f"{cell}{title}{f' in {unit}' if unit else ''}"))
        axes.set_xlabel(_label(study, wanted.x))
    for axes in rows[:-1, 0] if len({c.x for c in curves}) == 1 else ():
        axes.set_xlabel("")
    return figure


def _draw_curve(axes: Axes, sweep: Sweep, wanted: Curve, column: str, place: int) -> None:
    """Markers at the runs, a line between them in a grid; crosses where there is no value."""
    x, values = _curve(sweep, wanted, column)
    style = STYLES[place % len(STYLES)] if sweep.study.design.kind == "grid" else ""
    colour, marker = COLORS[place % len(COLORS)], MARKERS[place % len(MARKERS)]
    name = ", ".join(filter(None, [sweep.study.variant, _title(sweep.study, column)]))
    axes.plot(x, values, linestyle=style, marker=marker, ms=4, color=colour, label=name)
    missing = ~np.isfinite(values)
    if missing.any():
        axes.plot(
            x[missing], np.full(missing.sum(), 0.03 + 0.04 * (place % 5)), "x", color=colour,
            transform=axes.get_xaxis_transform(), label=f"no {name}: {missing.sum()} of {len(x)}",
        )  # fmt: skip


def _curve(sweep: Sweep, wanted: Curve, column: str) -> tuple[Floats, Floats]:
    """Values of x and of a column there: in a grid one for each x, else one for each run."""
    x, z = _numbers(sweep, wanted.x), _numbers(sweep, column)
    if sweep.study.design.kind != "grid":
        return x, z
    x, _, values = _cells(wanted.cell, x, np.zeros_like(x), z)
    return x, values[0]


# What they share


def _numbers(sweep: Sweep, name: str) -> Floats:
    """A column of the results in the unit in which it is shown."""
    return sweep.study.shown(name)[0] * sweep.numbers(name)


def _made_title(sweeps: Sequence[Sweep]) -> str:
    """The study, the number of its runs, of each variant, and what they vary."""
    study, count = sweeps[0].study, len(sweeps[0].outcomes)
    each = f"{len(sweeps)} times " if len(sweeps) > 1 else ""
    *names, last = (p.name for p in study.parameters)
    over = " and ".join(filter(None, [", ".join(names), last]))
    over = over if len(names) < 3 else f"{len(names) + 1} parameters"
    failed = sum(sweep.failed for sweep in sweeps)
    failures = f", {failed} failed" if failed else ""
    return f"{study.title}: {each}{_runs(count)}{failures}, over {over}"


def _changed(sweeps: Sequence[Sweep]) -> dict[str, Any]:
    """What of the system differs from its file, and is the same in all variants and runs."""
    study = sweeps[0].study
    varied = {*study.seeds, *(v for p in study.parameters for v in p.variables)}
    first, *others = (changed(sweep.study.system) for sweep in sweeps)
    same = {k: v for k, v in first.items() if all(o.get(k) == v for o in others)}
    return {k: v for k, v in same.items() if k not in varied}


def _cells(cell: Cell, x: Floats, y: Floats, z: Floats) -> tuple[Floats, Floats, Floats]:
    """Values of x, of y and the metric over both, NaN where there is none; of runs that share a
    cell, the mean of those with a value, or the greatest of all, which is none where one has none.
    """
    across, column = np.unique(x, return_inverse=True)
    along, row = np.unique(y, return_inverse=True)
    shape = len(along), len(across)
    if cell == "greatest":
        most = np.full(shape, -np.inf)
        np.maximum.at(most, (row, column), np.where(np.isfinite(z), z, np.inf))
        return across, along, np.where(np.isfinite(most), most, np.nan)
    total, count = np.zeros((2, *shape))
    there = np.isfinite(z)
    np.add.at(total, (row[there], column[there]), z[there])
    np.add.at(count, (row[there], column[there]), 1.0)
    return across, along, np.divide(total, count, out=np.full_like(total, np.nan), where=count > 0)


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


def _even(values: Floats) -> bool:
    """True if rising values are at equal distances."""
    steps = np.diff(values)
    return not len(steps) or bool(np.ptp(steps) < 1e-9 * abs(values).max())


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


def _distributions(sweeps: Sequence[Sweep], metrics: Sequence[str]) -> Figure:
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
    return figure


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


def _runs(count: int) -> str:
    return f"{count} run" if count == 1 else f"{count} runs"


def _label(study: Study, name: str) -> str:
    """A parameter or metric with its unit."""
    unit, title = study.shown(name)[1], _title(study, name)
    return _plain(f"{title} in {unit}" if unit else title)


def _title(study: Study, name: str) -> str:
    metric = study.metric_of(name)
    known = metric is not None and name in metric.columns
    return metric.column_title(name) if metric and known else name


def _plain(name: str) -> str:
    """A name of which matplotlib makes no formula."""
    return name.replace("$", r"\$")
