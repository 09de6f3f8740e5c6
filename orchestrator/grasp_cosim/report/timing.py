"""The timing of a paced run: a chart, a sentence and a section of the page. Times are in s.

A curve is the share of the steps that took longer than a time, over that time, both logarithmic:
the tail, which decides whether a loop keeps its period, takes as much room as the bulk. A histogram
would show one step in a million as nothing.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from html import escape
from itertools import accumulate, zip_longest
from math import ceil, floor, log10
from pathlib import Path
from typing import TYPE_CHECKING

from ..base.errors import InputError, choices
from ..base.text import grouped
from ..realtime.timing import Histogram, Spread, Timing
from ..recording.result import Result
from .plot import GREY, RED, as_svg, beside, finish, headed, new_figure, save
from .tables import Caption, bullets, caption, number, svg_button, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

QUANTILES = {"median": 0.5, "p99": 0.01, "p99.9": 0.001}
"""The share of the steps that took longer, by the name of a quantile."""

NAMES = {"step": "whole step", "start": "late start", "between": "between steps"}
"""Labels of the parts of a step whose name does not say enough."""

COLORS = (
    "#1b7f79", "#b26b00", "#7a4fa3", "#4c7a1f", "#a83279", "#5b6470", "#2f6fb3", "#8c4a2f",
)  # fmt: skip
"""Those of components; each next one is dashed in another way, so that grey tells them too."""

OTHERS = ("step", "start", "between", "exchange", "recording", "backlog")
"""All that is no component: three in black, three in grey; a backlog is because of steps before."""

DASHES, MARKERS = ("-", "--", ":"), ("o", "D", "s")
"""By the number of a look."""

SHORTEST = 1e-7
"""s; an axis begins here at the earliest, where the clock itself is no longer exact."""

TIMING = "timing"
"""The stem of the file of the chart."""

BLAMED, MOST_ROWS = 4, 50
"""So many culprits are in the sentence, and so many overruns in the table."""


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


def kept(timing: Timing) -> str:
    """A sentence: the period was kept, or how often it was not, by how much, and through what."""
    steps, period = grouped(timing.steps), duration(timing.period)
    if not timing.overruns:
        return f"All {steps} steps ended within their period of {period}."
    blamed = [f"{label(name)} ({grouped(n)})" for name, n in timing.culprits.items()]
    listed = len(timing.listed)
    some = f" of the first {grouped(listed)}" if listed < timing.overruns else ""
    return (
        f"{grouped(timing.overruns)} of {steps} steps ({_percent(timing.overruns / timing.steps)}) "
        f"ended after their period of {period}. The worst{some} was "
        f"{duration(max(overrun.late for overrun in timing.listed))} late; "
        f"to blame: {choices(blamed, BLAMED)}."
    )


def label(part: str) -> str:
    """The label of a part of a step: a component is called by its name."""
    return NAMES.get(part, part)


def duration(seconds: float) -> str:
    """A time for the eye, with three figures: like 41.2 µs or 1.1 ms."""
    for factor, unit in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms")):
        if factor * abs(seconds) < 999.5 and seconds:
            return f"{factor * seconds:.3g} {unit}"
    return f"{seconds:.3g} s" if abs(seconds) < 999.5 else f"{seconds:.0f} s"


def _percent(share: float) -> str:
    return f"{100.0 * share:.3g} %"


def looks(timing: Timing) -> dict[str, tuple[str, int]]:
    """The colour of every part and culprit, components in colours, all else black and grey; and the
    place of its line and marker in DASHES, MARKERS.
    """
    components = dict.fromkeys(n for n in (*timing.parts, *timing.culprits) if n not in OTHERS)
    found = {n: (COLORS[k % len(COLORS)], k % 3) for k, n in enumerate(components)}
    return found | {n: ("#8a9098" if k > 2 else "#1d2023", k % 3) for k, n in enumerate(OTHERS)}


def tail(spread: Spread, histogram: Histogram) -> list[tuple[float, float]]:
    """Times and the share of the steps that took longer, to that of the worst."""
    edges, counts = histogram
    left = list(accumulate(reversed(counts)))[::-1]
    # Where nothing fell between two edges the line is level: its ends are enough.
    bins = [
        (edge, n / left[0])
        for edge, n, here, before in zip(edges, left, counts, (0, *counts), strict=False)
        if n and (here or before)
    ]
    one = 1.0 / left[0]
    shares = {**QUANTILES, "worst": one}.values()
    marks = [(time, share) for time, share in zip(spread, shares, strict=False) if share >= one]
    return sorted({*bins, *marks}, key=lambda p: (p[0], -p[1]))


def decades(times: Iterable[float]) -> tuple[float, float]:
    """Powers of ten that hold the times in s, with some room above; 0 s is SHORTEST."""
    logs = [log10(max(t, SHORTEST)) for t in times if t]
    low = floor(min(logs, default=log10(SHORTEST)))
    return 10.0**low, 10.0 ** max(ceil(max(logs, default=low) + 0.05), low + 1)


def _figure(timing: Timing, end: float) -> Figure:
    """The distribution of each part above, the overruns over the run below."""
    figure = new_figure(12.0, 8.6)
    above, below = figure.subplots(2, 1, height_ratios=[1.7, 1.0])
    _draw_distributions(above, timing)
    _draw_overruns(below, timing, end)
    return figure


def _draw_distributions(axes: Axes, timing: Timing) -> None:
    """The share of the steps that took longer over the time, of each part; a ring on the worst."""
    look, period, ends = looks(timing), timing.period, [timing.period]
    for part, histogram in timing.histograms.items():  # an underscore in front hides a label
        spread, (color, dash), whole = timing.parts[part], look[part], part == "step"
        times, shares = zip(*tail(spread, histogram), strict=True)
        ends += [times[0], times[-1]]
        axes.plot(
            [max(t, SHORTEST) for t in times], shares, DASHES[dash], color=color,
            linewidth=2.2 if whole else 1.3, zorder=3 if whole else 2, marker="o", mfc="white",
            markevery=[-1], markersize=5,
            label=f" {label(part)}: {duration(spread.median)}, at worst {duration(spread.worst)}",
        )  # fmt: skip
    left, right = decades(ends)
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
    _logarithmic(axes, "share that took longer")
    axes.xaxis.set_major_formatter(lambda seconds, _: duration(seconds))
    axes.yaxis.set_major_formatter(lambda share, _: _percent(share))


def _draw_overruns(axes: Axes, timing: Timing, end: float) -> None:
    """How late each listed step ended, over the time of the run, in the colour of its culprit."""
    listed, look = timing.listed, looks(timing)
    low, high = decades(o.late for o in listed)
    axes.set(xlim=(0.0, max([end, SHORTEST, *(o.time for o in listed)])))
    axes.set_xlabel("time in the run in s")
    if not listed:
        axes.set_yticks([])
        axes.text(0.5, 0.5, "no overruns", transform=axes.transAxes, ha="center", color=GREY)
        finish(axes, "late by", legend=False)
        return
    for part, times in timing.culprits.items():  # the rarest on top
        color, dash = look[part]
        of_it = [o for o in listed if o.culprit == part]
        axes.plot(
            [o.time for o in of_it], [max(o.late, low) for o in of_it], MARKERS[dash], color=color,
            mfc="white" if dash else color, markersize=4.0, clip_on=False,
            label=f"{grouped(times)} × {label(part)}",
        )  # fmt: skip
    axes.set(yscale="log", ylim=(low, high))
    if rest := timing.overruns - len(listed):
        axes.axvspan(listed[-1].time, end, color=GREY, alpha=0.15, linewidth=0.0)
        text = f"grey: {grouped(rest)} more, counted only"
        axes.set_title(text, fontsize=9, loc="right", color=GREY)
    _logarithmic(axes, "late by")
    axes.yaxis.set_major_formatter(lambda seconds, _: duration(seconds))


def _logarithmic(axes: Axes, what: str) -> None:
    axes.minorticks_off()
    finish(axes, what, legend=False)
    if axes.get_legend_handles_labels()[0]:
        beside(axes)


def timing_html(timing: Timing, end: float) -> str:
    """The content of the section; `end` is the simulated time in s at the end of the run.

    Without matplotlib a line says that the chart needs it.
    """
    kind, rate = "warn" if timing.overruns else "sum", number(timing.real_time_factor)
    pace = (
        f"{rate} times as fast as real time, asked for {number(timing.factor)}",
        f"after an overrun: {timing.overrun}",
    )
    return (
        f'<p class="{kind}">{escape(kept(timing))}</p>{_chart(timing, end)}'
        f'<div class="paced"><div><h3>Parts of a step</h3>{_parts(timing)}</div>'
        f"<div>{bullets('Pace', pace, '')}"
        f"{bullets('Granted by the machine', timing.granted, 'Nothing.')}"
        f"{bullets('Refused by the machine', timing.refused, 'Nothing.')}</div></div>"
        f"{_listed(timing)}"
    )


def _chart(timing: Timing, end: float) -> str:
    try:
        svg = as_svg(_figure(timing, end))
    except InputError as error:
        return f'<p class="hint">No chart: {escape(str(error))}</p>'
    text = "how often a part of a step took longer than a time, and how late steps ended"
    return (
        f'<div class="scroll"><div class="chart" role="img" aria-label="{text}">{svg}</div></div>'
        f"{svg_button('.chart svg', 'timing')}"
    )


def _parts(timing: Timing) -> str:
    """The times that each part took and how often it was to blame; empty for a mere culprit."""
    rows = []
    for part in dict.fromkeys((*timing.parts, *timing.culprits)):
        cells, late = [""] * (len(QUANTILES) + 2), list[bool]()
        if spread := timing.parts.get(part):
            cells = [grouped(1e6 * t, 1) for t in spread[:-1]] + [number(spread.worst_at)]
            late = [t > timing.period for t in spread[:-1]]
        cells.append(grouped(timing.culprits[part]) if part in timing.culprits else "")
        both = zip_longest(cells, late, fillvalue=False)
        texts = (f'<td class="n{" warn" * is_late}">{text}</td>' for text, is_late in both)
        rows.append(f"<td>{escape(label(part))}</td>{''.join(texts)}")
    heads = (
        f'<th class="n">{head}</th>' for head in (*QUANTILES, "worst", "at t in s", "overruns")
    )
    return table(f"<th>part of a step, in µs</th>{''.join(heads)}", rows)


def _listed(timing: Timing) -> str:
    listed = timing.listed[:MOST_ROWS]
    if not listed:
        return ""
    title = f"The first {len(listed)} of {grouped(timing.overruns)} overruns"
    rows = (
        f'<td class="n">{number(o.time, 9)}</td><td class="n">{grouped(o.step)}</td>'
        f'<td class="n">{grouped(1e6 * o.late, 1)}</td><td>{escape(label(o.culprit))}</td>'
        f'<td class="n">{grouped(1e6 * o.took, 1)}</td>'
        for o in listed
    )
    heads = (
        '<th class="n">t in s</th><th class="n">step</th><th class="n">late by, µs</th>'
        '<th>culprit</th><th class="n">which took, µs</th>'
    )
    return f"<details><summary>{title}</summary>{table(heads, rows)}</details>"
