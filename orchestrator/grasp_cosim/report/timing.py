"""The figure of a paced run's timing: how long the parts of a step took, and its overruns."""

from __future__ import annotations

from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

from ..realtime.timing import Timing
from .plot import GREY, RED, finish, new_figure, save
from .tables import count
from .timing_curves import (
    QUANTILES,
    SHORTEST,
    TOP,
    Curve,
    Look,
    axes,
    culprits,
    curves,
    decades,
    duration,
    kept,
    label,
    late_decades,
    looks,
    percent,
    quantiles,
    unlisted,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.legend import Legend

COLORS = {
    "--ink": "#1d2023", "--muted": "#8a9098",
    "--c0": "#1b7f79", "--c1": "#b26b00", "--c2": "#7a4fa3", "--c3": "#4c7a1f",
    "--c4": "#a83279", "--c5": "#5b6470", "--c6": "#2f6fb3", "--c7": "#8c4a2f",
}  # fmt: skip
"""Those of the page, by CSS variable."""

MOST_STEMS = 100
"""With more overruns there are no lines down to the axis: they would be a wall."""

WIDTH = 120
"""So many letters of the title fit into a line."""

HANDLE = 5
"""Letters that the line before a text in the legend takes, with the gap after it."""

LETTER = 0.602
"""The width of a letter of DejaVu Sans Mono, as a share of its size."""

DASHES = ("-", "--", ":")
MARKERS = ("o", "D", "s")
"""By Look.dash."""


def draw_timing(timing: Timing, end: float, path: Path) -> None:
    """The distribution of each part above, the overruns over the run below, as a PNG.

    end is the simulated time in s at the end of the run. InputError without matplotlib.
    """
    figure = new_figure(12.0, 8.6)
    title = fill(kept(timing), WIDTH)  # matplotlib's own wrapping takes dollars for formulas
    figure.suptitle(title, fontsize=11, x=0.01, ha="left", parse_math=False)
    above, below = figure.subplots(2, 1, height_ratios=[1.7, 1.0])
    _draw_distributions(above, timing)
    _draw_overruns(below, timing, end)
    save(figure, path)


def _draw_distributions(place: Axes, timing: Timing) -> None:
    """The share of the steps that took longer over the time, of each part."""
    drawn, look = curves(timing), looks(timing)
    span = axes(drawn, timing.period)
    for curve in drawn:
        _draw_curve(place, curve, look[curve.part], span.left)
    period = timing.period
    place.axvline(period, color=RED, linewidth=1.6)
    place.axvspan(period, span.right, color=RED, alpha=0.07, linewidth=0.0)
    place.annotate(
        f"period {duration(period)}", (period, 1.0), (0, 3), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha="center", va="bottom", fontsize=9, color=RED,
    )  # fmt: skip
    for name, share in QUANTILES.items():
        if share <= span.bottom:
            continue
        place.axhline(share, color=GREY, linestyle=":", linewidth=0.9)
        place.annotate(
            name, (0.0, share), (5, 2), xycoords=("axes fraction", "data"),
            textcoords="offset points", fontsize=9, color=GREY,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )  # fmt: skip
    place.set(xscale="log", yscale="log")
    place.set(xlim=(span.left, span.right), ylim=(span.bottom, TOP))
    _ticks(place, "x", span.left, span.right)
    shares = decades(span.bottom, 1.0)
    place.set_yticks(shares, [percent(share) for share in shares])
    place.set_yticks([], minor=True)
    place.set_xlabel("time")
    finish(place, "share that took longer", legend=False)
    _legend(place, timing, drawn)


def _draw_curve(place: Axes, curve: Curve, look: Look, left: float) -> None:
    color = COLORS[look.color]
    x, y = zip(*((max(t, left), share) for t, share in curve.points), strict=True)
    width = 2.2 if curve.part == "step" else 1.3
    place.plot(x, y, DASHES[look.dash], color=color, linewidth=width, label=curve.part)
    marks = [(max(t, left), share) for t, share in curve.marks.values()]
    place.plot(*zip(*marks[:-1], strict=True) if marks[:-1] else ([], []), ".", color=color)
    place.plot(*marks[-1], "o", color=color, mfc="white", markersize=5, clip_on=False)


def _legend(place: Axes, timing: Timing, drawn: list[Curve]) -> None:
    """The parts in the order of the step, with their figures: a table beside the curves."""
    lines = {line.get_label(): line for line in place.lines}
    parts = [part for part in timing.parts if part in {curve.part for curve in drawn}]
    names = {part: label(part) for part in parts}
    wide = max(map(len, names.values()), default=0)
    figures = {part: quantiles(timing.parts[part]) for part in parts}
    heads = (*QUANTILES, "worst")
    title = " " * (HANDLE + wide + 1) + "".join(f"{head:>9s}" for head in heads)
    rows = [
        f"{names[part]:{wide}s} " + "".join(f"{duration(t):>9s}" for t in figures[part].values())
        for part in parts
    ]
    font = {"family": "DejaVu Sans Mono", "size": 8}
    legend = place.legend(
        [lines[part] for part in parts], rows, loc="upper left", bbox_to_anchor=(1.01, 1.0),
        title=title, alignment="left", prop=font, title_fontproperties=font,
        frameon=False, handlelength=HANDLE * LETTER - 0.8, handletextpad=0.8,
    )  # fmt: skip
    _plain(legend)


def _draw_overruns(place: Axes, timing: Timing, end: float) -> None:
    """How late each listed step ended, over the time of the run, in the colour of its culprit."""
    listed = timing.listed
    place.set_xlim(0.0, max(end, SHORTEST))
    place.set_xlabel("time in the run in s")
    if not listed:
        place.set_yticks([])
        place.text(0.5, 0.5, "no overruns", transform=place.transAxes, ha="center", color=GREY)
        finish(place, "late by", legend=False)
        return
    look = looks(timing)
    few = len(listed) <= MOST_STEMS
    low, high = late_decades(listed)
    for part, times in culprits(timing):  # the rarest on top
        points = [(o.time, max(o.late, low)) for o in listed if o.culprit == part]
        if points:
            color, dash = COLORS[look[part].color], look[part].dash
            x, y = zip(*points, strict=True)
            if few:
                place.vlines(x, low, y, color=color, linewidth=0.8, alpha=0.4)
            place.plot(
                x, y, MARKERS[dash], color=color, mfc="white" if dash else color,
                markersize=5.0 if few else 3.0, clip_on=False,
                label=f"{count(times)} × {label(part)}",
            )  # fmt: skip
    place.set(yscale="log", ylim=(low, high))
    _ticks(place, "y", low, high)
    _unlisted(place, timing, end)
    finish(place, "late by", legend=False)
    legend = place.legend(
        loc="upper left", bbox_to_anchor=(1.01, 1.0), title="what took too long", fontsize=9,
        title_fontsize=9, alignment="left", frameon=False,
    )  # fmt: skip
    _plain(legend)


def _plain(legend: Legend) -> None:
    """A name with dollars is no formula."""
    for text in legend.get_texts():
        text.set_parse_math(False)


def _unlisted(place: Axes, timing: Timing, end: float) -> None:
    """Shade the part of the run whose overruns were counted only."""
    if rest := unlisted(timing):
        place.axvspan(timing.listed[-1].time, end, color=GREY, alpha=0.15, linewidth=0.0)
        text = f"grey: {count(rest)} more, counted only"
        place.set_title(text, fontsize=9, loc="right", color=GREY)


def _ticks(place: Axes, axis: str, low: float, high: float) -> None:
    """Times at the decades."""
    at = decades(low, high)
    set_ticks = place.set_xticks if axis == "x" else place.set_yticks
    set_ticks(at, [duration(t) for t in at])
    set_ticks([], minor=True)
