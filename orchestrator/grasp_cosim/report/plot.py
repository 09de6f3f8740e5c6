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
from .embed import excerpt_of
from .wording import Caption, caption

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend

Times = npt.NDArray[np.float64]

BLUE, RED, GREY, MUTED = "#1f5fa8", "#c0392b", "#7f7f7f", "#5b6470"
LINE_COLORS = (BLUE, RED, GREY)
"""The colours of the lines of a panel, in turn."""

LINE_STYLES = ("-", "--", "-.", ":")
"""Their dashes, so that they can be told apart in grey."""

DPI = 130
"""Pixels per inch of the pictures."""

MAX_POINTS = 200_000
"""So many points at most has a line."""

MAX_LINES = 6
"""So many lines at most are in one panel."""

MAX_SIGNALS = 36
"""So many signals at most are in a picture where none are asked for by name."""

VARYING_METADATA = {
    "png": ("Software",),
    "svg": ("Creator", "Date", "Format", "Type"),
    "pdf": ("Creator", "Producer", "CreationDate"),
}
"""Entries that would not be the same in a picture of the same figure, by its format."""

FINGER_STYLES = {1: "-", 2: "--"}
"""How finger 1 and 2 are drawn: they can be told apart in grey."""

LINE_HEIGHT, LETTER_WIDTH = 11.5 / 72.0, 4.4 / 72.0
"""In inches: the height of a line below the title of a picture, and the width of a letter there."""

TITLE_SHARE = 0.72
"""So many letters of a title take the width of one letter below it."""

MAX_DRAWN = 1e300
"""What is further from zero is not drawn: inf and the largest double, a distance to nothing."""


@np.errstate(over="ignore")  # of what is not drawn
def plot_signals(run: Result, path: Path | None = None, of: Sequence[str] = ()) -> Figure:
    """Draw signals of any run but Strings over time, those of the same unit together, at most
    MAX_LINES in a panel.

    Args:
        run: The result.
        path: Where the figure is written, see save_figure(); None writes none.
        of: The names of the signals; by default all, or of more than MAX_SIGNALS those that are
            connected, then those of components in a role, then the first.

    Raises:
        InputError: matplotlib is missing, or there are no signals.
        KeyError: There is no signal of a name.
    """
    names = [name for name in of if run[name] is not None] or main_signals(run)
    by_unit: dict[str, list[str]] = {}
    for name in names:
        by_unit.setdefault(run.units[name] or "", []).append(name)
    panels = [
        (unit, names_of_unit[k : k + MAX_LINES])
        for unit, names_of_unit in by_unit.items()
        for k in range(0, len(names_of_unit), MAX_LINES)
    ]
    if not panels:
        place = run.settings["system"] if path is None else path
        raise InputError(
            f"{place}: nothing to draw; must be a result with signals that are numbers"
        )
    figure = new_figure(9.0, 0.9 + 2.2 * len(panels))
    rows = figure.subplots(len(panels), 1, sharex=True, squeeze=False)[:, 0]
    for axes, (unit, names_in_panel) in zip(rows, panels, strict=True):
        factor, display_unit = in_milli(unit)
        looks = zip(names_in_panel, cycle(LINE_STYLES), cycle(LINE_COLORS), strict=False)
        for name, style, color in looks:
            line = drawn_line(run.time, factor * run.signals[name])
            axes.plot(*line, style, color=color, linewidth=1.0, label=name)
        finish_axes(axes, f"in {display_unit}" if display_unit else "no unit", legend=False)
        legend_beside(axes)
    figure.axes[-1].set_xlabel("time in s")
    remarks = []
    if not_drawn := len(run.numbers) - len(names):
        remarks.append(f"{not_drawn} more signals: the page of `report`")
    add_heading(figure, caption(run), *remarks)
    return saved_figure(figure, path)


def main_signals(run: Result, max_signals: int = MAX_SIGNALS) -> list[str]:
    """The signals that tell most of a run, `max_signals` at most, in the order of recording.

    Signals that are connected go before those of components in a role, and these before others.
    """
    if len(run.numbers) <= max_signals:
        return list(run.numbers)
    connections = run.settings.get("connections", ())
    connected = {c["from"] for c in connections} | {c["to"] for c in connections}
    components_in_a_role = set(run.roles.values())

    def rank(name: str) -> int:
        if name in connected:
            return 0
        component, _, _ = name.partition(".")
        return 1 if component in components_in_a_role else 2

    selected = set(sorted(run.numbers, key=rank)[:max_signals])
    return [name for name in run.numbers if name in selected]


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


def add_heading(figure: Figure, heading: Caption, *remarks: str) -> None:
    """Put a caption, and below it a line for each remark, above all else of a figure.

    The figure grows by the height of these. Text in them is no formula.
    """
    width, height = figure.get_size_inches()
    letters_per_line = int((width - 0.2) / LETTER_WIDTH)
    titles = wrap(heading.title, int(TITLE_SHARE * letters_per_line)) or [""]
    lines = [line for text in (heading.about, *remarks) for line in wrap(text, letters_per_line)]
    title_height = 1.5 * LINE_HEIGHT * len(titles)
    heading_height = title_height + LINE_HEIGHT * len(lines) + 0.12
    total_height = height + heading_height
    figure.set_size_inches(width, total_height)
    engine: Any = figure.get_layout_engine()
    engine.set(rect=(0.0, 0.0, 1.0, height / total_height))

    def add(texts: Sequence[str], inches_from_top: float, **style: Any) -> None:
        place = (0.1 / width, 1.0 - inches_from_top / total_height)
        figure.text(*place, "\n".join(texts), va="top", parse_math=False, **style)

    add(titles, 0.06, fontsize=11, fontweight="bold")
    add(lines, 0.06 + title_height, fontsize=8, color=MUTED)


def saved_figure(figure: Figure, path: Path | None) -> Figure:
    """Return the figure, written to the path if there is one."""
    if path is not None:
        save_figure(figure, path)
    return figure


def drawn_line(time: Times, values: npt.NDArray[Any]) -> tuple[Times, npt.NDArray[Any]]:
    """A line as it is drawn: of many points the lowest and the highest of those side by side.

    Where it is further than MAX_DRAWN from zero it is broken.
    """
    line = excerpt_of(time, {"": values}, 2 * MAX_POINTS)
    heights = line.signals[""]
    return line.time, np.where(np.abs(heights) < MAX_DRAWN, heights, np.nan)


def save_figure(figure: Figure, path: Path) -> None:
    """Write the figure in the format of the path's suffix, under a temporary name, and rename it.

    InputError where that is none of PICTURES. The same figure has the same bytes. Not by savefig(),
    which draws a figure with a layout twice.
    """
    kind = path.suffix.lower().removeprefix(".")
    if kind not in PICTURES:
        suffixes = ", ".join(f".{suffix}" for suffix in PICTURES)
        raise InputError(f"{path}: must end in {suffixes}")
    with in_one_piece(path) as part:
        _write(figure, kind, part)


def _write(figure: Figure, kind: str, file: Any) -> None:
    """Write a figure; a letter that the font lacks is drawn as a box, without a warning."""
    from matplotlib import rc_context
    from matplotlib.backend_bases import get_registered_canvas_class

    canvas: Any = get_registered_canvas_class(kind)(figure)
    settings: Any = {"svg.hashsalt": "grasp-cosim", "svg.fonttype": "path"}
    with warnings.catch_warnings(), rc_context(settings):
        warnings.filterwarnings("ignore", "Glyph .* missing")
        getattr(canvas, f"print_{kind}")(file, metadata=dict.fromkeys(VARYING_METADATA[kind]))


def as_svg(figure: Figure) -> str:
    """Return the figure as an SVG element for a page: letters as shapes, the same bytes each time.

    It takes the width that the page gives it.
    """
    file = StringIO()
    _write(figure, "svg", file)
    _, start, text = file.getvalue().partition("<svg ")
    text = re.sub(r'(width|height)="[^"]*pt" ', "", text, count=2)
    # matplotlib's rule for all elements must not reach those of the page.
    return start + text.replace("*{stroke", ".chart *{stroke", 1)


def finish_axes(axes: Axes, label: str, legend: bool = True) -> None:
    """Give axes a label of the values and a grid, and a legend unless it is to have none."""
    axes.set_ylabel(label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    if legend:
        _without_formulas(axes.legend(fontsize=8, framealpha=0.9))
    axes.spines[["top", "right"]].set_visible(False)


def legend_beside(axes: Axes) -> None:
    """Give axes a legend on their right."""
    place: dict[str, Any] = {"loc": "upper left", "bbox_to_anchor": (1.01, 1.0)}
    _without_formulas(
        axes.legend(fontsize=8, frameon=False, handlelength=3.0, borderaxespad=0.0, **place)
    )


def legend_below(figure: Figure) -> None:
    """Give a figure one legend of all that its axes name, below them; each name once."""
    handles = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            handles[label] = handle
    place: dict[str, Any] = {"loc": "outside lower left", "ncols": 5, "handlelength": 3.0}
    _without_formulas(
        figure.legend([*handles.values()], [*handles], fontsize=8, frameon=False, **place)
    )


def _without_formulas(legend: Legend) -> None:
    """Show the texts of a legend as they are, a $ as a $."""
    for text in legend.get_texts():
        text.set_parse_math(False)
