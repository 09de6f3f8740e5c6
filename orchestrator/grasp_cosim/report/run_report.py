"""The page of a run, HTML that needs nothing else: traces, metrics, connections, settings.

More for one kind of system, like the animation of a grasp, comes from higher up as a Scene.
"""

from __future__ import annotations

import logging
from pathlib import Path
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
from .embed import MAX_VALUES, Excerpt, excerpt_of
from .html_tables import (
    PAGE,
    metrics_html,
    protocol_html,
    settings_html,
    summary,
    svg_button,
    windows_html,
)
from .plot import main_signals
from .system_html import connections_svg
from .timing_chart import TIMING_STEM, draw_pictures, timing_html
from .traces_page import (
    Scene,
    columns_html,
    log_times,
    plain_page,
    scripts,
    signal_styles,
    traces_html,
    traces_page,
)
from .wording import caption

LOGGER = logging.getLogger(__name__)

MAX_FIRST_SIGNALS = 6
"""So many signals are shown when the page opens where no scene says which."""


def write_report(
    run: Result | str | Path, out: str | Path | None = None, title: str = ""
) -> list[Path]:
    """Write a page on a run, and the pictures of it.

    The page of a triggered run has no traces: each of its windows in a folder gets its own page.

    Args:
        run: The result, or the folder or file of one that load_run() reads.
        out: The file of the page; by default report.html in the folder of the run, or in the
            current one of a result that has none.
        title: The title; "" for that of the run.

    Returns:
        The paths of the page and, with matplotlib, of its picture and of the timing of a run in
        real time; then those of windows.

    Raises:
        InputError: The folder has no run, or the page cannot be written.

    Example:
        >>> from grasp_cosim import grasp_system, simulate, write_report
        >>> result = simulate(grasp_system(), step=1e-3, stop=0.1)
        >>> [path.name for path in write_report(result, "page.html")]
        ['page.html', 'grasp.png']
    """
    result = run if isinstance(run, Result) else load_run(run)
    result = result.titled(title)
    folder = result.folder or Path()
    page = Path(out) if out else folder / PAGE
    if result.folder and result.wall_time is None and not result.complete:
        LOGGER.warning("%s: unfinished, to t = %.6g s", folder, result.end_time)
    check_file(page)
    remove_parts(page.parent, page.name, *of_any_format(result.view.stem, TIMING_STEM))
    write_page(result, page, scene=None if result.is_triggered else result.view.scene(result))
    files = [page]
    if is_stream(page):
        return files
    try:
        files += draw_pictures(result, page.parent)
    except InputError as error:
        LOGGER.warning("no picture: %s", error)
    for window in result.windows:
        if window.folder:
            files += write_report(window)
    return files


def write_page(
    result: Result, path: Path, *, scene: Scene | None = None, max_values: int = MAX_VALUES
) -> None:
    """Write the page of a result, under its title: see wording.caption().

    Of more than `max_values` values the signals are thinned, and the page has a note.
    """
    write_text(path, page_html(result, scene=scene, max_values=max_values))


def page_html(result: Result, *, scene: Scene | None = None, max_values: int = MAX_VALUES) -> str:
    """Return the page as text, see write_page."""
    if result.is_triggered:
        return plain_page(caption(result), summary(result.metrics), _sections_of_windows(result))
    columns = {name: _numbers(column) for name, column in result.items()}
    excerpt = excerpt_of(result.time, columns, max_values)
    heading = caption(result)
    embedded = {f"signal{k}": values for k, values in enumerate(excerpt.signals.values())}
    return traces_page(
        heading,
        summary=summary(result.metrics),
        sections=_sections(result, excerpt, scene),
        state=_state(result, excerpt, scene) | {"about": heading.about},
        data=columns_html(excerpt.time, embedded),
        script=[scripts("save", "panels"), scene.scripts if scene else ""],
        style=scene.style if scene else "",
    )


def _sections(result: Result, excerpt: Excerpt, scene: Scene | None) -> dict[str, tuple[str, str]]:
    """The sections of the page by their ids, each its head and its HTML."""
    traces = {"traces": ("Traces", _traces_html(result, excerpt, scene))}
    of_scene = {"scene": (scene.title, scene.html)} if scene else {}
    sections = _protocol(result) | of_scene | traces | _figures(result)
    sections["connections"] = "Connections", _connections_html(result)
    sections["settings"] = "Settings", settings_html(result)
    return sections


def _sections_of_windows(result: Result) -> dict[str, tuple[str, str]]:
    """Those of a triggered run: its windows are in the place of traces."""
    windows = {"windows": ("Windows", windows_html(result))}
    settings = {"settings": ("Settings", settings_html(result))}
    return _protocol(result) | windows | _figures(result) | settings


def _protocol(result: Result) -> dict[str, tuple[str, str]]:
    """The section with the verdict, where there is one."""
    return {"protocol": ("Test protocol", protocol_html(result))} if result.verdict else {}


def _figures(result: Result) -> dict[str, tuple[str, str]]:
    """The sections with the metrics and the timing."""
    sections = {"metrics": ("Metrics", metrics_html(result))}
    if result.timing:
        sections["timing"] = "Real time", timing_html(result.timing, result.end_time)
    return sections


def _state(result: Result, excerpt: Excerpt, scene: Scene | None) -> dict[str, Any]:
    """Return the data for the scripts, without the values of the signals."""
    first_signals = list(scene.first_signals) if scene else []
    csv_header = ",".join(quoted(name) for name in ("time", *result.signals))
    return {
        "rows": len(excerpt.time),
        "signals": [signal_state(result, k, name) for k, name in enumerate(result.signals)],
        "shown": first_signals or main_signals(result, MAX_FIRST_SIGNALS),
        **signal_styles(scene),
        "header": csv_header,
        "csv": "signals.csv" if excerpt.rows_per_pair is None else "signals_thinned.csv",
        "marks": _marks(result, scene),
        "scene": scene.state if scene else None,
    }


def _marks(result: Result, scene: Scene | None) -> list[dict[str, Any]]:
    """Return the moments that are marked in the traces: those of the scene, events and faults."""
    marks = list(scene.marks) if scene else []
    marks += [(time, "--fault") for time in log_times(result.log)]
    return [{"t": time, "color": color} for time, color in marks]


def signal_state(result: Result, k: int, name: str) -> dict[str, Any]:
    """Return the data on the signal of this name, the k-th of the run, for the scripts.

    Of Strings that are the texts that their numbers stand for, and the cells of a CSV with them.
    """
    values = result.signals[name]
    state: dict[str, Any] = {
        "name": name,
        "unit": result.units[name],
        "steps": values.dtype.kind != "f",
        "text": result.descriptions.get(name, ""),
        "id": f"signal{k}",
        "texts": None,
    }
    if values.dtype == object:
        texts = list(dict.fromkeys(values))
        state |= {"texts": texts, "cells": [quoted(text) for text in texts]}
    return state


def _numbers(column: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """A column as it is drawn: of a String the numbers of its texts, in the order they came."""
    if column.dtype != object:
        return column
    texts = Texts()
    return np.array([texts.number(text) for text in column])


def _traces_html(result: Result, excerpt: Excerpt, scene: Scene | None) -> str:
    points = f"{grouped(len(result.time))} points of {len(excerpt.signals)} signals"
    exactness = f"All {points} are in this page, to the last bit."
    if excerpt.rows_per_pair is not None:
        exactness = (
            f"<b>Of {points} this page keeps, of each {excerpt.rows_per_pair}, the lowest and the "
            "highest value;</b> all are in signals.csv."
        )
    return traces_html(
        exactness,
        {name: result.units[name] for name in result.signals},
        result.descriptions,
        scene.zooms if scene else (),
        '<button id="csv" type="button">CSV</button>',
    )


def _connections_html(result: Result) -> str:
    svg = connections_svg(result.settings, result.units)
    return (
        f'<div class="diagram">{svg}</div>'
        f"{svg_button('.diagram svg', 'connections')}"
        '<p class="hint">From left to right in the order of execution. Above: connections past '
        "others. Dashed, below: connections back to a component that steps earlier. Hold the "
        "pointer over one for its name.</p>"
    )
