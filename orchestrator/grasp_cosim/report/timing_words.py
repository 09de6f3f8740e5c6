"""The timing of a run by the clock in words."""

from ..base.errors import choices
from ..base.text import grouped
from ..realtime.timing import Timing

PART_LABELS = {"step": "whole step", "start": "late start", "between": "between steps"}
"""Labels of the parts of a step whose name does not say enough."""

MAX_CULPRITS = 4
"""So many culprits are in the sentence."""


def timing_sentence(timing: Timing) -> str:
    """A sentence: the period was kept, or how often it was not, by how much, and through what."""
    steps, period = grouped(timing.steps), duration(timing.period)
    if not timing.overruns:
        return f"All {steps} steps ended within their period of {period}."
    share = percent(timing.overruns / timing.steps)
    recorded = len(timing.listed)
    of_the_first = f" of the first {grouped(recorded)}" if recorded < timing.overruns else ""
    worst = duration(max(overrun.late for overrun in timing.listed))
    culprits = [f"{part_label(name)} ({grouped(n)})" for name, n in timing.culprits.items()]
    return (
        f"{grouped(timing.overruns)} of {steps} steps ({share}) "
        f"ended after their period of {period}. The worst{of_the_first} was "
        f"{worst} late; to blame: {choices(culprits, MAX_CULPRITS)}."
    )


def part_label(part: str) -> str:
    """The label of a part of a step: a component is called by its name."""
    return PART_LABELS.get(part, part)


def duration(seconds: float) -> str:
    """A time for the eye, with three figures: like 41.2 µs or 1.1 ms."""
    for factor, unit in ((1e9, "ns"), (1e6, "µs"), (1e3, "ms")):
        if factor * abs(seconds) < 999.5 and seconds:
            return f"{factor * seconds:.3g} {unit}"
    return f"{seconds:.3g} s" if abs(seconds) < 999.5 else f"{seconds:.0f} s"


def percent(share: float) -> str:
    """A share for the eye, with three figures: like 0.52 %."""
    return f"{100.0 * share:.3g} %"
