"""run.json: what stands in it, and the checks of one that is read.

It has a run's settings (system/settings.py), its figures, as "measured" its metrics, and what is
known of its signals. Every entry is checked before anything is made of it, down to the last one.
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from ..base.checks import is_number, is_value, known
from ..base.errors import InputError
from ..realtime.timing import SPREAD_KEYS
from ..system.parts import Acceptance
from ..system.times import LONGEST, NANOSECONDS

Check = Callable[[str, Any], None]
"""Takes a place and the value there; raises InputError where it is not as it must be."""


def refused(place: str, value: Any, must: str) -> InputError:
    """The error for an entry."""
    return InputError(f"{place} = {_short(value)}; must be {must}")


SHOWN = 60
"""Characters of a value that a message shows."""


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}..."


def _a(must: str, fits: Callable[[Any], bool]) -> Check:
    def check(place: str, value: Any) -> None:
        if not fits(value):
            raise refused(place, value, must)

    return check


def _or_null(must: str, fits: Callable[[Any], bool]) -> Check:
    return _a(f"{must} or null", lambda value: value is None or fits(value))


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _is_finite(value: Any) -> bool:
    return is_number(value) and abs(value) <= LARGEST


LARGEST = 1.7976931348623157e308
"""The largest number that is finite as a float64; JSON has larger integers, and Infinity."""


def _is_count(value: Any) -> bool:
    return is_number(value) and isinstance(value, int) and 0 <= value < 2**63


def _is_time(value: Any) -> bool:
    return _is_finite(value) and abs(value) <= LONGEST


def _is_step(value: Any) -> bool:
    return _is_time(value) and value * NANOSECONDS >= 1.0


def _is_logging(value: Any) -> bool:
    categories = value if isinstance(value, list) else []
    return isinstance(value, bool) or (bool(categories) and all(map(_is_text, categories)))


def _is_metric(value: Any) -> bool:
    values = value if isinstance(value, list) else [value]
    return all(v is None or isinstance(v, bool) or _is_finite(v) for v in values)


def _each(check: Check) -> Check:
    """A list of such values."""

    def check_list(place: str, value: Any) -> None:
        if not isinstance(value, list):
            raise refused(place, value, "a list")
        for number, entry in enumerate(value):
            check(f"{place}[{number}]", entry)

    return check_list


def _named(check: Check) -> Check:
    """An object of such values by names."""

    def check_object(place: str, value: Any) -> None:
        if not isinstance(value, dict):
            raise refused(place, value, "a JSON object")
        for name, entry in value.items():
            check(f"{place}: {name}", entry)

    return check_object


def _object(needed: Mapping[str, Check], others: Mapping[str, Check] | None = None) -> Check:
    """An object with these entries, of which the others may be missing."""
    all_checks = {**needed, **(others or {})}

    def check_object(place: str, value: Any) -> None:
        if not isinstance(value, dict):
            raise refused(place, value, "a JSON object")
        for name in needed:
            if name not in value:
                raise InputError(f"{place}: no entry {name!r}; must have one")
        for name, entry in value.items():
            if name in all_checks:
                all_checks[name](f"{place}: {name}", entry)

    return check_object


TEXT, TEXT_OR_NULL = _a("a string", _is_text), _or_null("a string", _is_text)
NUMBER, NUMBER_OR_NULL = _a("a number", _is_finite), _or_null("a number", _is_finite)
COUNT = _a("a whole number, at least 0", _is_count)
TIME = _a(f"a number from -{LONGEST:g} to {LONGEST:g}", _is_time)
STEP = _a("a number greater than 0, at least 1e-09", _is_step)
BOOLEAN = _a("true or false", lambda value: isinstance(value, bool))
VALUE = _a("a number, boolean or string, or a list of such", is_value)
ANYTHING: Check = _a("anything", lambda _: True)
METRIC = _a("a number, a boolean or null, or a list of such", _is_metric)

COMPONENT = _object(
    {
        "fmu": TEXT,
        "values": _named(VALUE),
        "step": NUMBER_OR_NULL,
        "isolation": TEXT,
        "rename": _named(TEXT),
    },
    {
        "units": _named(TEXT),
        "solver": _object({"relative_tolerance": NUMBER}),
        "tolerance": NUMBER,
        "logging": _a("true or a list of strings", _is_logging),
    },
)
CONNECTION = _object({"from": TEXT, "to": TEXT, "factor": NUMBER_OR_NULL, "offset": NUMBER_OR_NULL})
EVENT = _object({"set": _named(VALUE)}, {"at": NUMBER, "when": TEXT})
FAULT = _object(
    {"connection": TEXT, "kind": TEXT},
    {"from": NUMBER, "until": NUMBER, "when": TEXT, "seed": NUMBER},
)

SPREAD = _object(dict.fromkeys(SPREAD_KEYS, TIME))
OVERRUN = _object({"step": COUNT, "time": TIME, "late": TIME, "culprit": TEXT, "took": TIME})
TIMING = _object(
    {
        "factor": NUMBER,
        "period": TIME,
        "overrun": TEXT,
        "granted": _each(TEXT),
        "refused": _each(TEXT),
        "steps": COUNT,
        "real_time_factor": NUMBER,
        "overruns": _object({"count": COUNT, "culprits": _named(COUNT), "listed": _each(OVERRUN)}),
        "parts": _named(SPREAD),
        "histograms": _named(_object({"edges": _each(TIME), "counts": _each(COUNT)})),
    }
)

MADE: Mapping[str, Check] = {
    "system": TEXT,
    "scheme": TEXT,
    "step": STEP,
    "stop": TIME,
    "initialisation": _named(VALUE),
    "components": _named(COMPONENT),
    "connections": _each(CONNECTION),
    "events": _each(EVENT),
    "faults": _each(FAULT),
}
MADE_BESIDE: Mapping[str, Check] = {
    "roles": _named(TEXT),
    "input": _named(TEXT),
    "changed": _named(VALUE),
    "metrics": _each(TEXT),
    "diverging": TEXT,
    "start": TIME,
    "record": _each(TEXT),
    "realtime": _named(_or_null("a number, boolean or string", is_value)),
    "limits": _each(_object({"when": TEXT, "then": TEXT})),
    "acceptance": _object({}, {f.name: NUMBER for f in fields(Acceptance)}),
}
"""Entries that say how the run was made; the latter may be missing."""

ORIGIN: Mapping[str, Check] = {
    "title": TEXT,
    "date": TEXT,
    "versions": _named(TEXT),
    "fmus": _named(
        _object(
            {}, {"guid": TEXT, "tool": TEXT_OR_NULL, "native_twin_of": TEXT, "sha256": TEXT_OR_NULL}
        )
    ),
    "command": _each(TEXT),
}
"""Those that say when it was made, and with what; they may be missing."""

OF_THE_RUN: Mapping[str, Check] = {
    "complete": BOOLEAN,
    "wall_time": NUMBER_OR_NULL,
    "steps": COUNT,
    "rows": COUNT,
    "measured": _named(METRIC),
    "log": _each(TEXT),
    "rejections": _named(_object({"count": COUNT, "first": NUMBER})),
    "units": _named(TEXT_OR_NULL),
}
"""What came out."""

BESIDE: Mapping[str, Check] = {
    "metric_units": _named(TEXT_OR_NULL),
    "missing_metrics": _each(TEXT),
    "types": _named(TEXT),
    "descriptions": _named(TEXT),
    "to_si": _named(_object({"factor": NUMBER, "offset": NUMBER})),
    "proxies": _named(_named(ANYTHING)),
    "ended_at": NUMBER,
    "timing": TIMING,
    "exceeded": _each(
        _object({"limit": TEXT, "then": TEXT, "first": NUMBER, "value": NUMBER, "steps": COUNT})
    ),
    "initialised_anew": _each(NUMBER),
    "peers": _named(_named(TEXT)),
    "verdict": _each(_named(ANYTHING)),
}
"""What is known of that besides; these may be missing."""

CHECKS = {**MADE, **MADE_BESIDE, **ORIGIN, **OF_THE_RUN, **BESIDE}
NEEDED = (*MADE, *OF_THE_RUN)


def read_run_json(path: Path) -> dict[str, Any]:
    """The object in a run.json; InputError at the first entry that is not as it must be."""
    try:
        written = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise unreadable(path, error) from error
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: is damaged, not JSON in UTF-8: {error}") from error
    if not isinstance(written, dict):
        raise InputError(f"{path}: is {type(written).__name__}; must be a JSON object")
    for key in NEEDED:
        if key not in written:
            raise InputError(
                f"{path}: no entry {key!r}; must have one, as `grasp-cosim run --out` writes it"
            )
    for key, check in CHECKS.items():
        if key in written:
            check(f"{path}: {key}", written[key])
    for number, connection in enumerate(written["connections"]):
        for end in ("from", "to"):
            name = connection[end].partition(".")[0]
            place = f"{path}: connections[{number}]: {end} = {connection[end]!r}: no component"
            known(place, name, written["components"])
    return written


def unreadable(path: Path, error: OSError) -> InputError:
    """The error for a file of a run that cannot be read."""
    return InputError(
        f"{path}: {error.strerror}; must be a folder that `grasp-cosim run --out` wrote"
    )
