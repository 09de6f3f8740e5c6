"""The picture of a tuning: what was tried, the Pareto front, the gains before and after."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path, PurePath
from typing import TYPE_CHECKING

from ..errors import InputError
from ..metrics.metric import Metric
from ..tuning.search import Point, Tuning
from .caption import Caption, about
from .plot import BLUE, GREY, RED, finish, headed, kept, new_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

REACH = 1.25
"""Shown are values up to so many times the greatest of the front, the limit and the start."""


def draw_tuning(found: Tuning, path: Path | None = None, start: str = "start") -> Figure:
    """Draw what is to be least over what the first limit is on, a mark per point.

    `start` names the gains of the system. With a path it is written there, see save(). InputError
    without matplotlib, and where there is no limit.
    """
    check_drawable(found.problem.limits)
    figure = new_figure(8.0, 5.4)
    axes = figure.subplots()
    others = set(list(found.limits)[1:])
    keeping = [not others & set(point.broken(found.limits)) for point in found.points]
    for keeps, mark, color, name in (
        (False, "x", GREY, "breaks another limit"),
        (True, "o", BLUE, "keeps the other limits"),
    ):
        points = [p for p, k in zip(found.points, keeping, strict=True) if k is keeps]
        _marks(axes, _places(found, points), mark, color, name)
    front = _places(found, found.front)
    if front:
        axes.step(*zip(*front, strict=True), "k-", where="post", label="Pareto front of these")
    for point, mark, size, name in (
        (found.start, "s", 9, start),
        (found.tuned, "*", 16, "tuned"),
    ):
        for x, y in _places(found, [point] if point else []):
            axes.plot(
                x, y, mark, markersize=size, label=f"{name}: {x:.3g}, {y:.3g}", linestyle="none",
                markerfacecolor="white", markeredgecolor=RED, markeredgewidth=1.8, zorder=5,
            )  # fmt: skip
    beyond = _frame(axes, found, front)
    tried = f"{len(found.points)} sets of {len(found.problem.gains)} gains, seed {found.seed}"
    headed(figure, _caption(found), f"{tried}; {beyond} are beyond the axes, or have no value")
    return kept(figure, path)


def check_drawable(limits: Mapping[str, object]) -> None:
    """InputError where there is no limit."""
    if not limits:
        raise InputError("--plot: no limit; must have one, whose metric is the other axis")


def _marks(
    axes: Axes, places: Sequence[tuple[float, float]], mark: str, color: str, name: str
) -> None:
    if places:
        x, y = zip(*places, strict=True)
        axes.scatter(x, y, s=14, marker=mark, c=color, alpha=0.6, linewidths=0.8, label=name)


def _places(found: Tuning, points: Sequence[Point]) -> list[tuple[float, float]]:
    """Where points lie in the picture, in the units that tables show; not those without a value."""
    y, x = (found.problem.metric(name) for name in found.problem.names[:2])
    pairs = [(point.figures[x.name], point.figures[y.name]) for point in points]
    return [(a * x.factor, b * y.factor) for a, b in pairs if a is not None and b is not None]


def _frame(axes: Axes, found: Tuning, front: Sequence[tuple[float, float]]) -> int:
    """Draw the limit, and set the axes; return how many points are not within them."""
    y, x = (found.problem.metric(name) for name in found.problem.names[:2])
    most = found.limits[x.name] * x.factor
    label = f"limit: {most:.3g} {x.display_unit}".rstrip()
    axes.axvline(most, color="k", linestyle="--", linewidth=1.0, label=label)
    seen = [*front, *_places(found, [found.start])]
    right = REACH * max([most, *(a for a, _ in seen)])
    top = REACH * max([b for _, b in seen], default=1.0)
    axes.set_xlim(min(0.0, *(a for a, _ in seen), 0.0), right)
    axes.set_ylim(min(0.0, *(b for _, b in seen), 0.0), top)
    axes.set_xlabel(_label(x))
    finish(axes, _label(y))
    return len(found.points) - sum(a <= right and b <= top for a, b in _places(found, found.points))


def _label(metric: Metric) -> str:
    return f"{metric.title}, worst case" + (metric.display_unit and f", in {metric.display_unit}")


def _caption(found: Tuning) -> Caption:
    """The title: of which system, what, and what it is the worst of."""
    y, x = (found.problem.metric(name).title for name in found.problem.names[:2])
    system = PurePath(found.problem.system.name).stem
    conditions = "; ".join(c.name for c in found.problem.conditions)
    return Caption(
        f"{system}, tuned: {y} against {x}", f"the worst of: {conditions} · {about(None)}"
    )
