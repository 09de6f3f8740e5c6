"""A run read back from its folder, and the log of any tool."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..base.checks import choice
from ..base.errors import InputError, choices
from ..base.files import check_nature
from ..base.si_units import known_unit
from ..base.text import counted
from ..exchange.listener import Window
from ..interface.units import Conversion
from ..metrics.groups import metrics_of
from ..metrics.metric import Measured, Metric, Signals, resolved
from ..realtime.timing import Timing
from .folder import ARROW, SETTINGS, SIGNALS, window_folders
from .log_names import AS_THEY_ARE, LogNames
from .recorded_run import OfEveryStep, Rejection, Trip
from .result import Result
from .run_json import MADE, MADE_BESIDE, ORIGIN, RunJson, read_run_json, unreadable

if TYPE_CHECKING:
    from .signals import Log

NOTHING: Mapping[str, str] = {}

TEXT = "str"
TYPES = ("float64", "int32", "int64", "bool", TEXT)
"""The element types of recorded columns, the last that of Strings."""

_ELEMENTS = {name: np.dtype(object if name == TEXT else name) for name in TYPES}


def run_folder(path: Path) -> Path:
    """The folder of a run, which one of its files names too; InputError where it is none."""
    if path.name in (SIGNALS, ARROW, SETTINGS) and path.is_file():
        return path.parent
    check_nature(path, "run")
    return path


def load_run(folder: str | Path) -> Result:
    """Read the result in a folder that `run --out` wrote, or is writing: then as far as it got.

    Metrics are worked out again from the signals; those of a user's file, and of a run that
    recorded only some of its steps or its signals, are as they were recorded. A triggered run has
    its windows as further results.

    Args:
        folder: The folder, or one of its files.

    Returns:
        The result.

    Raises:
        InputError: A file is missing or damaged, or the two files are not of the same run.

    Example:
        >>> from grasp_cosim import grasp_system, load_run, simulate
        >>> simulate(grasp_system(), step=1e-3, stop=0.1).save("results")
        >>> float(load_run("results").time[-1])
        0.1
    """
    folder = run_folder(Path(folder))
    path, arrow, signals = folder / SETTINGS, folder / ARROW, folder / SIGNALS
    report = read_run_json(path)
    units, types = report["units"], report.get("types", {})
    if "windows" in report:
        return _triggered(report, folder)
    if not units and not arrow.exists() and not signals.exists():
        raise InputError(f"{path}: this run recorded no signal; must have recorded one")
    rows = arrow if arrow.exists() else signals
    try:
        rows.stat()
    except OSError as error:
        raise unreadable(rows, error) from error
    from .signals import read_signals  # only here, as below: a run that writes does not read

    time, columns = read_signals(rows, [name for name, kind in types.items() if kind == TEXT])
    if list(units) != list(columns):
        raise InputError(
            f"{path}: units are those of {choices(units)}; "
            f"must be those of the recorded columns: {choices(columns)}"
        )
    typed = {
        name: _typed(f"{path}: type of {name}", column, types.get(name, "float64"))
        for name, column in columns.items()
    }
    read = _result_of(report, folder, time, typed)
    _check_rows(rows, read, report)
    in_part = read.every > 1 or "record" in report
    return _with_figures_of_every_step(read, report) if in_part else read


def _triggered(report: RunJson, folder: Path) -> Result:
    """The result of a triggered run, with the rows of its windows."""
    windows = [load_run(path) for path in window_folders(folder)]
    listed = report.get("windows", [])
    if len(windows) < len(listed):
        raise InputError(
            f"{folder}: is damaged: has {counted(len(windows), 'window')}; must have "
            f"{len(listed)}, as {SETTINGS} says"
        )
    types = report.get("types", {})
    empty = {name: np.empty(0, _ELEMENTS[types.get(name, "float64")]) for name in report["units"]}
    signals = {
        name: np.concatenate([column, *(window[name] for window in windows)])
        for name, column in empty.items()
    }
    time = np.concatenate([np.empty(0), *(window.time for window in windows)])
    read = replace(
        _result_of(report, folder, time, signals),
        windows=tuple(windows),
        steps_done=report["steps"],
    )
    return _with_figures_of_every_step(read, report)


def _result_of(
    report: RunJson, folder: Path, time: npt.NDArray[np.float64], signals: Mapping[str, Any]
) -> Result:
    """The result that a run.json describes, with the rows that were recorded."""
    entries: Mapping[str, Any] = report
    settings = {key: entries[key] for key in (*MADE, *MADE_BESIDE) if key in entries}
    origin = {key: entries[key] for key in ORIGIN if key in entries}
    to_si = {name: Conversion(**change) for name, change in report.get("to_si", {}).items()}
    rejections = {name: Rejection(**counts) for name, counts in report["rejections"].items()}
    timing, place = report.get("timing"), f"{folder / SETTINGS}: timing"
    return Result(
        settings=settings,
        time=time,
        signals=signals,
        units=report["units"],
        wall_time=report["wall_time"],
        complete=report["complete"],
        ended_at=report.get("ended_at"),
        descriptions=report.get("descriptions", {}),
        rejections=rejections,
        log=tuple(report["log"]),
        timing=None if timing is None else Timing.from_dict(place, timing),
        more_metrics=_as_recorded(report),
        origin=origin,
        to_si=to_si,
        folder=folder,
        limits=tuple(Trip(**trip) for trip in report.get("exceeded", ())),
        initialised_anew=tuple(report.get("initialised_anew", ())),
        peers=report.get("peers", {}),
        window=Window(**report["window"]) if "window" in report else None,
    )


def _check_rows(path: Path, read: Result, written: Mapping[str, Any]) -> None:
    """InputError where rows are missing of a run that came to its end, whatever end that was."""
    if read.wall_time is None and not read.complete:  # it goes on, or was killed
        return
    if read.wall_time is None and not read.window:
        raise InputError(
            f"{path.with_name(SETTINGS)}: wall_time = None; must be a number, as it is complete"
        )
    count, last = len(read.time), read.last_step
    if (count, last) != (written["rows"], written["steps"]):
        raise InputError(
            f"{path}: is damaged: has {counted(count, 'row')}, the last of step {last}; must have "
            f"{written['rows']}, the last of step {written['steps']}, as {SETTINGS} says"
        )


def _with_figures_of_every_step(read: Result, written: Mapping[str, Any]) -> Result:
    """A result of some rows or signals with the metrics that run.json has, which are of all."""
    metrics, measured = metrics_of(read.groups, read.more_metrics), written["measured"]
    worked_out = tuple(m for m in metrics if m.name in measured)
    if not worked_out and metrics and read.is_triggered:
        return replace(read, of_every_step=OfEveryStep.without(read.time, read.signals))
    if not worked_out and metrics and read.every > 1:  # it did not come to its end
        line = f"one row in {read.every} was recorded: the metrics are of these"
        return replace(read, log=(*read.log, line))
    if not worked_out and "proxies" not in written:
        return read
    place = read.folder / SETTINGS if read.folder else SETTINGS
    values = {m.name: measured[m.name] for m in worked_out}
    sized = tuple(_sized(m, values[m.name], read.roles) for m in worked_out)
    for m in (m for m in sized if m not in read.more_metrics):
        value = values[m.name]
        several = isinstance(value, list)
        if several != bool(m.entries) or (several and len(value) != len(m.entries)):
            count = counted(len(m.entries) or 1, "value")
            raise InputError(f"{place}: measured: {m.name} = {value!r}; must be {count}")
    of_all_rows = Measured(values, sized, tuple(written.get("missing_metrics", ())))
    return replace(read, of_every_step=OfEveryStep(of_all_rows, written.get("proxies", {})))


def _sized(m: Metric, value: Any, roles: Mapping[str, str]) -> Metric:
    """The metric of as many elements of its arrays as it has values."""
    places = range(1, len(value) + 1) if isinstance(value, list) else ()
    return m.of({resolved(n.replace("*", str(j)), roles) for n in m.arrays for j in places}, roles)


def _as_recorded(written: Mapping[str, Any]) -> tuple[Metric, ...]:
    """The metrics in run.json that nothing here would work out again, as they are there."""
    of_groups = {m.name for m in metrics_of(written.get("metrics", ()))}
    units = written.get("metric_units", {})
    return tuple(
        Metric(name, partial(_constant, value), units.get(name))
        for name, value in written["measured"].items()
        if name not in of_groups
    )


def _constant(value: Any, _: Signals) -> Any:
    return value


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


def load_log(
    path: str | Path,
    note: Callable[[str], None] = lambda _: None,
    expects: Mapping[str, str] = NOTHING,
    names: LogNames = AS_THEY_ARE,
) -> Signals:
    """The numbers in a log of any tool, by the names of its columns, or by others for these.

    They come in SI units where the run.json of the run next to it, or the units in the log, tell of
    others; else they are taken to be in SI, which `note` is told. InputError where it is missing,
    damaged or of another kind, or where what reads it is not installed; where a column is in a unit
    of something else than it is expected in; at a cell that is no number once its column is asked
    for.
    """
    from .signals import LOGS, read_log

    path = Path(path)
    if not path.is_file():
        raise InputError(f"{path}: no such log; must be a {choices(LOGS)} file")
    if path.suffix.lower() not in LOGS:
        raise InputError(f"{path}: must be a {choices(LOGS)} file")
    if names.offset is None:
        raise InputError(
            f"{names.file}: time.offset = 'fit': there is no run to compare with; must be a number "
            "of s"
        )
    log = read_log(path, names)
    for name, unit in expects.items():
        log.check_unit(name, unit)
    beside = path.with_name(SETTINGS)
    if path.stem == Path(SIGNALS).stem and beside.is_file():
        to_si = {n: Conversion(**c) for n, c in read_run_json(beside).get("to_si", {}).items()}
    else:
        to_si = _units_to_si(log, note)
    return Signals(log.time, log, to_si=to_si)


def _units_to_si(log: "Log", note: Callable[[str], None]) -> dict[str, Conversion]:
    """The conversions of the columns that are in a unit that is not of SI."""
    units = {name: known_unit(unit) for name, unit in log.units.items() if unit}
    silent = [name for name in log.numeric if name not in units]
    if log.path.suffix.lower() == ".mf4":
        silent = []  # in which Booleans have no unit either
    elif not units:
        missing = f"there is no {SETTINGS} next to it"
        note(f"{log.path}: {missing}; its values are taken to be in SI units")
    elif silent:
        note(f"{log.path}: {choices(silent, 6)}: no unit; taken to be in SI units")
    for name in (name for name, unit in units.items() if unit is None):
        note(f"{log.path}: {name} [{log.units[name]}]: not a known unit; taken to be in SI units")
    return {n: Conversion(u.factor, u.offset) for n, u in units.items() if u and not u.si}
