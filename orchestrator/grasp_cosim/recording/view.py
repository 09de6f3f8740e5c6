"""How a result is shown beyond its numbers."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from ..base.higher import higher


class View(NamedTuple):
    """A picture: the stem of its file, whether it fits a result, how it is drawn, and written to a
    path if there is one.

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


OF_ANY = View(
    "signals", lambda _: True, lambda run, path: higher("report.plot").plot_signals(run, path)
)
"""Of a result of any system."""
