"""What every picture and page says of itself: its title, and where it comes from."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import PurePath
from typing import Any, NamedTuple

from ..recording.folder import now
from ..recording.result import Result
from .tables import number

MOST_CHANGED = 6
"""So many values that differ from the defaults are named, of more their number."""


DEFAULTS = "as in the system file"
"""In place of changes, where there are none."""


class Caption(NamedTuple):
    """The title of a picture; below it what differs from the defaults, the date, the version."""

    title: str
    about: str


def caption(result: Result, title: str = "") -> Caption:
    """Return the caption of a result: a title as given here or to its run, else one made of what
    it is; of a run that was just done the date is that of today.
    """
    origin, settings = result.origin, result.settings
    words = result.view.words(result)
    made = ", ".join([PurePath(str(settings["system"])).stem, *words])
    date = str(origin.get("date", "" if result.folder else now().date().isoformat()))[:10]
    own = origin.get("versions", {}).get("grasp-cosim", "" if result.folder else None)
    chosen = title or str(origin.get("title", "")) or made
    return Caption(chosen, about(settings.get("changed"), date, own))


def about(
    changed: Mapping[str, Any] | None, date: str | None = None, own_version: str | None = None
) -> str:
    """Return a line of what was changed of a system (see system.settings; None: that is not known),
    the date and the version of grasp-cosim.

    By default those of now; an empty text is left out.
    """
    date = now().date().isoformat() if date is None else date
    own_version = version("grasp-cosim") if own_version is None else own_version
    what = None if changed is None else changes(changed)
    return " · ".join(filter(None, [what, date, own_version and f"grasp-cosim {own_version}"]))


def changes(changed: Mapping[str, Any]) -> str:
    """Return what was changed of a system, each as name = value; see system.settings."""
    named = [f"{name} = {_text(value)}" for name, value in changed.items()]
    more = [f"{len(named) - MOST_CHANGED} more"] if len(named) > MOST_CHANGED else []
    return ", ".join([*named[:MOST_CHANGED], *more]) or DEFAULTS


def _text(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else number(value)
