"""A result as one HTML page that needs nothing else: traces, metrics, connections, settings.

More for one kind of system, like the animation of a grasp, comes from higher up as a Scene.

The traces are drawn by page/traces.js, 200 lines on a canvas, rather than by a library: plotly
would add 4.5 MB to each page and slows down from 100,000 points on; uPlot has no Python package,
so a copy would have to be kept here, and neither keeps extremes over millions of rows at hand.
"""

from __future__ import annotations

import json
import logging
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from importlib.metadata import version
from importlib.resources import files
from pathlib import Path
from string import Template
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..base.files import check_file, of_any_format, remove_parts, write_text
from ..base.one_piece import is_stream
from ..base.text import grouped
from ..exchange.listener import Texts
from ..recording.csv import quoted
from ..recording.read_back import load_run
from ..recording.result import Result
from .embed import LIMIT, Shown, fit, packed
from .plot import that_matter
from .system import connections_svg
from .tables import (
    Caption,
    caption,
    metrics_table,
    protocol_html,
    settings_html,
    summary,
    svg_button,
)
from .timing import TIMING, draw_result, timing_html

LOGGER = logging.getLogger(__name__)

AT_FIRST = 6
"""So many signals are shown first where no scene says which."""


@dataclass(frozen=True)
class Zoom:
    """A button that zooms the traces to `begin` until `end`, in s; `kind` is its class."""

    text: str
    begin: float
    end: float
    kind: str = ""


@dataclass(frozen=True)
class Scene:
    """A section for one kind of system, and more: what is shown first, colours, marks, buttons.

    `html` is the content of its section under `title`. `scripts` define startScene(state), which
    returns what draws it and plays it: {draw(), toggle()}. A colour is the name of a CSS variable
    that `style` or the page defines.
    """

    title: str
    html: str
    style: str
    scripts: str
    state: Mapping[str, Any]
    """Data for the scripts, as JSON has it."""
    shown: Sequence[str] = ()
    """Signals that are shown first."""
    colors: Mapping[str, str] = field(default_factory=dict)
    """The colours of signals, by name; others get one in turn."""
    dashes: Mapping[str, int] = field(default_factory=dict)
    """Their dashes, from 0 on: 0 where nothing is said."""
    negated: Sequence[str] = ()
    """Signals that are shown with the other sign."""
    marks: Sequence[tuple[float, str]] = ()
    """Moments in s that are marked in the traces, and the colours of their lines."""
    zooms: Sequence[Zoom] = ()


def write_report(
    run: Result | str | Path, out: str | Path | None = None, title: str = ""
) -> list[Path]:
    """Write a page on a run, and the pictures of it.

    Args:
        run: The result, or what load_run() reads.
        out: The file of the page; by default report.html in the folder of the run, or in the
            current one of a result that has none.
        title: The title; "" for that of the run.

    Returns:
        The files: the page, and with matplotlib a picture beside it, and one of the timing of a run
        in real time.

    Raises:
        InputError: The folder has no run, or the page cannot be written.
    """
    read = run if isinstance(run, Result) else load_run(run)
    folder = read.folder or Path()
    page = Path(out) if out else folder / "report.html"
    recorded = read.titled(title)
    if recorded.folder and recorded.wall_time is None:
        LOGGER.warning("%s: unfinished, to t = %.6g s", folder, recorded.time[-1])
    check_file(page)
    remove_parts(page.parent, page.name, *of_any_format(recorded.view.stem, TIMING))
    write_page(recorded, page, scene=recorded.view.scene(recorded))
    written = [page]
    if is_stream(page):
        return written
    try:
        written += draw_result(recorded, page.parent)
    except InputError as error:
        LOGGER.warning("no picture: %s", error)
    return written


def write_page(
    result: Result, path: Path, *, scene: Scene | None = None, limit: int = LIMIT
) -> None:
    """Write the page of a result, under its title: see caption.caption().

    Of more than `limit` values the signals are thinned, and it says so.
    """
    write_text(path, page_html(result, scene=scene, limit=limit))


def page_html(result: Result, *, scene: Scene | None = None, limit: int = LIMIT) -> str:
    """Return the page as text, see write_page."""
    shown = fit(result.time, {name: _drawn(column) for name, column in result.items()}, limit)
    timing = result.timing
    protocol = ("Test protocol", protocol_html(result)) if result.verdict else None
    sections = {
        "protocol": protocol,
        "scene": (scene.title, scene.html) if scene else None,
        "traces": ("Traces", _traces(result, shown, scene)),
        "metrics": ("Metrics", metrics_table(result)),
        "timing": ("Real time", timing_html(timing, float(result.time[-1]))) if timing else None,
        "connections": ("Connections", _connections(result)),
        "settings": ("Settings", settings_html(result)),
    }
    said = caption(result)
    return document(
        said,
        summary(result.metrics),
        {name: section for name, section in sections.items() if section},
        _state(result, shown, scene) | {"about": said.about},
        data_html(shown.time, {f"signal{k}": v for k, v in enumerate(shown.signals.values())}),
        [scripts("save", "panels"), scene.scripts if scene else ""],
        scene.style if scene else "",
    )


def document(
    said: Caption,
    summary: str,
    sections: Mapping[str, tuple[str, str]],
    state: Mapping[str, Any],
    data: str,
    script: Sequence[str],
    style: str = "",
) -> str:
    """Return a page with traces as text.

    `summary` and `data` are HTML, `sections` are by their ids, each its head and its HTML; `state`
    is what the scripts take as `page`, `script` what comes between those of the traces and
    main.js, and `style` what comes after that of the page.
    """
    return Template(_text("page.html")).substitute(
        title=escape(said.title),
        about=escape(said.about),
        style=page_style() + style,
        summary=summary,
        contents="".join(f'<a href="#{name}">{head}</a>' for name, (head, _) in sections.items()),
        sections="\n".join(
            f'<section id="{name}">\n<h2>{head}</h2>\n{html}\n</section>'
            for name, (head, html) in sections.items()
        ),
        version=escape(version("grasp-cosim")),
        page=json.dumps(state).replace("<", "\\u003c"),  # cannot end its script element
        data=data,
        script="\n".join([traces_script(), *script, scripts("main")]),
    )


def traces_script() -> str:
    """Return the scripts that draw traces and take what a hand does to them."""
    return scripts("data", "traces", "view", "hands")


def scripts(*names: str) -> str:
    """Return the scripts of these names."""
    return "\n".join(_text(f"{name}.js") for name in names)


def page_style() -> str:
    """Return the style of a page."""
    return _text("page.css")


def _state(result: Result, shown: Shown, scene: Scene | None) -> dict[str, Any]:
    """Return the data for the scripts, without the values of the signals."""
    marks = [*(scene.marks if scene else ()), *((t, "--fault") for t in moments(result.log))]
    return {
        "rows": len(shown.time),
        "signals": [
            {
                "name": name,
                "unit": result.units[name],
                "steps": values.dtype.kind != "f",
                "text": result.descriptions.get(name, ""),
                "id": f"signal{k}",
                **_texts(values),
            }
            for k, (name, values) in enumerate(result.signals.items())
        ],
        "shown": list(scene.shown if scene else ()) or that_matter(result, AT_FIRST),
        **looks(scene),
        "header": ",".join(map(quoted, ("time", *result.signals))),
        "csv": "signals.csv" if shown.rows_per_pair is None else "signals_thinned.csv",
        "marks": [{"t": t, "color": color} for t, color in marks],
        "scene": scene.state if scene else None,
    }


def looks(scene: Scene | None) -> dict[str, Any]:
    """Return how signals are drawn, for the scripts."""
    colors, dashes, negated = (scene.colors, scene.dashes, scene.negated) if scene else ({}, {}, ())
    return {"colors": dict(colors), "dashes": dict(dashes), "negated": list(negated)}


def _texts(column: npt.NDArray[Any]) -> dict[str, Any]:
    """Of Strings the texts that their numbers stand for, and the cells of a CSV with them."""
    if column.dtype != object:
        return {"texts": None}
    texts = list(dict.fromkeys(column))
    return {"texts": texts, "cells": [*map(quoted, texts)]}


def _drawn(column: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A column as it is drawn: of a String the numbers of its texts, in the order they came."""
    return np.array([*map(Texts().number, column)]) if column.dtype == object else column


def _text(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


def data_html(time: npt.NDArray[np.float64], columns: Mapping[str, npt.NDArray[Any]]) -> str:
    """Return the columns of the traces by their ids, as elements that the scripts unpack."""
    return "\n".join(
        f'<script type="text/plain" id="{name}">{packed(values)}</script>'
        for name, values in {"time": time, **columns}.items()
    )


def _traces(result: Result, shown: Shown, scene: Scene | None) -> str:
    points = f"{grouped(len(result.time))} points of {len(shown.signals)} signals"
    exact = f"All {points} are in this page, to the last bit."
    if shown.rows_per_pair is not None:
        exact = (
            f"<b>Of {points} this page keeps, of each {shown.rows_per_pair}, the lowest and the "
            "highest value;</b> all are in signals.csv."
        )
    return traces_html(
        exact,
        {name: result.units[name] for name in result.signals},
        result.descriptions,
        scene.zooms if scene else (),
        '<button id="csv" type="button">CSV</button>',
    )


def traces_html(
    how_exact: str,
    units: Mapping[str, str | None],
    texts: Mapping[str, str],
    zooms: Sequence[Zoom],
    csv: str = "",
) -> str:
    """Return the traces: buttons, boxes to choose signals, the place where they are drawn.

    `units` are those of the signals by name, `texts` their descriptions; `csv` is the button that
    saves them, if there is one.
    """
    buttons = "\n".join(
        f'<button type="button" class="{zoom.kind}" data-from="{zoom.begin!r}" '
        f'data-to="{zoom.end!r}">{escape(zoom.text)}</button>'
        for zoom in zooms
    )
    return Template(_text("traces.html")).substitute(
        zooms=buttons, csv=csv, signals=_choice(units, texts), exactness=how_exact
    )


def _choice(units: Mapping[str, str | None], texts: Mapping[str, str]) -> str:
    """A box to tick per signal, in groups by component."""
    groups: dict[str, str] = {}
    for name, unit in units.items():
        component, dot, variable = map(escape, name.partition("."))
        if not dot:  # an output of the system itself
            component, variable = "system", component
        box = f'<input type="checkbox" data-component="{component}">{component}'
        groups.setdefault(component, f"<fieldset><legend><label>{box}</label></legend>")
        groups[component] += (
            f'<label title="{escape(texts.get(name, ""))}"><input type="checkbox" '
            f'data-signal="{escape(name)}" data-of="{component}">'
            f"{variable} <small>{escape(unit or '')}</small></label>"
        )
    return "".join(f"{group}</fieldset>" for group in groups.values())


def moments(log: Sequence[str]) -> list[float]:
    """The times in s with which lines of the log begin: events, faults."""
    found = (re.match(r"t = (\S+) s: ", line) for line in log)
    return [float(match[1]) for match in found if match]


def _connections(result: Result) -> str:
    svg = connections_svg(result.settings, result.units)
    return (
        f'<div class="diagram">{svg}</div>'
        f"{svg_button('.diagram svg', 'connections')}"
        '<p class="hint">From left to right in the order of execution. Above: connections past '
        "others. Dashed, below: connections back to a component that steps earlier. Hold the "
        "pointer over one for its name.</p>"
    )
