"""The scene of a grasp for its page: the fingers moving, their contacts, their colours."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from html import escape
from importlib.resources import files
from string import Template
from typing import Any, TypeVar

import numpy as np

from ..base.si_units import known_unit
from ..metrics.metric import resolved
from ..recording.result import Result
from ..report.traces_page import Scene, Zoom
from .metrics import FINGERS, TARGET_POSITION, fingers_of, first_contact, is_grasp, touching

BEFORE, AFTER = 0.005, 0.03
"""s around a contact that a button zooms to."""

QUANTITIES = {
    "gap": "gap", "velocity": "velocity", "contact_force": "contact force", "contact": "touches",
    "actuator": "actuator force",
}  # fmt: skip
"""Heads of the table below the animation, by quantity of a finger."""

VIEW = "The object is drawn from face to face, where the gaps say it is"
"""What is to be known of the animation."""

Look = TypeVar("Look", str, int)

Contact = Mapping[str, float]
"""A moment `t` in s at which a `finger` begins to touch."""


def grasp_scene(result: Result, view: str = VIEW) -> Scene | None:
    """Return the scene of a result, `view` saying what is seen; None where it is no grasp."""
    if not is_grasp(result.by_role):
        return None
    target = resolved(TARGET_POSITION, result.roles)
    targets = [target] if target in result.signals else []
    state = {"target": target} if targets else {}
    made = scene_of_fingers(result, "Grasp", view, targets, state)
    return replace(made, negated=[made.state["contact_force"][2]])


def scene_of_fingers(
    result: Result, title: str, view: str, more: Sequence[str], state: Mapping[str, Any]
) -> Scene:
    """Return the scene of fingers around an object, with `more` signals and `state` of its own.

    `view` says what is seen in it.
    """
    named, fingers = _signals(result), fingers_of(result.by_role)
    contacts = _contacts(result)
    used = [*(name for by_finger in named.values() for name in by_finger.values()), *more]
    shown = [
        named[quantity][j] for quantity in ("gap", "contact_force", "velocity") for j in fingers
    ]
    return Scene(
        title=title,
        html=_html(view, named, contacts),
        style=scene_style(),
        scripts=scene_script(),
        state={
            **named,
            **state,
            "signals": used,
            "toSi": {n: c._asdict() for n in used if (c := result.to_si.get(n))},
            "contacts": contacts,
        },
        first_signals=[*shown, *more],
        colors=_of_fingers(result, {str(j): f"--finger{j}" for j in fingers}),
        dashes=_of_fingers(result, {str(j): j - 1 for j in fingers}),
        marks=[(c["t"], f"--finger{c['finger']}") for c in contacts],
        zooms=_zooms(contacts),
    )


def scene_style() -> str:
    """Return the style of a scene."""
    return _text("grasp.css")


def scene_script() -> str:
    """Return the script that draws a scene and plays it."""
    return _text("grasp.js")


def _text(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


def _signals(result: Result) -> dict[str, dict[int, str]]:
    """The signals that the animation is drawn from, by quantity and finger."""
    run, fingers = result.by_role, fingers_of(result.by_role)
    found: dict[str, dict[int, str]] = {}
    for quantity in ("position", "gap", "velocity", "contact_force", "contact"):
        of_finger = {j: f"plant.{quantity}[{j}]" for j in fingers}
        found[quantity] = {j: resolved(n, result.roles) for j, n in of_finger.items() if n in run}
    return {**found, "actuator": _actuators(result)}


def _actuators(result: Result) -> dict[int, str]:
    """The recorded signal that is the force on each finger as it is, where there is one."""
    newton = known_unit("N")
    fingers = fingers_of(result.by_role)
    forces = {resolved(f"plant.force[{j}]", result.roles): j for j in fingers}
    return {
        forces[c["to"]]: c["from"]
        for c in result.settings["connections"]
        if c["to"] in forces
        and (unit := known_unit(result.units.get(c["from"]) or ""))
        and newton
        and unit.measures(newton)
        and (unit.si or result.to_si.get(c["from"]))
        and c["factor"] in (None, 1.0)
        and not c["offset"]
    }


def _contacts(result: Result) -> list[Contact]:
    """Each moment at which a finger begins to touch, in order of time.

    The first one of each finger is that of the metrics, later ones are the samples themselves.
    """
    found = []
    for j in fingers_of(result.by_role):
        touches = touching(result.by_role, j)
        begins = np.flatnonzero(touches[1:] & ~touches[:-1]) + 1
        first = first_contact(result.by_role, j)
        later = begins if touches[0] else begins[1:]
        moments = ([first.time] if first else []) + result.time[later].tolist()
        found += [{"t": t, "finger": j} for t in moments]
    return sorted(found, key=lambda c: c["t"])


def _firsts(contacts: Sequence[Contact]) -> dict[int, float]:
    return dict(sorted({int(c["finger"]): c["t"] for c in reversed(contacts)}.items()))


def _of_fingers(result: Result, each: Mapping[str, Look]) -> dict[str, Look]:
    """What there is for each finger, for signals of it: those of an element [1], of a sensor_1."""
    found = {name: re.search(r"(?:\[(\d)\]|_(\d)\..*)$", name) for name in result.signals}
    return {name: each[j] for name, m in found.items() if m and (j := m[1] or m[2]) in each}


def _zooms(contacts: Sequence[Contact]) -> list[Zoom]:
    firsts = _firsts(contacts)
    spans = [(f"Contact of finger {j}", t, t, f"f{j}") for j, t in firsts.items()]
    if len(firsts) > 1:
        both = "Both" if len(firsts) == len(FINGERS) else "All"
        spans.append((f"{both} contacts", min(firsts.values()), max(firsts.values()), ""))
    return [Zoom(text, a - BEFORE, b + AFTER, kind) for text, a, b, kind in spans]


def _html(view: str, named: Mapping[str, Mapping[int, str]], contacts: Sequence[Contact]) -> str:
    """The canvas of the animation, its buttons, and the values at its time."""
    jumps = (
        f'<button type="button" class="f{j}" data-at="{max(t - BEFORE, 0.0)!r}">'
        f"Before contact {j}</button>"
        for j, t in _firsts(contacts).items()
    )
    shown = {quantity: head for quantity, head in QUANTITIES.items() if named[quantity]}
    rows = []
    for j in named["gap"]:
        cells = (_cell(head, named[quantity].get(j)) for quantity, head in shown.items())
        rows.append(f'<tr><td><span class="key{j}">finger {j}</span></td>{"".join(cells)}</tr>')
    return Template(_text("grasp.html")).substitute(
        jumps="\n".join(jumps),
        heads="".join(f'<th class="n">{head}</th>' for head in shown.values()),
        rows="\n".join(rows),
        view=view,
    )


def _cell(head: str, signal: str | None) -> str:
    if signal is None:
        return "<td></td>"
    shown = f'<output data-signal="{escape(signal)}"></output>'
    return f'<td class="n" data-head="{head}">{shown}</td>'
