"""How the result of a hand is shown: its picture, and fingers on rays around the object."""

from __future__ import annotations

from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from ..grasp.metrics import fingers_of
from ..grasp.presets import case_of, words_of
from ..grasp.scene import scene_of_fingers
from ..metrics.metric import resolved
from ..recording.result import Result, View
from ..report.plot import (
    BLUE,
    GREY,
    RED,
    add_heading,
    drawn_line,
    finish_axes,
    legend_below,
    new_figure,
    saved_figure,
)
from ..report.traces_page import Scene
from ..report.wording import caption
from .metrics import directions, is_disc, is_hand

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HOW_IT_IS_SEEN = (
    "The hand is seen from above; the object is drawn from face to face, where the gaps say it is"
)


COLORS = (BLUE, RED, "#2e8b57", "#8e44ad", "#b9770e", "#117a8b", "#5d4037", "#6c757d")
DASHES = ("-", "--", "-.", ":", (0, (6, 1)), (0, (1, 1)), (0, (8, 2, 1, 2)), (0, (4, 4)))
"""Of the fingers, from the first on; the dashes tell them apart in grey."""

OBJECT = "#cfcfc8"

Points = npt.NDArray[np.complex128]
"""In the plane, x + i·y."""


@np.errstate(over="ignore", invalid="ignore")  # of what is not drawn
def draw_hand(run: Result, path: Path | None = None) -> Figure:
    """Gaps, contact forces and closing speeds by finger; next to them the hand at the end.

    With a `path` the figure is written there, see report.plot.save_figure().
    """
    figure = new_figure(11.0, 7.5)
    grid = figure.add_gridspec(3, 2, width_ratios=[1.3, 1.0])
    rows = [figure.add_subplot(grid[i, 0]) for i in range(3)]
    signals = run.by_role
    for axes, name, factor, label in zip(
        rows,
        ("gap", "contact_force", "velocity"),
        (1e3, 1.0, -1e3),
        ("gap to the object in mm", "contact force in N", "closing speed in mm/s"),
        strict=True,
    ):
        axes.sharex(rows[-1])
        for i, k in enumerate(fingers_of(signals)):
            line = drawn_line(run.time, factor * signals[f"plant.{name}[{k}]"])
            axes.plot(*line, linestyle=DASHES[i], color=COLORS[i], label=f"finger {k}")
        finish_axes(axes, label, legend=False)
    rows[-1].set_xlabel("time in s")
    _from_above(figure.add_subplot(grid[:, 1]), run)
    legend_below(figure)
    add_heading(figure, caption(run))
    return saved_figure(figure, path)


def _from_above(axes: Axes, run: Result) -> None:
    """The fingers on their rays, the object and the contact forces in the last row, in mm."""
    signals = run.by_role
    e = np.exp(1j * np.asarray(directions(signals)))
    fingers = fingers_of(signals)
    tips, gaps, forces = (
        np.array([signals[f"plant.{name}[{k}]"][-1] for k in fingers])
        for name in ("position", "gap", "contact_force")
    )
    far = 1e3 * float(np.abs(tips).max())
    faces = 1e3 * (tips - gaps) * e
    centre = 1e3 * complex(*(signals[f"plant.object_position[{i}]"][-1] for i in (1, 2)))
    turned = np.exp(1j * signals["plant.object_angle"][-1])
    if is_disc(signals):
        around = centre + abs(faces[0] - centre) * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 200))
    else:
        around = _prism(faces, e * turned, far)
    axes.fill(around.real, around.imag, color=OBJECT, label="object")
    axes.plot(centre.real, centre.imag, "+", color=GREY)
    for i, k in enumerate(fingers):
        tip, back, end = (1e3 * tips[i] * e[i] + out * far * e[i] for out in (0.0, 0.7, 1.0))
        axes.plot([0.0, end.real], [0.0, end.imag], color="#dddddd", lw=0.8)
        ends = ([tip.real, back.real], [tip.imag, back.imag])
        axes.plot(*ends, color=COLORS[i], lw=11.0, solid_capstyle="butt")
        label = f"{k}: {forces[i]:.2f} N"
        axes.text(end.real, end.imag, label, ha="center", va="center", fontsize=8)
        if forces[i] > 0.0:
            to = tip - 0.6 * far * np.sqrt(forces[i] / forces.max()) * e[i]
            arrow = {"arrowstyle": "-|>", "color": "#1d2023", "lw": 1.5}
            axes.annotate("", (to.real, to.imag), (tip.real, tip.imag), arrowprops=arrow)
    axes.set_aspect("equal")
    axes.set_xlim(-2.3 * far, 2.3 * far)
    axes.set_ylim(-2.3 * far, 2.3 * far)
    title = f"seen from above at {run.time[-1]:g} s; arrows: forces on the object"
    axes.set_title(title, fontsize=10)
    axes.set_xlabel("x in mm")
    finish_axes(axes, "y in mm", legend=False)


def _prism(faces: Points, normals: Points, far: float) -> Points:
    """The corners of what faces through these points leave of a large square."""
    corners: Points = np.array([1 + 1j, -1 + 1j, -1 - 1j, 1 - 1j], np.complex128) * 1.9 * far
    for face, normal in zip(faces, normals, strict=True):
        corners = _cut(corners, face, normal)
    return corners


def _cut(corners: Points, face: complex, normal: complex) -> Points:
    """The corners of a polygon of which a face cuts off what is outside, in mm."""
    heights = ((corners - face) * np.conj(normal)).real  # of the corners above the face
    inside: list[complex] = []
    edges = zip(corners, heights, np.roll(corners, -1), np.roll(heights, -1), strict=True)
    for a, height_a, b, height_b in edges:
        if height_a <= 0.0:
            inside.append(a)
        if (height_a < 0.0) != (height_b < 0.0):
            inside.append(a + (b - a) * height_a / (height_a - height_b))
    return np.array(inside, np.complex128)


def hand_scene(result: Result) -> Scene | None:
    """Return the scene of a result; None where it is no hand."""
    signals = result.by_role
    if not is_hand(signals):
        return None
    names = ("object_position[1]", "object_position[2]", "object_angle")
    pose_signals = [resolved(f"plant.{name}", result.roles) for name in names]
    state = {"where": pose_signals, "angles": directions(signals), "disc": is_disc(signals)}
    scene = scene_of_fingers(result, "Hand", HOW_IT_IS_SEEN, pose_signals, state)
    return replace(
        scene,
        style=scene.style + _text("hand.css"),
        scripts=f"{scene.scripts}\n{_text('hand.js')}",
        first_signals=[name for name in scene.first_signals if name not in pose_signals],
    )


def _text(name: str) -> str:
    return (files(__package__) / "page" / name).read_text("utf-8")


VIEW = View(
    "hand",
    lambda result: is_hand(result.by_role),
    draw_hand,
    hand_scene,
    lambda result: {"case": case_of(result.settings)},
    lambda result: words_of(result.settings),
)
