"""Compared signals and metrics as text that is read in ten seconds, and for JSON."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, isfinite
from typing import Any

from .compared import Compared

ROWS = 8
"""The most signals, metrics or differences of one severity that the text lists."""

FEW = 3
"""How many it lists where all of them are inside, or just notes."""

WIDE = 0.1
"""A band wider than this share of the range of its signal proves little."""


def counts(signals: Sequence[Compared], metrics: Sequence[Compared]) -> str:
    """How many are out of band: "2 of 30 signals and 1 of 12 metrics out of band"."""
    found = [
        f"{sum(not c.inside for c in compared)} of {len(compared)} {name}"
        for name, compared in (("signals", signals), ("metrics", metrics))
        if compared
    ]
    return f"{' and '.join(found)} out of band"


def compared_table(
    name: str, compared: Sequence[Compared], runs: tuple[str, str] = ("original", "candidate")
) -> list[str]:
    """The lines of a table of signals or metrics, as `name` says: what is out of band, the worst
    first, else some that are inside; `runs` are the heads of their values.
    """
    outside = [c for c in compared if not c.inside]
    shown = outside[:ROWS] or compared[:FEW]
    rows = [("x band", name, "deviation", "band", "unit", "at t in s", *runs)]
    rows += [
        (
            _number(c.ratio, 3),
            c.name,
            _number(c.deviation, 3),
            _number(c.band.width, 3),
            c.unit or "",
            "" if c.time is None else f"{c.time:.9g}",
            _number(c.original, 6),
            _number(c.candidate, 6),
        )
        for c in shown
    ]
    if name == "metric":
        rows = [(*row[:5], *row[6:]) for row in rows]  # type: ignore[misc]
    left = len(compared) - len(shown)
    more = f"{len(outside) - len(shown)} more out of band, " if len(outside) > len(shown) else ""
    inside = len(compared) - len(outside) if outside else left
    rest = [f"{'':8}{more}{inside} more inside"] if left else []
    return [*_aligned(rows), *rest]


def _aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Columns side by side: texts to the left, numbers to the right."""
    texts = {i for i, title in enumerate(rows[0]) if title in ("signal", "metric", "unit")}
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return [
        "  ".join(
            cell.ljust(width) if i in texts else cell.rjust(width)
            for i, (cell, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in rows
    ]


def bands_lines(signals: Sequence[Compared], metrics: Sequence[Compared], basis: str) -> list[str]:
    """Where the bands are from: given, or derived from `basis`; and which prove little."""
    given = sum(c.band.source == "given" for c in (*signals, *metrics))
    derived = len(signals) + len(metrics) - given
    lines = [f"bands: {given} given, {derived} derived from {basis}"]
    if not derived:
        lines = [f"bands: all {given} given"]
    if wide := [c.name for c in signals if c.span and WIDE * c.span < c.band.width < inf]:
        lines.append(f"bands that are wide for the range of their signals: {', '.join(wide)}")
    return lines


def _number(value: float | None, digits: int) -> str:
    return "none" if value is None else f"{value:.{digits}g}"


def compared_json(c: Compared, runs: tuple[str, str] = ("original", "candidate")) -> dict[str, Any]:
    """All of it, ready for JSON: a number that is infinite is null; `runs` name the two values."""
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
