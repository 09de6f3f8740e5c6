"""What pages and notebooks show of a result as HTML: its metrics, settings and protocol."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from html import escape
from typing import Any

from ..base.text import counted, grouped
from ..metrics.metric import Metric
from ..recording.result import Result
from .wording import entries, number, scaled

EXPERIMENT = (
    "system", "step", "stop", "scheme", "initialisation", "steps", "wall_time", "real_time_factor",
    "complete",
)  # fmt: skip
"""Entries of run.json that say how the run was made, in the order in which they are shown."""

PAGE = "report.html"
"""The page of a run, in its folder."""

_EXPERIMENT_UNITS = {"step": "s", "stop": "s", "wall_time": "s"}


def summary(run: Mapping[str, Any]) -> str:
    """One line on the run."""
    steps = f"{grouped(run['steps'])} steps of {number(1e3 * run['step'])} ms"
    text = escape(f"{number(run['stop'])} s in {steps}, {run['scheme']}")
    if run["wall_time"] is None:
        end = number(run["steps"] * run["step"])
        return f'{text} <span class="warn">unfinished: to t = {end} s</span>'
    text += f", {number(run['real_time_factor'], 3)} times as fast as real time"
    if run.get("ended_at") is not None:
        text += f" ended at {number(run['ended_at'])} s, as an FMU asked"
    elif not run["complete"]:
        text += ' <span class="warn">not complete: interrupted, or failed on the way</span>'
    return text


def result_html(result: Result) -> str:
    """The HTML of a result for a notebook: its summary, metrics and names of signals."""
    system = escape(str(result.settings["system"]))
    folder = f", read from {escape(str(result.folder))}" if result.folder else ""
    signals = "".join(
        f"<li>{escape(name)} <small>{escape(unit or '')}</small></li>"
        for name, unit in result.units.items()
    )
    count = counted(len(result), "signal")
    return (
        f"<p>{system}: {summary(result.metrics)}{folder}</p>{metrics_html(result)}"
        f"<details><summary>{count}</summary><ul>{signals}</ul></details>"
    )


def metrics_html(result: Result) -> str:
    """Return the metrics of a result, and why others are missing.

    There is a column for each of several values, like those of two fingers; a metric that has
    others has a row for each.
    """
    measured = result.measured
    heads = next((metric.entries for metric in measured.metrics if metric.entries), ())
    rows = []
    for metric in measured.metrics:
        value = measured.values[metric.name]
        if not metric.entries:
            rows.append(_metric_row(metric.title, [value], metric, len(heads)))
        elif metric.entries == heads:
            rows.append(_metric_row(metric.title, value, metric, len(heads)))
        else:
            titles = map(metric.column_title, metric.columns)
            for title, entry in zip(titles, value, strict=True):
                rows.append(_metric_row(title, [entry], metric, len(heads)))
    reasons = "".join(f"<p>{escape(line)}</p>" for line in measured.missing)
    if not rows:
        return reasons or "<p>There are no metrics of this system.</p>"
    cells = "".join(
        f'<th class="n"><span class="key{j}">{escape(head)}</span></th>'
        for j, head in enumerate(heads, start=1)
    )
    return table(f"<th></th>{cells}<th></th>" if heads else "", rows) + reasons


def _metric_row(title: str, values: Sequence[Any], metric: Metric, columns: int) -> str:
    """A row: a cell per value; a single value takes all columns."""
    texts = [scaled(value, metric.factor) for value in values]
    if len(texts) == 1:
        cells = [cell(texts[0], class_="both", colspan=max(columns, 1))]
    else:
        cells = [cell(text, class_="n") for text in texts]
    note = {"title": metric.description} if metric.description else {}
    return "".join([cell(title, **note), *cells, cell(metric.display_unit)])


def settings_html(result: Result) -> str:
    """Components, experiment, events, faults, log and discarded steps."""
    run: dict[str, Any] = {**result.metrics, **result.settings}
    discarded = [f"{name}: {entries(asdict(r))}" for name, r in result.rejections.items()]
    lists = [
        bullets("Events", map(entries, run["events"]), "No events."),
        bullets("Faults on connections", map(entries, run["faults"]), "No faults."),
        bullets("Log", result.log, "Nothing to report."),
        bullets("Steps discarded or cut short", discarded, "None."),
    ]
    return (
        f"<h3>Components, in the order of execution</h3>{_components_html(run['components'])}"
        f'<div class="two"><section><h3>Experiment</h3>{_experiment_html(run, result.origin)}'
        f"</section>{''.join(lists)}</div>"
    )


def _components_html(components: Mapping[str, Mapping[str, Any]]) -> str:
    """A row for each component: its FMU, its start values, and how it is run."""
    rows = [
        cell(name)
        + cell(component["fmu"], data_head="FMU")
        + cell(
            _values(component) or "as the FMU starts",
            class_="w",
            data_head="start values given",
        )
        + cell(_execution(component))
        for name, component in components.items()
    ]
    heads = "<th>component</th><th>FMU</th><th>start values given</th><th></th>"
    return table(heads, rows, "cards")


def _values(component: Mapping[str, Any]) -> str:
    """The start values of a component with their units."""
    units = component.get("value_units", {})
    return "; ".join(
        f"{entries({name: value})} {units.get(name, '')}".strip()
        for name, value in component["values"].items()
    )


def _experiment_html(run: Mapping[str, Any], origin: Mapping[str, Any]) -> str:
    """A row for each of EXPERIMENT, then when and with what the run was made."""
    rows = [
        cell(key.replace("_", " ")) + cell(f"{number(run[key])} {_EXPERIMENT_UNITS.get(key, '')}")
        for key in EXPERIMENT
    ]
    rows += [cell(key) + cell(text) for key, text in origin_rows(origin)]
    return table("", rows)


def windows_html(result: Result) -> str:
    """A row for each window of a triggered run: when its trigger came true, and what it has."""
    rows = []
    for window in (part.summary for part in result.windows):
        times = [number(window[key]) for key in ("time", "from", "until")]
        cells = [window["folder"], *times, grouped(window["rows"])]
        rows.append("".join(map(cell, cells)))
    condition = escape(result.settings["trigger"]["when"])
    hint = f'<p class="hint">In windows around the points at which {condition} became true.</p>'
    heads = "<th>folder</th><th>trigger in s</th><th>from</th><th>until</th><th>rows</th>"
    return table(heads, rows) + hint


def protocol_html(result: Result) -> str:
    """The verdict on a run, criterion by criterion, and what was tested: FMUs and peers."""
    failed = [criterion for criterion in result.verdict if not criterion.passed]
    verdict = f"Failed: {', '.join(c.what for c in failed)}." if failed else "Passed."
    kind = "warn" if failed else "sum"
    return (
        f'<p class="{kind} verdict">{escape(verdict)}</p>{_criteria_html(result)}'
        f"<h3>What was tested</h3>{_tested_html(result)}"
    )


def _criteria_html(result: Result) -> str:
    """A row for each criterion: its limit, what was measured, and the verdict."""
    rows = []
    for criterion in result.verdict:
        verdict = "pass" if criterion.passed else "fail"
        measured = "no value"
        if criterion.measured is not None:
            measured = f"{number(criterion.measured)} {criterion.unit}"
        rows.append(
            cell(criterion.what)
            + cell(criterion.must, data_head="limit")
            + cell(measured, data_head="measured")
            + cell(verdict, data_head="verdict", class_=verdict)
        )
    return table("<th>criterion</th><th>limit</th><th>measured</th><th>verdict</th>", rows, "cards")


def _tested_html(result: Result) -> str:
    """A row for each component: its FMU, and the peer that it talked to."""
    rows = []
    for name, component in result.settings["components"].items():
        peer = result.peers.get(name, {})
        rows.append(
            cell(name)
            + cell(component["fmu"], data_head="FMU")
            + cell(_hash_of(result, name), data_head="SHA-256", class_="w hash")
            + cell(peer.get("name", ""), data_head="peer")
            + cell(peer.get("build", ""), data_head="build of the peer", class_="w hash")
        )
    heads = "<th>component</th><th>FMU</th><th>SHA-256</th><th>peer</th><th>its build</th>"
    return table(heads, rows, "cards")


def _hash_of(result: Result, name: str) -> str:
    fmu = result.origin.get("fmus", {}).get(name, {})
    return fmu.get("sha256") or "unknown"


def origin_rows(origin: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """When and with what a run was made, as far as that is known: labels and texts."""
    if "date" in origin:
        yield "date", str(origin["date"])
    if "versions" in origin:
        yield "versions", ", ".join(f"{name} {v}" for name, v in origin["versions"].items())
    if origin.get("command"):
        yield "command", shlex.join(map(str, origin["command"]))


def table(heads: str, rows: Iterable[str], kind: str = "") -> str:
    """A table, its heads and each row as the HTML of their cells.

    Of the kind "cards" each row is a card on a phone, in which the data-head of a cell stands
    before the cell.
    """
    head = f"<thead><tr>{heads}</tr></thead>" if heads else ""
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    attribute = f' class="{kind}"' if kind else ""
    return f'<div class="scroll"><table{attribute}>{head}<tbody>{body}</tbody></table></div>'


def cell(text: str, **attributes: str | int) -> str:
    """A cell of a table, its text and attributes escaped.

    The attributes are named as in Python: class_ is class, data_head is data-head.
    """
    named = "".join(
        f' {name.rstrip("_").replace("_", "-")}="{escape(str(value))}"'
        for name, value in attributes.items()
    )
    return f"<td{named}>{escape(text)}</td>"


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """A table of texts, the first row its heads."""
    heads, *body = rows
    head_cells = "".join(f"<th>{escape(text)}</th>" for text in heads)
    return table(head_cells, ["".join(map(cell, row)) for row in body])


def svg_button(selector: str, name: str) -> str:
    """Return a button that saves the SVG of the page that a CSS selector finds, under a name."""
    button = f'<button type="button" data-svg="{selector}" data-name="{name}">SVG</button>'
    return f'<p class="saves">{button}</p>'


def bullets(title: str, lines: Iterable[str], none: str) -> str:
    """A list below a title, each line as a text; `none` is shown where there are no lines."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    body = f'<ul class="plain">{items}</ul>' if items else f'<p class="hint">{none}</p>'
    return f"<section><h3>{title}</h3>{body}</section>"


def _execution(component: Mapping[str, Any]) -> str:
    """How a component is run where that is not as usual: step, process, solver, names."""
    parts = []
    if component["step"] is not None:
        parts.append(f"step {number(1e3 * component['step'])} ms")
    if component["isolation"] != "none":
        parts.append(f"isolation: {component['isolation']}")
    if solver := component.get("solver"):
        parts.append(f"integrated by CVode to {number(solver['relative_tolerance'])}")
    if tolerance := component.get("tolerance"):
        parts.append(f"tolerance {number(tolerance)}")
    if component["rename"]:
        renames = [f"{name} is {fmu_name}" for name, fmu_name in component["rename"].items()]
        parts.append(f"renamed: {', '.join(renames)}")
    return "; ".join(parts)
