"""What the top of the package lends to lower rooms, so that none of these needs to know it.

`grasp_cosim/__init__.py` enters functions here; each imports what it needs when it is called.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NamedTuple

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence
    from pathlib import Path

readers: dict[str, Callable[[Path, Path | None, float | None, float | None, Any], Any]] = {}
"""Readers of system files by suffix: `path`, folder of the FMUs, step and stop in s, and stimuli
(`system.stimuli.Stimuli`) or None, to a System."""

metrics: dict[str, Callable[[], tuple[Any, ...]]] = {}
"""Groups of metrics (`metrics.metric.Metric`) by the names that a system has them by."""


html: list[Callable[[Any], str]] = []
"""What a notebook shows of a result, as HTML."""


class Drawing(NamedTuple):
    """A picture of a result: its file's stem, if it fits a result, how to draw the figure, which is
    written to a path if there is one.

    `scene` makes what the page of such a result has besides (`report.page.Scene`), or None;
    `traits` are what such a result is beside its settings, in words, like {"case": "2"}; `words`
    are those that a title has of it, like "case 2".
    """

    stem: str
    fits: Callable[[Any], bool]
    draw: Callable[[Any, Path | None], Any]
    scene: Callable[[Any], Any] = lambda _: None
    traits: Callable[[Any], Mapping[str, str]] = lambda _: {}
    words: Callable[[Any], Sequence[str]] = lambda _: ()


drawings: list[Drawing] = []
"""Pictures of a result, of which the first that fits is drawn."""
