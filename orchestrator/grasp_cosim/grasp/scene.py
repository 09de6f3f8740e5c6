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

ZOOM_BEFORE, ZOOM_AFTER = 0.005, 0.03
"""s before and after a contact that a button zooms to."""

TABLE_HEADS = {
    "gap": "gap", "velocity": "velocity", "contact_force": "contact force", "contact": "touches",
    "actuator": "actuator force",
}  # fmt: skip
"""Heads of the table below the animation, by quantity of a finger."""

DESCRIPTION = "The object is drawn from face to face, where the gaps say it is"
"""What the user has to know of the animation."""

Style = TypeVar("Style", str, int)

Contact = Mapping[str, float]
"""A moment `t` in s at which a `finger` begins to touch."""


def grasp_scene(result: Result, description: str = DESCRIPTION) -> Scene | None:
    """Return the scene of a result, `description` saying what is seen; None if it is no grasp."""
    if not is_grasp(result.by_role):
        return None
    target = resolved(TARGET_POSITION, result.roles)
    targets = [target] if target in result.signals else []
    state = {"target": target} if targets else {}
    scene = scene_of_fingers(result, "Grasp", description, targets, state)
    return replace(scene, negated=[scene.state["contact_force"][2]])


def scene_of_fingers(
    result: Result,
    title: str,
    description: str,
    extra_signals: Sequence[str],
    extra_state: Mapping[str, Any],
) -> Scene:
    """Return the scene of fingers around an object.

    Args:
        result: The run.
        title: The head of the section.
        description: What is seen in it.
        extra_signals: Signals that are drawn in addition to those of the fingers.
        extra_state: Data for the scripts in addition to those of the fingers.
    """
    fingers = fingers_of(result.by_role)
    signals = _signals(result)
    contacts = _contacts(result)
    drawn = [name for by_finger in signals.values() for name in by_finger.values()]
    drawn += extra_signals
    conversions = {name: result.to_si.get(name) for name in drawn}
    first_signals = [
        signals[quantity][j] for quantity in ("gap", "contact_force", "velocity") for j in fingers
    ]
    state = {
        **signals,
        **extra_state,
        "signals": drawn,
        "toSi": {name: to_si._asdict() for name, to_si in conversions.items() if to_si},
        "contacts": contacts,
    }
    return Scene(
        title=title,
        html=_html(description, signals, contacts),
        style=scene_style(),
        scripts=scene_script(),
        state=state,
        first_signals=[*first_signals, *extra_signals],
        colors=_styles(result, {str(j): f"--finger{j}" for j in fingers}),
        dashes=_styles(result, {str(j): j - 1 for j in fingers}),
        marks=[(contact["t"], f"--finger{contact['finger']}") for contact in contacts],
        zooms=_zooms(contacts),
    )


def scene_style() -> str:
    """Return the style of a scene."""
    return _page_file("grasp.css")


def scene_script() -> str:
    """Return the script that draws a scene and plays it."""
    return _page_file("grasp.js")


def _page_file(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


def _signals(result: Result) -> dict[str, dict[int, str]]:
    """The signals that the animation is drawn from, by quantity and finger."""
    signals: dict[str, dict[int, str]] = {}
    for quantity in ("position", "gap", "velocity", "contact_force", "contact"):
        by_role = {j: f"plant.{quantity}[{j}]" for j in fingers_of(result.by_role)}
        signals[quantity] = {
            j: resolved(name, result.roles) for j, name in by_role.items() if name in result.by_role
        }
    return {**signals, "actuator": _actuators(result)}


def _actuators(result: Result) -> dict[int, str]:
    """The recorded signal that is the force on each finger as it is, where there is one."""
    fingers = fingers_of(result.by_role)
    forces = {resolved(f"plant.force[{j}]", result.roles): j for j in fingers}
    return {
        forces[connection["to"]]: connection["from"]
        for connection in result.settings["connections"]
        if connection["to"] in forces
        and connection["factor"] in (None, 1.0)
        and not connection["offset"]
        and _is_force(result, connection["from"])
    }


def _is_force(result: Result, signal: str) -> bool:
    """True if a signal is recorded as a force whose value in N is known."""
    newton, unit = known_unit("N"), known_unit(result.units.get(signal) or "")
    if newton is None or unit is None or not unit.measures(newton):
        return False
    return bool(unit.si or result.to_si.get(signal))


def _contacts(result: Result) -> list[Contact]:
    """Each moment at which a finger begins to touch, in order of time.

    The first one of each finger is that of the metrics, later ones are the samples themselves.
    """
    contacts = []
    for j in fingers_of(result.by_role):
        touches = touching(result.by_role, j)
        rows = np.flatnonzero(touches[1:] & ~touches[:-1]) + 1
        later_rows = rows if touches[0] else rows[1:]
        times = result.time[later_rows].tolist()
        if first := first_contact(result.by_role, j):
            times.insert(0, first.time)
        contacts += [{"t": time, "finger": j} for time in times]
    return sorted(contacts, key=lambda contact: contact["t"])


def _first_times(contacts: Sequence[Contact]) -> dict[int, float]:
    """The time in s of the first contact of each finger that touches, by finger."""
    times: dict[int, float] = {}
    for contact in contacts:
        times.setdefault(int(contact["finger"]), contact["t"])
    return dict(sorted(times.items()))


def _styles(result: Result, by_finger: Mapping[str, Style]) -> dict[str, Style]:
    """The style of each signal of a finger: those of an element [1], and of a sensor_1."""
    styles = {}
    for name in result.signals:
        if match := re.search(r"(?:\[(\d)\]|_(\d)\..*)$", name):
            finger = match[1] or match[2]
            if finger in by_finger:
                styles[name] = by_finger[finger]
    return styles


def _zooms(contacts: Sequence[Contact]) -> list[Zoom]:
    """A button for the first contact of each finger, and one for all of them."""
    times = _first_times(contacts)
    zooms = [_zoom(f"Contact of finger {j}", time, time, f"f{j}") for j, time in times.items()]
    if len(times) > 1:
        fingers = "Both" if len(times) == len(FINGERS) else "All"
        zooms.append(_zoom(f"{fingers} contacts", min(times.values()), max(times.values()), ""))
    return zooms


def _zoom(text: str, first: float, last: float, kind: str) -> Zoom:
    return Zoom(text, first - ZOOM_BEFORE, last + ZOOM_AFTER, kind)


def _html(
    description: str, signals: Mapping[str, Mapping[int, str]], contacts: Sequence[Contact]
) -> str:
    """The canvas of the animation, its buttons, and the values at its time."""
    jumps = [
        f'<button type="button" class="f{j}" data-at="{max(time - ZOOM_BEFORE, 0.0)!r}">'
        f"Before contact {j}</button>"
        for j, time in _first_times(contacts).items()
    ]
    heads = {quantity: head for quantity, head in TABLE_HEADS.items() if signals[quantity]}
    rows = []
    for j in signals["gap"]:
        cells = [_cell(head, signals[quantity].get(j)) for quantity, head in heads.items()]
        rows.append(f'<tr><td><span class="key{j}">finger {j}</span></td>{"".join(cells)}</tr>')
    return Template(_page_file("grasp.html")).substitute(
        jumps="\n".join(jumps),
        heads="".join(f'<th class="n">{head}</th>' for head in heads.values()),
        rows="\n".join(rows),
        view=description,
    )


def _cell(head: str, signal: str | None) -> str:
    """A cell in which the scripts put the value of a signal; empty without a signal."""
    if signal is None:
        return "<td></td>"
    output = f'<output data-signal="{escape(signal)}"></output>'
    return f'<td class="n" data-head="{head}">{output}</td>'
