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

MARKS = {1: (".", "o"), 2: ("x", "s")}
"""Simulated and published values of a finger, where they are no lines."""

TARGET = "#1d2023"
"""The colour of the target, which is of no finger."""

FORCE_LIMIT = 12.0
"""Top of the force axes in N; the peak of an impact above it is written there."""

BEFORE, AFTER, NEAR = 0.015, 0.03, 0.05
"""s before and after a contact in a close-up; contacts that are nearer than NEAR share one."""


class Line(NamedTuple):
    """A place in m that is drawn beside the target: its signal by role, and how."""

    signal: str
    label: str
    color: str
    style: str


@np.errstate(over="ignore")  # of what is not drawn
def draw_grasp(run: Result, path: Path | None = None, *beside: Line) -> Figure:
    """Gaps, contact forces, target and closing speed; on the right around the contacts.

    With a `path` the figure is written there, see report.plot.save_figure(); places `beside` the
    target are drawn with it.
    """
    spans = _around_contacts(run)
    figure = new_figure(7.2 + 2.9 * len(spans), 8.0)
    rows = figure.subplots(
        3, 1 + len(spans), squeeze=False, width_ratios=[2.2, *(1.0 for _ in spans)]
    )
    gaps, contact, target = rows[:, 0]
    for axes in rows[:, 0]:
        axes.sharex(rows[2, 0])
    _gaps(gaps, run, slice(None), FINGERS)
    finish_axes(gaps, "gap to the object in mm", legend=False)
    draw_contact_forces(contact, run)
    for line in beside:
        place = 1e3 * run.by_role[line.signal]
        target.plot(*drawn_line(run.time, place), line.style, color=line.color, label=line.label)
    draw_targets(target, [(run, "-", "")])
    target.set_xlabel("time in s")
    for (fingers, begin, end), column in zip(spans, rows[:, 1:].T, strict=True):
        _around(column, run, fingers, begin, end)
        for axes in rows[:, 0]:
            axes.axvspan(begin, end, color="#000000", alpha=0.06, linewidth=0.0)
    legend_below(figure)
    add_heading(figure, caption(run))
    return saved_figure(figure, path)


def _around_contacts(run: Result) -> list[tuple[Sequence[int], float, float]]:
    """Fingers, begin and end in s of the close-ups: one each, or one of both if they are near."""
    contacts = {j: first_contact(run.by_role, j) for j in FINGERS}
    times = {j: contact.time for j, contact in contacts.items() if contact}
    if len(times) > 1 and max(times.values()) - min(times.values()) < NEAR:
        return [(FINGERS, min(times.values()) - BEFORE, max(times.values()) + AFTER)]
    return [((j,), t - BEFORE, t + AFTER) for j, t in times.items()]


def _around(
    column: Iterable[Axes], run: Result, fingers: Sequence[int], begin: float, end: float
) -> None:
    """The gaps, contact forces and closing speeds of fingers from begin to end, in s."""
    gaps, forces, speeds = column
    rows = slice(*np.searchsorted(run.time, (begin, end)))
    time = run.time[rows]
    _gaps(gaps, run, rows, fingers)
    names = " and ".join(map(str, fingers))
    gaps.set_title(f"contact of finger {names}", fontsize=10)
    for j in fingers:
        force = abs(run.by_role[f"plant.contact_force[{j}]"][rows])
        speed = 1e3 * CLOSING[j] * run.by_role[f"plant.velocity[{j}]"][rows]
        forces.plot(time, force, FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}")
        speeds.plot(time, speed, FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}")
    speeds.set_xlabel("time in s")
    for axes, label in (
        (gaps, "gap in mm"),
        (forces, "contact force in N"),
        (speeds, "closing speed in mm/s"),
    ):
        axes.sharex(speeds)
        axes.set_xlim(begin, end)
        axes.locator_params(axis="x", nbins=4)
        finish_axes(axes, label, legend=False)


def _gaps(axes: Axes, run: Result, rows: slice, fingers: Sequence[int]) -> None:
    for j in fingers:
        gap = 1e3 * run.by_role[f"plant.gap[{j}]"][rows]
        axes.plot(
            *drawn_line(run.time[rows], gap), FINGER_STYLES[j], color=COLOR[j], label=f"finger {j}"
        )


def draw_contact_forces(axes: Axes, run: Result) -> None:
    """Magnitude of the contact force on each finger; peaks above FORCE_LIMIT are said."""
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

    runs are as (result, style, label).
    """
    for result, style, label in (run for run in runs if TARGET_POSITION in run[0].by_role):
        target = 1e3 * result.by_role[TARGET_POSITION]
        name = f"target, {label}" if label else "target"
        axes.plot(*drawn_line(result.time, target), style, color=TARGET, label=name)
    result = runs[0][0]
    centre = 1e3 * result.by_role["plant.object_position"]
    axes.plot(*drawn_line(result.time, centre), ":", color=GREY, label="centre of the object")
    finish_axes(axes, "position in mm", legend=False)


def draw_contact_times(axes: Axes, rows: Sequence[Mapping[str, Any]], case: int) -> None:
    """Published contact times (rings, squares) and simulated ones by the conditions of the rows.

    These are positions of the object, simulated as lines, or colours of its surfaces, as dots. The
    time axis ends at a whole number of seconds above the times of all cases.
    """
    of_case = [r for r in rows if r["case"] == case and r["finger"]]
    conditions = [r["condition"] for r in of_case if r["finger"] == FINGERS[0]]
    if colours := isinstance(conditions[0], str):
        x = list(range(len(conditions)))
        axes.set_xticks(x, [c.replace("/", "\n") for c in conditions], fontsize=8)
    else:
        x = [1e3 * c for c in conditions]
        axes.set_xlabel("object position in mm")
    for j in FINGERS:
        simulated, published = (
            [r[key] for r in of_case if r["finger"] == j] for key in ("simulated", "published")
        )
        (dot, ring), name = MARKS[j], f"finger {j}"
        axes.plot(x, simulated, dot if colours else FINGER_STYLES[j], color=COLOR[j], label=name)
        axes.plot(x, published, ring, color=COLOR[j], mfc="none", label=f"{name}, published")
    axes.set_title(f"Case {case}", fontsize=10)
    latest = max(max(r["simulated"], r["published"]) for r in rows if r["finger"])
    axes.set_ylim(0.0, max(3.0, np.ceil(latest)))
    finish_axes(axes, "time to contact in s", legend=False)
