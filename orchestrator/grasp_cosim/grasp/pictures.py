"""Pictures of a grasp, drawn with matplotlib (the optional extra `plot`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..base.text import fixed
from ..recording.result import Result
from ..report.plot import (
    BLUE,
    FINGER_STYLES,
    GREY,
    RED,
    add_heading,
    drawn_line,
    finish_axes,
    legend_below,
    new_figure,
    saved_figure,
)
from ..report.wording import caption
from .metrics import CLOSING, FINGERS, TARGET_POSITION, first_contact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOR = {1: BLUE, 2: RED}
"""Finger 1, the right one, is blue and finger 2 red, as in the paper's figures."""

MARKERS = {1: (".", "o"), 2: ("x", "s")}
"""The markers of simulated and of published values of a finger, where they are no lines."""

TARGET_COLOR = "#1d2023"
"""The colour of the target, which is of no finger."""

FORCE_LIMIT = 12.0
"""Top of the force axes in N; the peak of an impact above it is written there."""

CLOSE_UP_BEFORE, CLOSE_UP_AFTER = 0.015, 0.03
"""s before and after a contact in a close-up."""

SHARED_CLOSE_UP = 0.05
"""s; contacts that are nearer to each other than that share a close-up."""


class Line(NamedTuple):
    """A line of a position in m in the panel of the target: its signal by role, and how."""

    signal: str
    label: str
    color: str
    style: str


@np.errstate(over="ignore")  # of what is not drawn
def draw_grasp(run: Result, path: Path | None = None, *positions: Line) -> Figure:
    """Gaps, contact forces, target and closing speed; on the right around the contacts.

    With a `path` the figure is written there, see report.plot.save_figure(); `positions`
    are drawn in the panel of the target.
    """
    close_ups = _close_ups(run)
    figure = new_figure(7.2 + 2.9 * len(close_ups), 8.0)
    rows = figure.subplots(
        3, 1 + len(close_ups), squeeze=False, width_ratios=[2.2, *(1.0 for _ in close_ups)]
    )
    gaps, contact, target = rows[:, 0]
    for axes in rows[:, 0]:
        axes.sharex(rows[2, 0])
    _draw_gaps(gaps, run, slice(None), FINGERS)
    finish_axes(gaps, "gap to the object in mm", legend=False)
    draw_contact_forces(contact, run)
    for line in positions:
        position = 1e3 * run.by_role[line.signal]
        target.plot(*drawn_line(run.time, position), line.style, color=line.color, label=line.label)
    draw_targets(target, [(run, "-", "")])
    target.set_xlabel("time in s")
    for (fingers, begin, end), column in zip(close_ups, rows[:, 1:].T, strict=True):
        _draw_close_up(column, run, fingers, begin, end)
        for axes in rows[:, 0]:
            axes.axvspan(begin, end, color="#000000", alpha=0.06, linewidth=0.0)
    legend_below(figure)
    add_heading(figure, caption(run))
    return saved_figure(figure, path)


def _close_ups(run: Result) -> list[tuple[Sequence[int], float, float]]:
    """Fingers, begin and end in s of the close-ups: one each, or one of both if they are near."""
    times = {}
    for j in FINGERS:
        if contact := first_contact(run.by_role, j):
            times[j] = contact.time
    if len(times) > 1:
        first, last = min(times.values()), max(times.values())
        if last - first < SHARED_CLOSE_UP:
            return [(FINGERS, first - CLOSE_UP_BEFORE, last + CLOSE_UP_AFTER)]
    return [((j,), time - CLOSE_UP_BEFORE, time + CLOSE_UP_AFTER) for j, time in times.items()]


def _draw_close_up(
    column: Iterable[Axes], run: Result, fingers: Sequence[int], begin: float, end: float
) -> None:
    """The gaps, contact forces and closing speeds of fingers from begin to end, in s."""
    gaps, forces, speeds = column
    rows = slice(*np.searchsorted(run.time, (begin, end)))
    time = run.time[rows]
    _draw_gaps(gaps, run, rows, fingers)
    names = " and ".join(map(str, fingers))
    gaps.set_title(f"contact of finger {names}", fontsize=10)
    for j in fingers:
        force = abs(run.by_role[f"plant.contact_force[{j}]"][rows])
        speed = 1e3 * CLOSING[j] * run.by_role[f"plant.velocity[{j}]"][rows]
        forces.plot(time, force, FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}")
        speeds.plot(time, speed, FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}")
    speeds.set_xlabel("time in s")
    labels = {gaps: "gap in mm", forces: "contact force in N", speeds: "closing speed in mm/s"}
    for axes, label in labels.items():
        axes.sharex(speeds)
        axes.set_xlim(begin, end)
        axes.locator_params(axis="x", nbins=4)
        finish_axes(axes, label, legend=False)


def _draw_gaps(axes: Axes, run: Result, rows: slice, fingers: Sequence[int]) -> None:
    for j in fingers:
        gap = 1e3 * run.by_role[f"plant.gap[{j}]"][rows]
        axes.plot(
            *drawn_line(run.time[rows], gap), FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}"
        )


def draw_contact_forces(axes: Axes, run: Result) -> None:
    """Magnitude of the contact force on each finger; peaks above FORCE_LIMIT are written there."""
    peaks = []
    for j in FINGERS:
        force = abs(run.by_role[f"plant.contact_force[{j}]"])
        peaks.append(float(force.max()))
        axes.plot(
            *drawn_line(run.time, force), FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}"
        )
    highest = max(peaks)
    axes.set_ylim(-0.03 * min(highest, FORCE_LIMIT), 1.1 * min(max(highest, 1e-3), FORCE_LIMIT))
    if highest > FORCE_LIMIT:
        text = f"peaks: {' and '.join(fixed(peak, 0) for peak in peaks)} N"
        axes.text(0.99, 0.95, text, transform=axes.transAxes, ha="right", va="top", fontsize=8)
    finish_axes(axes, "contact force in N", legend=False)


def draw_targets(axes: Axes, runs: Sequence[tuple[Result, str, str]]) -> None:
    """The target position, of those that have one, against the centre of the object.

    `runs` are as (result, style, label).
    """
    for result, style, label in runs:
        if TARGET_POSITION in result.by_role:
            target = 1e3 * result.by_role[TARGET_POSITION]
            name = f"target, {label}" if label else "target"
            axes.plot(*drawn_line(result.time, target), style, color=TARGET_COLOR, label=name)
    result, _, _ = runs[0]
    centre = 1e3 * result.by_role["plant.object_position"]
    axes.plot(*drawn_line(result.time, centre), ":", color=GREY, label="centre of the object")
    finish_axes(axes, "position in mm", legend=False)


def draw_contact_times(axes: Axes, rows: Sequence[Mapping[str, Any]], case: int) -> None:
    """Published contact times (rings, squares) and simulated ones by the conditions of the rows.

    These are positions of the object, simulated as lines, or colours of its surfaces, as dots. The
    time axis ends at a whole number of seconds above the times of all cases.
    """
    of_case = [row for row in rows if row["case"] == case and row["finger"]]
    conditions = [row["condition"] for row in of_case if row["finger"] == FINGERS[0]]
    are_colours = isinstance(conditions[0], str)
    if are_colours:
        x = list(range(len(conditions)))
        axes.set_xticks(x, [colours.replace("/", "\n") for colours in conditions], fontsize=8)
    else:
        x = [1e3 * x_m for x_m in conditions]
        axes.set_xlabel("object position in mm")
    for j in FINGERS:
        of_finger = [row for row in of_case if row["finger"] == j]
        simulated = [row["simulated"] for row in of_finger]
        published = [row["published"] for row in of_finger]
        dot, ring = MARKERS[j]
        style = dot if are_colours else FINGER_STYLES[j]
        axes.plot(x, simulated, style, color=COLOR[j], label=f"finger {j}")
        axes.plot(x, published, ring, color=COLOR[j], mfc="none", label=f"finger {j}, published")
    axes.set_title(f"Case {case}", fontsize=10)
    latest = max(max(r["simulated"], r["published"]) for r in rows if r["finger"])
    axes.set_ylim(0.0, max(3.0, np.ceil(latest)))
    finish_axes(axes, "time to contact in s", legend=False)
