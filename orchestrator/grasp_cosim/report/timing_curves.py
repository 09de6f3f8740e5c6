"""What the pictures of a paced run's timing are drawn from: curves, looks and axes.

A curve is the share of the steps that took longer than a time, over that time, both logarithmic:
the tail, which decides whether a loop keeps its period, takes as much room as the bulk. A histogram
would show one step in a million as nothing.

Times are in s.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import accumulate
from math import ceil, floor, log10
from typing import NamedTuple

from ..realtime.timing import Histogram, Overrun, Spread, Timing
from .tables import count

QUANTILES = {"median": 0.5, "p99": 0.01, "p99.9": 0.001}
"""The share of the steps that took longer, by the name of a quantile."""

NAMES = {
    "step": "whole step",
    "start": "late start",
    "between": "between steps",
}
"""What the parts of a step are called where their name does not say it."""

BACKLOG = "backlog"
"""The culprit of a step that began late because of those before."""

BLAMED = 3
"""So many other culprits are named in a sentence."""

COLORS = 8
"""Components have so many colours; then come the same ones dashed."""

SHORTEST = 1e-7
"""s; the axis begins here at the earliest, where the clock itself is no longer exact."""

TOP = 1.5
"""The upper end of the axis of shares: room above all steps."""

Point = tuple[float, float]
"""A time in s, and the share of the steps that took longer."""


class Look(NamedTuple):
    """How a part is drawn: a colour by its CSS variable, and 0 solid, 1 dashed, 2 dotted."""

    color: str
    dash: int


class Curve(NamedTuple):
    """A part of a step as points from left to right; marks are quantiles and worst."""

    part: str
    points: tuple[Point, ...]
    marks: dict[str, Point]


class Axes(NamedTuple):
    """The ends of the logarithmic axes: times in s, and the lowest share. All whole decades."""

    left: float
    right: float
    bottom: float


OTHERS = {
    "step": Look("--ink", 0),
    "start": Look("--ink", 1),
    "between": Look("--ink", 2),
    "exchange": Look("--muted", 0),
    "recording": Look("--muted", 1),
    BACKLOG: Look("--muted", 2),
}
"""How what is no component is drawn."""


def label(part: str) -> str:
    """What a part of a step is called; a component by its name."""
    return NAMES.get(part, part)


def looks(timing: Timing) -> dict[str, Look]:
    """The look of every part and culprit: components in colours, all else in black and grey."""
    components = [name for name in (*timing.parts, *timing.culprits) if name not in OTHERS]
    return OTHERS | {
        name: Look(f"--c{k % COLORS}", k // COLORS % 3)
        for k, name in enumerate(dict.fromkeys(components))
    }


def curves(timing: Timing) -> list[Curve]:
    """The curve of each part, the whole step last and so on top."""
    drawn = [
        _curve(part, timing.parts[part], histogram) for part, histogram in timing.histograms.items()
    ]
    return sorted(drawn, key=lambda curve: curve.part == "step")


def quantiles(spread: Spread) -> dict[str, float]:
    """The figures of a part by name: the quantiles, then the worst."""
    return {**dict(zip(QUANTILES, spread, strict=False)), "worst": spread.worst}


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


def axes(drawn: Iterable[Curve], period: float) -> Axes:
    """Axes that hold all curves and the period, with some room on its right."""
    points = [point for curve in drawn for point in curve.points]
    times = [t for t, _ in points if t > 0.0]
    longest = max([*times, period])
    right = 10.0 ** ceil(log10(longest) + 0.1)
    left = 10.0 ** floor(log10(max(min([*times, period]), SHORTEST)))
    lowest = min([share for _, share in points] + [0.1])
    return Axes(left, right, 10.0 ** floor(log10(lowest) - 1e-9))


def decades(low: float, high: float) -> list[float]:
    """The powers of ten from low to high, both included."""
    return [10.0**k for k in range(round(log10(low)), round(log10(high)) + 1)]


def place(value: float, low: float, high: float) -> float:
    """Where a value is on a logarithmic axis: 0 at low or below, 1 at high or above."""
    if value <= low:
        return 0.0
    return min(log10(value / low) / log10(high / low), 1.0)


def duration(seconds: float) -> str:
    """A time for the eye, with three figures: like 41.2 µs or 1.1 ms."""
    for factor, unit in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms")):
        if factor * abs(seconds) < 999.5 and seconds:
            return f"{factor * seconds:.3g} {unit}"
    return f"{seconds:.3g} s" if abs(seconds) < 999.5 else f"{seconds:.0f} s"


def percent(share: float) -> str:
    """A share for the eye, with three figures: like 100 % or 0.0123 %."""
    return f"{100.0 * share:.3g} %"


def late_decades(overruns: Sequence[Overrun]) -> tuple[float, float]:
    """The ends in s of a logarithmic axis that holds how late these overruns were."""
    lates = [max(overrun.late, SHORTEST) for overrun in overruns]
    low = 10.0 ** floor(log10(min(lates)))
    return low, max(10.0 ** ceil(log10(max(lates)) + 0.05), 10.0 * low)


def kept(timing: Timing) -> str:
    """A sentence: the period was kept, or how often it was not, by how much, and through what."""
    steps, period = count(timing.steps), duration(timing.period)
    if not timing.overruns:
        return f"All {steps} steps ended within their period of {period}."
    blamed = [
        f"{label(name)} ({count(times)})" for name, times in culprits(timing) if name != BACKLOG
    ]
    rest = len(blamed) - BLAMED
    names = blamed[:BLAMED] + ([f"{rest} other{'s' if rest > 1 else ''}"] if rest > 0 else [])
    if BACKLOG in timing.culprits:  # it follows from what the others did
        names.append(f"{label(BACKLOG)} ({count(timing.culprits[BACKLOG])})")
    some = f" of the first {count(len(timing.listed))}" if unlisted(timing) else ""
    return (
        f"{count(timing.overruns)} of {steps} steps ({percent(timing.overruns / timing.steps)}) "
        f"ended after their period of {period}. The worst{some} was "
        f"{duration(max(overrun.late for overrun in timing.listed))} late; "
        f"to blame: {', '.join(names)}."
    )


def culprits(timing: Timing) -> list[tuple[str, int]]:
    """What made steps late, and how many; the most frequent first."""
    return sorted(timing.culprits.items(), key=lambda entry: -entry[1])


def unlisted(timing: Timing) -> int:
    """How many overruns were counted only."""
    return timing.overruns - len(timing.listed)
