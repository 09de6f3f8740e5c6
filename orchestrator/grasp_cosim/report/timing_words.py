"""The timing of a paced run in words, for its figure and its section of the page; times in s."""

from __future__ import annotations

from ..base.numerals import grouped
from ..realtime.timing import Spread, Timing

QUANTILES = {"median": 0.5, "p99": 0.01, "p99.9": 0.001}
"""The share of the steps that took longer, by the name of a quantile."""

NAMES = {"step": "whole step", "start": "late start", "between": "between steps"}
"""Labels of the parts of a step whose name does not say enough."""

BACKLOG = "backlog"
"""The culprit of a step that began late because of those before."""

BLAMED = 3
"""So many other culprits are named in a sentence."""


def label(part: str) -> str:
    """Return the label of a part of a step: a component is called by its name."""
    return NAMES.get(part, part)


def quantiles(spread: Spread) -> dict[str, float]:
    """Return the figures of a part by name: the quantiles, then the worst."""
    return {**dict(zip(QUANTILES, spread, strict=False)), "worst": spread.worst}


def culprits(timing: Timing) -> list[tuple[str, int]]:
    """Return what made steps late, and how many of them; the most frequent first."""
    return sorted(timing.culprits.items(), key=lambda entry: -entry[1])


def unlisted(timing: Timing) -> int:
    """Return how many overruns were counted only."""
    return timing.overruns - len(timing.listed)


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
    some = f" of the first {grouped(len(timing.listed))}" if unlisted(timing) else ""
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
