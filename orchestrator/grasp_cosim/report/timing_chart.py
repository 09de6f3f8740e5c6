"""The timing of a paced run: a chart, a sentence and a section of the page. Times are in s.

A curve is the share of the steps that took longer than a time, over that time, both logarithmic:
the tail, which decides whether a loop keeps its period, takes as much space as the bulk. A
histogram would show one step in a million as nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from itertools import accumulate
from math import ceil, floor, log10
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError
from ..base.files import make_folder
from ..base.text import grouped
from ..realtime.timing import Histogram, Spread, Timing
from ..recording.result import Result
from .html_tables import bullets, cell, svg_button, table
from .plot import (
    GREY,
    RED,
    add_heading,
    as_svg,
    finish_axes,
    legend_beside,
    new_figure,
    save_figure,
)
from .timing_words import duration, part_label, percent, timing_sentence
from .wording import Caption, caption, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUANTILES = {"median": 0.5, "p99": 0.01, "p99.9": 0.001}
"""The share of the steps that took longer, by the name of a quantile."""

COMPONENT_COLORS = (
    "#1b7f79", "#b26b00", "#7a4fa3", "#4c7a1f", "#a83279", "#5b6470", "#2f6fb3", "#8c4a2f",
)  # fmt: skip
"""Those of components; each next one is dashed in another way, so that grey tells them too."""

BLACK, LIGHT_GREY = "#1d2023", "#8a9098"

BLACK_PARTS = ("step", "start", "between")
GREY_PARTS = ("exchange", "recording", "backlog")
"""All parts that are no component; a backlog is because of steps before."""

DASHES, MARKERS = ("-", "--", ":"), ("o", "D", "s")
"""The line and the marker of a part, by the number in its style."""

SHORTEST_TIME = 1e-7
"""s; an axis begins here at the earliest, where the clock itself is no longer exact."""

TIMING_STEM = "timing"
"""The stem of the file of the chart."""

MAX_OVERRUN_ROWS = 50
"""So many overruns are in the table."""


def draw_pictures(result: Result, folder: Path, suffix: str = "png") -> Iterator[Path]:
    """Draw the picture of a result, and the timing if it was paced; yield each once it is drawn.

    A triggered run has none, but each of its windows. `suffix` is one of files.PICTURES.
    """
    make_folder(folder)
    if not result.is_triggered:
        picture = folder / f"{result.view.stem}.{suffix}"
        result.plot(picture)
        yield picture
    if result.timing:
        picture = folder / f"{TIMING_STEM}.{suffix}"
        draw_timing(result.timing, result.end_time, picture, caption(result))
        yield picture


def draw_timing(timing: Timing, end: float, path: Path, heading: Caption) -> None:
    """Draw the chart under the caption of its run and a sentence on the overruns.

    `end` is the simulated time in s at the end of the run. InputError without matplotlib, and as
    plot.save_figure() has it.
    """
    figure = _figure(timing, end)
    titled = heading._replace(title=f"{heading.title}: timing")
    add_heading(figure, titled, timing_sentence(timing))
    save_figure(figure, path)


def part_styles(timing: Timing) -> dict[str, tuple[str, int]]:
    """The style of every part and culprit: its colour, and its number in DASHES and MARKERS."""
    not_components = (*BLACK_PARTS, *GREY_PARTS)
    names = dict.fromkeys((*timing.parts, *timing.culprits))
    components = [name for name in names if name not in not_components]
    styles = {}
    for k, name in enumerate(components):
        styles[name] = (COMPONENT_COLORS[k % len(COMPONENT_COLORS)], k % len(DASHES))
    for color, parts in ((BLACK, BLACK_PARTS), (LIGHT_GREY, GREY_PARTS)):
        styles |= {name: (color, k) for k, name in enumerate(parts)}
    return styles


def exceedance(spread: Spread, histogram: Histogram) -> list[tuple[float, float]]:
    """Times in s and the share of the steps that took longer, to that of the worst."""
    edges, counts = histogram
    longer = list(accumulate(reversed(counts)))[::-1]  # steps that took longer than each edge
    steps = longer[0]
    points = set()
    previous_count = 0
    for edge, steps_longer, count in zip(edges, longer, counts, strict=False):
        # Where nothing fell between two edges the line is level: its ends are enough.
        if steps_longer and (count or previous_count):
            points.add((edge, steps_longer / steps))
        previous_count = count
    share_of_one_step = 1.0 / steps
    shares = (*QUANTILES.values(), share_of_one_step)
    for time, share in zip(spread, shares, strict=False):
        if share >= share_of_one_step:
            points.add((time, share))
    return sorted(points, key=lambda point: (point[0], -point[1]))


def decade_limits(times: Iterable[float]) -> tuple[float, float]:
    """Powers of ten that hold the times in s, with some space above; 0 s is SHORTEST_TIME."""
    logs = [log10(max(time, SHORTEST_TIME)) for time in times if time]
    low = floor(min(logs, default=log10(SHORTEST_TIME)))
    high = max(ceil(max(logs, default=low) + 0.05), low + 1)
    return 10.0**low, 10.0**high


def _figure(timing: Timing, end: float) -> Figure:
    """The distribution of each part above, the overruns over the run below."""
    figure = new_figure(12.0, 8.6)
    above, below = figure.subplots(2, 1, height_ratios=[1.7, 1.0])
    _draw_distributions(above, timing)
    _draw_overruns(below, timing, end)
    return figure


def _draw_distributions(axes: Axes, timing: Timing) -> None:
    """The share of the steps that took longer over the time, of each part; a ring on the worst."""
    period = timing.period
    times = [period]
    for part in timing.histograms:
        times += _draw_exceedance(axes, timing, part)
    left, right = decade_limits(times)
    axes.axvline(period, color=RED, linewidth=1.6)
    axes.axvspan(period, right, color=RED, alpha=0.07, linewidth=0.0)
    axes.set_title(f"red: from the period of {duration(period)} on", fontsize=9, color=RED)
    axes.set(xscale="log", yscale="log", xlim=(left, right), xlabel="time")
    bottom = 10.0 ** floor(-log10(max(timing.steps, 10)) - 1e-9)
    axes.set_ylim(bottom, 1.5)
    for name, share in QUANTILES.items():
        if share > bottom:
            axes.axhline(share, color=GREY, linestyle=":", linewidth=0.9)
            axes.text(left, share, f" {name}", va="bottom", fontsize=9, color=GREY)
    _finish_logarithmic(axes, "share that took longer")
    axes.xaxis.set_major_formatter(lambda seconds, _: duration(seconds))
    axes.yaxis.set_major_formatter(lambda share, _: percent(share))


def _draw_exceedance(axes: Axes, timing: Timing, part: str) -> tuple[float, float]:
    """Draw the curve of a part, and return its shortest and its longest time in s."""
    spread = timing.parts[part]
    color, dash = part_styles(timing)[part]
    is_whole_step = part == "step"
    times, shares = zip(*exceedance(spread, timing.histograms[part]), strict=True)
    # The space in front of the label: matplotlib hides one that begins with an underscore.
    axes.plot(
        [max(time, SHORTEST_TIME) for time in times], shares, DASHES[dash], color=color,
        linewidth=2.2 if is_whole_step else 1.3, zorder=3 if is_whole_step else 2, marker="o",
        mfc="white", markevery=[-1], markersize=5,
        label=f" {part_label(part)}: {duration(spread.median)}, at worst {duration(spread.worst)}",
    )  # fmt: skip
    return times[0], times[-1]


def _draw_overruns(axes: Axes, timing: Timing, end: float) -> None:
    """How late each listed step ended, over the time of the run, in the colour of its culprit."""
    overruns = timing.listed
    axes.set(xlim=(0.0, max([end, SHORTEST_TIME, *(overrun.time for overrun in overruns)])))
    axes.set_xlabel("time in the run in s")
    if not overruns:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no overruns", transform=axes.transAxes, ha="center", color=GREY)
        finish_axes(axes, "late by", legend=False)
        return
    low, high = decade_limits(overrun.late for overrun in overruns)
    styles = part_styles(timing)
    for part, count in timing.culprits.items():  # the rarest on top
        color, marker = styles[part]
        through_it = [overrun for overrun in overruns if overrun.culprit == part]
        axes.plot(
            [overrun.time for overrun in through_it],
            [max(overrun.late, low) for overrun in through_it],
            MARKERS[marker], color=color, mfc="white" if marker else color, markersize=4.0,
            clip_on=False, label=f"{grouped(count)} × {part_label(part)}",
        )  # fmt: skip
    axes.set(yscale="log", ylim=(low, high))
    if unlisted := timing.overruns - len(overruns):
        axes.axvspan(overruns[-1].time, end, color=GREY, alpha=0.15, linewidth=0.0)
        title = f"grey: {grouped(unlisted)} more, counted only"
        axes.set_title(title, fontsize=9, loc="right", color=GREY)
    _finish_logarithmic(axes, "late by")
    axes.yaxis.set_major_formatter(lambda seconds, _: duration(seconds))


def _finish_logarithmic(axes: Axes, label: str) -> None:
    """Finish axes without minor ticks, and with a legend next to them if they have lines."""
    axes.minorticks_off()
    finish_axes(axes, label, legend=False)
    if axes.get_legend_handles_labels()[0]:
        legend_beside(axes)


def timing_html(timing: Timing, end: float) -> str:
    """The content of the section; `end` is the simulated time in s at the end of the run.

    Without matplotlib a line asks for it.
    """
    kind = "warn" if timing.overruns else "sum"
    rate = number(timing.real_time_factor)
    pace = (
        f"{rate} times as fast as real time, asked for {number(timing.factor)}",
        f"after an overrun: {timing.overrun}",
    )
    lists = (
        bullets("Pace", pace, ""),
        bullets("Granted by the machine", timing.granted, "Nothing."),
        bullets("Refused by the machine", timing.refused, "Nothing."),
    )
    return (
        f'<p class="{kind}">{escape(timing_sentence(timing))}</p>{_chart_html(timing, end)}'
        f'<div class="paced"><div><h3>Parts of a step</h3>{_parts_html(timing)}</div>'
        f"<div>{''.join(lists)}</div></div>"
        f"{_overruns_html(timing)}"
    )


def _chart_html(timing: Timing, end: float) -> str:
    try:
        svg = as_svg(_figure(timing, end))
    except InputError as error:
        return f'<p class="hint">No chart: {escape(str(error))}</p>'
    text = "how often a part of a step took longer than a time, and how late steps ended"
    return (
        f'<div class="scroll"><div class="chart" role="img" aria-label="{text}">{svg}</div></div>'
        f"{svg_button('.chart svg', 'timing')}"
    )


def _parts_html(timing: Timing) -> str:
    """The times that each part took and how often it was to blame; empty for a mere culprit."""
    rows = []
    for part in dict.fromkeys((*timing.parts, *timing.culprits)):
        cells = [cell(part_label(part)), *_time_cells(timing, part)]
        overruns = grouped(timing.culprits[part]) if part in timing.culprits else ""
        rows.append("".join([*cells, _number_cell(overruns)]))
    heads = [
        f'<th class="n">{head}</th>' for head in (*QUANTILES, "worst", "at t in s", "overruns")
    ]
    return table(f"<th>part of a step, in µs</th>{''.join(heads)}", rows)


def _time_cells(timing: Timing, part: str) -> list[str]:
    """The cells of the times that a part took in µs, and of when it took longest in s."""
    spread = timing.parts.get(part)
    if not spread:
        return [_number_cell("")] * (len(QUANTILES) + 2)
    *times, worst_at = spread
    cells = [_number_cell(grouped(1e6 * time, 1), time > timing.period) for time in times]
    return [*cells, _number_cell(number(worst_at))]


def _number_cell(text: str, warn: bool = False) -> str:
    return cell(text, class_="n warn" if warn else "n")


def _overruns_html(timing: Timing) -> str:
    """The table of the first overruns, folded; empty where there are none."""
    overruns = timing.listed[:MAX_OVERRUN_ROWS]
    if not overruns:
        return ""
    title = f"The first {len(overruns)} of {grouped(timing.overruns)} overruns"
    rows = [
        _number_cell(number(overrun.time, 9))
        + _number_cell(grouped(overrun.step))
        + _number_cell(grouped(1e6 * overrun.late, 1))
        + cell(part_label(overrun.culprit))
        + _number_cell(grouped(1e6 * overrun.took, 1))
        for overrun in overruns
    ]
    heads = (
        '<th class="n">t in s</th><th class="n">step</th><th class="n">late by, µs</th>'
        '<th>culprit</th><th class="n">which took, µs</th>'
    )
    return f"<details><summary>{title}</summary>{table(heads, rows)}</details>"
