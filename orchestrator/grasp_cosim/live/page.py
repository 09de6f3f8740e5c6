"""The page of a run that goes on: that of a report, fed by the server."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import Any

from ..recording.result import Result
from ..report.plot import main_signals
from ..report.run_report import MAX_FIRST_SIGNALS, signal_state
from ..report.traces_page import Scene, scripts, signal_styles, traces_html, traces_page
from ..report.wording import caption
from .panel import panel_html

EXACTNESS = (
    "The page keeps the lowest and the highest value of short blocks of steps. Older ones become "
    "longer. With <code>--out</code> all steps are recorded."
)


def page_html(
    result: Result, scene: Scene | None, settings: Sequence[dict[str, Any]], left_out: int
) -> str:
    """Return the page of a run that goes on.

    Args:
        result: What is known of it so far.
        scene: Its scene, if it has one.
        settings: What can be set: see panel.settings_of().
        left_out: How many signals are not shown.
    """
    heading = caption(result)
    sections = {"live": ("Run", _page_file("live.html"))}
    if scene:
        sections["scene"] = scene.title, scene.html
    note = f" {left_out} signals are not shown: texts, or too many." if left_out else ""
    sections["traces"] = (
        "Traces",
        traces_html(EXACTNESS + note, dict(result.units), result.descriptions, ()),
    )
    sections["parameters"] = "Parameters", panel_html(list(settings))
    sections["log"] = "Log", '<ol id="lines" class="plain" aria-live="polite"></ol>'
    state = {
        "rows": 0,
        "signals": [signal_state(result, k, name) for k, name in enumerate(result.signals)],
        "shown": list(scene.first_signals) if scene else main_signals(result, MAX_FIRST_SIGNALS),
        **signal_styles(scene),
        "marks": [],
        "about": heading.about,
        "scene": dict(scene.state) if scene else None,
        "settings": list(settings),
    }
    return traces_page(
        heading,
        summary="The page follows the run while it goes on.",
        sections=sections,
        state=state,
        data="",
        script=[
            scripts("save", "panels"),
            scene.scripts if scene else "",
            _page_file("parameters.js"),
            _page_file("live.js"),
        ],
        style=(scene.style if scene else "") + _page_file("live.css"),
        footer="Served by grasp-cosim on this computer, until the run ends.",
    )


def _page_file(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")
