"""What pages and pictures say of a result: its caption; as HTML its metrics and settings."""

from __future__ import annotations

import shlex
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import asdict
from html import escape
from importlib.metadata import version
from pathlib import PurePath
from typing import Any, NamedTuple

from ..base.text import counted, fixed, grouped, significant
from ..metrics.metric import Metric
from ..recording.folder import now
from ..recording.result import Result

EXPERIMENT = (
    "system", "step", "stop", "scheme", "initialisation", "steps", "wall_time", "real_time_factor",
    "complete",
)  # fmt: skip
"""Entries of run.json that say how the run was made, in the order in which they are shown."""

MOST_CHANGED = 6
"""So many values that differ from the defaults are named, of more their number."""

DEFAULTS = "as in the system file"
"""In place of changes, where there are none."""

_UNITS = {"step": "s", "stop": "s", "wall_time": "s"}


class Caption(NamedTuple):
    """The title of a picture; below it what differs from the defaults, the date, the version."""

    title: str
    about: str


def caption(result: Result, title: str = "") -> Caption:
    """Return the caption of a result: a title as given here or to its run, else one made of what
    it is; of a run that was just done the date is that of today.
    """
    origin, settings = result.origin, result.settings
    words = result.view.words(result)
    made = ", ".join([PurePath(str(settings["system"])).stem, *words])
    date = str(origin.get("date", "" if result.folder else now().date().isoformat()))[:10]
    own = origin.get("versions", {}).get("grasp-cosim", "" if result.folder else None)
    chosen = title or str(origin.get("title", "")) or made
    return Caption(chosen, about(settings.get("changed"), date, own))


def about(
    changed: Mapping[str, Any] | None, date: str | None = None, own_version: str | None = None
) -> str:
    """Return a line of what was changed of a system (see system.settings; None: that is not known),
    the date and the version of grasp-cosim.

    By default those of now; an empty text is left out.
    """
    date = now().date().isoformat() if date is None else date
    own_version = version("grasp-cosim") if own_version is None else own_version
    what = None if changed is None else changes(changed)
    return " · ".join(filter(None, [what, date, own_version and f"grasp-cosim {own_version}"]))


def changes(changed: Mapping[str, Any]) -> str:
    """Return what was changed of a system, each as name = value; see system.settings."""
    named = [f"{name} = {_changed(value)}" for name, value in changed.items()]
    more = [f"{len(named) - MOST_CHANGED} more"] if len(named) > MOST_CHANGED else []
    return ", ".join([*named[:MOST_CHANGED], *more]) or DEFAULTS


def _changed(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else number(value)


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
    of = f"{escape(str(result.settings['system']))}: {summary(result.metrics)}"
    where = f", read from {escape(str(result.folder))}" if result.folder else ""
    names = "".join(
        f"<li>{escape(n)} <small>{escape(u or '')}</small></li>" for n, u in result.units.items()
    )
    return (
        f"<p>{of}{where}</p>{metrics_table(result)}"
        f"<details><summary>{counted(len(result), 'signal')}</summary><ul>{names}</ul></details>"
    )


def metrics_table(result: Result) -> str:
    """Return the metrics of a result, and why others are missing.

    There is a column for each of several values, like those of two fingers; a metric that has
    others has a row for each.
    """
    measured = result.measured
    heads = next((m.entries for m in measured.metrics if m.entries), ())
    rows = []
    for m in measured.metrics:
        values = measured.values[m.name]
        one_row = not m.entries or m.entries == heads
        titles = [m.title] if one_row else map(m.column_title, m.columns)
        found = [values if m.entries else [values]] if one_row else [[value] for value in values]
        rows += [_metric(t, c, m, len(heads)) for t, c in zip(titles, found, strict=True)]
    why = "".join(f"<p>{escape(line)}</p>" for line in measured.missing)
    if not rows:
        return why or "<p>There are no metrics of this system.</p>"
    cells = "".join(
        f'<th class="n"><span class="key{j}">{escape(head)}</span></th>'
        for j, head in enumerate(heads, start=1)
    )
    return table(f"<th></th>{cells}<th></th>" if heads else "", rows) + why


def _metric(title: str, values: Sequence[Any], metric: Metric, columns: int) -> str:
    """A row: a cell per value, or one across all columns."""
    one = f' class="both" colspan="{max(columns, 1)}"'
    how = one if len(values) == 1 else ' class="n"'
    cells = "".join(f"<td{how}>{escape(scaled(v, metric.factor))}</td>" for v in values)
    note = f' title="{escape(metric.description)}"' if metric.description else ""
    return f"<td{note}>{escape(title)}</td>{cells}<td>{escape(metric.display_unit)}</td>"


def scaled(value: Any, factor: float) -> str:
    """A value of a metric in its shown unit, for the eye."""
    if isinstance(value, list):
        return ", ".join(scaled(v, factor) for v in value)
    if isinstance(value, float):
        return fixed(factor * value, 4, most=1e4, digits=6)
    return number(value)


def settings_html(result: Result) -> str:
    """Components, experiment, events, faults, log and discarded steps."""
    run: dict[str, Any] = {**result.metrics, **result.settings}
    components = [
        (
            f'<td>{escape(name)}</td><td data-head="FMU">{escape(c["fmu"])}</td>'
            f'<td class="w" data-head="start values given">'
            f"{escape(entries(c['values'])) or 'as the FMU starts'}</td>"
            f"<td>{escape(_how(c))}</td>"
        )
        for name, c in run["components"].items()
    ]
    heads = "<th>component</th><th>FMU</th><th>start values given</th><th></th>"
    experiment = [
        f"<td>{escape(key.replace('_', ' '))}</td>"
        f"<td>{escape(number(run[key]))} {_UNITS.get(key, '')}</td>"
        for key in EXPERIMENT
    ]
    experiment += [
        f"<td>{key}</td><td>{escape(text)}</td>" for key, text in origin_rows(result.origin)
    ]
    lists = [
        bullets("Events", map(entries, run["events"]), "No events."),
        bullets("Faults on connections", map(entries, run["faults"]), "No faults."),
        bullets("Log", result.log, "Nothing to report."),
        bullets(
            "Steps discarded or cut short",
            (f"{name}: {entries(asdict(r))}" for name, r in result.rejections.items()),
            "None.",
        ),
    ]
    return (
        f"<h3>Components, in the order of execution</h3>{table(heads, components, 'cards')}"
        f'<div class="two"><section><h3>Experiment</h3>{table("", experiment)}</section>'
        f"{''.join(lists)}</div>"
    )


def protocol_html(result: Result) -> str:
    """The verdict on a run, criterion by criterion, and what was tested: FMUs and peers."""
    failed = [criterion for criterion in result.verdict if not criterion.passed]
    verdict = f"Failed: {', '.join(c.what for c in failed)}." if failed else "Passed."
    criteria = [
        (
            f"<td>{escape(c.what)}</td>"
            f'<td data-head="limit">at most {escape(number(c.limit))} {escape(c.unit)}</td>'
            f'<td data-head="measured">{escape(number(c.measured))} {escape(c.unit)}</td>'
            f'<td data-head="verdict" class="{"pass" if c.passed else "fail"}">'
            f"{'pass' if c.passed else 'fail'}</td>"
        )
        for c in result.verdict
    ]
    tested = [
        (
            f'<td>{escape(name)}</td><td data-head="FMU">{escape(component["fmu"])}</td>'
            f'<td data-head="SHA-256" class="w hash">{escape(_hash_of(result, name))}</td>'
            f'<td data-head="peer">{escape(peer.get("name", ""))}</td>'
            f'<td data-head="build of the peer" class="w hash">{escape(peer.get("build", ""))}</td>'
        )
        for name, component in result.settings["components"].items()
        for peer in [result.peers.get(name, {})]
    ]
    kind = "warn" if failed else "sum"
    heads = "<th>criterion</th><th>limit</th><th>measured</th><th>verdict</th>"
    what = "<th>component</th><th>FMU</th><th>SHA-256</th><th>peer</th><th>its build</th>"
    return (
        f'<p class="{kind} verdict">{escape(verdict)}</p>{table(heads, criteria, "cards")}'
        f"<h3>What was tested</h3>{table(what, tested, 'cards')}"
    )


def _hash_of(result: Result, name: str) -> str:
    fmu = result.origin.get("fmus", {}).get(name, {})
    return fmu.get("sha256") or "unknown"


def origin_rows(origin: Mapping[str, Any]) -> Iterator[tuple[str, str]]:
    """When and with what the run was made, as far as that is known."""
    if "date" in origin:
        yield "date", str(origin["date"])
    if "versions" in origin:
        yield "versions", ", ".join(f"{name} {v}" for name, v in origin["versions"].items())
    if origin.get("command"):
        yield "command", shlex.join(map(str, origin["command"]))


def table(heads: str, rows: Iterable[str], kind: str = "") -> str:
    """A table of rows of cells that are HTML already; of the kind "cards" each row is a card on a
    phone, in which the data-head of a cell stands before it.
    """
    head = f"<thead><tr>{heads}</tr></thead>" if heads else ""
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    of_kind = f' class="{kind}"' if kind else ""
    return f'<div class="scroll"><table{of_kind}>{head}<tbody>{body}</tbody></table></div>'


def text_table(rows: Sequence[Sequence[str]]) -> str:
    """A table of texts, the first row its heads."""
    heads, *others = rows
    head = "".join(f"<th>{escape(cell)}</th>" for cell in heads)
    return table(head, ["".join(f"<td>{escape(cell)}</td>" for cell in row) for row in others])


def svg_button(which: str, name: str) -> str:
    """Return a button that saves an SVG of the page under a name; `which` selects it."""
    button = f'<button type="button" data-svg="{which}" data-name="{name}">SVG</button>'
    return f'<p class="saves">{button}</p>'


def bullets(title: str, lines: Iterable[str], none: str) -> str:
    """A list below a title, each line as a text; none is said where there are no lines."""
    items = "".join(f"<li>{escape(line)}</li>" for line in lines)
    body = f'<ul class="plain">{items}</ul>' if items else f'<p class="hint">{none}</p>'
    return f"<section><h3>{title}</h3>{body}</section>"


def entries(values: Mapping[str, Any]) -> str:
    """Like a = 1, b = 2; a mapping within in brackets."""
    return ", ".join(
        f"{key} = " + (f"({number(v)})" if isinstance(v, Mapping) else number(v))
        for key, v in values.items()
    )


def number(value: Any, digits: int = 6) -> str:
    """A value for the eye: floats with so many figures, True and False in words, entries()."""
    if isinstance(value, Mapping):
        return entries(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return significant(value, digits)
    if value is None:
        return "none"
    return str(value)


def _how(component: Mapping[str, Any]) -> str:
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
        parts.append("renamed: " + ", ".join(f"{k} is {v}" for k, v in component["rename"].items()))
    return "; ".join(parts)
