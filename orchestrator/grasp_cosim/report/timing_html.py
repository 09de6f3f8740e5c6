"""The section on the timing of a paced run, as HTML: what was kept, the chart, tables, overruns."""

from __future__ import annotations

from html import escape

from ..base.errors import InputError
from ..base.text import grouped
from ..realtime.timing import Timing
from .tables import bullets, number, svg_button, table
from .timing import QUANTILES, duration, kept, label, quantiles, timing_svg

MOST_ROWS = 50
"""So many overruns are in the table."""


def timing_html(timing: Timing, end: float) -> str:
    """Return the content of the section; `end` is the simulated time in s at the end of the run.

    Without matplotlib a line says that the chart needs it.
    """
    kind = "warn" if timing.overruns else "sum"
    return (
        f'<p class="{kind}">{escape(kept(timing))}</p>{_chart(timing, end)}'
        f'<div class="paced"><div><h3>Parts of a step</h3>{_parts(timing)}</div>'
        f"<div><h3>Pace</h3>{_pace(timing)}"
        f"{bullets('Granted by the machine', timing.granted, 'Nothing.')}"
        f"{bullets('Refused by the machine', timing.refused, 'Nothing.')}</div></div>"
        f"{_listed(timing)}"
    )


def _chart(timing: Timing, end: float) -> str:
    """How often a part took longer than a time, and how late steps ended."""
    try:
        svg = timing_svg(timing, end)
    except InputError as error:
        return f'<p class="hint">No chart: {escape(str(error))}</p>'
    text = "how often a part of a step took longer than a time, and how late steps ended"
    return (
        f'<div class="scroll"><div class="chart" role="img" aria-label="{text}">{svg}</div></div>'
        f"{svg_button('.chart svg', 'timing')}"
    )


def _pace(timing: Timing) -> str:
    rows = {
        "period": duration(timing.period),
        "factor asked for": number(timing.factor),
        "times as fast as real time": number(timing.real_time_factor, 6),
        "after an overrun": timing.overrun,
        "steps": grouped(timing.steps),
        "overruns": grouped(timing.overruns),
    }
    return table("", (f"<td>{name}</td><td>{escape(text)}</td>" for name, text in rows.items()))


def _parts(timing: Timing) -> str:
    """The times that each part took and how often it was to blame."""
    late = ["overruns"] if timing.overruns else []
    heads, rows = [*QUANTILES, "worst", "at t in s", *late], []
    for part in dict.fromkeys((*timing.parts, *timing.culprits)):
        row = f"<td>{escape(label(part))}</td>{_figures(timing, part)}"
        blamed = grouped(timing.culprits[part]) if part in timing.culprits else ""
        rows.append(row + (f'<td class="n">{blamed}</td>' if late else ""))
    cells = "".join(f'<th class="n">{head}</th>' for head in heads)
    return table(f"<th>part of a step, in µs</th>{cells}", rows)


def _figures(timing: Timing, part: str) -> str:
    """The cells of a part; empty for what only makes steps late."""
    if part not in timing.parts:
        return "<td></td>" * (len(QUANTILES) + 2)
    spread = timing.parts[part]
    cells = "".join(
        f'<td class="n{" warn" if t > timing.period else ""}">{grouped(1e6 * t, 1)}</td>'
        for t in quantiles(spread).values()
    )
    return f'{cells}<td class="n">{number(spread.worst_at)}</td>'


def _listed(timing: Timing) -> str:
    listed = timing.listed[:MOST_ROWS]
    if not listed:
        return ""
    total = timing.overruns
    title = f"The first {len(listed)} of {grouped(total)} overruns"
    if total == len(listed):
        title = f"All {total} overruns" if total > 1 else "The overrun"
    rows = (
        f'<td class="n">{number(o.time, 9)}</td><td class="n">{grouped(o.step)}</td>'
        f'<td class="n">{grouped(1e6 * o.late, 1)}</td><td>{escape(label(o.culprit))}</td>'
        f'<td class="n">{grouped(1e6 * o.took, 1)}</td>'
        for o in listed
    )
    heads = (
        '<th class="n">t in s</th><th class="n">step</th><th class="n">late by, µs</th>'
        '<th>culprit</th><th class="n">which took, µs</th>'
    )
    return f"<details><summary>{title}</summary>{table(heads, rows)}</details>"
