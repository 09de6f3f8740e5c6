"""The panel of what can be set in a run: a row for each variable, in groups by component."""

from __future__ import annotations

from html import escape
from math import isfinite
from typing import Any

from ..interface.variables import Variable
from ..system.description import System
from ..system.parts import Port
from ..system.scenario import settable_ports

FEW = 12
"""Of so many variables, at most, all groups are open when the page opens."""


def settings_of(system: System) -> list[dict[str, Any]]:
    """What can be set in a run of a system, for the scripts: an entry for each variable.

    Tunable parameters, and inputs without a source, with the values that they start with.
    """
    return [_entry(system, port, v) for port, v in system.once(settable_ports).items()]


def _entry(system: System, port: Port, variable: Variable) -> dict[str, Any]:
    component = system.by_name[port.component]
    value = component.values.get(variable.name, variable.start_value)
    entry: dict[str, Any] = {
        "name": str(port),
        "component": port.component,
        "variable": variable.name,
        "kind": variable.kind,
        "unit": "" if variable.unit in (None, "1") else variable.unit,
        "text": variable.description or "",
        "value": value,
        "items": dict(variable.items),
        "low": None,
        "high": None,
    }
    if variable.kind in ("Real", "Integer") and not variable.items:
        entry |= {
            key: limit
            for key, limit in (("low", variable.low), ("high", variable.high))
            if isfinite(limit)
        }
    return entry


def panel_html(entries: list[dict[str, Any]]) -> str:
    """Return the panel as HTML: a search box, and the groups."""
    groups: dict[str, list[str]] = {}
    for number, entry in enumerate(entries):
        groups.setdefault(entry["component"], []).append(_row_html(number, entry))
    opened = " open" if len(entries) <= FEW else ""
    parts = [
        f'<details{opened}><summary>{escape(component)} <small class="num">{len(rows)}</small>'
        f"</summary>\n{''.join(rows)}</details>"
        for component, rows in groups.items()
    ]
    if not parts:
        return "<p>This system has nothing that can be set in a run.</p>"
    return (
        '<input id="find-parameter" type="search" placeholder="Find a parameter" '
        'aria-label="Find a parameter">\n'
        f"{''.join(parts)}"
        '<p class="hint">A value is set at the next communication point of its component. It is in '
        "the log, and an event in run.json: <code>grasp-cosim run DIR/run.json</code> repeats the "
        "run. A value out of its range is refused, and the old one stays. An FMU may also refuse "
        "values that do not fit each other: such a refusal ends the run at the next step.</p>"
    )


def _row_html(number: int, entry: dict[str, Any]) -> str:
    """The row of a variable: its name and unit, a box, a slider where it has a range."""
    unit = f" <small>{escape(entry['unit'])}</small>" if entry["unit"] else ""
    has_range = entry["low"] is not None and entry["high"] is not None
    slider = (
        f'<input type="range" min="0" max="1000" step="1" aria-labelledby="name{number}">'
        if has_range
        else ""
    )
    return (
        f'<div class="parameter" data-number="{number}">'
        f'<label id="name{number}" for="value{number}">{escape(entry["variable"])}{unit}</label>'
        f"{_box_html(number, entry)}{slider}"
        f'<p class="hint">{escape(_help(entry))}</p><p class="refusal" role="alert"></p></div>\n'
    )


def _box_html(number: int, entry: dict[str, Any]) -> str:
    """The box of a variable, by its kind."""
    value = entry["value"]
    if entry["kind"] == "Boolean":
        checked = " checked" if value in (True, "true", 1) else ""
        return f'<input id="value{number}" type="checkbox"{checked}>'
    if entry["items"]:
        options = "".join(
            f'<option value="{item}"{" selected" if item == value else ""}>{escape(name)}</option>'
            for name, item in entry["items"].items()
        )
        return f'<select id="value{number}">{options}</select>'
    if entry["kind"] == "String":
        return f'<input id="value{number}" type="text" value="{escape(str(value or ""))}">'
    shown = "" if value is None else repr(value)
    return f'<input id="value{number}" type="number" step="any" value="{shown}">'


def _help(entry: dict[str, Any]) -> str:
    """The description of a variable, and its range."""
    low, high = entry["low"], entry["high"]
    if low is not None and high is not None:
        limits = f"{low:g} to {high:g}"
    elif low is not None:
        limits = f"at least {low:g}"
    elif high is not None:
        limits = f"at most {high:g}"
    else:
        limits = ""
    return "; ".join(part for part in (entry["text"], limits) if part)
