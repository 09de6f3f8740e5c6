"""The folder of a run, on disk while it runs, its rows and run.json beside them, and read back."""

import json
import os
import platform
import time
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any, Literal, Self, get_args

import numpy as np
import numpy.typing as npt

from ..base.checks import choice, is_number
from ..base.errors import InputError, choices
from ..base.files import check_nature, of_any_format, remove, unwritable
from ..base.higher import groups
from ..base.scratch import SUFFIX, Lock
from ..base.si_units import known_unit
from ..exchange.listener import Experiment, Listener, Signal
from ..interface.units import Conversion
from ..metrics.in_si import in_si
from ..metrics.metric import Measured, Metric, Signals, metrics_of
from ..realtime.timing import Timing
from ..system.description import System
from .arrow import ArrowListener, read_arrow
from .csv import CsvListener, read_csv, unreadable
from .mdf import read_mdf
from .memory import Rows, typed
from .result import OF_ANY, UNITS, Known, Rejection, Result

SIGNALS, ARROW, SETTINGS = "signals.csv", "signals.arrow", "run.json"
"""The files of a run's folder, of which it has one of the former two."""

DRAWN = ("report.html", "signals.mf4", *of_any_format("timing"))
"""The files that may be made of a run in its folder, beside its picture."""

Form = Literal["csv", "arrow"]
FORMS: tuple[str, ...] = get_args(Form)

FIRST_GUESS = 20e3
"""ns that it takes to write a row."""

SHARE = 0.03
"""The share of the time in which rows are written even where there is none to spare."""


class RunFolder:
    """A listener that writes a run into a folder, and takes the place of an older run there.

    It does so with the first row, so that a run which does not come so far leaves the older one as
    it was. From then on the folder has the rows until now and a run.json with "complete": false,
    until finish(). At no moment there are files of two runs. Its context keeps other runs out of
    the folder from the first row on.
    """

    def __init__(
        self,
        folder: Path,
        system: System,
        command: Sequence[str] = (),
        paced: bool = False,
        form: Form = "csv",
    ) -> None:
        """`command` led to the run; if it is `paced`, rows are written in spare() time only.

        `form` is that of the rows, signals.csv or signals.arrow. InputError without pyarrow, where
        that needs it.
        """
        self._folder, self._paced = folder, paced
        self._place = folder.absolute()  # an FMU may go elsewhere
        self._origin = origin(system, command)
        conversions = in_si(system, ()).conversions
        recorded = {str(port) for port in system.recorded}
        self._to_si = {name: c for name, c in conversions.items() if name in recorded}
        name = ARROW if form == "arrow" else SIGNALS
        kind = ArrowListener if form == "arrow" else CsvListener
        self._file: Listener = kind(folder / name, self._place / name)
        self._begun, self._broken = False, False
        self._waiting: deque[Rows] = deque()
        self._row_ns, self._at_last_ns = FIRST_GUESS, 0.0
        self._lock = Lock(self._place / SUFFIX)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Let others into the folder."""
        self._lock.release()

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Nothing is written yet."""
        self._experiment, self._signals = experiment, tuple(signals)

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Take the rows; InputError where the folder is not for us, SimulationError if it fails."""
        if not self._begun:
            self._take_the_folder(steps, rows)
        elif self._paced:
            self._waiting.append((steps.copy(), rows.copy()))
        else:
            self._write(steps, rows)

    def spare(self, ns: float) -> bool:
        """Write rows that wait, as many as take about so many ns, and one at last."""
        start = time.perf_counter_ns()
        count = max(int(ns / self._row_ns), int(start > self._at_last_ns))
        if not self._waiting or count < 1:
            return False
        steps, rows = self._waiting.popleft()
        if count < len(steps):
            self._waiting.appendleft((steps[count:], rows[count:]))
        self._write(steps[:count], rows[:count])
        took = time.perf_counter_ns() - start
        # one that was held up by something else does not count for much
        self._row_ns = min(1.5 * self._row_ns, took / min(count, len(steps)))
        self._at_last_ns = start + took + took / SHARE
        return True

    def end(self, complete: bool) -> None:
        """Write the rows that still wait, and close their file."""
        if self._begun:
            try:
                while self._waiting and not self._broken:
                    self._write(*self._waiting.popleft())
            finally:
                if self._signals:
                    self._file.end(complete)

    def finish(self, result: Result) -> None:
        """Write the run.json of a result that ended, in whatever way; not if rows are missing."""
        if self._begun and not self._broken:
            replace(result, origin=self._origin).to_json(self._place / SETTINGS)

    def _write(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        if not self._signals:
            return
        self._broken = True
        self._file.block(steps, rows)
        self._broken = False

    def _take_the_folder(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Remove the older run and begin ours; a kill leaves one of them, or no run.json."""
        settings = self._place / SETTINGS
        try:
            self._place.mkdir(parents=True, exist_ok=True)
            if not self._lock.taken():  # for as long as this process lives
                raise InputError(
                    f"{self._folder}: another process records a run in it; must end first, or --out"
                    " be another folder"
                )
            if settings.is_file() and any(
                (self._place / name).is_file() for name in (SIGNALS, ARROW)
            ):
                remove(self._place, *DRAWN, *of_any_format(OF_ANY.stem, *groups()))
            remove(self._place, SETTINGS, SIGNALS, ARROW)
            if self._signals:
                self._file.begin(self._experiment, self._signals)
            self._begun = True
            self._write(steps, rows)
            of, columns = self._signals, rows[:1].T
            begun = Result(
                self._experiment.settings, self._experiment.times(steps[:1]),
                {s.name: typed(s, column) for s, column in zip(of, columns, strict=True)},
                {s.name: s.unit for s in of}, None, False, {s.name: s.description for s in of},
                to_si=self._to_si, known=Known(Measured({}, (), ()), {}),
            )  # fmt: skip
            self.finish(begun)
        except OSError as error:
            path = Path(error.filename or self._place)
            if path.is_relative_to(self._place):
                path = self._folder / path.relative_to(self._place)
            raise InputError(unwritable(path, error)) from error


def now() -> datetime:
    """Return the time, or that of SOURCE_DATE_EPOCH, where the environment has it.

    InputError where that is not the seconds since 1970.
    """
    epoch = os.environ.get("SOURCE_DATE_EPOCH")
    if not epoch:
        return datetime.now().astimezone()
    try:
        return datetime.fromtimestamp(int(epoch), UTC)
    except (ValueError, OverflowError, OSError) as error:
        raise InputError(f"SOURCE_DATE_EPOCH={epoch}: must be the seconds since 1970") from error


def origin(system: System, command: Sequence[str]) -> dict[str, Any]:
    """The date now, the versions of what makes the run, which FMUs those are, and the command."""
    from importlib.metadata import version

    fmus = {c.name: {"guid": c.loaded.guid, "tool": c.loaded.tool} for c in system.components}
    for c in system.components:
        if c.native:  # the FMU whose place it takes
            fmus[c.name]["native_twin_of"] = c.interface.guid
    return {
        "date": now().isoformat(timespec="seconds"),
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("grasp-cosim", "numpy", "fmpy")},
        },
        "fmus": fmus,
        "command": list(command),
    }


# ------------------------------------------------------------------ read back

ENTRIES: Mapping[str, tuple[Any, str, str]] = {
    "a string": (str, "system scheme", "diverging title date"),
    "a number": ((int, float), "step stop", "start"),
    "a number or null": ((int, float, type(None)), "wall_time", ""),
    "true or false": (bool, "complete", ""),
    "a list": (list, "connections events faults log", "metrics command record"),
    "a JSON object": (
        dict,
        "initialisation components rejections units",
        "roles input changed versions fmus types descriptions metric_units to_si",
    ),
}
"""What entries of run.json must be besides metrics: those that are needed, and others."""

MADE = (
    "system", "scheme", "step", "stop", "initialisation", "components", "connections", "events",
    "faults", "roles", "input", "changed", "metrics", "diverging", "start", "record",
)  # fmt: skip
"""Those that say how the run was made."""

ORIGIN = ("title", "date", "versions", "fmus", "command")
"""Those that say when it was made, and with what."""

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
    only some of its steps or its signals, are as they were recorded.
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
        settings={k: written[k] for k in MADE if k in written},
        time=time,
        signals={
            name: _typed(f"{path}: type of {name}", column, types.get(name, "float64"))
            for name, column in columns.items()
        },
        units=units,
        wall_time=written["wall_time"],
        complete=written["complete"],
        descriptions=written.get("descriptions", {}),
        rejections=_records(path, written, "rejections", Rejection),
        log=tuple(written["log"]),
        timing=None if realtime is None else Timing.from_dict(f"{path}: realtime", realtime),
        more_metrics=_as_recorded(written),
        origin={key: written[key] for key in ORIGIN if key in written},
        to_si=_records(path, written, "to_si", Conversion),
        folder=folder,
    )
    in_part = read.every > 1 or "record" in written
    return _with_known(read, written) if in_part else read


def _with_known(read: Result, written: Mapping[str, Any]) -> Result:
    """A result of some rows or signals with the metrics that run.json has, which are of all."""
    asked = metrics_of(read.groups, read.more_metrics)
    there = tuple(m for m in asked if m.name in written)
    if not asked:
        return read
    if not there and read.every > 1:  # it did not come to its end
        line = f"one row in {read.every} was recorded: the metrics are of these"
        return replace(read, log=(*read.log, line))
    if not there:
        return read
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


def _records(path: Path, written: Mapping[str, Any], key: str, make: type[Any]) -> dict[str, Any]:
    """The objects by name in an entry of run.json, of a class whose fields are all numbers."""
    fields, found = list(make.__annotations__), {}
    for name, entry in written.get(key, {}).items():
        numbers = [entry.get(field) for field in fields] if isinstance(entry, dict) else [None]
        if not all(map(is_number, numbers)):
            must = " and ".join(fields)
            raise InputError(f"{path}: {key}: {name} = {entry!r}; must be {must}")
        found[name] = make(*numbers)
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
    for must, (kind, needed, others) in ENTRIES.items():
        for key in (*needed.split(), *others.split()):
            there, value = key in settings, settings.get(key)
            right = isinstance(value, kind) and (kind is bool or not isinstance(value, bool))
            if not (right if there else key in others.split()):
                said = f"{key} = {value!r}" if there else f"no entry {key!r}"
                must = f"{must}, as `grasp-cosim run --out` writes it"
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
        to_si = _records(beside, _settings(beside), "to_si", Conversion)
    elif note and kind == ".csv":
        note(f"{path}: there is no {SETTINGS} beside it; its values are taken to be in SI units")
    numbers = {name: column for name, column in columns.items() if column.dtype != object}
    return Signals(time, numbers, to_si=to_si)
