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
from ..report.html_tables import bullets, cell, origin_rows, summary, table, text_table
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
from ..system.settings import given_units
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

WORST_SIGNALS = 4
"""So many of the worst signals are shown when the page opens."""

ZOOM_MARGIN = 0.02
"""The share of the compared time before and after a worst moment that a button zooms to."""

MIN_ZOOM_MARGIN = 1e-3
"""s; what takes the place of that where no time is compared."""


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


def comparison_html(c: ComparisonData, max_values: int = MAX_VALUES) -> str:
    """Return the page as text; of more than `max_values` values the signals are thinned."""
    return _html(c, max_values, verdict(c), c.alike, [*absent_lines(c), *notes(c)])


def short_html(c: ComparisonData) -> str:
    """The verdict on two runs, what they are, and the worst signals and metrics, for a notebook."""
    sides = zip(c.names, (c.a, c.b), strict=True)
    runs = "<br>".join(escape(f"{name}: {side.name}") for name, side in sides)
    return f"<p><b>{escape(verdict(c))}</b><br>{runs}</p>{_worst_html(c)}"


def short_qualification_html(q: QualificationData) -> str:
    """The verdict on a candidate and its reason, its interface, and the worst, for a notebook."""
    head = f"<p><b>{escape(qualification_verdict(q))}</b><br>{escape(reason(q))}</p>"
    interface = "<br>".join(map(escape, difference_lines(q.swap.differences)))
    worst = _worst_html(q.comparison) if q.comparison else ""
    return f"{head}<p>{interface}</p>{worst}"


def _worst_html(c: ComparisonData) -> str:
    """Tables of the signals and the metrics that are furthest out of their bands."""
    tables = [text_table(cells(kind, compared[:ROWS], c.names)) for kind, compared in kinds(c)]
    return "".join(tables)


def _html(
    c: ComparisonData, max_values: int, headline: str, is_good: bool, remarks: Sequence[str]
) -> str:
    """Return the page as text, with the headline at its top, and remarks on the runs."""
    time = np.union1d(*(side.part(c.begin, c.end).time for side in (c.a, c.b)))
    excerpt = _excerpt(c, time, max_values)
    ids = {key: f"column{k}" for k, key in enumerate(excerpt.signals)}
    scene = c.a.result.view.scene(c.a.result) if c.a.result else None
    title = f"{_title(c.a)} and {_title(c.b)}"
    kind = "" if is_good else "warn"
    columns = {ids[key]: values for key, values in excerpt.signals.items()}
    return traces_page(
        Caption(title, about(None)),
        summary=f'<span class="{kind}">{escape(headline)}</span>',
        sections=_sections(c, len(time), excerpt.rows_per_pair, remarks),
        state=_state(c, excerpt, ids, scene),
        data=columns_html(excerpt.time, columns),
        script=[scripts("save", "pairs")],
        style=scene.style if scene else "",
    )


def _excerpt(c: ComparisonData, time: npt.NDArray[np.float64], max_values: int) -> Excerpt:
    """The curves of all signals at these times, by the signal and the kind of curve."""
    curves = {
        f"{signal.name} {kind}": values
        for signal in c.signals
        for kind, values in _curves(c, signal, time)
    }
    return excerpt_of(time, curves, max_values)


def _title(side: Side) -> str:
    """The title of a run, or else its name."""
    title = side.result.origin.get("title") if side.result else None
    return str(title or side.name)


def _sections(
    c: ComparisonData, rows: int, rows_per_pair: int | None, remarks: Sequence[str]
) -> dict[str, tuple[str, str]]:
    """The sections of the page by their ids, each its head and its HTML."""
    return {
        "runs": (" and ".join(c.names), _runs_html(c, remarks)),
        "traces": ("Traces", _traces_html(c, rows, rows_per_pair)),
        "metrics": ("Metrics", f'<div class="pairs">{_metrics_html(c)}</div>'),
        "signals-table": (
            "Signals, the worst first",
            f'<div class="pairs">{_signals_html(c)}</div>',
        ),
    }


def _traces_html(c: ComparisonData, rows: int, rows_per_pair: int | None) -> str:
    """The traces; of each `rows_per_pair` rows the extremes are kept, where it is None all rows."""
    first, second = c.names
    exactness = (
        f"{first} solid and pale, {second} dashed over it; the tube is the band around {first}. "
        f"{grouped(rows)} rows of {counted(len(c.signals), 'signal')}."
    )
    if rows_per_pair:
        exactness += (
            f" Of each {rows_per_pair} rows this page keeps the lowest and the highest value."
        )
    units = {signal.name: signal.unit for signal in c.signals}
    in_order = {name: units[name] for name in c.curves[0] if name in units}
    return traces_html(exactness, in_order, _descriptions(c), ())


def _descriptions(c: ComparisonData) -> Mapping[str, str]:
    """The descriptions of the signals of the first run, as far as there are any."""
    return c.a.result.descriptions if c.a.result else {}


def _curves(
    c: ComparisonData, signal: Compared, time: npt.NDArray[np.float64]
) -> Iterator[tuple[str, npt.NDArray[Any]]]:
    """The curves of a signal at these times by kind: both runs, their deviation, the band."""
    first, second = (curves[signal.name] for curves in c.curves)
    band = signal.band
    apart = deviation(first.until(float(second.time[-1])), second, band.time)
    yield "a", first.at(time)
    yield "b", second.at(time)
    yield "apart", np.interp(time, apart.time, apart.values)
    if isfinite(band.width):
        low, high = tube(first, time, band.time)
        yield "low", low - band.width
        yield "high", high + band.width


def _state(
    c: ComparisonData, excerpt: Excerpt, ids: Mapping[str, str], scene: Scene | None
) -> dict[str, Any]:
    """Return the data for the scripts, without the values of the signals."""
    logs = [side.result.log for side in (c.a, c.b) if side.result]
    of_scene = scene.first_signals if scene else ()
    first_signals = [name for name in of_scene if name in c.curves[0]]
    first_signals += [signal.name for signal in c.signals[:WORST_SIGNALS]]
    marks = [{"t": time, "color": "--fault"} for log in logs for time in log_times(log)]
    return {
        "rows": len(excerpt.time),
        "names": list(c.names),
        "signals": [_signal_state(c, signal, ids) for signal in c.signals],
        "shown": list(dict.fromkeys(first_signals)),
        **signal_styles(scene),
        "about": about(None),
        "marks": marks,
        "scene": None,
    }


def _signal_state(c: ComparisonData, signal: Compared, ids: Mapping[str, str]) -> dict[str, Any]:
    """Return the data on a signal for the scripts; `ids` are those of its columns."""
    name, width = signal.name, signal.band.width
    return {
        "name": name,
        "unit": signal.unit,
        "steps": c.curves[0][name].held,
        "text": _descriptions(c).get(name, ""),
        "id": ids[f"{name} a"],
        "texts": None,
        "pair": {kind: ids.get(f"{name} {kind}") for kind in ("b", "low", "high", "apart")},
        "width": width if isfinite(width) else None,
    }


def _runs_html(c: ComparisonData, remarks: Sequence[str]) -> str:
    """A table of the two runs and of the settings that differ; and what is not compared."""
    heads = "".join(f"<th>{name}</th>" for name in ("", *c.names))
    of_a, of_b = _about_html(c.a), _about_html(c.b)
    rows = [
        _row(key, [of_a.get(key, ""), of_b.get(key, "")])
        for key in ("from", "what", "changed", "run", "date", "command")
        if key in of_a or key in of_b
    ]
    different = [_row(d.setting, [escape(d.a), escape(d.b)]) for d in c.differences]
    settings = ""
    if different:
        settings = f"<h3>The settings differ in</h3>{table(heads, different)}"
    elif c.a.result and c.b.result:
        settings = "<p>The settings of the two runs are the same.</p>"
    return f"{table(heads, rows)}{settings}{bullets('Notes', remarks, 'None.')}"


def _about_html(side: Side) -> dict[str, str]:
    """What a run is, by heads, as HTML."""
    run = side.result
    if run is None:
        first, last = number(float(side.time[0])), number(float(side.time[-1]))
        rows = f"{grouped(len(side.time))} rows, {first} to {last} s"
        return {"from": escape(side.name), "what": "", "changed": "", "run": rows}
    settings, changed = run.settings, ""
    if "changed" in settings:
        changed = changes(settings["changed"], given_units(settings))
    return {
        "from": escape(side.name),
        "what": escape(caption(run).title),
        "changed": escape(changed),
        "run": summary(run.metrics),
        **{key: escape(text) for key, text in origin_rows(run.origin)},
    }


def _row(head: str, cells_html: Iterable[str]) -> str:
    """A row of cells that are HTML already."""
    return cell(head) + "".join(f'<td class="w">{html}</td>' for html in cells_html)


def _signals_html(c: ComparisonData) -> str:
    """The signals, the worst first."""
    formatted = partial(number, digits=4)
    rows = [_compared_row(c, signal, signal.name, signal.unit, formatted) for signal in c.signals]
    return table(_heads(c), rows)


def _metrics_html(c: ComparisonData) -> str:
    """The metrics, in the order in which they are worked out."""
    rows = []
    for metric in c.metric_definitions:
        in_display_unit = partial(scaled, factor=metric.factor)
        for compared in sorted(c.metrics, key=lambda compared: compared.name):
            if plain(compared.name) == metric.name:
                if compared.name in metric.columns:
                    title = metric.column_title(compared.name)
                else:
                    title = f"{metric.title}{compared.name.removeprefix(metric.name)}"
                rows.append(_compared_row(c, compared, title, metric.display_unit, in_display_unit))
    return table(_heads(c), rows) if rows else "<p>There are no metrics that both have.</p>"


def _heads(c: ComparisonData) -> str:
    heads = ("", "at", "deviation", "band", *c.names)
    return "<th></th>" + "".join(f'<th class="n">{head}</th>' for head in heads)


def _compared_row(
    c: ComparisonData,
    compared: Compared,
    title: str,
    unit: str | None,
    formatted: Callable[[Any], str],
) -> str:
    """A row: how many widths of its band it is off; a button goes to the worst moment."""
    values = (compared.deviation, compared.band.width, compared.original, compared.candidate)
    return (
        cell(f"{title} in {unit}" if unit else title)
        + cell(_judgement(compared), class_="n" if compared.inside else "n warn")
        + f'<td class="n">{_zoom_button(c, compared)}</td>'
        + "".join(cell(formatted(value), class_="n") for value in values)
    )


def _judgement(compared: Compared) -> str:
    """Whether it is inside its band, or how far off in widths of it."""
    if not isfinite(compared.deviation):
        return "one has none"
    if compared.inside:
        return "inside"
    return f"{compared.ratio:.3g} × band" if isfinite(compared.ratio) else "differ"


def _zoom_button(c: ComparisonData, compared: Compared) -> str:
    """A button that shows a signal at its worst moment; empty of a metric, which has no time."""
    if compared.time is None:
        return ""
    margin = ZOOM_MARGIN * (c.end - c.begin) or MIN_ZOOM_MARGIN
    begin, end = compared.time - margin, compared.time + margin
    return (
        f'<button type="button" data-show="{escape(compared.name)}" data-from="{begin!r}" '
        f'data-to="{end!r}">{number(compared.time)} s</button>'
    )
