"""A comparison, and a qualification, as text that is read in ten seconds, and as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

from ..base.errors import choices
from ..base.text import columns, significant
from ..metrics.metric import Metric
from ..system.parts import NANOSECONDS
from .bands import Compared
from .compare import Comparison
from .interface_difference import SEVERITIES, Difference
from .qualify import Qualification

ROWS = 8
"""The most signals, metrics or differences of one severity that the text lists."""

FEW = 3
"""How many it lists where all of them are inside, or just notes."""

MOST = 12
"""So many differences of the settings at most are in the text."""

WIDE = 0.1
"""A band wider than this share of the range of its signal proves little."""


def verdict(c: Comparison) -> str:
    """The outcome in a line."""
    word = "ALIKE" if c.alike else "DIFFERENT"
    ended = [f"{name} did not come to its end" for name in c.unfinished]
    said = "; ".join([*ended, counts(c.signals, c.metrics)])
    return f"{word}: {said}, from {c.begin:.6g} to {c.end:.6g} s"


def as_text(c: Comparison) -> str:
    """The verdict, what the runs are and differ in, and what is out of band, the worst first."""
    sides = zip(c.names, (c.a, c.b), strict=True)
    parts = [[verdict(c), *(f"{name}: {side.name}" for name, side in sides)]]
    if c.differences:
        rows = [f"  {d.what}: {d.a} | {d.b}" for d in c.differences[:MOST]]
        if left := len(c.differences) - len(rows):
            rows.append(f"  {left} more; --json and the page have all")
        parts.append([f"the runs differ in ({' | '.join(c.names)}):", *rows])
    elif c.a.result and c.b.result:
        parts.append(["the settings of the runs are the same"])
    parts += _tables(c.signals, c.metrics, c.names)
    parts.append([*notes(c), *basis(c)])
    return "\n\n".join(map("\n".join, parts))


def notes(c: Comparison) -> list[str]:
    """What is not judged, and why."""
    only = [
        f"{kind} only in {run}: {choices(names, 6)}"
        for kind, both in (("signals", c.only), ("metrics", c.only_metrics))
        for run, names in zip(c.names, both, strict=True)
        if names
    ]
    return [*c.notes, *absent_lines(c.absent, c.asked, c.end), *only]


def basis(c: Comparison) -> list[str]:
    """Where the bands are from."""
    return bands_lines(c.signals, c.metrics, f"{c.names[0]} (its range; every second sample)")


def as_json(c: Comparison) -> dict[str, Any]:
    """All of it, ready for JSON; a number that is infinite, or does not exist, is null."""
    return {
        "alike": c.alike,
        "verdict": verdict(c),
        "a": c.a.name,
        "b": c.b.name,
        "begin": c.begin,
        "end": c.end,
        "differences": [d._asdict() for d in c.differences],
        "signals": [_json(s, "a", "b") for s in c.signals],
        "metrics": [_json(m, "a", "b") for m in c.metrics],
        "no_value": list(c.absent),
        "only_a": {"signals": list(c.only[0]), "metrics": list(c.only_metrics[0])},
        "only_b": {"signals": list(c.only[1]), "metrics": list(c.only_metrics[1])},
        "notes": notes(c),
        "units": {"begin": "s", "end": "s", "band_time": "s", "time": "s"},
    }


def qualification_text(q: Qualification) -> str:
    """The verdict, then what is out of band, the worst first, then the interface."""
    parts = [[qualification_verdict(q), reason(q)]]
    parts += _tables(q.signals, q.metrics, ("original", "candidate"))
    parts.append(difference_lines(q.swap.differences))
    if q.signals:
        parts.append(qualification_basis(q))
    elif q.failure:
        parts.append(
            [f"whether this machine loads it: grasp-cosim inspect --load {q.swap.candidate}"]
        )
    return "\n\n".join(map("\n".join, parts))


def qualification_verdict(q: Qualification) -> str:
    """The outcome in a line, and of which runs."""
    system, word = q.swap.system, "QUALIFIED" if q.qualified else "NOT QUALIFIED"
    step, stop = system.step_ns / NANOSECONDS, system.stop_ns / NANOSECONDS
    from_ = f"{system.start_ns / NANOSECONDS:g} to " if system.start_ns else ""
    return (
        f"{word}: {q.swap.candidate.name} as {q.swap.component} (now {q.swap.original.name}), "
        f"{from_}{stop:g} s in steps of {1e3 * step:g} ms, {system.scheme}"
    )


def qualification_json(q: Qualification) -> dict[str, Any]:
    """All of it, ready for JSON; a number that is infinite, or does not exist, is null.

    `bands` are those that were used: `qualify --bands` takes the file.
    """
    system = q.swap.system
    return {
        "qualified": q.qualified,
        "reason": reason(q),
        "component": q.swap.component,
        "original": str(q.swap.original),
        "candidate": str(q.swap.candidate),
        "system": system.name,
        "step": system.step_ns / NANOSECONDS,
        "stop": system.stop_ns / NANOSECONDS,
        "scheme": system.scheme,
        "failure": q.failure,
        "differences": [asdict(d) for d in q.swap.differences],
        "signals": [_json(c, "original", "candidate") for c in q.signals],
        "metrics": [_json(c, "original", "candidate") for c in q.metrics],
        "no_value": list(q.absent),
        "uncompared": list(q.uncompared),
        "numerics": list(q.numerics),
        "log": list(q.log),
        "bands": {
            "signals": {c.name: _band(c) | {"time": c.band.time} for c in q.signals},
            "metrics": {c.name: _band(c) for c in q.metrics},
        },
        "units": {"step": "s", "stop": "s", "band_time": "s", "time": "s"},
    }


def reason(q: Qualification) -> str:
    """Why the verdict is what it is, in one line."""
    if q.blocks:
        names = choices((d.variable for d in q.blocks), FEW)
        return f"not run, the interface does not fit: {names}"
    if q.failure:
        return f"the candidate failed: {q.failure}"
    if not (q.signals or q.metrics):
        return "nothing was compared: no output that both record is a number"
    end = q.swap.system.stop_ns / NANOSECONDS
    return "; ".join([counts(q.signals, q.metrics), *absent_lines(q.absent, q.asked, end)])


def difference_lines(differences: Sequence[Difference]) -> list[str]:
    """What the candidate declares otherwise, the worst first."""
    if not differences:
        return ["interface: no difference"]
    found = {s: sum(d.severity == s for d in differences) for s in SEVERITIES}
    lines = ["interface: " + ", ".join(f"{n} {s}" for s, n in found.items() if n)]
    for severity in SEVERITIES:
        of_it = [d for d in differences if d.severity == severity]
        most = FEW if severity == "notes" else ROWS
        lines += [f"  {severity:6}  {d.kind:11}  {d.variable}: {d.text}" for d in of_it[:most]]
        if len(of_it) > most:
            lines.append(f"  {severity:6}  {len(of_it) - most} more; --json has all")
    return lines


def qualification_basis(q: Qualification) -> list[str]:
    """Where the bands are from, what is not judged, and what the candidate's run told."""
    runs = "; ".join(q.numerics) or "its own range alone"
    lines = bands_lines(q.signals, q.metrics, f"the original ({runs})")
    if q.uncompared:
        names = ", ".join(q.uncompared)
        lines.append(f"not compared, as the candidate has no such output: {names}")
        if any(c.original is not None and c.candidate is None for c in q.metrics):
            lines.append(
                "metrics that want such an output have no value there; to judge it without them: "
                "--bands with '*' = { absolute = inf } under [metrics]"
            )
    lines += [f"the candidate's run: {line}" for line in q.log[:ROWS]]
    if len(q.log) > ROWS:
        lines.append(f"the candidate's run: {len(q.log) - ROWS} more lines; --json has all")
    return lines


def counts(signals: Sequence[Compared], metrics: Sequence[Compared]) -> str:
    """How many are out of band: "2 of 30 signals and 1 of 12 metrics out of band"."""
    found = [
        f"{sum(not c.inside for c in compared)} of {len(compared)} {name}"
        for name, compared in (("signals", signals), ("metrics", metrics))
        if compared
    ]
    return f"{' and '.join(found)} out of band"


def absent_lines(absent: Sequence[str], asked: Sequence[Metric], end: float) -> list[str]:
    """A line on metrics that have no value in either run, and on what that means."""
    if not absent:
        return []
    names = {name.partition("[")[0] for name in absent}
    means = [m.none for m in asked if m.none and m.name in names]
    said = f"{', '.join(dict.fromkeys(means))} until t = {end:g} s: " if means else ""
    until = "" if means else f" until t = {end:g} s"
    return [f"{said}{len(absent)} metrics have no value in either run{until}: {choices(absent, 6)}"]


def bands_lines(signals: Sequence[Compared], metrics: Sequence[Compared], basis: str) -> list[str]:
    """Where the bands are from: given, or derived from `basis`; and which prove little."""
    given = sum(c.band.source == "given" for c in (*signals, *metrics))
    derived = len(signals) + len(metrics) - given
    from_ = f"{given} given, {derived} derived from {basis}" if derived else f"all {given} given"
    lines = [f"bands: {from_}"]
    if wide := [c.name for c in signals if c.span and WIDE * c.span < c.band.width < inf]:
        lines.append(f"bands that are wide for the range of their signals: {', '.join(wide)}")
    return lines


def _tables(
    signals: Sequence[Compared], metrics: Sequence[Compared], runs: tuple[str, str]
) -> list[list[str]]:
    both = (("signal", signals), ("metric", metrics))
    return [_table(name, compared, runs) for name, compared in both if compared]


def _table(name: str, compared: Sequence[Compared], runs: tuple[str, str]) -> list[str]:
    """The lines of a table of signals or metrics: what is out of band, the worst first, else some
    that are inside; `runs` are the heads of their values.
    """
    outside = [c for c in compared if not c.inside]
    shown, time = outside[:ROWS] or compared[:FEW], ["at t in s"] if name == "signal" else []
    rows = [["x band", name, "deviation", "band", "unit", *time, *runs]]
    for c in shown:
        at = [] if c.time is None else [f"{c.time:.9g}"]
        values = [significant(v, 6) for v in (c.original, c.candidate)]
        widths = [significant(v, 3) for v in (c.deviation, c.band.width)]
        rows.append([significant(c.ratio, 3), c.name, *widths, c.unit or "", *at, *values])
    lines = columns(rows, {1, 4})
    if left := len(compared) - len(shown):
        beyond = len(outside) - len(shown)
        more = f"{beyond} more out of band, " if beyond > 0 else ""
        inside = len(compared) - len(outside) if outside else left
        lines.append(f"{'':8}{more}{inside} more inside")
    return lines


def _json(c: Compared, *runs: str) -> dict[str, Any]:
    """All of it: a number that is infinite is null; `runs` name the two values."""
    numbers = {"ratio": c.ratio, "deviation": c.deviation, "band": c.band.width}
    return {
        "name": c.name,
        "unit": c.unit,
        "inside": c.inside,
        **{key: value if isfinite(value) else None for key, value in numbers.items()},
        "band_time": c.band.time,
        "band_source": c.band.source,
        "time": c.time,
        **dict(zip(runs, (c.original, c.candidate), strict=True)),
        "span": c.span,
    }


def _band(c: Compared) -> dict[str, float | None]:
    return {"absolute": c.band.width if isfinite(c.band.width) else None}
