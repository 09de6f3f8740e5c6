"""A tuning for a terminal, as JSON, as values to paste, as a table of all points."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..numerals import fixed
from .problem import Gain
from .search import Point, Tuning

OBJECTIVE = "of a metric the greatest value counts, over its entries and the conditions"


def as_json(found: Tuning) -> dict[str, Any]:
    """The object of `tune --json`."""
    problem = found.problem
    units = {name: problem.metric(name).unit for name in problem.names}
    return {
        "minimise": problem.minimise,
        "objective": OBJECTIVE,
        "conditions": [c.name for c in problem.conditions],
        "bounds": {g.name: [g.low, g.high] for g in problem.gains},
        "budget": found.budget,
        "seed": found.seed,
        "points": len(found.points),
        "runs": len(found.points) * len(problem.conditions),
        "limits": dict(found.limits),
        "start": _point(found, found.start),
        "tuned": _point(found, found.tuned) if found.tuned else None,
        "front": [_point(found, point) for point in found.front],
        "checks": [
            {
                "condition": c.name,
                "start": c.start.figures,
                "tuned": c.tuned.figures,
                "broken": c.tuned.broken(found.limits),
            }
            for c in found.checks
        ],
        "units": {**units, **{g.name: problem.unit(g) for g in problem.gains}},
    }


def as_text(found: Tuning, start: str) -> str:
    """Tables of the figures, the gains and the checks; `start` names the gains of the system."""
    problem, best = found.problem, found.tuned
    lines = [
        f"least {problem.metric(problem.minimise).title}, the worst of: "
        f"{'; '.join(c.name for c in problem.conditions)}",
        f"{len(found.points)} sets of {len(problem.gains)} gains, seed {found.seed}, "
        f"{len(found.points) * len(problem.conditions)} runs; {OBJECTIVE}",
        "",
        f"{'':40s}{start:>11s}{'tuned':>11s}{'at most':>11s}",
    ]
    for name in problem.names:
        figures = [found.start.figures[name], best.figures[name] if best else None]
        shown = [_shown(found, name, x) for x in (*figures, found.limits.get(name))]
        unit = problem.metric(name).display_unit
        if name not in found.limits:
            shown[2] = ""
        lines.append(
            f"{problem.metric(name).title:40s}{''.join(f'{x:>11s}' for x in shown)} {unit}".rstrip()
        )
    lines += ["", *_gain_lines(found)]
    if best is None:
        return "\n".join([*lines, "", "NONE of the points keeps all limits"])
    return "\n".join(
        [*lines, *_check_lines(found, start), "", f"as options: {options(found, best)}"]
    )


def options(found: Tuning, point: Point) -> str:
    """The --set options of `run` with these gains."""
    return " ".join(f"--set {k}={v!r}" for k, v in _values(found, point).items())


def preset_toml(found: Tuning, point: Point, name: str = "tuned") -> str:
    """A preset of a system file with these gains, where they are from as comments."""
    problem = found.problem
    limits = ", ".join(f"{k} at most {v:.6g}" for k, v in found.limits.items())
    lines = [
        f"# Least {problem.minimise}, {point.figures[problem.minimise]:.6g}; limits: "
        f"{limits or 'none'}; SI units.",
        f"# The worst of: {'; '.join(c.name for c in problem.conditions)}.",
        f"# The best of {len(found.points)} points, seed {found.seed}: no proof of a best one.",
        f"# At the end of a system file it is for: grasp-cosim run FILE --preset {name}",
        f"[presets.{name}]",
        *(
            f'"{key}" = {value!r}{_unit(found, gain)}'
            for gain in problem.gains
            for key, value in _values(found, point).items()
            if key in gain.variables
        ),
    ]
    return "\n".join(lines) + "\n"


def rows(found: Tuning) -> list[dict[str, Any]]:
    """A row per point, in the order in which they were tried."""
    return [
        {
            **dict(zip((g.name for g in found.problem.gains), point.gains, strict=True)),
            **point.figures,
            "kept": point.keeps(found.limits),
            "error": point.error or "",
        }
        for point in found.points
    ]


def _gain_lines(found: Tuning) -> list[str]:
    best, lines = found.tuned, []
    for i, gain in enumerate(found.problem.gains):
        values = [found.start.gains[i], *([best.gains[i]] if best else [])]
        shown = "".join(f"{v:11.4g}" for v in values) + ("" if best else f"{'none':>11s}")
        at = " AT ITS BOUND" if best and best.gains[i] in (gain.low, gain.high) else ""
        bounds = f"  {gain.low:.4g} to {gain.high:.4g}"
        unit = found.problem.unit(gain) or ""
        lines.append(f"{gain.name:40s}{shown}{bounds} {unit}{at}".rstrip())
    return lines


def _check_lines(found: Tuning, start: str) -> list[str]:
    """A line per check: what was and is reached there, and loudly, which limits are broken."""
    if not found.checks:
        return []
    metrics = [found.problem.metric(name) for name in found.problem.names]
    wide = [max(17, len(m.title) + 2) for m in metrics]

    def line(name: str, cells: Iterable[str]) -> str:
        return f"{name:28s}" + "".join(f"{c:>{w}s}" for c, w in zip(cells, wide, strict=True))

    lines = [
        "",
        f"where it was not tuned, {start} -> tuned:",
        line("", (m.title for m in metrics)),
        line("", (m.display_unit or "1" for m in metrics)),
    ]
    for c in found.checks:
        both = (
            f"{_shown(found, m.name, c.start.figures[m.name])} -> "
            f"{_shown(found, m.name, c.tuned.figures[m.name])}"
            for m in metrics
        )
        lines.append(line(c.name, both))
        lines += [f"  {broken}" for broken in broken_lines(found, c.start, c.tuned, start)]
    return lines


def broken_lines(found: Tuning, before: Point, after: Point, start: str) -> list[str]:
    """Like "BROKEN: impact velocity, at most 6.043 mm/s; published: kept"."""
    lines = []
    for name in after.broken(found.limits):
        metric = found.problem.metric(name)
        most = _shown(found, name, found.limits[name])
        too = "broken, too" if name in before.broken(found.limits) else "kept"
        lines.append(
            f"BROKEN: {metric.title}, at most {most} {metric.display_unit}; {start}: {too}"
        )
    if after.figures[found.problem.minimise] is None:
        lines.append(f"NO {found.problem.metric(found.problem.minimise).title} there")
    return lines


def _shown(found: Tuning, name: str, value: float | None) -> str:
    """A figure in the unit in which tables show it."""
    factor = found.problem.metric(name).factor
    return "none" if value is None else fixed(factor * value, 3, rounded=True)


def _point(found: Tuning, point: Point) -> dict[str, Any]:
    return {"gains": _values(found, point), **point.figures}


def _values(found: Tuning, point: Point) -> Mapping[str, float]:
    return found.problem.values(point.gains)


def _unit(found: Tuning, gain: Gain) -> str:
    unit = found.problem.unit(gain)
    return f"  # {unit}" if unit else ""
