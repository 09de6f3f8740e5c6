"""A qualification as text that is read in ten seconds, as JSON, and its bands as a file."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

from ..errors import choices
from ..numerals import counted
from ..system.parts import NANOSECONDS
from .interface_difference import SEVERITIES, Difference
from .qualify import Qualification
from .tables import FEW, ROWS, bands_lines, compared_json, compared_table, counts


def as_text(q: Qualification) -> str:
    """The verdict, then what is out of band, the worst first, then the interface."""
    system, word = q.swap.system, "QUALIFIED" if q.qualified else "NOT QUALIFIED"
    step, stop = system.step_ns / NANOSECONDS, system.stop_ns / NANOSECONDS
    head = (
        f"{word}: {q.swap.candidate.name} as {q.swap.component} (now {q.swap.original.name}), "
        f"{stop:g} s in steps of {1e3 * step:g} ms, {system.scheme}"
    )
    parts = [[head, reason(q)]]
    for name, compared in (("signal", q.signals), ("metric", q.metrics)):
        if compared:
            parts.append(compared_table(name, compared))
    parts.append(_differences(q.swap.differences))
    if q.signals:
        parts.append(_basis(q))
    elif q.failure:
        parts.append([f"whether this machine loads it: grasp-cosim doctor {q.swap.candidate}"])
    return "\n\n".join(map("\n".join, parts))


def as_json(q: Qualification) -> dict[str, Any]:
    """All of it, ready for JSON; a number that is infinite, or does not exist, is null."""
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
        "signals": [compared_json(c) for c in q.signals],
        "metrics": [compared_json(c) for c in q.metrics],
        "uncompared": list(q.uncompared),
        "numerics": list(q.numerics),
        "log": list(q.log),
    }


def as_bands(q: Qualification) -> str:
    """The bands as they were used, in the form of a file of bands (TOML)."""
    lines = [f"# {q.swap.candidate.name} as {q.swap.component}: the bands as they were used"]
    for table, compared in (("signals", q.signals), ("metrics", q.metrics)):
        lines += ["", f"[{table}]"]
        for c in sorted(compared, key=lambda c: c.name):
            time = f", time = {c.band.time!r}" if table == "signals" else ""
            lines.append(f"{json.dumps(c.name)} = {{ absolute = {c.band.width!r}{time} }}")
    return "\n".join(lines) + "\n"


def reason(q: Qualification) -> str:
    """Why the verdict is what it is, in one line."""
    if q.blocks:
        names = choices((d.variable for d in q.blocks), FEW)
        return f"not run, the interface does not fit: {names}"
    if q.failure:
        return f"the candidate failed: {q.failure}"
    if not (q.signals or q.metrics):
        return "nothing was compared: no output that both record is a number"
    return counts(q.signals, q.metrics)


def _differences(differences: Sequence[Difference]) -> list[str]:
    if not differences:
        return ["interface: no difference"]
    counts = {s: sum(d.severity == s for d in differences) for s in SEVERITIES}
    lines = ["interface: " + ", ".join(f"{n} {s}" for s, n in counts.items() if n)]
    for severity in SEVERITIES:
        of_it = [d for d in differences if d.severity == severity]
        most = FEW if severity == "notes" else ROWS
        lines += [f"  {severity:6}  {d.kind:11}  {d.variable}: {d.text}" for d in of_it[:most]]
        if len(of_it) > most:
            lines.append(f"  {severity:6}  {len(of_it) - most} more; --json has all")
    return lines


def _basis(q: Qualification) -> list[str]:
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
        lines.append(
            f"the candidate's run: {counted(len(q.log) - ROWS, 'line')} more; --json has all"
        )
    return lines
