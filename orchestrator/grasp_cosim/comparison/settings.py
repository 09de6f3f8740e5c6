"""The settings, FMUs and versions of two runs, and where they differ."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from ..recording.result import Result

AS_IT_STARTS = "as the FMU starts"
"""In place of a value that was not given."""

NONE = "none"
"""In place of what one run has not."""


class Difference(NamedTuple):
    """A setting that differs between two runs, and its value in each of them, in words."""

    what: str
    a: str
    b: str


def differences(a: Result, b: Result) -> tuple[Difference, ...]:
    """Where the settings of two runs, the FMUs and the versions differ."""
    first, second = dict(_facts(a)), dict(_facts(b))
    values = {name for run in (a, b) for name, _ in _values(run)}
    found = []
    for what in dict.fromkeys((*first, *second)):
        lacking = AS_IT_STARTS if what in values else NONE
        pair = first.get(what, lacking), second.get(what, lacking)
        if pair[0] != pair[1]:
            found.append(Difference(what, *pair))
    return tuple(found)


def _facts(run: Result) -> Iterator[tuple[str, str]]:
    """The settings, FMUs and versions of a run by name, each in words; equal for equal runs."""
    settings, fmus = run.settings, run.origin.get("fmus", {})
    yield from run.view.traits(run).items()
    for key in ("system", "scheme", "step", "stop"):
        yield key, _words(settings[key]) + (" s" if key in ("step", "stop") else "")
    yield from _nested("initialisation", settings["initialisation"])
    yield "order of the components", ", ".join(settings["components"])
    for name, component in settings["components"].items():
        ran = fmus.get(name, {})
        twin = ", native" if "native_twin_of" in ran else ""
        guid = f" {ran['guid']}" if "guid" in ran else ""
        yield f"FMU of {name}", f"{component['fmu']}{guid}{twin}"
        for key in ("step", "isolation", "solver", "rename", "units"):
            yield from _nested(f"{key} of {name}", component.get(key))
    yield from _values(run)
    yield from _nested("role", settings.get("roles", {}))
    for connection in settings["connections"]:
        factor, offset = connection["factor"], connection["offset"]
        scaled = "" if factor is None else f" x {_words(factor)}"
        shifted = f" + {_words(offset)}" if offset else ""
        yield f"source of {connection['to']}", f"{connection['from']}{scaled}{shifted}"
    for kind in ("events", "faults"):
        yield kind, "; ".join(map(_words, settings[kind])) or NONE
    yield from _nested("input", settings.get("input", {}))
    yield from _nested("version of", run.origin.get("versions", {}))


def _values(run: Result) -> Iterator[tuple[str, str]]:
    for name, component in run.settings["components"].items():
        for variable, value in component["values"].items():
            yield f"{name}.{variable}", _words(value)


def _nested(what: str, entry: Any) -> Iterator[tuple[str, str]]:
    """The entries of a mapping, each by its name; else the entry itself, if there is one."""
    if isinstance(entry, Mapping):
        for key, value in entry.items():
            yield f"{what} {key}", _words(value)
    elif entry is not None:
        yield what, _words(entry)


def _words(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_words(v)}" for key, v in value.items())
    if isinstance(value, list | tuple):
        return ", ".join(map(_words, value))
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)
