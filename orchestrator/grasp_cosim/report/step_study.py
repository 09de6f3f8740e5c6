"""Figure of a step study: how quantities err, and the energy that sampling creates."""

from __future__ import annotations

from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from .caption import Caption, about
from .plot import COLORS, GREY, STYLES, finish, headed, new_figure, save

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..convergence.step_study import StepStudy

MARKERS = ("o", "s", "^", "D", "v", "P")
"""One per quantity or energy, so that lines on top of each other can be told apart."""


def draw_step_study(study: StepStudy, path: Path) -> None:
    """Errors of the quantities over the step, below them energies if there are any; see save()."""
    # A logarithmic axis has no place for 0.
    names = list(dict.fromkeys(n for run in study.runs for n, e in run.energies.items() if e))
    figure = new_figure(7.2, 7.6 if names else 4.4)
    if names:
        errors, energies = figure.subplots(2, 1, sharex=True)
        _draw_energies(energies, study, names)
        energies.set_xlabel("communication step in ms")
    else:
        errors = figure.subplots()
        errors.set_xlabel("communication step in ms")
    _draw_errors(errors, study)
    title = f"{PurePath(study.system).stem}: error over the step, {study.scheme}"
    headed(figure, Caption(title, about(study.changed)))
    save(figure, path)


def _draw_errors(axes: Axes, study: StepStudy) -> None:
    """Distance of the quantities from their limits, with the tolerance."""
    factor, unit = study.shown
    drawn: list[tuple[float, float]] = []
    for i, (name, convergence) in enumerate(study.limits.items()):
        points = [
            (1e3 * run.step, factor * abs(error))
            for run, error in zip(study.runs, convergence.errors, strict=True)
            if error
        ]
        order = "" if convergence.order is None else f", order {convergence.order:.2f}"
        axes.plot(
            *zip(*points, strict=True) if points else ([], []),
            linestyle=STYLES[i % len(STYLES)],
            marker=MARKERS[i % len(MARKERS)],
            markersize=max(9 - 3 * i, 4),
            color=COLORS[i % len(COLORS)],
            mfc="none" if i == 0 else COLORS[i % len(COLORS)],
            label=f"{name}{order}",
        )
        drawn += points
    tolerance = factor * study.tolerance
    axes.axhline(tolerance, color=GREY, linestyle="--", label=f"tolerance, {tolerance:g} {unit}")
    if len(drawn) > 1:
        _draw_slope(axes, drawn)
    _set_scales(axes, study)
    finish(axes, f"error in {unit}" if unit else "error")


def _draw_slope(axes: Axes, points: list[tuple[float, float]]) -> None:
    """A triangle below the points that shows the slope of the first order."""
    steps = [step for step, _ in points]
    left = min(steps) * (max(steps) / min(steps)) ** 0.6
    right = min(2.0 * left, max(steps))
    bottom = 0.35 * min(e for s, e in points if s >= left)
    top = bottom * right / left
    axes.plot([left, right, right, left], [bottom, bottom, top, bottom], color=GREY, linewidth=1.0)
    axes.annotate(
        "1", (right, (bottom * top) ** 0.5), (4, 0), textcoords="offset points", va="center",
        color=GREY, fontsize=9,
    )  # fmt: skip
    axes.annotate(
        "1", ((left * right) ** 0.5, bottom), (0, -3), textcoords="offset points", ha="center",
        va="top", color=GREY, fontsize=9,
    )  # fmt: skip


def _draw_energies(axes: Axes, study: StepStudy, names: list[str]) -> None:
    """Magnitude of each energy at the end in uJ; an open marker is energy lost."""
    for i, name in enumerate(names):
        color = COLORS[i % len(COLORS)]
        ends = [(1e3 * run.step, 1e6 * run.energies.get(name, 0.0)) for run in study.runs]
        found = [(h, e) for h, e in ends if e]
        steps, sizes = [h for h, _ in found], [abs(e) for _, e in found]
        axes.plot(steps, sizes, STYLES[i % len(STYLES)], color=color, label=name)
        for h, e in found:
            face = color if e > 0.0 else "none"
            axes.plot([h], [abs(e)], MARKERS[i % len(MARKERS)], color=color, mfc=face)
    _set_scales(axes, study)
    finish(axes, "energy created by sampling in µJ\n(open: lost)")


def _set_scales(axes: Axes, study: StepStudy) -> None:
    """Logarithmic axes with a tick at each step, and a line at the system's own."""
    axes.set(xscale="log", yscale="log")
    steps = [1e3 * run.step for run in study.runs]
    axes.set_xticks(steps, [f"{step:g}" for step in steps])
    axes.set_xticks([], minor=True)
    axes.yaxis.set_major_formatter("{x:g}")
    own = 1e-6 * study.step_ns
    axes.axvline(own, color="black", linestyle=":", linewidth=1.0, label=f"own step, {own:g} ms")
