"""The options of a run in real time, and what is said of its timing."""

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

import click

from ..errors import InputError
from ..realtime.timing import Timing
from ..system.realtime import OVERRUNS, Realtime
from .frame import together

realtime_options = together(
    click.option("--realtime", is_flag=True, help="Pace the run by the clock; print its timing."),
    click.option("--factor", type=float, help="Times as fast as real time; 1 by default."),
    click.option(
        "--overrun",
        type=click.Choice(OVERRUNS),
        help="After a late step: keep the schedule (default), shift it, or stop.",
    ),
    click.option("--priority", type=int, help="Run with SCHED_FIFO at this priority, 1 to 99."),
    click.option("--cpu", type=int, help="Stay on the CPU of this number."),
    click.option("--lock-memory", is_flag=True, help="Keep the memory from being swapped out."),
)


def chosen_realtime(given: Mapping[str, Any]) -> Realtime | None:
    """What the options ask for; `given` are the values of all options of a command by name.

    InputError where one of them comes without --realtime.
    """
    names = (f.name for f in fields(Realtime))
    asked = {n: given[n] for n in names if given[n] is not None and given[n] is not False}
    if given["realtime"]:
        return Realtime(**asked)
    for name, value in asked.items():
        option = f"--{name.replace('_', '-')}"
        text = option if value is True else f"{option} {value}"
        raise InputError(f"{text}: must come with --realtime")
    return None


def timing_lines(timing: Timing) -> list[str]:
    """How the run kept to the clock, for people."""
    parts, period = timing.parts, 1e3 * timing.period
    lines = [
        f"paced at {timing.real_time_factor:.4g} of real time, asked for {timing.factor:g}: a step "
        f"every {period:g} ms",
        *(
            f"{label:22s}median {_ms(part.median)}  p99 {_ms(part.p99)}  p99.9 {_ms(part.p999)}  "
            f"worst {_ms(part.worst)} ms at t = {part.worst_at:.6g} s"
            for name, label in (("step", "step computes"), ("start", "start is late by"))
            if (part := parts.get(name))
        ),
    ]
    if not timing.overruns:
        return [*lines, "overruns              none: every step ended within its period"]
    blamed = ", ".join(f"{name} {count}" for name, count in timing.culprits.items())
    causes = [o for o in timing.listed if o.culprit != "backlog"] or timing.listed
    worst = max(causes, key=lambda o: o.took)
    what = "it began late by" if worst.culprit == "start" else f"{worst.culprit} took"
    lines += [
        f"overruns              {timing.overruns} of {timing.steps} steps; because of: {blamed}",
        f"  e.g.                at t = {worst.time:.6g} s {_ms(worst.late)} ms late: "
        f"{what} {_ms(worst.took)} ms",
    ]
    return [*lines, *_advice(timing)]


def _advice(timing: Timing) -> list[str]:
    step = timing.parts["step"]
    if step.median > timing.period:
        return [
            f"  the machine is too slow for this system: a step takes {_ms(step.median)} ms, the "
            f"period is {_ms(timing.period)} ms; take a longer --step or a smaller --factor"
        ]
    first = {name: n for name, n in timing.culprits.items() if name != "backlog"}
    waking = first.get("start", 0) + first.get("between", 0)
    if 2 * waking >= sum(first.values()) and not timing.granted:
        return [
            "  mostly the machine let us wait: give the run a --priority and a --cpu of its own, "
            "on an idle machine"
        ]
    return []


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.3g}"
