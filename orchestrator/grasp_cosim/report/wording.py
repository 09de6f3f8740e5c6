"""What pages and pictures say of a result in words: captions, values, changes."""

from __future__ import annotations

from collections.abc import Mapping
from importlib.metadata import version
from pathlib import PurePath
from typing import Any, NamedTuple

from ..base.text import fixed, significant
from ..recording.folder import now
from ..recording.result import Result

MAX_CHANGES = 6
"""So many values that differ from the defaults are named, of more their number."""

DEFAULTS = "as in the system file"
"""In place of changes, where there are none."""


class Caption(NamedTuple):
    """The title of a picture; below it what differs from the defaults, the date, the version."""

    title: str
    about: str


def caption(result: Result, title: str = "") -> Caption:
    """Return the caption of a result.

    Its title is the one given here, or the one given to its run, or else made of what it is. Of a
    run that was just done the date is that of today.
    """
    origin, settings = result.origin, result.settings
    title = title or str(origin.get("title", ""))
    if not title:
        system = PurePath(str(settings["system"])).stem
        title = ", ".join([system, *result.view.words(result)])
    if result.folder:
        date = str(origin.get("date", ""))
        version_of_run = origin.get("versions", {}).get("grasp-cosim", "")
    else:
        date = str(origin.get("date", now().date().isoformat()))
        version_of_run = origin.get("versions", {}).get("grasp-cosim")
    day = date[:10]
    return Caption(title, about(settings.get("changed"), day, version_of_run))


def about(
    changed: Mapping[str, Any] | None, date: str | None = None, own_version: str | None = None
) -> str:
    """Return a line of what was changed of a system, the date and the version of grasp-cosim.

    Args:
        changed: As system.settings has it; None leaves it out, as it is not known.
        date: None is today; "" leaves it out.
        own_version: None is that of this grasp-cosim; "" leaves it out.
    """
    if date is None:
        date = now().date().isoformat()
    if own_version is None:
        own_version = version("grasp-cosim")
    parts = [
        "" if changed is None else changes(changed),
        date,
        f"grasp-cosim {own_version}" if own_version else "",
    ]
    return " · ".join(part for part in parts if part)


TIMES = dict.fromkeys(("start", "step", "stop"), "s")
"""The units of times among the changes of a system."""


def changes(changed: Mapping[str, Any], units: Mapping[str, str] = {}) -> str:
    """Return the changes of a system, each as name = value unit; see system.settings."""
    if not changed:
        return DEFAULTS
    units = {**TIMES, **units}
    texts = [
        f"{name} = {_changed_value(value)} {units.get(name, '')}".rstrip()
        for name, value in changed.items()
    ]
    if len(texts) > MAX_CHANGES:
        texts = [*texts[:MAX_CHANGES], f"{len(texts) - MAX_CHANGES} more"]
    return ", ".join(texts)


def _changed_value(value: Any) -> str:
    return str(value).lower() if isinstance(value, bool) else number(value)


def scaled(value: Any, factor: float) -> str:
    """A value of a metric in its shown unit, for the eye."""
    if isinstance(value, list):
        return ", ".join(scaled(item, factor) for item in value)
    if isinstance(value, float):
        return fixed(factor * value, 4, most=1e4, digits=6)
    return number(value)


def entries(values: Mapping[str, Any]) -> str:
    """Like a = 1, b = 2; a mapping within in brackets."""
    texts = []
    for key, value in values.items():
        text = f"({number(value)})" if isinstance(value, Mapping) else number(value)
        texts.append(f"{key} = {text}")
    return ", ".join(texts)


def number(value: Any, digits: int = 6) -> str:
    """A value for the eye: floats with so many figures, True and False in words, entries()."""
    if isinstance(value, Mapping):
        return entries(value)
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return significant(value, digits)
    if value is None:
        return "none"
    return str(value)
