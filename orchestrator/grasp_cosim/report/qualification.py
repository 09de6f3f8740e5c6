"""The figure of a qualification: the worst signals over each other, in their bands."""

from __future__ import annotations

from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING

from ..numerals import in_milli
from ..qualification.tube import deviation, tube
from ..system.made_of import changed
from ..system.parts import NANOSECONDS
from .caption import Caption, about
from .plot import BLUE, GREY, RED, headed, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..qualification.compared import Compared
    from ..qualification.qualify import Qualification

ROWS = 4
"""The most signals that are drawn."""

ZOOM_SHIFTS, ZOOM_STEPS = 8, 40
"""The zoom reaches as many allowed shifts, at least as many steps, to both sides of the worst."""


def draw_qualification(q: Qualification, path: Path) -> None:
    """The worst signals: the run, the worst moment, the deviation beside its band; see save().

    InputError without matplotlib. There must have been a run.
    """
    worst = q.signals[:ROWS]
    figure = new_figure(13.0, 0.6 + 2.5 * len(worst))
    rows = figure.subplots(len(worst), 3, squeeze=False)
    for compared, (whole, zoom, apart) in zip(worst, rows, strict=True):
        _draw_curves(whole, q, compared)
        _draw_curves(zoom, q, compared)
        _zoom(zoom, q, compared)
        _draw_deviation(apart, q, compared)
        unit = in_milli(compared.unit)[1]
        label = f"{compared.name} in {unit}" if unit else compared.name
        whole.set_ylabel(label, fontsize=8, parse_math=False)
    for axes, title in zip(
        rows[0], ("the run", "the worst moment", "deviation beyond the shift allowed"), strict=True
    ):
        axes.set_title(title, fontsize=10)
    for axes in rows[-1]:
        axes.set_xlabel("time in s")
    rows[0][0].legend(fontsize=8, framealpha=0.9)
    verdict = "qualified" if q.qualified else "not qualified"
    title = f"{q.swap.candidate.name} as {q.swap.component}: {verdict}"
    system = q.swap.system
    headed(figure, Caption(title, f"in {system.name}: {about(changed(system))}"))
    save(figure, path)


def _draw_curves(axes: Axes, q: Qualification, compared: Compared) -> None:
    original, candidate = (run[compared.name] for run in q.runs)
    style = "steps-post" if original.held else "default"
    allowed = tube(original, original.time, compared.band.time)
    width, factor = compared.band.width, in_milli(compared.unit)[0]
    if isfinite(width):
        axes.fill_between(
            allowed.time,
            factor * (allowed.low - width),
            factor * (allowed.high + width),
            color=BLUE,
            alpha=0.2,
            linewidth=0.0,
            label="band",
        )
    for run, dashes, color, label in (
        (original, "-", BLUE, "original"),
        (candidate, "--", RED, "candidate"),
    ):
        values = factor * run.values
        axes.plot(run.time, values, dashes, color=color, drawstyle=style, label=label)
    _tidy(axes)


def _zoom(axes: Axes, q: Qualification, compared: Compared) -> None:
    """Show the surroundings of the worst moment, and the values that are taken there."""
    step = q.swap.system.step_ns / NANOSECONDS
    reach = max(ZOOM_SHIFTS * compared.band.time, ZOOM_STEPS * step)
    moment = compared.time or 0.0
    first, last = max(moment - reach, 0.0), moment + reach
    seen = [
        run[compared.name].values[
            (run[compared.name].time >= first) & (run[compared.name].time <= last)
        ]
        for run in q.runs
    ]
    low, high = min(v.min() for v in seen), max(v.max() for v in seen)
    width = compared.band.width if isfinite(compared.band.width) else 0.0
    margin = width + 0.08 * (high - low) or 1.0
    axes.set_xlim(first, last)
    factor = in_milli(compared.unit)[0]
    axes.set_ylim(factor * (low - margin), factor * (high + margin))
    axes.axvline(moment, color=GREY, linestyle=":", linewidth=1.0)


def _draw_deviation(axes: Axes, q: Qualification, compared: Compared) -> None:
    original, candidate = (run[compared.name] for run in q.runs)
    apart = deviation(original.until(float(candidate.time[-1])), candidate, compared.band.time)
    factor = in_milli(compared.unit)[0]
    axes.plot(apart.time, factor * apart.values, color=RED, linewidth=1.0)
    if isfinite(compared.band.width):
        axes.axhline(factor * compared.band.width, color=BLUE, linestyle="--", linewidth=1.0)
    axes.set_ylim(bottom=0.0)
    axes.annotate(
        f"{compared.ratio:.3g} × band" if isfinite(compared.ratio) else "no band",
        (0.98, 0.93),
        xycoords="axes fraction",
        ha="right",
        va="top",
        fontsize=9,
        color=GREY if compared.inside else RED,
        bbox={"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.8},
    )
    _tidy(axes)


def _tidy(axes: Axes) -> None:
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.spines[["top", "right"]].set_visible(False)
    axes.tick_params(labelsize=8)
