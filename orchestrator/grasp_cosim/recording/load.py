"""Reads back the folder that a run left behind, signals.csv or signals.arrow and run.json; logs."""

import json
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
from si_units import known_unit

from ..base.checks import choice, is_number
from ..base.errors import InputError, choices
from ..base.files import check_nature
from ..interface.units import Conversion
from ..metrics.metric import Measured, Metric, Signals, metrics_of
from ..realtime.timing import Timing
from .arrow import read_arrow
from .csv import read_csv, unreadable
from .mdf import read_mdf
from .result import UNITS, Known, Rejection, Result

SIGNALS, ARROW, SETTINGS = "signals.csv", "signals.arrow", "run.json"
"""The files of a run's folder, of which it has one of the former two."""

NUMBER = (int, float)
MAYBE = (int, float, type(None))

SETTINGS_THERE: Mapping[str, Any] = {
    "system": str, "scheme": str, "step": NUMBER, "stop": NUMBER, "initialisation": dict,
    "components": dict, "connections": list, "events": list, "faults": list,
}  # fmt: skip
SETTINGS_MAYBE: Mapping[str, Any] = {
    "roles": dict, "input": dict, "changed": dict, "metrics": list, "diverging": str,
    "start": NUMBER,
}  # fmt: skip
"""Entries of run.json that say how the run was made, and of which types they are."""

ORIGIN: Mapping[str, Any] = {
    "title": str, "date": str, "versions": dict, "fmus": dict, "command": list,
}  # fmt: skip
"""Entries that say when it was made, and with what; they may be there."""

REQUIRED: Mapping[str, Any] = {
    **SETTINGS_THERE, "wall_time": MAYBE, "complete": bool, "log": list, "rejections": dict,
    "units": dict,
}  # fmt: skip
ENTRIES: Mapping[str, Any] = {
    **REQUIRED, **SETTINGS_MAYBE, **ORIGIN, "types": dict, "descriptions": dict,
    "metric_units": dict, "to_si": dict,
}  # fmt: skip
"""All entries besides metrics."""

FORMS = {
    str: "a string", NUMBER: "a number", MAYBE: "a number or null", bool: "true or false",
    list: "a list", dict: "a JSON object",
}  # fmt: skip
"""Types of entries in words."""

TEXT = "str"
TYPES = ("float64", "int32", "int64", "bool", TEXT)
"""The element types of recorded columns, the last that of Strings."""


def run_folder(path: Path) -> Path:
    """The folder of a run, which one of its files names as well; InputError where it is none."""
    if path.name in (SIGNALS, ARROW, SETTINGS) and path.is_file():
        return path.parent
    check_nature(path, "run")
    return path


def load_run(folder: str | Path) -> Result:
    """The result in a folder that `run --out` wrote, or is writing: then as far as it got.

    One of its files stands for it.

    Metrics are worked out anew from the signals; those of a user's file, and of a run that recorded
    only some of its steps, are as they were recorded.
    InputError where a file is missing or damaged, or the two files are not of the same run.
    """
    folder = run_folder(Path(folder))
    path, arrow, signals = folder / SETTINGS, folder / ARROW, folder / SIGNALS
    written = _settings(path)
    units, types, realtime = written["units"], written.get("types", {}), written.get("realtime")
    if arrow.exists():
        time, columns = read_arrow(arrow)
    elif not units and not signals.exists():
        raise InputError(f"{path}: this run recorded no signal; must have recorded one")
    else:
        unfinished = not written["complete"] and written["wall_time"] is None
        texts = {name for name, kind in types.items() if kind == TEXT}
        time, columns = read_csv(signals, texts, unfinished)
    if list(units) != list(columns):
        raise InputError(
            f"{path}: units are those of {choices(units)}; "
            f"must be those of the recorded columns: {choices(columns)}"
        )
    read = Result(
        settings={k: written[k] for k in (*SETTINGS_THERE, *SETTINGS_MAYBE) if k in written},
        time=time,
        signals={
            name: _typed(f"{path}: type of {name}", column, types.get(name, "float64"))
            for name, column in columns.items()
        },
        units=units,
        wall_time=written["wall_time"],
        complete=written["complete"],
        descriptions=written.get("descriptions", {}),
        rejections=_rejections(f"{path}: rejections", written["rejections"]),
        log=tuple(written["log"]),
        timing=None if realtime is None else Timing.from_dict(f"{path}: realtime", realtime),
        more_metrics=_as_recorded(written),
        origin={key: written[key] for key in ORIGIN if key in written},
        to_si=_to_si(f"{path}: to_si", written),
        folder=folder,
    )
    return _with_known(read, written) if read.every > 1 else read


def _with_known(read: Result, written: Mapping[str, Any]) -> Result:
    """A result of thinned rows with the metrics that run.json has, which are of every step."""
    asked = metrics_of(read.groups, read.more_metrics)
    there = tuple(m for m in asked if m.name in written)
    if not asked:
        return read
    if not there:  # it did not come to its end
        line = f"one row in {read.every} was recorded: the metrics are of these"
        return replace(read, log=(*read.log, line))
    values = {m.name: written[m.name] for m in there}
    measured = Measured(values, there, tuple(written.get("missing_metrics", ())))
    return replace(read, known=Known(measured, written.get("proxies", {})))


def _as_recorded(written: Mapping[str, Any]) -> tuple[Metric, ...]:
    """The metrics in run.json that nothing here would work out again, as they are there."""
    known = {*UNITS, *(m.name for m in metrics_of(written.get("metrics", ())))}
    return tuple(
        Metric(name, partial(_constant, written[name]), unit)
        for name, unit in written.get("metric_units", {}).items()
        if name not in known and name in written
    )


def _constant(value: Any, _: Signals) -> Any:
    return value


def _rejections(place: str, found: Mapping[str, Any]) -> dict[str, Rejection]:
    try:
        return {name: Rejection(int(r["count"]), float(r["first"])) for name, r in found.items()}
    except (KeyError, TypeError, ValueError) as error:
        said = f"{type(error).__name__}: {error}"
        raise InputError(f"{place}: is damaged ({said}); must have count and first each") from error


def _to_si(place: str, written: Mapping[str, Any]) -> dict[str, Conversion]:
    """The conversions to SI of signals in other units."""
    found: dict[str, Conversion] = {}
    for name, entry in written.get("to_si", {}).items():
        numbers = isinstance(entry, dict) and [entry.get(key) for key in Conversion._fields]
        if not (numbers and all(map(is_number, numbers))):
            raise InputError(f"{place}: {name} = {entry!r}; must be factor and offset")
        found[name] = Conversion(float(entry["factor"]), float(entry["offset"]))
    return found


def _typed(place: str, column: npt.NDArray[Any], name: Any) -> npt.NDArray[Any]:
    """The column with the element type of that name; InputError where its values have another."""
    if choice(place, name, TYPES) == TEXT or column.dtype == name:
        return column
    with np.errstate(invalid="ignore"):
        typed = column.astype(name)
    if not np.array_equal(typed, column, equal_nan=name == "float64"):
        value = column[np.flatnonzero(typed != column)[0]]
        raise InputError(f"{place} = {name}: must be a type of its values, like {value:g}")
    return typed


def _settings(path: Path) -> dict[str, Any]:
    """The object in run.json, whose entries have their types."""
    try:
        settings = json.loads(path.read_text("utf-8"))
    except OSError as error:
        raise unreadable(path, error) from error
    except ValueError as error:
        raise InputError(f"{path}: is damaged, not JSON in UTF-8: {error}") from error
    if not isinstance(settings, dict):
        raise InputError(f"{path}: is {type(settings).__name__}; must be a JSON object")
    for key, kind in ENTRIES.items():
        there, value = key in settings, settings.get(key)
        wrong = not isinstance(value, kind) or (isinstance(value, bool) and kind is not bool)
        if (there and wrong) or (key in REQUIRED and not there):
            said = f"{key} = {value!r}" if there else f"no entry {key!r}"
            must = f"{FORMS[kind]}, as `grasp-cosim run --out` writes it"
            raise InputError(f"{path}: {said}; must be {must}")
    return settings


def load_log(path: Path, note: Callable[[str], None] | None = None) -> Signals:
    """The numbers in a file, all float64: CSV with the column "time" and names, or ASAM MDF (.mf4).

    They come in SI units where the run.json of the run beside it tells of others, or the channels
    of an MDF do; else they are taken to be in SI, which `note` is told of a CSV. InputError where
    it is missing, damaged or of another kind, or where asammdf is not installed.
    """
    kind = path.suffix.lower()
    if not path.is_file():
        raise InputError(f"{path}: no such log; must be a .csv or .mf4 file")
    if kind not in (".mf4", ".csv"):
        raise InputError(f"{path}: must be a .csv or .mf4 file")
    to_si: Mapping[str, Conversion] = {}
    if kind == ".mf4":
        time, columns, units = read_mdf(path)
        known = {name: known_unit(unit) for name, unit in units.items()}
        to_si = {n: Conversion(u.factor, u.offset) for n, u in known.items() if u and not u.si}
    else:
        time, columns = read_csv(path)
    beside = path.with_name(SETTINGS)
    if path.stem == Path(SIGNALS).stem and beside.is_file():
        to_si = _to_si(f"{beside}: to_si", _settings(beside))
    elif note and kind == ".csv":
        note(f"{path}: there is no {SETTINGS} beside it; its values are taken to be in SI units")
    numbers = {name: column for name, column in columns.items() if column.dtype != object}
    return Signals(time, numbers, to_si=to_si)
