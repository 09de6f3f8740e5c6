"""Reads back the folder that a run left behind: signals.csv and run.json."""

import csv
import json
import logging
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError, choices
from ..realtime.timing import Timing
from .mdf import check_mdf

SIGNALS, SETTINGS = "signals.csv", "run.json"
"""The files of a run's folder."""


@dataclass(frozen=True, eq=False)
class Run:
    """A recorded run: its signals by name, like plant.gap[1], on time in s.

    settings is the whole of run.json, see Result.to_json. A column that its types do not name is
    float64.
    """

    time: npt.NDArray[np.float64]
    signals: Mapping[str, npt.NDArray[Any]]
    units: Mapping[str, str | None]
    descriptions: Mapping[str, str]
    settings: Mapping[str, Any]
    timing: Timing | None = None
    """How it kept to the clock; None where it was not paced."""


def load_run(folder: str | Path) -> Run:
    """The run in a folder that `run --out` wrote.

    InputError where a file is missing or damaged, or the two files are not of the same run.
    """
    folder = Path(folder)
    settings = _settings(folder / SETTINGS)
    names, table = _table(folder / SIGNALS)
    units, types = settings["units"], settings.get("types", {})
    path = folder / SETTINGS
    if list(units) != names:
        raise InputError(
            f"{path}: units are those of {choices(units)}; "
            f"must be those of the columns of {SIGNALS}: {choices(names)}"
        )
    return Run(
        time=table[:, 0],
        signals={
            name: _typed(f"{path}: type of {name}", column, types.get(name, "float64"))
            for name, column in zip(names, table[:, 1:].T, strict=True)
        },
        units=units,
        descriptions=settings.get("descriptions", {}),
        settings=settings,
        timing=(
            Timing.from_dict(f"{path}: realtime", settings["realtime"])
            if "realtime" in settings
            else None
        ),
    )


@dataclass(frozen=True, eq=False)
class Log:
    """Recorded signals by name on time in s, all float64, without what a run's folder adds."""

    time: npt.NDArray[np.float64]
    signals: Mapping[str, npt.NDArray[np.float64]]


def load_log(path: Path) -> Log:
    """The signals of a file: CSV with the column "time" and names, or ASAM MDF (.mf4).

    InputError where it is missing, damaged or of another kind, or where asammdf is not installed.
    """
    if not path.is_file():
        raise InputError(f"{path}: no such log; must be a .csv or .mf4 file")
    if path.suffix.lower() == ".mf4":
        return _mdf(path)
    if path.suffix.lower() != ".csv":
        raise InputError(f"{path}: must be a .csv or .mf4 file")
    names, table = _table(path)
    return Log(table[:, 0], dict(zip(names, table[:, 1:].T, strict=True)))


def _mdf(path: Path) -> Log:
    """Every channel of the first group that has samples, on its master."""
    check_mdf()
    from asammdf import MDF

    logging.getLogger("asammdf").setLevel(logging.CRITICAL)  # what is wrong is ours to say
    try:
        with MDF(path) as mdf:
            channels = [c for c in mdf.iter_channels() if len(c.samples)]
    except Exception as error:  # of a damaged file it raises whatever it stumbles over
        said = " ".join(f"{type(error).__name__}: {error}".split())
        raise InputError(f"{path}: is damaged, no MDF file: {said}") from error
    if not channels:
        raise InputError(f"{path}: no channel has samples; must be a recorded log")
    time = channels[0].timestamps
    return Log(
        time,
        {
            c.name: c.samples.astype(np.float64)
            for c in channels
            if c.samples.shape == time.shape and c.samples.dtype.kind in "fiub"
        },
    )


def _settings(path: Path) -> dict[str, Any]:
    """The object in run.json; its mappings by signal are mappings."""
    try:
        settings = json.loads(_text(path))
    except json.JSONDecodeError as error:
        raise InputError(f"{path}: is damaged, no JSON: {error}") from error
    if not isinstance(settings, dict):
        raise InputError(f"{path}: is {type(settings).__name__}; must be a JSON object")
    if "units" not in settings:
        raise InputError(f"{path}: no units; must be what `grasp-cosim run --out` wrote")
    for key in {"units", "types", "descriptions"} & settings.keys():
        if not isinstance(settings[key], dict):
            raise InputError(f"{path}: {key} = {settings[key]!r}; must be a JSON object")
    return settings


def _text(path: Path) -> str:
    try:
        return path.read_text("utf-8")
    except UnicodeDecodeError as error:
        raise InputError(f"{path}: is damaged, no UTF-8 text: {error.reason}") from error
    except OSError as error:
        raise _unreadable(path, error) from error


def _unreadable(path: Path, error: OSError) -> InputError:
    return InputError(
        f"{path}: {error.strerror}; must be a folder that `grasp-cosim run --out` wrote"
    )


def _table(path: Path) -> tuple[list[str], npt.NDArray[np.float64]]:
    """The names of the signals and the values: a row per point, time in the first column."""
    names = _header(path)
    try:
        table = np.loadtxt(
            path, delimiter=",", skiprows=1, comments=None, ndmin=2, encoding="utf-8"
        )
    except ValueError as error:  # also where it is no UTF-8
        raise InputError(f"{path}: is damaged: {str(error).splitlines()[0]}") from error
    if table.shape[1] != len(names) + 1:
        raise InputError(
            f"{path}: is damaged: {table.shape[1]} values in a row, {len(names) + 1} names"
        )
    if not (np.diff(table[:, 0], prepend=-np.inf) > 0.0).all():
        raise InputError(f"{path}: is damaged: the time must grow from row to row")
    return names, table


def _header(path: Path) -> list[str]:
    """The names of the columns after time; InputError where no whole row follows them."""
    try:
        with path.open("rb") as file:
            first = file.readline()
            file.seek(max(len(first), file.seek(0, os.SEEK_END) - 1))
            end = file.read()
    except OSError as error:
        raise _unreadable(path, error) from error
    try:
        time, *names = next(csv.reader([first.decode("utf-8")], strict=True), []) or ["nothing"]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: is damaged: the first line names no columns") from error
    if time != "time":
        raise InputError(f'{path}: the first column is {time!r}; must be "time"')
    if len(set(names)) != len(names):
        raise InputError(f"{path}: is damaged: two columns have the same name")
    if end != b"\n":
        raise InputError(f"{path}: is damaged: the last row is cut off, or there is none")
    return names


def _typed(place: str, column: npt.NDArray[np.float64], name: Any) -> npt.NDArray[Any]:
    """The column with the element type of that name; InputError where its values have another."""
    if name not in list(TYPES):
        raise InputError(f"{place} = {name!r}: must be one of {choices(TYPES)}")
    with np.errstate(invalid="ignore"):
        typed = column.astype(TYPES[name])
    if not np.array_equal(typed, column, equal_nan=name == "float64"):
        value = column[np.flatnonzero(typed != column)[0]]
        raise InputError(f"{place} = {name}: must be a type of its values, like {value:g}")
    return typed


TYPES: Mapping[str, type[np.generic]] = {
    "float64": np.float64,
    "int32": np.int32,
    "int64": np.int64,
    "bool": np.bool_,
}
"""The element types of recorded columns, by their names in run.json."""
