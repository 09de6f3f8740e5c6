"""The section on the timing of a paced run, as HTML: what was kept, curves, tables, overruns.

The charts are SVG whose places are per cent of its size, so that they fit any width with letters
that stay as they are; only curves are in a drawing of their own, which is stretched. No script.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from html import escape

from ..realtime.timing import Timing
from .tables import bullets, count, number, table
from .timing_curves import (
    QUANTILES,
    TOP,
    Axes,
    Curve,
    Look,
    axes,
    culprits,
    curves,
    decades,
    duration,
    kept,
    label,
    late_decades,
    looks,
    percent,
    place,
    quantiles,
    unlisted,
)

MARKS = ("dot", "ring", "square")
"""The marks of late steps, by Look.dash."""

MOST_ROWS = 50
"""So many overruns are in the table."""


def timing_html(timing: Timing, end: float) -> str:
    """The section's content; end is the simulated time in s at the end of the run."""
    kind = "warn" if timing.overruns else "sum"
    return (
        f'<p class="{kind}">{escape(kept(timing))}</p><div class="paced"><div>'
        "<figure><figcaption>How often a part of a step took longer than a time</figcaption>"
        f"{_distributions(timing)}</figure>{_parts(timing)}</div>"
        f"<div>{_overruns(timing, end)}<h3>Pace</h3>{_pace(timing)}"
        f"{bullets('Granted by the machine', timing.granted, 'Nothing.')}"
        f"{bullets('Refused by the machine', timing.refused, 'Nothing.')}</div></div>"
        f"{_listed(timing)}"
    )


# Tables ----------------------------------------------------------------------------------------


def _pace(timing: Timing) -> str:
    rows = {
        "period": duration(timing.period),
        "factor asked for": number(timing.factor),
        "times as fast as real time": number(timing.real_time_factor, 6),
        "after an overrun": timing.overrun,
        "steps": count(timing.steps),
        "overruns": count(timing.overruns),
    }
    return table("", (f"<td>{name}</td><td>{escape(text)}</td>" for name, text in rows.items()))


def _parts(timing: Timing) -> str:
    """What each part took and how often it was to blame; also the key of the charts."""
    look, heads = looks(timing), (*QUANTILES, "worst", "at t in s")
    rows = []
    for part in dict.fromkeys((*timing.parts, *timing.culprits)):
        row = f"<td>{_key(look[part], label(part))}</td>" + _figures(timing, part)
        blamed = count(timing.culprits[part]) if part in timing.culprits else ""
        rows.append(row + (f'<td class="n">{blamed}</td>' if timing.overruns else ""))
    if timing.overruns:
        heads = (*heads, "overruns")
    cells = "".join(f'<th class="n">{head}</th>' for head in heads)
    return table(f"<th>part of a step, in µs</th>{cells}", rows)


def _figures(timing: Timing, part: str) -> str:
    """The cells of a part; empty for what only makes steps late."""
    if part not in timing.parts:
        return "<td></td>" * (len(QUANTILES) + 2)
    spread = timing.parts[part]
    cells = "".join(
        f'<td class="n{" warn" if t > timing.period else ""}">{_microseconds(t)}</td>'
        for t in quantiles(spread).values()
    )
    return f'{cells}<td class="n">{number(spread.worst_at)}</td>'


def _microseconds(seconds: float) -> str:
    whole, _, tenths = f"{1e6 * seconds:.1f}".partition(".")
    return f"{count(int(whole))}.{tenths}"


def _key(look: Look, text: str) -> str:
    """A short line as the curves have it, then the text."""
    return f'<span class="key {_classes(look)}">{escape(text)}</span>'


def _classes(look: Look) -> str:
    return f"l{look.color[2:]} dash{look.dash}"


def _listed(timing: Timing) -> str:
    """The first overruns as a table that opens."""
    listed = timing.listed[:MOST_ROWS]
    if not listed:
        return ""
    total = timing.overruns
    title = f"The first {len(listed)} of {count(total)} overruns"
    if total == len(listed):
        title = f"All {total} overruns" if total > 1 else "The overrun"
    look = looks(timing)
    rows = (
        f'<td class="n">{number(o.time, 9)}</td><td class="n">{count(o.step)}</td>'
        f'<td class="n">{_microseconds(o.late)}</td>'
        f"<td>{_key(look[o.culprit], label(o.culprit))}</td>"
        f'<td class="n">{_microseconds(o.took)}</td>'
        for o in listed
    )
    heads = (
        '<th class="n">t in s</th><th class="n">step</th><th class="n">late by, µs</th>'
        '<th>culprit</th><th class="n">which took, µs</th>'
    )
    return f"<details><summary>{title}</summary>{table(heads, rows)}</details>"


# Charts ----------------------------------------------------------------------------------------


def _distributions(timing: Timing) -> str:
    """The curves of all parts, and the period as a line that must not be crossed."""
    drawn, look = curves(timing), looks(timing)
    span = axes(drawn, timing.period)
    edge = 100.0 * place(timing.period, span.left, span.right)
    text = f"period {duration(timing.period)}"
    parts = [
        f'<rect class="beyond" x="{edge:.2f}%" width="{100.0 - edge:.2f}%" height="100%"/>',
        *_times("x", span.left, span.right),
        *_shares(span),
        f'<line class="limit" x1="{edge:.2f}%" x2="{edge:.2f}%" y2="100%"/>',
        f'<text class="limit" x="{edge:.2f}%" dx="-5" y="-7" text-anchor="end">{text}</text>',
        '<svg viewBox="0 0 1000 1000" preserveAspectRatio="none">',
        *(_line(curve, look[curve.part], span) for curve in drawn),
        "</svg>",
        *(mark for curve in drawn for mark in _marks(curve, look[curve.part], span)),
        *_quantiles(span),
    ]
    return _chart("how often a part of a step took longer than a time", parts)


def _shares(span: Axes) -> Iterable[str]:
    """Lines and labels of the shares."""
    for share in decades(span.bottom, 1.0):
        y = _height(share, span)
        yield f'<line y1="{y:.2f}%" x2="100%" y2="{y:.2f}%"/>'
        yield f'<text x="-8" y="{y:.2f}%" dy="4" text-anchor="end">{percent(share)}</text>'


def _quantiles(span: Axes) -> Iterable[str]:
    """Lines and names of the quantiles."""
    for name, share in QUANTILES.items():
        if share > span.bottom:
            y = _height(share, span)
            yield f'<line class="quantile" y1="{y:.2f}%" x2="100%" y2="{y:.2f}%"/>'
            yield f'<text x="5" y="{y:.2f}%" dy="-3">{name}</text>'


def _height(share: float, span: Axes) -> float:
    """Where a share is, in per cent from the top."""
    return 100.0 - 100.0 * place(share, span.bottom, TOP)


def _times(axis: str, low: float, high: float) -> Iterable[str]:
    """Lines and labels at the decades of times, upright for the axis x, level for y."""
    for t in decades(low, high):
        at = 100.0 * place(t, low, high)
        if axis == "x":
            yield f'<line x1="{at:.2f}%" x2="{at:.2f}%" y2="100%"/>'
            yield _below(at, duration(t))
        else:
            yield f'<line y1="{100.0 - at:.2f}%" x2="100%" y2="{100.0 - at:.2f}%"/>'
            yield (
                f'<text x="-8" y="{100.0 - at:.2f}%" dy="4" text-anchor="end">{duration(t)}</text>'
            )


def _below(at: float, text: str) -> str:
    return f'<text x="{at:.2f}%" y="100%" dy="17" text-anchor="middle">{text}</text>'


def _line(curve: Curve, look: Look, span: Axes) -> str:
    points = (
        f"{1000.0 * place(t, span.left, span.right):.1f},{10.0 * _height(share, span):.1f}"
        for t, share in curve.points
    )
    thick = " thick" if curve.part == "step" else ""
    return (
        f'<polyline class="{_classes(look)}{thick}" points="{" ".join(points)}">'
        f"<title>{escape(label(curve.part))}</title></polyline>"
    )


def _marks(curve: Curve, look: Look, span: Axes) -> Iterable[str]:
    """A dot on each quantile, a ring on the worst; their times when the pointer is over them."""
    for name, (t, share) in curve.marks.items():
        x, y = 100.0 * place(t, span.left, span.right), _height(share, span)
        kind, radius = ("ring", 3.5) if name == "worst" else ("dot", 2.5)
        yield (
            f'<circle class="{kind} {_classes(look)}" cx="{x:.2f}%" cy="{y:.2f}%" r="{radius}">'
            f"<title>{escape(label(curve.part))}: {name} {duration(t)}</title></circle>"
        )


def _overruns(timing: Timing, end: float) -> str:
    """A dot for each overrun that is listed; nothing where there are none."""
    listed = timing.listed
    if not listed:
        return ""
    look = looks(timing)
    low, high = late_decades(listed)
    by_rank = [name for name, _ in culprits(timing)]
    parts = [*_times("y", low, high), *_run_time(end), *_unlisted(timing, end)]
    for o in sorted(listed, key=lambda o: by_rank.index(o.culprit)):  # the rarest on top
        x, y = _percent(o.time, end), 100.0 - 100.0 * place(o.late, low, high)
        text = (
            f"t = {number(o.time, 9)} s: {duration(o.late)} late, "
            f"{label(o.culprit)} took {duration(o.took)}"
        )
        parts.append(_mark(look[o.culprit], x, y, escape(text)))
    chart = _chart("how late steps ended over the time of the run", parts)
    caption = "How late steps ended, and what was to blame"
    return f"<figure><figcaption>{caption}</figcaption>{chart}{_marks_key(timing, look)}</figure>"


def _mark(look: Look, x: float, y: float, title: str) -> str:
    """The mark of a late step, its middle in per cent; the title when the pointer is over it."""
    kind = f"{MARKS[look.dash]} {_classes(look)}"
    if MARKS[look.dash] == "square":
        shape, end = f'rect x="{x:.2f}%" y="{y:.2f}%" width="6" height="6"', "rect"
    else:
        shape, end = f'circle cx="{x:.2f}%" cy="{y:.2f}%" r="3"', "circle"
    return f'<{shape} class="late {kind}"><title>{title}</title></{end}>'


def _marks_key(timing: Timing, look: Mapping[str, Look]) -> str:
    """What the marks stand for, the most frequent first; with all their steps, listed or not."""
    drawn = {o.culprit for o in timing.listed}
    items = (
        f'<li class="{MARKS[look[name].dash]} {_classes(look[name])}">'
        f"{count(times)} × {escape(label(name))}</li>"
        for name, times in culprits(timing)
        if name in drawn
    )
    return f'<ul class="marks">{"".join(items)}</ul>'


def _percent(t: float, end: float) -> float:
    return 100.0 * min(t / end, 1.0) if end else 0.0


def _run_time(end: float) -> Iterable[str]:
    """Labels of the run's time, at its quarters."""
    for quarter in range(5):
        at = 25.0 * quarter
        yield f'<line x1="{at}%" x2="{at}%" y2="100%"/>'
        yield _below(at, f"{number(end * quarter / 4, 4)} s")


def _unlisted(timing: Timing, end: float) -> Iterable[str]:
    """A shade over the part of the run whose overruns were counted only."""
    if rest := unlisted(timing):
        x = _percent(timing.listed[-1].time, end)
        text = f"grey: {count(rest)} more, counted only"
        yield f'<rect class="unlisted" x="{x:.2f}%" width="{100.0 - x:.2f}%" height="100%"/>'
        yield f'<text x="100%" y="-7" text-anchor="end">{text}</text>'


def _chart(text: str, parts: Iterable[str]) -> str:
    """The drawing; text is for those who cannot see it."""
    return f'<div class="chart"><svg role="img" aria-label="{text}">{"".join(parts)}</svg></div>'
