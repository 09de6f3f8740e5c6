"""Figures of a grasp, drawn with matplotlib (the optional extra `plot`)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import InputError
from ..recording.result import in_one_piece
from ..study.metrics import CONTROLLER, FINGERS, PLANT, is_grasp

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..recording.result import Result

BLUE, RED, GREY = "#1f5fa8", "#c0392b", "#7f7f7f"
COLOR = {1: BLUE, 2: RED}
"""Finger 1, the right one, is blue and finger 2 red, as in the paper's figures."""

FORCE_LIMIT = 12.0
"""Top of the force axes in N; the legend gives the peak of an impact above it."""


def plot_run(result: Result, path: Path) -> None:
    """Gaps, contact forces and target over time, as a PNG."""
    check_plot(result.signals)
    figure = new_figure(7.2, 8.0)
    gaps, contact, target = figure.subplots(3, 1, sharex=True)
    for j in FINGERS:
        gaps.plot(
            result.time, 1e3 * result[f"{PLANT}.gap[{j}]"], color=COLOR[j], label=f"finger {j}"
        )
    finish(gaps, "gap to the object in mm")
    draw_contact_forces(contact, [(result, "-", "")])
    draw_targets(target, [(result, "-", "")])
    target.set_xlabel("time in s")
    save(figure, path)


def check_plot(signals: Iterable[str]) -> None:
    """InputError where plot_run() could not draw signals of these names."""
    new_figure(1.0, 1.0)
    if not is_grasp(signals):
        raise InputError("nothing to draw; must be a system with a gripper plant and a controller")


def draw_contact_forces(axes: Axes, runs: Sequence[tuple[Result, str, str]]) -> None:
    """Magnitude of the contact force on each finger; runs as (result, line style, label)."""
    highest = 0.0
    for result, style, label in runs:
        for j in FINGERS:
            force = abs(result[f"{PLANT}.contact_force[{j}]"])
            peak = float(force.max())
            name = f"{label}, finger {j}" if label else f"finger {j}"
            if peak > FORCE_LIMIT:
                name += f", peak {peak:.0f} N"
            axes.plot(result.time, force, style, color=COLOR[j], label=name)
            highest = max(highest, peak)
    axes.set_ylim(-0.03 * min(highest, FORCE_LIMIT), 1.1 * min(max(highest, 1e-3), FORCE_LIMIT))
    finish(axes, "contact force in N")


def draw_targets(axes: Axes, runs: Sequence[tuple[Result, str, str]]) -> None:
    """The target position against the centre of the object; runs as (result, style, label)."""
    for result, style, label in runs:
        target = 1e3 * result[f"{CONTROLLER}.target_position"]
        name = f"target, {label}" if label else "target"
        axes.plot(result.time, target, style, color=BLUE, label=name)
    result = runs[0][0]
    centre = 1e3 * result[f"{PLANT}.object_position"]
    axes.plot(result.time, centre, ":", color=GREY, label="centre of the object")
    finish(axes, "position in mm")


def draw_contact_times(axes: Axes, rows: Sequence[Mapping[str, Any]], case: int) -> None:
    """Published (circles) and simulated (lines) contact times over the object position."""
    for j in FINGERS:
        of_finger = [r for r in rows if r["case"] == case and r["finger"] == j]
        x = [1e3 * r["condition"] for r in of_finger]
        axes.plot(x, [r["simulated"] for r in of_finger], "-", color=COLOR[j], label=f"finger {j}")
        axes.plot(
            x,
            [r["published"] for r in of_finger],
            "o",
            color=COLOR[j],
            mfc="none",
            label=f"finger {j}, published",
        )
    axes.set_title(f"Case {case}", fontsize=10)
    axes.set_xlabel("object position in mm")
    axes.set_ylim(0.0, 3.0)
    finish(axes, "time to contact in s")


def new_figure(width: float, height: float) -> Figure:
    """An empty figure, sizes in inches; InputError without matplotlib."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise InputError(
            "matplotlib is not installed, it draws the figures; "
            "install it with: pip install 'grasp-cosim[plot]'"
        ) from error
    return Figure(figsize=(width, height), layout="constrained")


def save(figure: Figure, path: Path) -> None:
    """Write the figure as a PNG under a temporary name, then rename it."""
    with in_one_piece(path) as part:
        figure.savefig(part, format="png", dpi=130, metadata={"Software": None})


def finish(axes: Axes, label: str) -> None:
    """What all axes have: a label of the values, a grid, a legend."""
    axes.set_ylabel(label)
    axes.grid(True, color="#dddddd", linewidth=0.6)
    axes.legend(fontsize=8, framealpha=0.9)
    axes.spines[["top", "right"]].set_visible(False)
