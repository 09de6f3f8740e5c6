"""A result as the command line prints it."""

from collections.abc import Mapping
from typing import Any

from ..base.text import counted, fixed, significant
from ..realtime.timing import Timing
from ..recording.result import Result
from .timing_words import timing_sentence


def run_json(result: Result) -> dict[str, Any]:
    """The metrics of a run and their units, and its timing where it was paced."""
    entries: dict[str, Any] = {**result.metrics, "units": result.metric_units}
    if result.verdict:
        entries["verdict"] = [criterion.as_dict() for criterion in result.verdict]
    if result.is_triggered:
        entries["windows"] = [window.summary for window in result.windows]
    if result.measured.missing:
        entries["missing_metrics"] = list(result.measured.missing)
    if result.timing:
        entries["realtime"] = result.timing.as_dict()
    return entries


def run_text(result: Result) -> str:
    """What a run came to, for people: a line for each metric."""
    metrics: Mapping[str, Any] = result.metrics
    lines = [
        f"{counted(metrics['steps'], 'step')} of {1e3 * metrics['step']:g} ms, "
        f"{metrics['scheme']}, "
        f"{fixed(metrics['real_time_factor'], 2)} times as fast as real time"
    ]
    for metric in result.measured.metrics:
        numbers = _numbers(metrics[metric.name], metric.factor)
        lines.append(f"{metric.title:22s}{numbers} {metric.display_unit}".rstrip())
    lines += result.measured.missing
    if result.is_triggered:
        windows, rows = len(result.windows), len(result.time)
        lines.append(f"{'recorded':22s}{counted(rows, 'row')} in {counted(windows, 'window')}")
    if result.verdict:
        failed = [criterion for criterion in result.verdict if not criterion.passed]
        outcome = f"failed {len(failed)} of" if failed else "passed all"
        lines.append(f"{'verdict':22s}{outcome} {len(result.verdict)} criteria")
    if result.timing:
        lines += timing_lines(result.timing)
    return "\n".join(lines)


def _numbers(value: Any, factor: float) -> str:
    if isinstance(value, list):
        return "  ".join(_numbers(v, factor) for v in value)
    if isinstance(value, bool):
        return f"{'yes' if value else 'no':>8}"
    return "    none" if value is None else fixed(factor * value, 3, width=8)


def timing_lines(timing: Timing) -> list[str]:
    """How a run kept to the clock, for people."""
    period_ms = 1e3 * timing.period
    lines = [
        f"paced at {timing.real_time_factor:.4g} of real time, asked for {timing.factor:g}: a step "
        f"every {period_ms:g} ms"
    ]
    for name, label in (("step", "step computes"), ("start", "start is late by")):
        if part := timing.parts.get(name):
            quantiles = f"{label:22s}median {_ms(part.median)}  p99 {_ms(part.p99)}"
            worst = f"worst {_ms(part.worst)} ms at t = {part.worst_at:.6g} s"
            lines.append(f"{quantiles}  p99.9 {_ms(part.p999)}  {worst}")
    lines.append(f"{'overruns':22s}{timing_sentence(timing)}")
    if timing.overruns:
        lines += _advice(timing)
    return lines


def _advice(timing: Timing) -> list[str]:
    """A line on what may help against overruns; none where nothing is sure to."""
    step = timing.parts["step"]
    if step.median > timing.period:
        return [
            f"  the machine is too slow for this system: a step takes {_ms(step.median)} ms, the "
            f"period is {_ms(timing.period)} ms; take a longer step, or a smaller "
            "realtime.factor"
        ]
    counts = {name: count for name, count in timing.culprits.items() if name != "backlog"}
    while_waiting = counts.get("start", 0) + counts.get("between", 0)
    if 2 * while_waiting >= sum(counts.values()) and not timing.granted:
        return [
            "  mostly the machine let us wait: give the run a priority and its own CPU, "
            "--set realtime.priority=80 --set realtime.cpu=1, on an idle machine"
        ]
    return []


def _ms(seconds: float) -> str:
    return significant(1e3 * seconds, 3)
