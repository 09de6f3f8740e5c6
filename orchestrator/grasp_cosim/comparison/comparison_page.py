"""The page of a comparison: two runs over each other, and what differs between them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import partial
from html import escape
from math import isfinite
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.files import write_text
from ..base.text import counted, grouped
from ..report.embed import MAX_VALUES, Excerpt, excerpt_of
from ..report.html_tables import bullets, origin_rows, summary, table, text_table
from ..report.traces_page import (
    Scene,
    columns_html,
    log_times,
    scripts,
    signal_styles,
    traces_html,
    traces_page,
)
from ..report.wording import Caption, about, caption, changes, number, scaled
from .bands import Compared, plain
from .outcome import ComparisonData, QualificationData
from .side import Side
from .summary import (
    ROWS,
    absent_lines,
    cells,
    difference_lines,
    kinds,
    notes,
    qualification_verdict,
    reason,
    verdict,
)
from .tube import deviation, tube

AT_FIRST = 4
"""So many of the worst signals are shown first."""

AROUND = 0.02
"""The share of the time in view before and after a worst moment that a button zooms to."""

Columns = Mapping[str, npt.NDArray[Any]]


def write_comparison(c: ComparisonData, path: Path) -> None:
    """Write the page of a comparison."""
    write_text(path, comparison_html(c))


def write_qualification(q: QualificationData, path: Path) -> bool:
    """Write the page of a qualification, as of a comparison; False where there were no two runs.

    A page that was there before is gone then.
    """
    c = q.comparison
    if c is None or not c.signals:
        path.unlink(missing_ok=True)
        return False
    remarks = [*difference_lines(q.swap.differences), *notes(c)]
    text = f"{qualification_verdict(q)}: {reason(q)}"
    write_text(path, _html(c, MAX_VALUES, text, q.qualified, remarks))
    return True


def comparison_html(c: ComparisonData, limit: int = MAX_VALUES) -> str:
    """Return the page as text; of more than `limit` values the signals are thinned."""
    return _html(c, limit, verdict(c), c.alike, [*absent_lines(c), *notes(c)])


def short_html(c: ComparisonData) -> str:
    """The verdict on two runs, what they are, and the worst signals and metrics, for a notebook."""
    sides = zip(c.names, (c.a, c.b), strict=True)
    runs = "<br>".join(escape(f"{name}: {side.name}") for name, side in sides)
    return f"<p><b>{escape(verdict(c))}</b><br>{runs}</p>{_worst(c)}"


def short_qualification_html(q: QualificationData) -> str:
    """The verdict on a candidate and its reason, its interface, and the worst, for a notebook."""
    head = f"<p><b>{escape(qualification_verdict(q))}</b><br>{escape(reason(q))}</p>"
    interface = "<br>".join(map(escape, difference_lines(q.swap.differences)))
    return f"{head}<p>{interface}</p>{'' if q.comparison is None else _worst(q.comparison)}"


def _worst(c: ComparisonData) -> str:
    """Tables of the signals and the metrics that are furthest out of their bands."""
    return "".join(text_table(cells(kind, compared[:ROWS], c.names)) for kind, compared in kinds(c))


def _html(
    c: ComparisonData, limit: int, headline: str, is_good: bool, remarks: Sequence[str]
) -> str:
    """Return the page as text, with the headline at its top, and remarks on the runs."""
    time = np.union1d(*(run.part(c.begin, c.end).time for run in (c.a, c.b)))
    embedded = excerpt_of(
        time, {f"{s.name} {k}": v for s in c.signals for k, v in _drawn(c, s, time)}, limit
    )
    ids = {key: f"column{k}" for k, key in enumerate(embedded.signals)}
    scene = c.a.result.view.scene(c.a.result) if c.a.result else None
    units = {s.name: s.unit for s in sorted(c.signals, key=lambda s: [*c.curves[0]].index(s.name))}
    texts = c.a.result.descriptions if c.a.result else {}
    exact = (
        f"{c.names[0]} solid and pale, {c.names[1]} dashed over it; the tube is the band around "
        f"{c.names[0]}. {grouped(len(time))} rows of {counted(len(c.signals), 'signal')}."
    )
    if thinned := embedded.rows_per_pair:
        exact += f" Of each {thinned} rows this page keeps the lowest and the highest value."
    digits = partial(number, digits=4)
    signals = table(_heads(c), [_compared(c, s, s.name, s.unit, digits) for s in c.signals])
    sections = {
        "runs": (" and ".join(c.names), _runs(c, remarks)),
        "traces": ("Traces", traces_html(exact, units, texts, ())),
        "metrics": ("Metrics", f'<div class="pairs">{_metrics(c)}</div>'),
        "signals-table": ("Signals, the worst first", f'<div class="pairs">{signals}</div>'),
    }
    titles = [str((s.result and s.result.origin.get("title")) or s.name) for s in (c.a, c.b)]
    return traces_page(
        Caption(" and ".join(titles), about(None)),
        f'<span class="{"" if is_good else "warn"}">{escape(headline)}</span>',
        sections,
        _state(c, embedded, ids, scene, texts),
        columns_html(
            embedded.time,
            {ids[key]: values for key, values in embedded.signals.items()},
        ),
        [scripts("save", "pairs")],
        scene.style if scene else "",
    )


def _drawn(
    c: ComparisonData, s: Compared, time: npt.NDArray[np.float64]
) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """The curves of a signal at these times by name: both runs, their deviation, the band."""
    first, second = (run[s.name] for run in c.curves)
    apart = deviation(first.until(float(second.time[-1])), second, s.band.time)
    yield "a", first.at(time)
    yield "b", second.at(time)
    yield "apart", np.interp(time, apart.time, apart.values)
    if isfinite(s.band.width):
        low, high = tube(first, time, s.band.time)
        yield "low", low - s.band.width
        yield "high", high + s.band.width


def _state(
    c: ComparisonData, embedded: Excerpt, ids: Mapping[str, str], scene: Scene | None,
    texts: Mapping[str, str],
) -> dict[str, Any]:  # fmt: skip
    """Return the data for the scripts, without the values of the signals."""
    logs = [run.result.log for run in (c.a, c.b) if run.result]
    in_scene = [name for name in (scene.first_signals if scene else ()) if name in c.curves[0]]
    worst = [s.name for s in c.signals[:AT_FIRST]]
    return {
        "rows": len(embedded.time),
        "names": list(c.names),
        "signals": [_signal_state(c, s, ids, texts) for s in c.signals],
        "shown": list(dict.fromkeys([*in_scene, *worst])),
        **signal_styles(scene),
        "about": about(None),
        "marks": [{"t": t, "color": "--fault"} for log in logs for t in log_times(log)],
        "scene": None,
    }


def _signal_state(
    c: ComparisonData, s: Compared, ids: Mapping[str, str], texts: Mapping[str, str]
) -> dict[str, Any]:
    """What the scripts are told of a signal; `ids` are those of its columns."""
    pair = {key: ids.get(f"{s.name} {key}") for key in ("b", "low", "high", "apart")}
    width = s.band.width if isfinite(s.band.width) else None
    return {
        "name": s.name,
        "unit": s.unit,
        "steps": c.curves[0][s.name].held,
        "text": texts.get(s.name, ""),
        "id": ids[f"{s.name} a"],
        "texts": None,
        "pair": pair,
        "width": width,
    }


def _runs(c: ComparisonData, remarks: Sequence[str]) -> str:
    """A table of the two runs and of the settings that differ; and what is not compared."""
    sides, heads = (c.a, c.b), "".join(f"<th>{name}</th>" for name in ("", *c.names))
    about = [_about(side) for side in sides]
    always = ("from", "what", "changed", "run")
    has_text = [key for key in (*always, "date", "command") if any(key in of for of in about)]
    rows = [_row(key, [of.get(key, "") for of in about]) for key in has_text]
    differ = [_row(d.setting, [escape(d.a), escape(d.b)]) for d in c.differences]
    settings = f"<h3>The settings differ in</h3>{table(heads, differ)}" if differ else ""
    if c.a.result and c.b.result and not differ:
        settings = "<p>The settings of the two runs are the same.</p>"
    return f"{table(heads, rows)}{settings}{bullets('Notes', remarks, 'None.')}"


def _about(side: Side) -> dict[str, str]:
    """What a run is, by heads, as HTML."""
    run = side.result
    if run is None:
        span = " to ".join(number(float(side.time[row])) for row in (0, -1))
        length = f"{grouped(len(side.time))} rows, {span} s"
        return {"from": escape(side.name), "what": "", "changed": "", "run": length}
    changed = changes(run.settings["changed"]) if "changed" in run.settings else ""
    return {
        "from": escape(side.name),
        "what": escape(caption(run).title),
        "changed": escape(changed),
        "run": summary(run.metrics),
        **{key: escape(text) for key, text in origin_rows(run.origin)},
    }


def _row(head: str, cells: Iterable[str]) -> str:
    """A row of cells that are HTML already."""
    return f"<td>{escape(head)}</td>" + "".join(f'<td class="w">{cell}</td>' for cell in cells)


def _metrics(c: ComparisonData) -> str:
    """The metrics, in the order in which they are worked out."""
    rows = []
    for metric in c.metric_definitions:
        for m in sorted(c.metrics, key=lambda m: m.name):
            if plain(m.name) == metric.name:
                has_column, entry = m.name in metric.columns, m.name.removeprefix(metric.name)
                title = metric.column_title(m.name) if has_column else f"{metric.title}{entry}"
                in_display_unit = partial(scaled, factor=metric.factor)
                rows.append(_compared(c, m, title, metric.display_unit, in_display_unit))
    return table(_heads(c), rows) if rows else "<p>There are no metrics that both have.</p>"


def _heads(c: ComparisonData) -> str:
    heads = ("", "at", "deviation", "band", *c.names)
    return "<th></th>" + "".join(f'<th class="n">{head}</th>' for head in heads)


def _compared(
    c: ComparisonData,
    compared: Compared,
    title: str,
    unit: str | None,
    formatted: Callable[[Any], str],
) -> str:
    """A row: how many widths of its band it is off; a button goes to the worst moment."""
    state, at = "inside", ""
    if not isfinite(compared.deviation):
        state = "one has none"
    elif not compared.inside:
        state = f"{compared.ratio:.3g} × band" if isfinite(compared.ratio) else "differ"
    if compared.time is not None:
        begin, end = (
            compared.time + by * (AROUND * (c.end - c.begin) or 1e-3) for by in (-1.0, 1.0)
        )
        at = (
            f'<button type="button" data-show="{escape(compared.name)}" data-from="{begin!r}" '
            f'data-to="{end!r}">{number(compared.time)} s</button>'
        )
    values = map(
        formatted, (compared.deviation, compared.band.width, compared.original, compared.candidate)
    )
    cells = "".join(f'<td class="n">{cell}</td>' for cell in (at, *map(escape, values)))
    warn, of_unit = "" if compared.inside else " warn", f" in {escape(unit)}" if unit else ""
    return f'<td>{escape(title)}{of_unit}</td><td class="n{warn}">{state}</td>{cells}'
