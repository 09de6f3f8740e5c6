"""The timing of a paced run as a chart and in words: the parts of a step, and its overruns.

A curve is the share of the steps that took longer than a time, over that time, both logarithmic:
the tail, which decides whether a loop keeps its period, takes as much room as the bulk. A histogram
would show one step in a million as nothing. Times are in s.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import accumulate
from math import ceil, floor, log10
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ..base.text import grouped
from ..realtime.timing import Histogram, Spread, Timing
from ..recording.result import Result
from .caption import Caption, caption
from .plot import GREY, RED, as_svg, finish, headed, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUANTILES = {"median": 0.5, "p99": 0.01, "p99.9": 0.001}
"""The share of the steps that took longer, by the name of a quantile."""

NAMES = {"step": "whole step", "start": "late start", "between": "between steps"}
"""Labels of the parts of a step whose name does not say enough."""

BACKLOG = "backlog"
"""The culprit of a step that began late because of those before."""

BLAMED = 3
"""So many other culprits are named in a sentence."""

COLORS = (
    "#1b7f79", "#b26b00", "#7a4fa3", "#4c7a1f", "#a83279", "#5b6470", "#2f6fb3", "#8c4a2f",
)  # fmt: skip
"""Those of components; each next one is dashed in another way, so that grey tells them too."""

INK, MUTED = "#1d2023", "#8a9098"

DASHES, MARKERS = ("-", "--", ":"), ("o", "D", "s")
"""By Look.dash."""

SHORTEST = 1e-7
"""s; an axis begins here at the earliest, where the clock itself is no longer exact."""

MOST_STEMS = 100
"""With more overruns there are no lines down to the axis: they would be a wall."""

TIMING = "timing"
"""The stem of the file of the chart."""

HANDLE = 5
"""Letters that the line before a text in the legend takes, with the gap after it."""

LETTER = 0.602
"""The width of a letter of DejaVu Sans Mono, as a share of its size."""

Point = tuple[float, float]
"""A time, and the share of the steps that took longer."""


class Look(NamedTuple):
    """How a part is drawn: its colour, and the place of its line and marker in DASHES, MARKERS."""

    color: str
    dash: int


class Curve(NamedTuple):
    """A part of a step as points from left to right; marks are quantiles and worst."""

    part: str
    points: tuple[Point, ...]
    marks: dict[str, Point]


OTHERS = {
    "step": Look(INK, 0),
    "start": Look(INK, 1),
    "between": Look(INK, 2),
    "exchange": Look(MUTED, 0),
    "recording": Look(MUTED, 1),
    BACKLOG: Look(MUTED, 2),
}
"""The looks of all that is no component."""


def draw_result(result: Result, folder: Path, suffix: str = "png") -> Iterator[Path]:
    """Draw the picture of a result, and the timing if it was paced; yield each once it is drawn.

    `suffix` is one of files.PICTURES.
    """
    picture = folder / f"{result.view.stem}.{suffix}"
    result.plot(picture)
    yield picture
    if result.timing:
        picture = folder / f"{TIMING}.{suffix}"
        draw_timing(result.timing, float(result.time[-1]), picture, caption(result))
        yield picture


def draw_timing(timing: Timing, end: float, path: Path, said: Caption) -> None:
    """Draw the chart, under its caption and a sentence on what was kept; see plot.save().

    `end` is the simulated time in s at the end of the run. InputError without matplotlib.
    """
    figure = _figure(timing, end)
    headed(figure, said._replace(title=f"{said.title}: timing"), kept(timing))
    save(figure, path)


def timing_svg(timing: Timing, end: float) -> str:
    """Return the chart as an SVG element, without a caption: see draw_timing."""
    return as_svg(_figure(timing, end))


def _figure(timing: Timing, end: float) -> Figure:
    """The distribution of each part above, the overruns over the run below."""
    figure = new_figure(12.0, 8.6)
    above, below = figure.subplots(2, 1, height_ratios=[1.7, 1.0])
    _draw_distributions(above, timing)
    _draw_overruns(below, timing, end)
    return figure


def label(part: str) -> str:
    """Return the label of a part of a step: a component is called by its name."""
    return NAMES.get(part, part)


def quantiles(spread: Spread) -> dict[str, float]:
    """Return the figures of a part by name: the quantiles, then the worst."""
    return {**dict(zip(QUANTILES, spread, strict=False)), "worst": spread.worst}


def culprits(timing: Timing) -> list[tuple[str, int]]:
    """Return what made steps late, and how many of them; the most frequent first."""
    return sorted(timing.culprits.items(), key=lambda entry: -entry[1])


def kept(timing: Timing) -> str:
    """A sentence: the period was kept, or how often it was not, by how much, and through what."""
    steps, period = grouped(timing.steps), duration(timing.period)
    if not timing.overruns:
        return f"All {steps} steps ended within their period of {period}."
    blamed = [
        f"{label(name)} ({grouped(times)})" for name, times in culprits(timing) if name != BACKLOG
    ]
    rest = len(blamed) - BLAMED
    names = blamed[:BLAMED] + ([f"{rest} other{'s' if rest > 1 else ''}"] if rest > 0 else [])
    if BACKLOG in timing.culprits:  # it follows from what the others did
        names.append(f"{label(BACKLOG)} ({grouped(timing.culprits[BACKLOG])})")
    listed = len(timing.listed)
    some = f" of the first {grouped(listed)}" if listed < timing.overruns else ""
    return (
        f"{grouped(timing.overruns)} of {steps} steps ({percent(timing.overruns / timing.steps)}) "
        f"ended after their period of {period}. The worst{some} was "
        f"{duration(max(overrun.late for overrun in timing.listed))} late; "
        f"to blame: {', '.join(names)}."
    )


def duration(seconds: float) -> str:
    """A time for the eye, with three figures: like 41.2 µs or 1.1 ms."""
    for factor, unit in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms")):
        if factor * abs(seconds) < 999.5 and seconds:
            return f"{factor * seconds:.3g} {unit}"
    return f"{seconds:.3g} s" if abs(seconds) < 999.5 else f"{seconds:.0f} s"


def percent(share: float) -> str:
    """A share for the eye, with three figures: like 100 % or 0.0123 %."""
    return f"{100.0 * share:.3g} %"


def looks(timing: Timing) -> dict[str, Look]:
    """Return the look of every part and culprit: components in colours, all else black and grey."""
    components = [name for name in (*timing.parts, *timing.culprits) if name not in OTHERS]
    return OTHERS | {
        name: Look(COLORS[k % len(COLORS)], k % len(DASHES))
        for k, name in enumerate(dict.fromkeys(components))
    }


def curves(timing: Timing) -> list[Curve]:
    """Return the curve of each part, the whole step last and so on top."""
    drawn = [
        _curve(part, timing.parts[part], histogram) for part, histogram in timing.histograms.items()
    ]
    return sorted(drawn, key=lambda curve: curve.part == "step")


def _curve(part: str, spread: Spread, histogram: Histogram) -> Curve:
    edges, counts = histogram
    tails = list(accumulate(reversed(counts)))[::-1]
    total = tails[0]
    # Where nothing fell between two edges the line is level: its ends are enough.
    bins = [
        (edges[k], tails[k] / total)
        for k in range(len(counts))
        if tails[k] and (counts[k] or (k and counts[k - 1]))
    ]
    one = 1.0 / total
    figures, shares = quantiles(spread), {**QUANTILES, "worst": one}
    marks = {name: (figures[name], share) for name, share in shares.items() if share >= one}
    points = sorted({*bins, *marks.values()}, key=lambda p: (p[0], -p[1]))
    return Curve(part, tuple(points), marks)


def decades(times: Iterable[float]) -> tuple[float, float]:
    """Return powers of ten that hold the times in s, with some room above; 0 s is SHORTEST."""
    logs = [log10(max(t, SHORTEST)) for t in times if t]
    low = floor(min(logs, default=log10(SHORTEST)))
    return 10.0**low, 10.0 ** max(ceil(max(logs, default=low) + 0.05), low + 1)


def _draw_distributions(axes: Axes, timing: Timing) -> None:
    """The share of the steps that took longer over the time, of each part."""
    drawn, look, period = curves(timing), looks(timing), timing.period
    for curve in drawn:
        _draw_curve(axes, curve, look[curve.part])
    points = [point for curve in drawn for point in curve.points]
    left, right = decades([period, *(t for t, _ in points)])
    bottom = 10.0 ** floor(log10(min([share for _, share in points], default=0.1)) - 1e-9)
    axes.axvline(period, color=RED, linewidth=1.6)
    axes.axvspan(period, right, color=RED, alpha=0.07, linewidth=0.0)
    axes.annotate(
        f"period {duration(period)}", (period, 1.0), (0, 3), xycoords=("data", "axes fraction"),
        textcoords="offset points", ha="center", va="bottom", fontsize=9, color=RED,
    )  # fmt: skip
    for name, share in QUANTILES.items():
        if share <= bottom:
            continue
        axes.axhline(share, color=GREY, linestyle=":", linewidth=0.9)
        axes.annotate(
            name, (0.0, share), (5, 2), xycoords=("axes fraction", "data"),
            textcoords="offset points", fontsize=9, color=GREY,
            bbox={"facecolor": "white", "edgecolor": "none", "pad": 0.5, "alpha": 0.8},
        )  # fmt: skip
    axes.set(xscale="log", yscale="log", xlim=(left, right), ylim=(bottom, 1.5), xlabel="time")
    axes.xaxis.set_major_formatter(lambda seconds, _: duration(seconds))
    axes.yaxis.set_major_formatter(lambda share, _: percent(share))
    axes.minorticks_off()
    finish(axes, "share that took longer", legend=False)
    _key(axes, timing)


def _draw_curve(axes: Axes, curve: Curve, look: Look) -> None:
    """The line with a dot on each quantile and a ring on the worst."""
    line, *marks = (
        [(max(t, SHORTEST), share) for t, share in points]
        for points in (curve.points, [*curve.marks.values()][:-1], [curve.marks["worst"]])
    )
    axes.plot(
        *zip(*line, strict=True), DASHES[look.dash], color=look.color, label=curve.part,
        linewidth=2.2 if curve.part == "step" else 1.3,
    )  # fmt: skip
    axes.plot(*(zip(*marks[0], strict=True) if marks[0] else ([], [])), ".", color=look.color)
    axes.plot(*marks[1][0], "o", color=look.color, mfc="white", markersize=5, clip_on=False)


def _key(axes: Axes, timing: Timing) -> None:
    """The parts in the order of the step, with their figures: a table beside the curves."""
    lines = {line.get_label(): line for line in axes.lines}
    wide = max((len(label(part)) for part in timing.parts), default=0)
    heads = (*QUANTILES, "worst")
    title = " " * (HANDLE + wide + 1) + "".join(f"{head:>9s}" for head in heads)
    rows = [
        f"{label(part):{wide}s} "
        + "".join(f"{duration(t):>9s}" for t in quantiles(spread).values())
        for part, spread in timing.parts.items()
    ]
    font = {"family": "DejaVu Sans Mono", "size": 8}
    _legend(
        axes, [lines[part] for part in timing.parts], rows, title=title, prop=font,
        title_fontproperties=font, handlelength=HANDLE * LETTER - 0.8, handletextpad=0.8,
    )  # fmt: skip


def _draw_overruns(axes: Axes, timing: Timing, end: float) -> None:
    """How late each listed step ended, over the time of the run, in the colour of its culprit."""
    listed = timing.listed
    axes.set_xlim(0.0, max([end, SHORTEST, *(o.time for o in listed)]))
    axes.set_xlabel("time in the run in s")
    finish(axes, "late by", legend=False)
    if not listed:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no overruns", transform=axes.transAxes, ha="center", color=GREY)
        return
    look = looks(timing)
    few = len(listed) <= MOST_STEMS
    low, high = decades(o.late for o in listed)
    for part, times in culprits(timing):  # the rarest on top
        points = [(o.time, max(o.late, low)) for o in listed if o.culprit == part]
        if not points:
            continue
        color, dash = look[part]
        times_in_run, lates = zip(*points, strict=True)
        if few:
            axes.vlines(times_in_run, low, lates, color=color, linewidth=0.8, alpha=0.4)
        axes.plot(
            times_in_run, lates, MARKERS[dash], color=color, mfc="white" if dash else color,
            markersize=5.0 if few else 3.0, clip_on=False,
            label=f"{grouped(times)} × {label(part)}",
        )  # fmt: skip
    axes.set(yscale="log", ylim=(low, high))
    axes.yaxis.set_major_formatter(lambda seconds, _: duration(seconds))
    axes.minorticks_off()
    if rest := timing.overruns - len(
        listed
    ):  # shade the part of the run whose overruns were counted only
        axes.axvspan(listed[-1].time, end, color=GREY, alpha=0.15, linewidth=0.0)
        text = f"grey: {grouped(rest)} more, counted only"
        axes.set_title(text, fontsize=9, loc="right", color=GREY)
    _legend(axes, title="what took too long", fontsize=9, title_fontsize=9)


def _legend(axes: Axes, *entries: Sequence[Any], **options: Any) -> None:
    legend = axes.legend(
        *entries, loc="upper left", bbox_to_anchor=(1.01, 1.0), alignment="left", frameon=False,
        **options,
    )  # fmt: skip
    for text in legend.get_texts():
        text.set_parse_math(False)  # a name with dollars is no formula
