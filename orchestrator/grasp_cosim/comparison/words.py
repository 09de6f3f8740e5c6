"""A comparison as text that is read in ten seconds, and as JSON."""

from __future__ import annotations

from typing import Any

from ..errors import choices
from ..qualification.tables import bands_lines, compared_json, compared_table, counts
from .compare import Comparison

RUNS = ("A", "B")
"""The names of the two runs."""

MOST = 12
"""So many differences of the settings at most are in the text."""


def verdict(c: Comparison) -> str:
    """The outcome in a line."""
    word = "ALIKE" if c.alike else "DIFFERENT"
    return f"{word}: {counts(c.signals, c.metrics)}, from {c.begin:.6g} to {c.end:.6g} s"


def as_text(c: Comparison) -> str:
    """The verdict, what the runs are and differ in, and what is out of band, the worst first."""
    parts = [
        [verdict(c), *(f"{name}: {side.name}" for name, side in zip(RUNS, (c.a, c.b), strict=True))]
    ]
    if c.differences:
        rows = [f"  {d.what}: {d.a} | {d.b}" for d in c.differences[:MOST]]
        left = len(c.differences) - len(rows)
        more = [f"  {left} more; --json and the page have all"] if left else []
        parts.append(["the runs differ in (A | B):", *rows, *more])
    elif c.a.result and c.b.result:
        parts.append(["the settings of the runs are the same"])
    for name, compared in (("signal", c.signals), ("metric", c.metrics)):
        if compared:
            parts.append(compared_table(name, compared, RUNS))
    parts.append([*c.notes, *only_lines(c), *basis(c)])
    return "\n\n".join(map("\n".join, parts))


def only_lines(c: Comparison) -> list[str]:
    """The signals and metrics that only one of the two has."""
    return [
        f"{kind} only in {run}: {choices(names, 6)}"
        for kind, both in (("signals", c.only), ("metrics", c.only_metrics))
        for run, names in zip(RUNS, both, strict=True)
        if names
    ]


def basis(c: Comparison) -> list[str]:
    """Where the bands are from."""
    return bands_lines(c.signals, c.metrics, "A (its range; every second sample)")


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
        "signals": [compared_json(s, ("a", "b")) for s in c.signals],
        "metrics": [compared_json(m, ("a", "b")) for m in c.metrics],
        "only_a": {"signals": list(c.only[0]), "metrics": list(c.only_metrics[0])},
        "only_b": {"signals": list(c.only[1]), "metrics": list(c.only_metrics[1])},
        "notes": list(c.notes),
        "units": {"begin": "s", "end": "s", "band_time": "s", "time": "s"},
    }
