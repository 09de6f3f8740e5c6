"""A comparison, and a qualification, as text that is read in ten seconds, and as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict
from math import inf, isfinite
from typing import Any

from ..base.errors import choices
from ..base.text import columns, on_a_screen, significant
from ..system.times import in_seconds
from .bands import Compared, plain
from .interface_difference import SEVERITIES, Difference
from .outcome import ComparisonData, QualificationData

ROWS = 8
"""The most signals, metrics or differences of one severity that the text lists."""

FEW_ROWS = 3
"""How many it lists where all of them are inside, or just notes."""

MAX_LINES = 12
"""So many differences of the settings, or notes, at most are in the text."""

WIDE = 0.1
"""A band wider than this share of the range of its signal proves little."""


def verdict(c: ComparisonData) -> str:
    """The outcome in a line."""
    word = "ALIKE" if c.alike else "DIFFERENT"
    ended = [f"{name} did not come to its end" for name in c.unfinished]
    return f"{word}: {'; '.join([*ended, counts(c)])}, from {c.begin:.6g} to {c.end:.6g} s"


def as_text(c: ComparisonData) -> str:
    """The verdict, what the runs are and differ in, and what is out of band, the worst first."""
    sides = zip(c.names, (c.a, c.b), strict=True)
    parts = [[verdict(c), *(f"{name}: {side.name}" for name, side in sides)]]
    if c.differences:
        rows = _cut([f"  {d.setting}: {d.a} | {d.b}" for d in c.differences], MAX_LINES, "  ")
        parts.append([f"the runs differ in ({' | '.join(c.names)}):", *rows])
    elif c.a.result and c.b.result:
        parts.append(["the settings of the runs are the same"])
    return _joined([*parts, *_tables(c), [*absent_lines(c), *notes(c)]])


def short_text(c: ComparisonData) -> str:
    """The verdict, what the runs are, and a few of the worst: the repr() of a comparison."""
    sides = zip(c.names, (c.a, c.b), strict=True)
    head = [verdict(c), *(f"  {name}: {side.name}" for name, side in sides)]
    return on_a_screen([*head, *short_lines(c)])


def short_qualification(q: QualificationData) -> str:
    """The verdict and its reason, a few of the worst, and the interface, as its repr()."""
    interface, *_ = difference_lines(q.swap.differences)
    worst = [] if q.comparison is None else short_lines(q.comparison)
    return on_a_screen([qualification_verdict(q), f"  {reason(q)}", f"  {interface}", *worst])


def short_lines(c: ComparisonData) -> list[str]:
    """A few of the signals and metrics, the worst first."""
    return [
        f"  {line}"
        for kind, compared in kinds(c)
        for line in _table(kind, compared, c.names, FEW_ROWS)
    ]


def kinds(c: ComparisonData) -> list[tuple[str, Sequence[Compared]]]:
    """The signals and the metrics that were compared, as far as there are any."""
    return [
        (k, compared) for k, compared in (("signal", c.signals), ("metric", c.metrics)) if compared
    ]


def notes(c: ComparisonData) -> list[str]:
    """Where the bands are from, what only one has, which is not judged, and notes of the runs."""
    only = [
        f"{kind} only in {run}: {choices(names, 6)}"
        for kind, both in (("signals", c.only), ("metrics", c.only_metrics))
        for run, names in zip(c.names, both, strict=True)
        if names
    ]
    compared = (*c.signals, *c.metrics)
    stated_count = sum(m.band.source == "given" for m in compared)
    derived = f"{len(compared) - stated_count} derived from {c.names[0]} ({'; '.join(c.numerics)})"
    bands = (
        f"{stated_count} given, {derived}"
        if stated_count < len(compared)
        else f"all {stated_count} given"
    )
    wide = [s.name for s in c.signals if s.span and WIDE * s.span < s.band.width < inf]
    wide_note = [f"bands that are wide for the range of their signals: {', '.join(wide)}"]
    return [f"bands: {bands}", *(wide_note if wide else []), *only, *c.notes]


def as_json(c: ComparisonData) -> dict[str, Any]:
    """All of it, ready for JSON; a number that is infinite, or does not exist, is null."""
    differences = [{"what": d.setting, "a": d.a, "b": d.b} for d in c.differences]
    only_a, only_b = (
        {"signals": list(signals), "metrics": list(metrics)}
        for signals, metrics in zip(c.only, c.only_metrics, strict=True)
    )
    summary = {
        "alike": c.alike,
        "verdict": verdict(c),
        "a": c.a.name,
        "b": c.b.name,
        "begin": c.begin,
        "end": c.end,
        "differences": differences,
    }
    return {
        **summary,
        "signals": [_json(s, "a", "b") for s in c.signals],
        "metrics": [_json(m, "a", "b") for m in c.metrics],
        "no_value": list(c.absent),
        "only_a": only_a,
        "only_b": only_b,
        "notes": [*absent_lines(c), *notes(c)],
        "units": {"begin": "s", "end": "s", "band_time": "s", "time": "s"},
    }


def qualification_text(q: QualificationData) -> str:
    """The verdict, then what is out of band, the worst first, then the interface."""
    c, parts = q.comparison, [[qualification_verdict(q), reason(q)]]
    last = [f"whether this machine loads it: grasp-cosim inspect --load {q.swap.candidate}"]
    parts += [*([] if c is None else _tables(c)), difference_lines(q.swap.differences)]
    if c is not None:
        last = _cut(notes(c), MAX_LINES)
    return _joined([*parts, last if c is not None or q.failure else []])


def qualification_verdict(q: QualificationData) -> str:
    """The outcome in a line, and of which runs."""
    system, word = q.swap.system, "QUALIFIED" if q.qualified else "NOT QUALIFIED"
    step, stop = in_seconds(system.step_ns), in_seconds(system.stop_ns)
    from_ = f"{in_seconds(system.start_ns):g} to " if system.start_ns else ""
    return (
        f"{word}: {q.swap.candidate.name} as {q.swap.component} (now {q.swap.original.name}), "
        f"{from_}{stop:g} s in steps of {1e3 * step:g} ms, {system.scheme}"
    )


def qualification_json(q: QualificationData) -> dict[str, Any]:
    """All of it, ready for JSON; a number that is infinite, or does not exist, is null.

    `bands` are those that were used: `qualify --bands` takes the file.
    """
    system, c = q.swap.system, q.comparison
    summary = {
        "qualified": q.qualified,
        "reason": reason(q),
        "component": q.swap.component,
        "original": str(q.swap.original),
        "candidate": str(q.swap.candidate),
    }
    experiment = {
        "system": system.name,
        "step": in_seconds(system.step_ns),
        "stop": in_seconds(system.stop_ns),
        "scheme": system.scheme,
    }
    runs = ("original", "candidate")
    compared = {
        "signals": [_json(s, *runs) for s in q.signals],
        "metrics": [_json(m, *runs) for m in q.metrics],
        "no_value": [] if c is None else list(c.absent),
        "uncompared": [] if c is None else list(c.only[0]),
        "numerics": [] if c is None else list(c.numerics),
        "log": [] if c is None else list(c.notes),
    }
    bands = {
        "signals": {s.name: _band(s) | {"time": s.band.time} for s in q.signals},
        "metrics": {m.name: _band(m) for m in q.metrics},
    }
    return {
        **summary,
        **experiment,
        "failure": q.failure,
        "differences": [asdict(d) for d in q.swap.differences],
        **compared,
        "bands": bands,
        "units": {"step": "s", "stop": "s", "band_time": "s", "time": "s"},
    }


def reason(q: QualificationData) -> str:
    """Why the verdict is what it is, in one line."""
    if q.blocks:
        names = choices((d.variable for d in q.blocks), FEW_ROWS)
        return f"not run, the interface does not fit: {names}"
    if q.failure:
        return f"the candidate failed: {q.failure}"
    if q.comparison is None or not (q.signals or q.metrics):
        return "nothing was compared: no output that both record is a number"
    return "; ".join([counts(q.comparison), *absent_lines(q.comparison)])


def difference_lines(differences: Sequence[Difference]) -> list[str]:
    """What the candidate declares otherwise, the worst first."""
    if not differences:
        return ["interface: no difference"]
    by_severity = {s: [d for d in differences if d.severity == s] for s in SEVERITIES}
    lines = ["interface: " + ", ".join(f"{len(of)} {s}" for s, of in by_severity.items() if of)]
    for severity, of in by_severity.items():
        rows = [f"  {severity:6}  {d.kind:11}  {d.variable}: {d.text}" for d in of]
        lines += _cut(rows, FEW_ROWS if severity == "notes" else ROWS, f"  {severity:6}  ")
    return lines


def counts(c: ComparisonData) -> str:
    """How many are out of band: "2 of 30 signals and 1 of 12 metrics out of band"."""
    shares = [
        f"{sum(not comparison.inside for comparison in compared)} of {len(compared)} {name}"
        for name, compared in (("signals", c.signals), ("metrics", c.metrics))
        if compared
    ]
    return f"{' and '.join(shares)} out of band"


def absent_lines(c: ComparisonData) -> list[str]:
    """A line on metrics that have no value in either run, and on what that means."""
    if not c.absent:
        return []
    names = {plain(name) for name in c.absent}
    means = [m.none for m in c.metric_definitions if m.none and m.name in names]
    meaning = f"{', '.join(dict.fromkeys(means))} until t = {c.end:g} s: " if means else ""
    until = "" if means else f" until t = {c.end:g} s"
    line = f"{len(c.absent)} metrics have no value in either run{until}: {choices(c.absent, 6)}"
    return [meaning + line]


def _joined(parts: Iterable[Sequence[str]]) -> str:
    return "\n\n".join("\n".join(lines) for lines in parts if lines)


def _cut(lines: Sequence[str], max_rows: int, indent: str = "") -> list[str]:
    remaining = len(lines) - max_rows
    return [
        *lines[:max_rows],
        *([f"{indent}{remaining} more; --json has all"] if remaining > 0 else []),
    ]


def _tables(c: ComparisonData) -> list[list[str]]:
    return [_table(kind, compared, c.names, ROWS) for kind, compared in kinds(c)]


def cells(name: str, compared: Sequence[Compared], runs: tuple[str, str]) -> list[list[str]]:
    """The head and a row for each signal or metric; `runs` are the heads of their values."""
    time = ["at t in s"] if name == "signal" else []
    rows = [["x band", name, "deviation", "band", "unit", *time, *runs]]
    for c in compared:
        at = [] if c.time is None else [f"{c.time:.9g}"]
        values = [significant(v, 6) for v in (c.original, c.candidate)]
        widths = [significant(v, 3) for v in (c.deviation, c.band.width)]
        rows.append([significant(c.ratio, 3), c.name, *widths, c.unit or "", *at, *values])
    return rows


def _table(
    name: str, compared: Sequence[Compared], runs: tuple[str, str], max_rows: int
) -> list[str]:
    """The lines of a table of signals or metrics: what is out of band, the worst first and at
    `max_rows` so many, else some that are inside; `runs` are the heads of their values.
    """
    outside = [c for c in compared if not c.inside]
    listed_rows = outside[:max_rows] or compared[:FEW_ROWS]
    lines = columns(cells(name, listed_rows, runs), {1, 4})
    if remaining := len(compared) - len(listed_rows):
        beyond = len(outside) - len(listed_rows)
        more_outside = f"{beyond} more out of band, " if beyond > 0 else ""
        inside = len(compared) - len(outside) if outside else remaining
        lines.append(f"{'':8}{more_outside}{inside} more inside")
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
