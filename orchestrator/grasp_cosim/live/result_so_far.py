"""The result of a run that goes on, of the rows that are kept: its scene, and its link figures."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from typing import Any

import numpy as np

from ..metrics.in_si import in_si
from ..recording.memory import typed
from ..recording.proxies import proxy_figures
from ..recording.result import Result
from ..report.traces_page import Scene
from ..system.description import System
from .feed import Feed

LOGGER = logging.getLogger(__name__)
"""Gets a line where a scene cannot be made of the first rows."""


def result_so_far(system: System, feed: Feed) -> Result:
    """Return the result of the rows that are kept: extremes of blocks, and the last row."""
    time, columns = feed.columns()
    signals = feed.signals
    conversions = in_si(system, ()).conversions
    return Result(
        feed.experiment.settings,
        time,
        {s.name: typed(s, columns[s.name]) for s in signals},
        {s.name: s.unit for s in signals},
        None,
        complete=False,
        descriptions={s.name: s.description for s in signals},
        to_si={name: c for name, c in conversions.items() if name in columns},
    )


def scene_so_far(system: System, feed: Feed) -> Scene | None:
    """Return the scene of the run as far as it is known; None where it has none.

    A view that does not cope with so few rows has none either, which the logger says.
    """
    result = result_so_far(system, feed)
    try:
        scene: Scene | None = result.view.scene(result)
    except (ValueError, LookupError, ArithmeticError) as error:
        LOGGER.warning("the page has no scene: %s: %s", type(error).__name__, error)
        return None
    return scene


def links_so_far(feed: Feed) -> Mapping[str, Mapping[str, Any]]:
    """Return the figures of each proxy so far, as recording.proxies has them, with those of now.

    These are `state`, and `round_trip_time` in s of the last step.
    """
    names = [s.name for s in feed.signals if ".proxy." in s.name]
    if not names:
        return {}
    time, columns = feed.columns()
    of_link = {s.name: typed(s, columns[s.name]) for s in feed.signals if s.name in names}
    figures = proxy_figures(time, of_link)
    for component, entries in figures.items():
        for name in ("state", "round_trip_time"):
            entries[f"{name}_now"] = float(of_link[f"{component}.proxy.{name}"][-1])
        del entries["round_trip_median"]  # of extremes it would be none
    finite: dict[str, Mapping[str, Any]] = {
        component: {
            name: value
            for name, value in entries.items()
            if not isinstance(value, float) or np.isfinite(value)
        }
        for component, entries in figures.items()
    }
    return finite
