"""Pictures of any result, drawn with matplotlib (the optional extra `plot`); what they share."""

from __future__ import annotations

import re
import warnings
from collections.abc import Sequence
from io import BytesIO, StringIO
from itertools import cycle
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..base.checks import extra_module
from ..base.errors import InputError
from ..base.files import PICTURES
from ..base.one_piece import in_one_piece
from ..base.text import in_milli
from ..recording.result import Result
from .embed import fit
from .tables import Caption, caption

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

Times = npt.NDArray[np.float64]

BLUE, RED, GREY, MUTED = "#1f5fa8", "#c0392b", "#7f7f7f", "#5b6470"
COLORS = (BLUE, RED, GREY)
"""The colours of several things, in turn."""

STYLES = ("-", "--", "-.", ":")
"""Their dashes, so that they can be told apart in grey."""

DPI = 130
"""Of the pictures."""

MOST_POINTS = 200_000
"""So many points at most has a line."""

MOST_LINES = 6
"""So many lines at most are in one panel."""

MOST_SIGNALS = 36
"""So many signals at most are in a picture where none are asked for by name."""

UNSAID = {
    "png": ("Software",),
    "svg": ("Creator", "Date", "Format", "Type"),
    "pdf": ("Creator", "Producer", "CreationDate"),
}
"""What would not be the same in a picture of the same figure, by its format."""

DASHES = {1: "-", 2: "--"}
"""How finger 1 and 2 are drawn: they can be told apart in grey."""

LINE_HEIGHT, LETTER = 11.5 / 72.0, 4.4 / 72.0
"""In inches: a line of what a picture says below its title, and the width of a letter there."""


FAR = 1e300
"""What is further from zero is not drawn: inf and the largest double, a distance to nothing."""


@np.errstate(over="ignore")  # of what is not drawn
def plot_signals(run: Result, path: Path | None = None, of: Sequence[str] = ()) -> Figure:
    """Draw signals of any run but Strings over time, those of the same unit together, at most
    MOST_LINES in a panel.

    They are those `of` these names; by default all, or of more than MOST_SIGNALS those that are
    connected, then those of components in a role, then the first. With a `path` the figure is
    written there, see save(). InputError without matplotlib, or where there are no signals;
    KeyError where there is none of a name.
    """
    names = [name for name in of if run[name] is not None] or that_matter(run)
    by_unit: dict[str, list[str]] = {}
    for name in names:
        by_unit.setdefault(run.units[name] or "", []).append(name)
    panels = [
        (unit, some[k : k + MOST_LINES])
        for unit, some in by_unit.items()
        for k in range(0, len(some), MOST_LINES)
    ]
    if not panels:
        place = run.settings["system"] if path is None else path
        raise InputError(
            f"{place}: nothing to draw; must be a result with signals that are numbers"
        )
    figure = new_figure(9.0, 0.9 + 2.2 * len(panels))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (unit, of_unit) in zip(rows, panels, strict=True):
        factor, shown = in_milli(unit)
        for name, style, color in zip(of_unit, cycle(STYLES), cycle(COLORS), strict=False):
            values = factor * run.signals[name]
            axes.plot(*drawn(run.time, values), style, color=color, linewidth=1.0, label=name)
        finish(axes, f"in {shown}" if shown else "no unit", legend=False)
        beside(axes)
    figure.axes[-1].set_xlabel("time in s")
    left = len(run.numbers) - len(names)
    headed(figure, caption(run), *([f"{left} more signals: the page of `report`"] if left else ()))
    return kept(figure, path)


def that_matter(run: Result, most: int = MOST_SIGNALS) -> list[str]:
    """So many signals at most that say most of a run, in the order in which they were recorded."""
    if len(run.numbers) <= most:
        return [*run.numbers]
    ends = {c[end] for c in run.settings.get("connections", ()) for end in ("from", "to")}
    players = set(run.roles.values())

    def rank(name: str) -> int:
        return 0 if name in ends else 1 if name.partition(".")[0] in players else 2

    chosen = set(sorted(run.numbers, key=rank)[:most])
    return [name for name in run.numbers if name in chosen]


def new_figure(width: float, height: float) -> Figure:
    """Return an empty figure, sizes in inches; InputError without matplotlib."""
    extra_module("matplotlib.figure", "it draws the figures", "plot")
    from matplotlib.figure import Figure

    class Picture(Figure):
        """A figure without pyplot: no window, and it is freed with its last name."""

        def _repr_png_(self) -> bytes:
            """As a notebook shows it."""
            file = BytesIO()
            self.savefig(file, format="png")
            return file.getvalue()

    return Picture(figsize=(width, height), dpi=DPI, layout="constrained")


def headed(figure: Figure, said: Caption, *more: str) -> None:
    """Put a title and what the caption says above all else of a figure, which grows by that.

    `more` are further lines. Text in it is no formula.
    """
    width, height = figure.get_size_inches()
    wide = int((width - 0.2) / LETTER)
    lines = [line for text in (said.about, *more) for line in wrap(text, wide)]
    titles = wrap(said.title, int(0.72 * wide)) or [""]
    top = 1.5 * LINE_HEIGHT * len(titles)
    head = top + LINE_HEIGHT * len(lines) + 0.12
    whole = height + head
    figure.set_size_inches(width, whole)
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(0.0, 0.0, 1.0, height / whole))
    bold: dict[str, Any] = {"fontsize": 11, "fontweight": "bold"}
    small: dict[str, Any] = {"fontsize": 8, "color": MUTED}
    for texts, down, style in ((titles, 0.06, bold), (lines, 0.06 + top, small)):
        at, text = (0.1 / width, 1.0 - down / whole), "\n".join(texts)
        figure.text(*at, text, va="top", parse_math=False, **style)


def kept(figure: Figure, path: Path | None) -> Figure:
    """Return the figure, saved if there is a path."""
    if path is not None:
        save(figure, path)
    return figure


def drawn(time: Times, values: npt.NDArray[Any]) -> tuple[Times, npt.NDArray[Any]]:
    """A line as it is drawn: of many points the lowest and the highest of those side by side.

    Where it is FAR from zero it is broken.
    """
    line = fit(time, {"": values}, 2 * MOST_POINTS)
    kept = line.signals[""]
    return line.time, np.where(np.abs(kept) < FAR, kept, np.nan)


def save(figure: Figure, path: Path) -> None:
    """Write the figure as its suffix says, under a temporary name, then rename it.

    InputError where that is none of PICTURES. The same figure has the same bytes. Not by savefig(),
    which draws a figure with a layout twice.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in PICTURES:
        raise InputError(f"{path}: must end in {', '.join(f'.{known}' for known in PICTURES)}")
    with in_one_piece(path) as part:
        _write(figure, kind, part)


def _write(figure: Figure, kind: str, file: Any) -> None:
    """Write a figure; a letter that the font lacks is a box, which says it without a warning."""
    from matplotlib import rc_context
    from matplotlib.backend_bases import get_registered_canvas_class

    canvas: Any = get_registered_canvas_class(kind)(figure)
    how: Any = {"svg.hashsalt": "grasp-cosim", "svg.fonttype": "path"}
    with warnings.catch_warnings(), rc_context(how):
        warnings.filterwarnings("ignore", "Glyph .* missing")
        getattr(canvas, f"print_{kind}")(file, metadata=dict.fromkeys(UNSAID[kind]))


def as_svg(figure: Figure) -> str:
    """Return the figure as an SVG element for a page: letters as shapes, the same bytes each time.

    It takes the width that the page gives it.
    """
    file = StringIO()
    _write(figure, "svg", file)
    _, start, text = file.getvalue().partition("<svg ")
    text = re.sub(r'(width|height)="[^"]*pt" ', "", text, count=2)
    return start + text.replace("*{stroke", ".chart *{stroke", 1)  # its rule is for all else


def finish(axes: Axes, label: str, legend: bool = True) -> None:
    """Give axes a label of the values and a grid, and a legend unless it is to have none."""
    axes.set_ylabel(label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    if legend:
        _plain(axes.legend(fontsize=8, framealpha=0.9))
    axes.spines[["top", "right"]].set_visible(False)


def beside(axes: Axes) -> None:
    """Give axes a legend on their right."""
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
    _plain(axes.legend(fontsize=8, frameon=False, handlelength=3.0, borderaxespad=0.0, **place))


def one_legend(figure: Figure) -> None:
    """Give a figure one legend of all that its axes name, below them; each name once."""
    named = [axes.get_legend_handles_labels() for axes in figure.axes]
    keys = {label: handle for pair in named for handle, label in zip(*pair, strict=True)}
    place: dict[str, Any] = {"loc": "outside lower left", "ncols": 5, "handlelength": 3.0}
    _plain(figure.legend([*keys.values()], [*keys], fontsize=8, frameon=False, **place))


def _plain(legend: Legend) -> None:
    for text in legend.get_texts():
        text.set_parse_math(False)
