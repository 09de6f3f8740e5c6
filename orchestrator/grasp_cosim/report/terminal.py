"""A result as the command line prints it."""

from collections.abc import Mapping
from typing import Any

from ..base.text import counted, fixed, significant
from ..realtime.timing import Timing
from ..recording.result import Result
from .timing import kept


def as_json(result: Result) -> dict[str, Any]:
    """The metrics of a run and their units, and its timing where it was paced."""
    timing = {"realtime": result.timing.as_dict()} if result.timing else {}
    missing = list(result.measured.missing)
    verdict = [criterion.as_dict() for criterion in result.verdict]
    return {
        **result.metrics,
        "units": result.metric_units,
        **({"verdict": verdict} if verdict else {}),
        **({"missing_metrics": missing} if missing else {}),
        **timing,
    }


def as_text(result: Result) -> str:
    """What a run came to, for people: a line for each metric."""
    m: Mapping[str, Any] = result.metrics
    lines = [
        f"{counted(m['steps'], 'step')} of {1e3 * m['step']:g} ms, {m['scheme']}, "
        f"{fixed(m['real_time_factor'], 2)} times as fast as real time"
    ]
    lines += [
        f"{metric.title:22s}{_numbers(m[metric.name], metric.factor)} "
        f"{metric.display_unit}".rstrip()
        for metric in result.measured.metrics
    ]
    lines += result.measured.missing
    if result.verdict:
        failed = [criterion for criterion in result.verdict if not criterion.passed]
        said = f"failed {len(failed)} of" if failed else "passed all"
        lines.append(f"{'verdict':22s}{said} {len(result.verdict)} criteria")
    return "\n".join([*lines, *(timing_lines(result.timing) if result.timing else ())])


def _numbers(value: Any, factor: float) -> str:
    if isinstance(value, list):
        return "  ".join(_numbers(v, factor) for v in value)
    if isinstance(value, bool):
        return f"{'yes' if value else 'no':>8}"
    return "    none" if value is None else fixed(factor * value, 3, width=8)


def timing_lines(timing: Timing) -> list[str]:
    """How a run kept to the clock, for people."""
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
    lines.append(f"{'overruns':22s}{kept(timing)}")
    return [*lines, *(_advice(timing) if timing.overruns else ())]


def _advice(timing: Timing) -> list[str]:
    step = timing.parts["step"]
    if step.median > timing.period:
        return [
            f"  the machine is too slow for this system: a step takes {_ms(step.median)} ms, the "
            f"period is {_ms(timing.period)} ms; take a longer step, or a smaller "
            "realtime.factor"
        ]
    first = {name: n for name, n in timing.culprits.items() if name != "backlog"}
    waking = first.get("start", 0) + first.get("between", 0)
    if 2 * waking >= sum(first.values()) and not timing.granted:
        return [
            "  mostly the machine let us wait: give the run a priority and a CPU of its own, "
            "--set realtime.priority=80 --set realtime.cpu=1, on an idle machine"
        ]
    return []


def _ms(seconds: float) -> str:
    return significant(1e3 * seconds, 3)
