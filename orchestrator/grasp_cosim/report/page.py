"""A run as one HTML page that needs nothing else: traces, animation, metrics, wiring, settings.

The traces are drawn by page/traces.js, 200 lines on a canvas, rather than by a library: plotly
would add 4.5 MB to each page and slows down from 100,000 points on; uPlot has no Python package,
so a copy would have to be kept here, and neither keeps extremes over millions of rows at hand.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from html import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np

from ..files import write_text
from ..grasp.metrics import FINGERS, first_contact, is_grasp
from ..metrics.metric import resolved
from ..realtime.timing import Timing
from ..recording.result import Result
from .embed import LIMIT, Shown, fit, packed
from .tables import count, metrics_table, number, settings_html, summary
from .timing_html import timing_html
from .wiring import Link, wiring_svg

SCRIPTS = ("data.js", "traces.js", "grasp.js", "main.js", "hands.js")
AT_FIRST = 6
"""So many signals are shown first where the system is no grasp."""
BEFORE, AFTER = 0.005, 0.03
"""s around a contact that a button zooms to."""


def write_page(run: Result, title: str, path: Path, limit: int = LIMIT) -> None:
    """Write the page of a run; of more than limit values the signals are thinned, and it says so.

    InputError where run.json lacks an entry that the page shows.
    """
    write_text(path, page_html(run, title, limit))


def page_html(run: Result, title: str, limit: int = LIMIT) -> str:
    """The page as text, see write_page."""
    shown = fit(run.time, run.signals, limit)
    grasp = _grasp(run)
    contacts = _contacts(run) if grasp else []
    timing = run.timing
    sections = {
        **({"grasp": "Grasp"} if grasp else {}),
        "traces": "Traces",
        "metrics": "Metrics",
        **({"timing": "Real time"} if timing else {}),
        "wiring": "Wiring",
        "settings": "Settings",
    }
    return _filled(
        "page.html",
        title=escape(title),
        style=_text("page.css"),
        summary=summary(run.metrics),
        contents="".join(f'<a href="#{s}">{name}</a>' for s, name in sections.items()),
        grasp=_grasp_html(grasp, contacts) if grasp else "",
        zooms=_zooms(contacts),
        signals=_choice(run),
        exactness=_exactness(shown, len(run.time)),
        metrics=metrics_table(run),
        timing=_timing_html(timing, float(run.time[-1])) if timing else "",
        wiring=_wiring(run),
        settings=settings_html(run),
        version=escape(version("grasp-cosim")),
        page=_json(_state(run, shown, grasp, contacts)),
        data=_data(shown),
        script="\n".join(map(_text, SCRIPTS)),
    )


def _state(
    run: Result,
    shown: Shown,
    grasp: Mapping[str, Any] | None,
    contacts: Sequence[Mapping[str, float]],
) -> dict[str, Any]:
    """What the scripts are told, beside the values themselves."""
    return {
        "rows": len(shown.time),
        "signals": [
            {
                "name": name,
                "unit": run.units[name],
                "steps": values.dtype.kind != "f",
                "text": run.descriptions.get(name, ""),
                "id": f"signal{k}",
            }
            for k, (name, values) in enumerate(run.signals.items())
        ],
        "shown": _at_first(run, grasp is not None),
        "marks": [
            *({"t": c["t"], "color": f"--finger{c['finger']}"} for c in contacts),
            *({"t": t, "color": "--fault"} for t in _moments(run.log)),
        ],
        "grasp": {**grasp, "contacts": contacts} if grasp else None,
    }


def _text(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


def _filled(name: str, **values: str) -> str:
    return Template(_text(name)).substitute(values)


def _json(value: Any) -> str:
    """JSON that cannot end the script element it stands in."""
    return json.dumps(value).replace("<", "\\u003c")


def _data(shown: Shown) -> str:
    columns = {
        "time": shown.time,
        **{f"signal{k}": v for k, v in enumerate(shown.signals.values())},
    }
    return "\n".join(
        f'<script type="text/plain" id="{name}">{packed(values)}</script>'
        for name, values in columns.items()
    )


def _exactness(shown: Shown, rows: int) -> str:
    columns = len(shown.signals)
    if shown.rows_per_pair is None:
        return f"All {count(rows)} points of {columns} signals are in this page, to the last bit."
    return (
        f"<b>Of {count(rows)} points of {columns} signals this page keeps, of each "
        f"{shown.rows_per_pair}, the lowest and the highest value;</b> all are in signals.csv."
    )


def _timing_html(timing: Timing, end: float) -> str:
    return f'<section id="timing">\n<h2>Real time</h2>\n{timing_html(timing, end)}\n</section>'


# The grasp -------------------------------------------------------------------------------------


def _grasp(run: Result) -> dict[str, Any] | None:
    """The signals that the animation is drawn from, by finger; None without a gripper plant."""
    if not is_grasp(run.by_role):
        return None
    names: dict[str, Any] = {
        quantity: {j: resolved(f"plant.{quantity}[{j}]", run.roles) for j in FINGERS}
        for quantity in ("position", "gap", "velocity", "contact_force", "contact")
    }
    names["actuator"] = _actuators(run)
    target = resolved("controller.target_position", run.roles)
    names["target"] = target if target in run.signals else None
    used = [n for named in names.values() if isinstance(named, dict) for n in named.values()]
    return {**names, "signals": used + ([target] if names["target"] else [])}


def _actuators(run: Result) -> dict[int, str]:
    """The recorded signal that is the force on each finger as it is, where there is one."""
    forces = {resolved(f"plant.force[{j}]", run.roles): j for j in FINGERS}
    return {
        forces[w["to"]]: w["from"]
        for w in run.settings["connections"]
        if w["to"] in forces
        and run.units.get(w["from"]) == "N"
        and w["factor"] in (None, 1.0)
        and not w["offset"]
    }


def _contacts(run: Result) -> list[dict[str, float]]:
    """Each moment in s at which a finger begins to touch, in order of time.

    The first one of each finger is that of the metrics, later ones are the samples themselves.
    """
    found = []
    for j in FINGERS:
        touching = np.asarray(run.by_role[f"plant.contact[{j}]"]).astype(bool)
        begins = np.flatnonzero(touching[1:] & ~touching[:-1]) + 1
        first = first_contact(run.by_role, j)
        later = begins if touching[0] else begins[1:]
        moments = ([first.time] if first else []) + run.time[later].tolist()
        found += [{"t": t, "finger": j} for t in moments]
    return sorted(found, key=lambda c: c["t"])


def _firsts(contacts: Sequence[Mapping[str, float]]) -> dict[int, float]:
    """The first contact of each finger, in s."""
    return {j: c["t"] for j in FINGERS for c in contacts[::-1] if c["finger"] == j}


def _zooms(contacts: Sequence[Mapping[str, float]]) -> str:
    """Buttons that zoom to the first contacts."""
    firsts = _firsts(contacts)
    spans = {f"Contact of finger {j}": (t, t, f"f{j}") for j, t in firsts.items()}
    if len(firsts) > 1:
        spans["Both contacts"] = (min(firsts.values()), max(firsts.values()), "")
    return "\n".join(
        f'<button type="button" class="{kind}" data-from="{a - BEFORE!r}" '
        f'data-to="{b + AFTER!r}">{text}</button>'
        for text, (a, b, kind) in spans.items()
    )


def _grasp_html(grasp: Mapping[str, Any], contacts: Sequence[Mapping[str, float]]) -> str:
    jumps = "\n".join(
        f'<button type="button" class="f{j}" data-at="{max(t - BEFORE, 0.0)!r}">'
        f"Before contact {j}</button>"
        for j, t in _firsts(contacts).items()
    )
    shown = {
        "gap": "gap",
        "velocity": "velocity",
        "contact_force": "contact force",
        "contact": "touches",
        **({"actuator": "actuator force"} if grasp["actuator"] else {}),
    }
    rows = [
        f'<tr><td><span class="key{j}">finger {j}</span></td>'
        + "".join(
            f'<td class="n"><output data-signal="{escape(grasp[key][j])}"></output></td>'
            if j in grasp[key]
            else "<td></td>"
            for key in shown
        )
        + "</tr>"
        for j in FINGERS
    ]
    heads = "".join(f'<th class="n">{text}</th>' for text in shown.values())
    return _filled("grasp.html", jumps=jumps, heads=heads, rows="\n".join(rows))


# Signals and connections -----------------------------------------------------------------------


def _at_first(run: Result, grasp: bool) -> list[str]:
    """The signals shown first."""
    wanted = [f"plant.{v}[{j}]" for v in ("gap", "contact_force", "velocity") for j in FINGERS]
    wanted = [resolved(name, run.roles) for name in (*wanted, "controller.target_position")]
    chosen = [name for name in wanted if name in run.signals] if grasp else []
    return chosen or list(run.signals)[:AT_FIRST]


def _choice(run: Result) -> str:
    """A box to tick per signal, in groups by component."""
    groups: dict[str, list[str]] = {}
    for name in run.signals:
        groups.setdefault(name.partition(".")[0], []).append(name)
    html = []
    for component, names in groups.items():
        of = escape(component)
        html.append(
            f'<fieldset><legend><label><input type="checkbox" data-component="{of}">{of}</label>'
            "</legend>"
        )
        for name in names:
            unit = f" <small>{escape(run.units[name] or '')}</small>"
            html.append(
                f'<label title="{escape(run.descriptions.get(name, ""))}"><input type="checkbox" '
                f'data-signal="{escape(name)}" data-of="{of}">'
                f"{escape(name.partition('.')[2])}{unit}</label>"
            )
        html.append("</fieldset>")
    return "".join(html)


def _moments(log: Sequence[str]) -> list[float]:
    """The times in s with which lines of the log begin: events, faults."""
    found = (re.match(r"t = (\S+) s: ", line) for line in log)
    return [float(match[1]) for match in found if match]


def _wiring(run: Result) -> str:
    faults: dict[str, list[str]] = {}
    for f in run.settings["faults"]:
        faults.setdefault(f["connection"], []).append(f["kind"])
    links = []
    for w in run.settings["connections"]:
        label = [] if w["factor"] is None else [f"× {number(w['factor'])}"]
        label += [f"+ {number(w['offset'])}"] if w["offset"] else []
        label += faults.get(w["to"], [])
        source, _, output = w["from"].partition(".")
        target, _, given = w["to"].partition(".")
        links.append(
            Link((source, output), (target, given), ", ".join(label), fault=w["to"] in faults)
        )
    boxes = {name: c["fmu"] for name, c in run.settings["components"].items()}
    return (
        f'<div class="diagram">{wiring_svg(boxes, links, run.units)}</div>'
        '<p class="hint">From left to right in the order of execution. Dashed, below: connections '
        "back to a component that steps earlier. Hold the pointer over one for its name.</p>"
    )
