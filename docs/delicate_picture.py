"""Draws delicate.png: what six delicate things bear, and what three laws do to them."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from delicate_things import Outcome, Window, compared
from grasp_cosim.report.plot import add_heading, new_figure, save_figure
from grasp_cosim.report.wording import Caption

LEAST, MOST = 0.03, 60.0
"""N, the ends of the axis."""

SLIPS, HOLDS, BREAKS = "#cfe0f3", "#9bd18b", "#f4b8ad"
"""Colours of the three ranges of a force."""

MARKERS: Mapping[str, tuple[str, str, str]] = {
    "position control": ("X", "#b3261e", "position control"),
    "published": ("o", "#1f4e8c", "the published law"),
    "grip force": ("*", "#111111", "the law with a grip force"),
}
"""Marker, colour and words of a law."""

HALF = 0.33
"""Of the height of a row that a thing and its ranges take."""

RED, LEAF, SHELL, WHITE, BROWN = "#d03b2f", "#3f8f3a", "#ecd2ac", "#fdfdf8", "#8a5a34"


def draw(folder: Path) -> None:
    """Draw it into a folder."""
    with TemporaryDirectory() as built:
        rows = list(compared(Path(built)))
    figure = new_figure(8.4, 5.0)
    sketches, chart = figure.subplots(1, 2, width_ratios=[1.0, 6.5], sharey=True)
    for row, (thing, limits, outcomes) in enumerate(rows):
        _sketch(sketches, thing, row)
        _ranges(chart, row, limits, outcomes)
    _frame(sketches, chart, [thing.replace("_", " ") for thing, _, _ in rows])
    add_heading(
        figure,
        Caption("Between slipping and breaking", "highest force of a finger in a grasp and a lift"),
        "Position control closes at 50 mm/s, and has the same grip force",
    )
    save_figure(figure, folder / "delicate.png")


def _ranges(axes: Any, row: int, limits: Window, outcomes: Mapping[str, Outcome]) -> None:
    """The three ranges of a thing, and where each law is."""
    edges = (LEAST, limits.slips_below, limits.damaged_above, MOST)
    for begin, end, colour in zip(edges, edges[1:], (SLIPS, HOLDS, BREAKS), strict=False):
        axes.barh(row, end - begin, left=begin, height=2.0 * HALF, color=colour, zorder=1)
    if row == 0:
        for place, words in ((0.04, "slips out"), (16.0, "breaks")):
            axes.text(place, row, words, va="center", fontsize=9, color="#555555")
    for law, outcome in outcomes.items():
        marker, colour, words = MARKERS[law]
        size = 190 if marker == "*" else 90
        axes.scatter(
            outcome.peak_force, row, size, colour, marker=marker, linewidths=0.8,
            edgecolors="white", zorder=3, label=words if row == 0 else None,
        )  # fmt: skip
        if outcome.word != "survives":
            axes.annotate(
                outcome.word, (outcome.peak_force, row), (0, -17), textcoords="offset points",
                ha="center", fontsize=8, color=colour, zorder=4,
            )  # fmt: skip


def _frame(sketches: Any, chart: Any, names: Sequence[str]) -> None:
    """Axes, names and legend."""
    sketches.set(xlim=(-0.6, 0.6), xticks=[], aspect="equal")
    sketches.set_yticks(range(len(names)), names, fontsize=10)
    sketches.tick_params(length=0)
    sketches.invert_yaxis()
    chart.set(xscale="log", xlim=(LEAST, MOST), xlabel="force of a finger, N")
    ticks = [0.1, 1.0, 10.0]
    chart.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
    chart.tick_params(left=False)
    for axes in (sketches, chart):
        for side in ("left", "right", "top", "bottom"):
            axes.spines[side].set_visible(axes is chart and side == "bottom")
    chart.legend(
        loc="upper center", bbox_to_anchor=(0.45, -0.12), ncols=3, fontsize=8, frameon=False
    )


def _sketch(axes: Any, thing: str, row: int) -> None:
    """A thing, drawn in its row."""
    from matplotlib.patches import Ellipse, FancyBboxPatch, Polygon

    line: Any = {"ec": "#555555", "lw": 0.8}
    top, bottom = row - HALF, row + HALF
    if thing == "tofu":
        corners = [(-0.4, top + 0.12), (0.4, top + 0.12), (0.4, bottom), (-0.4, bottom)]
        axes.add_patch(Polygon(corners, fc=WHITE, **line))
    elif thing == "strawberry":
        axes.add_patch(Polygon([(-0.3, top + 0.2), (0.0, top + 0.1), (0.3, top + 0.2),
                                (0.22, bottom - 0.2), (0.0, bottom), (-0.22, bottom - 0.2)],
                               fc=RED, joinstyle="round", **line))  # fmt: skip
        axes.add_patch(Polygon([(-0.2, top), (0.0, top + 0.2), (0.2, top)], fc=LEAF, **line))
        axes.plot([-0.12, 0.12, 0.0], [row, row, row + 0.15], ".", color="#f6dd8a", ms=3)
    elif thing == "tomato":
        axes.add_patch(Ellipse((0.0, row + 0.03), 0.74, 0.6, fc=RED, **line))
        axes.add_patch(Polygon([(-0.16, top + 0.02), (0.0, top + 0.14), (0.16, top + 0.02)],
                               fc=LEAF, **line))  # fmt: skip
    elif thing == "egg":
        axes.add_patch(Ellipse((0.0, row), 0.5, 0.66, fc=SHELL, **line))
    elif thing == "marshmallow":
        axes.add_patch(
            FancyBboxPatch((-0.2, top + 0.18), 0.4, 0.36, "round,pad=0.1", fc=WHITE, **line)
        )
    else:
        axes.add_patch(Polygon([(-0.3, top), (0.3, top), (0.2, bottom), (-0.2, bottom)],
                               fc=WHITE, **line))  # fmt: skip
        axes.add_patch(Polygon([(-0.26, row - 0.1), (0.26, row - 0.1), (0.22, row + 0.15),
                                (-0.22, row + 0.15)], fc=BROWN, **line))  # fmt: skip
