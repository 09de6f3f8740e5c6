"""A page with traces as HTML: what the page of a run and that of a comparison share.

The traces are drawn by page/traces.js, 200 lines on a canvas, rather than by a library: plotly
would add 4.5 MB to each page and slows down from 100,000 points on; uPlot has no Python package,
so a copy would have to be kept here, and neither keeps extremes over millions of rows at hand.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.metadata import version
from importlib.resources import files
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from .embed import packed
from .wording import Caption

IN_ONE_FILE = "Everything on this page is inside this one file."
"""The end of a page that is a file."""


@dataclass(frozen=True)
class Zoom:
    """A button that zooms the traces to `begin` until `end`, in s; `kind` is its class."""

    text: str
    begin: float
    end: float
    kind: str = ""


@dataclass(frozen=True)
class Scene:
    """A section for one kind of system, and how its signals are shown: colours, marks, buttons.

    `html` is the content of its section under `title`. `scripts` define startScene(state), which
    returns what draws it and plays it: {draw(), toggle(), renew(state, series)}. The last takes the
    state and the signals of a run that goes on, as they are now. A colour is the name of a CSS
    variable that `style` or the page defines.
    """

    title: str
    html: str
    style: str
    scripts: str
    state: Mapping[str, Any]
    """Data for the scripts, as JSON has it."""
    first_signals: Sequence[str] = ()
    """Signals that are shown when the page opens."""
    colors: Mapping[str, str] = field(default_factory=dict)
    """The colours of signals, by name; others get one in turn."""
    dashes: Mapping[str, int] = field(default_factory=dict)
    """The dashes of signals, by name, from 0 on; others have 0."""
    negated: Sequence[str] = ()
    """Signals that are shown with the other sign."""
    marks: Sequence[tuple[float, str]] = ()
    """Moments in s that are marked in the traces, and the colours of their lines."""
    zooms: Sequence[Zoom] = ()


def traces_page(
    caption: Caption,
    summary: str,
    sections: Mapping[str, tuple[str, str]],
    state: Mapping[str, Any],
    data: str,
    script: Sequence[str],
    style: str = "",
    footer: str = IN_ONE_FILE,
) -> str:
    """Return a page with traces as text.

    Args:
        caption: Its title, and the line below it.
        summary: HTML below these.
        sections: By their ids, each its head and its HTML.
        state: What the scripts take as `page`, as JSON has it.
        data: The HTML of columns_html().
        script: The scripts that come between those of the traces and main.js.
        style: What comes after the style that all pages have.
        footer: A sentence at its end.
    """
    return _page(
        caption,
        summary,
        sections,
        json.dumps(state).replace("<", "\\u003c"),  # cannot end its script element
        data,
        "\n".join([traces_script(), *script, scripts("main")]),
        style,
        footer,
    )


def plain_page(caption: Caption, summary: str, sections: Mapping[str, tuple[str, str]]) -> str:
    """Return a page without traces as text; its parts are as of traces_page()."""
    return _page(caption, summary, sections)


def _page(
    caption: Caption,
    summary: str,
    sections: Mapping[str, tuple[str, str]],
    state: str = "{}",
    data: str = "",
    script: str = "",
    style: str = "",
    footer: str = IN_ONE_FILE,
) -> str:
    links = "".join(f'<a href="#{name}">{head}</a>' for name, (head, _) in sections.items())
    elements = [
        f'<section id="{name}">\n<h2>{head}</h2>\n{html}\n</section>'
        for name, (head, html) in sections.items()
    ]
    return Template(_page_file("page.html")).substitute(
        title=escape(caption.title),
        about=escape(caption.about),
        style=page_style() + style,
        summary=summary,
        contents=links,
        sections="\n".join(elements),
        version=escape(version("grasp-cosim")),
        footer=escape(footer),
        page=state,
        data=data,
        script=script,
    )


def traces_script() -> str:
    """Return the scripts that draw traces and take what a hand does to them."""
    return scripts("data", "traces", "view", "hands")


def scripts(*names: str) -> str:
    """Return the scripts of these names."""
    return "\n".join(_page_file(f"{name}.js") for name in names)


def page_style() -> str:
    """Return the style of a page."""
    return _page_file("page.css")


def signal_styles(scene: Scene | None) -> dict[str, Any]:
    """Return how signals are drawn, for the scripts."""
    if scene is None:
        return {"colors": {}, "dashes": {}, "negated": []}
    return {
        "colors": dict(scene.colors),
        "dashes": dict(scene.dashes),
        "negated": list(scene.negated),
    }


def _page_file(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


def columns_html(time: npt.NDArray[np.float64], columns: Mapping[str, npt.NDArray[Any]]) -> str:
    """Return the columns of the traces by their ids, as elements that the scripts unpack."""
    return "\n".join(
        f'<script type="text/plain" id="{name}">{packed(values)}</script>'
        for name, values in {"time": time, **columns}.items()
    )


def traces_html(
    exactness: str,
    units: Mapping[str, str | None],
    descriptions: Mapping[str, str],
    zooms: Sequence[Zoom],
    csv_button: str = "",
) -> str:
    """Return the traces: buttons, boxes to choose signals, the place where they are drawn.

    Args:
        exactness: HTML on how exact the traces are.
        units: The units of the signals, by name.
        descriptions: Their descriptions, as far as there are any.
        zooms: The buttons that zoom.
        csv_button: The button that saves the signals, if there is one.
    """
    buttons = "\n".join(
        f'<button type="button" class="{zoom.kind}" data-from="{zoom.begin!r}" '
        f'data-to="{zoom.end!r}">{escape(zoom.text)}</button>'
        for zoom in zooms
    )
    return Template(_page_file("traces.html")).substitute(
        zooms=buttons,
        csv=csv_button,
        signals=_signal_boxes(units, descriptions),
        exactness=exactness,
    )


def _signal_boxes(units: Mapping[str, str | None], descriptions: Mapping[str, str]) -> str:
    """A box to tick per signal, in groups by component."""
    boxes: dict[str, list[str]] = {}
    for name, unit in units.items():
        component, dot, variable = map(escape, name.partition("."))
        if not dot:  # an output of the system itself
            component, variable = "system", component
        box = (
            f'<input type="checkbox" data-signal="{escape(name)}" data-of="{component}">'
            f"{variable} <small>{escape(unit or '')}</small>"
        )
        title = escape(descriptions.get(name, ""))
        boxes.setdefault(component, []).append(f'<label title="{title}">{box}</label>')
    groups = []
    for component, labels in boxes.items():
        group_box = f'<input type="checkbox" data-component="{component}">{component}'
        legend = f"<legend><label>{group_box}</label></legend>"
        groups.append(f"<fieldset>{legend}{''.join(labels)}</fieldset>")
    return "".join(groups)


def log_times(log: Sequence[str]) -> list[float]:
    """The times in s with which lines of the log begin: events, faults."""
    matches = [re.match(r"t = (\S+) s: ", line) for line in log]
    return [float(match[1]) for match in matches if match]
