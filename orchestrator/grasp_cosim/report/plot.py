"""Pictures of any result, drawn with matplotlib (the optional extra `plot`); what they share."""

from __future__ import annotations

import re
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from io import StringIO
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..checks import extra_module
from ..errors import InputError
from ..files import in_one_piece
from ..recording.result import Result

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

BLUE, RED, GREY = "#1f5fa8", "#c0392b", "#7f7f7f"
COLORS = (BLUE, RED, GREY)
"""The colours of several things, in turn."""

DPI = 130
"""Of the pictures."""

MOST_NAMED = 12
"""So many lines at most get a legend."""


def plot_signals(run: Result, path: Path | None = None) -> Figure:
    """Draw all signals of any run but Strings over time, those of the same unit together.

    With a `path` the figure is written there as a PNG. InputError without matplotlib, or where
    there are no signals.
    """
    units = list(dict.fromkeys(run.units[name] or "" for name in run.numbers))
    if not units:
        place = run.settings["system"] if path is None else path
        raise InputError(
            f"{place}: nothing to draw; must be a result with signals that are numbers"
        )
    figure = new_figure(9.0, 1.2 + 2.2 * len(units))
    rows = figure.subplots(len(units), 1, sharex=True, squeeze=False)[:, 0]
    for axes, unit in zip(rows, units, strict=True):
        names = [name for name in run.numbers if (run.units[name] or "") == unit]
        for name in names:
            axes.plot(run.time, run.signals[name], linewidth=1.0, label=name)
        finish(axes, f"in {unit}" if unit else "no unit", len(names) <= MOST_NAMED)
    figure.axes[-1].set_xlabel("time in s")
    return kept(figure, path)


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, sizes in inches; InputError without matplotlib."""
    extra_module("matplotlib.figure", "it draws the figures", "plot")
    from .picture import Picture

    return Picture(figsize=(width, height), dpi=DPI, layout="constrained")


def kept(figure: Figure, path: Path | None) -> Figure:
    """Return the figure, saved if there is a path."""
    if path is not None:
        save(figure, path)
    return figure


def save(figure: Figure, path: Path) -> None:
    """Write the figure as a PNG under a temporary name, then rename it.

    Not by savefig(), which draws a figure with a layout twice.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas: Any = FigureCanvasAgg(figure)
    with in_one_piece(path) as part, _any_letter():
        canvas.print_png(part, metadata={"Software": None})


def as_svg(figure: Figure) -> str:
    """Return the figure as an SVG element for a page: letters as shapes, the same bytes each time.

    It takes the width that the page gives it.
    """
    from matplotlib import rc_context
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    canvas: Any = FigureCanvasSVG(figure)
    file = StringIO()
    with rc_context({"svg.hashsalt": "grasp-cosim", "svg.fonttype": "path"}), _any_letter():
        canvas.print_svg(file, metadata=dict.fromkeys(("Creator", "Date", "Format", "Type")))
    _, start, text = file.getvalue().partition("<svg ")
    text = re.sub(r'(width|height)="[^"]*pt" ', "", text, count=2)
    return start + text.replace("*{stroke", ".chart *{stroke", 1)  # its rule is for all else


@contextmanager
def _any_letter() -> Iterator[None]:
    """Let a letter that the font lacks be drawn as a box, which says it too, without a warning."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", "Glyph .* missing")
        yield


def finish(axes: Axes, label: str, legend: bool = True) -> None:
    """Give axes a label of the values and a grid, and a legend unless it is too long."""
    axes.set_ylabel(label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    if legend:
        axes.legend(fontsize=8, framealpha=0.9)
    axes.spines[["top", "right"]].set_visible(False)
