"""Pictures of a grasp, drawn with matplotlib (the optional extra `plot`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..metrics.metric import resolved
from ..numerals import fixed
from ..recording.result import Result
from ..report.plot import BLUE, GREY, RED, finish, kept, new_figure
from .metrics import CLOSING, FINGERS, first_contact

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

COLOR = {1: BLUE, 2: RED}
"""Finger 1, the right one, is blue and finger 2 red, as in the paper's figures."""

FORCE_LIMIT = 12.0
"""Top of the force axes in N; the legend gives the peak of an impact above it."""

BEFORE, AFTER, NEAR = 0.015, 0.03, 0.05
"""s before and after a contact in a close-up; contacts that are nearer than NEAR share one."""


def draw_grasp(run: Result, path: Path | None = None) -> Figure:
    """Gaps, contact forces, target and closing speed; on the right around the contacts.

    With a `path` the figure is written there as a PNG.
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
    finish(gaps, "gap to the object in mm")
    draw_contact_forces(contact, [(run, "-", "")])
    draw_targets(target, [(run, "-", "")])
    target.set_xlabel("time in s")
    for (fingers, begin, end), column in zip(spans, rows[:, 1:].T, strict=True):
        _around(column, run, fingers, begin, end)
        for axes in rows[:, 0]:
            axes.axvspan(begin, end, color="#000000", alpha=0.06, linewidth=0.0)
    controller = resolved("controller.", run.roles)[:-1]
    fmu = run.settings.get("components", {}).get(controller, {}).get("fmu", "")
    figure.suptitle(fmu.removesuffix(".fmu"), fontsize=10, parse_math=False)
    return kept(figure, path)


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
        forces.plot(time, force, color=COLOR[j], label=f"finger {j}")
        speeds.plot(time, speed, color=COLOR[j], label=f"finger {j}")
    speeds.set_xlabel("time in s")
    for axes, label in (
        (gaps, "gap in mm"),
        (forces, "contact force in N"),
        (speeds, "closing speed in mm/s"),
    ):
        axes.sharex(speeds)
        axes.set_xlim(begin, end)
        axes.locator_params(axis="x", nbins=4)
        finish(axes, label)


def _gaps(axes: Axes, run: Result, rows: slice, fingers: Sequence[int]) -> None:
    for j in fingers:
        gap = 1e3 * run.by_role[f"plant.gap[{j}]"][rows]
        axes.plot(run.time[rows], gap, color=COLOR[j], label=f"finger {j}")


def draw_contact_forces(axes: Axes, runs: Sequence[tuple[Result, str, str]]) -> None:
    """Magnitude of the contact force on each finger; runs as (result, line style, label)."""
    highest = 0.0
    for result, style, label in runs:
        for j in FINGERS:
            force = abs(result.by_role[f"plant.contact_force[{j}]"])
            peak = float(force.max())
            name = f"{label}, finger {j}" if label else f"finger {j}"
            if peak > FORCE_LIMIT:
                name += f", peak {fixed(peak, 0)} N"
            axes.plot(result.time, force, style, color=COLOR[j], label=name)
            highest = max(highest, peak)
    axes.set_ylim(-0.03 * min(highest, FORCE_LIMIT), 1.1 * min(max(highest, 1e-3), FORCE_LIMIT))
    finish(axes, "contact force in N")


def draw_targets(axes: Axes, runs: Sequence[tuple[Result, str, str]]) -> None:
    """The target position against the centre of the object; runs as (result, style, label)."""
    for result, style, label in runs:
        target = 1e3 * result.by_role["controller.target_position"]
        name = f"target, {label}" if label else "target"
        axes.plot(result.time, target, style, color=BLUE, label=name)
    result = runs[0][0]
    centre = 1e3 * result.by_role["plant.object_position"]
    axes.plot(result.time, centre, ":", color=GREY, label="centre of the object")
    finish(axes, "position in mm")


def draw_contact_times(axes: Axes, rows: Sequence[Mapping[str, Any]], case: int) -> None:
    """Published contact times (circles) and simulated ones by the conditions of the rows.

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
        axes.plot(x, simulated, "." if colours else "-", color=COLOR[j], label=f"finger {j}")
        axes.plot(x, published, "o", color=COLOR[j], mfc="none", label=f"finger {j}, published")
    axes.set_title(f"Case {case}", fontsize=10)
    latest = max(max(r["simulated"], r["published"]) for r in rows if r["finger"])
    axes.set_ylim(0.0, max(3.0, np.ceil(latest)))
    finish(axes, "time to contact in s")
