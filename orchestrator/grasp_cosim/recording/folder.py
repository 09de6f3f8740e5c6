"""The folder of a run, on disk while it runs, its rows and run.json beside them, and read back."""

import os
import platform
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Self, get_args

import numpy as np
import numpy.typing as npt

from ..base.checks import choice
from ..base.errors import InputError, choices
from ..base.files import check_nature, make_folder, of_any_format, remove, unwritable
from ..base.higher import groups
from ..base.scratch import SUFFIX, Lock
from ..base.si_units import known_unit
from ..base.text import counted
from ..exchange.listener import Experiment, Listener, Signal
from ..interface.units import Conversion
from ..metrics.in_si import in_si
from ..metrics.metric import Measured, Metric, Signals, metrics_of, resolved
from ..realtime.timing import Timing
from ..system.description import System
from ..system.parts import Component
from .arrow import ArrowListener
from .csv import CsvListener
from .log_names import AS_THEY_ARE, LogNames
from .memory import Rows, typed, writing
from .result import OF_ANY, Known, Rejection, Result, Trip
from .run_json import MADE, MADE_BESIDE, ORIGIN, read_run_json, unreadable

if TYPE_CHECKING:
    from .signals import Log

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
        folder: str | Path,
        of: System | Result,
        command: Sequence[str] = (),
        paced: bool = False,
        form: Form = "csv",
    ) -> None:
        """`of` is the system that runs, or the result that did; `command` led to the run.

        If it is `paced`, rows are written in spare() time only. `form` is that of the rows,
        signals.csv or signals.arrow. InputError without pyarrow, where that needs it.
        """
        folder = Path(folder)
        self._folder, self._paced = folder, paced
        self._place = folder.absolute()  # an FMU may go elsewhere
        self._origin = origin(of.components, command)
        if isinstance(of, Result):
            self._origin |= of.origin
            self._to_si = dict(of.to_si)
        else:
            conversions = in_si(of, ()).conversions
            self._to_si = {name: c for name, c in conversions.items() if name in of.kept}
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
                    with self._whole_only_if_written():
                        self._file.end(complete)

    def finish(self, result: Result) -> None:
        """Write the run.json of a result that ended, in whatever way; not if rows are missing.

        SimulationError where that fails.
        """
        if self._begun and not self._broken:
            with writing(self._folder / SETTINGS):
                self._write_settings(result)

    def _write_settings(self, result: Result) -> None:
        replace(result, origin=self._origin).to_json(self._place / SETTINGS)

    def _write(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        if not self._signals:
            return
        with self._whole_only_if_written():
            self._file.block(steps, rows)

    @contextmanager
    def _whole_only_if_written(self) -> Iterator[None]:
        """The rows are broken from here on if their writing fails: the older run.json stays."""
        was_broken, self._broken = self._broken, True
        yield
        self._broken = was_broken

    def _take_the_folder(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Remove the older run and begin ours; a kill leaves one of them, or no run.json."""
        settings = self._place / SETTINGS
        try:
            make_folder(self._place)
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
            self._write_settings(begun)
        except OSError as error:
            path = Path(error.filename or self._place)
            if path.is_relative_to(self._place):
                path = self._folder / path.relative_to(self._place)
            raise InputError(unwritable(path, error)) from error


def save_run(result: Result, folder: Path, form: Form) -> None:
    """Write a result into a folder, as Result.save()."""
    with RunFolder(folder, result, form=form) as into:
        result.replay(into)
        into.finish(result)


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


def origin(components: Sequence[Component], command: Sequence[str]) -> dict[str, Any]:
    """The date now, the versions of what makes the run, which FMUs those are, and the command."""
    from importlib.metadata import version

    fmus = {
        c.name: {"guid": c.loaded.guid, "tool": c.loaded.tool, "sha256": _hash(c.loaded.path)}
        for c in components
    }
    for c in components:
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


def _hash(path: Path) -> str | None:
    """The SHA-256 of a file; None of what is a folder."""
    return sha256(path.read_bytes()).hexdigest() if path.is_file() else None


# ------------------------------------------------------------------ read back

NOTHING: Mapping[str, str] = {}

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
    """Read the result in a folder that `run --out` wrote, or is writing: then as far as it got.

    Metrics are worked out anew from the signals; those of a user's file, and of a run that recorded
    only some of its steps or its signals, are as they were recorded.

    Args:
        folder: The folder, or one of its files.

    Returns:
        The result.

    Raises:
        InputError: A file is missing or damaged, or the two files are not of the same run.
    """
    folder = run_folder(Path(folder))
    path, arrow, signals = folder / SETTINGS, folder / ARROW, folder / SIGNALS
    written = read_run_json(path)
    entries: Mapping[str, Any] = written
    units, types, timing = written["units"], written.get("types", {}), written.get("timing")
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
    read = Result(
        settings={key: entries[key] for key in (*MADE, *MADE_BESIDE) if key in entries},
        time=time,
        signals={
            name: _typed(f"{path}: type of {name}", column, types.get(name, "float64"))
            for name, column in columns.items()
        },
        units=units,
        wall_time=written["wall_time"],
        complete=written["complete"],
        ended_at=written.get("ended_at"),
        descriptions=written.get("descriptions", {}),
        rejections={name: Rejection(**r) for name, r in written["rejections"].items()},
        log=tuple(written["log"]),
        timing=None if timing is None else Timing.from_dict(f"{path}: timing", timing),
        more_metrics=_as_recorded(written),
        origin={key: entries[key] for key in ORIGIN if key in entries},
        to_si={name: Conversion(**c) for name, c in written.get("to_si", {}).items()},
        folder=folder,
        limits=tuple(Trip(**trip) for trip in written.get("exceeded", ())),
        initialised_anew=tuple(written.get("initialised_anew", ())),
        peers=written.get("peers", {}),
    )
    _check_rows(rows, read, written)
    in_part = read.every > 1 or "record" in written
    return _with_known(read, written) if in_part else read


def _check_rows(path: Path, read: Result, written: Mapping[str, Any]) -> None:
    """InputError where rows are missing of a run that came to its end, whatever end that was."""
    if read.wall_time is None and not read.complete:  # it goes on, or was killed
        return
    if read.wall_time is None:
        raise InputError(
            f"{path.with_name(SETTINGS)}: wall_time = None; must be a number, as it is complete"
        )
    count, last = len(read.time), read.last_step
    if (count, last) != (written["rows"], written["steps"]):
        raise InputError(
            f"{path}: is damaged: has {counted(count, 'row')}, the last of step {last}; must have "
            f"{written['rows']}, the last of step {written['steps']}, as {SETTINGS} says"
        )


def _with_known(read: Result, written: Mapping[str, Any]) -> Result:
    """A result of some rows or signals with the metrics that run.json has, which are of all."""
    metrics, measured = metrics_of(read.groups, read.more_metrics), written["measured"]
    worked_out = tuple(m for m in metrics if m.name in measured)
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
    return replace(read, known=Known(of_all_rows, written.get("proxies", {})))


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

    They come in SI units where the run.json of the run beside it, or the units in the log, tell of
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
        missing = f"there is no {SETTINGS} beside it"
        note(f"{log.path}: {missing}; its values are taken to be in SI units")
    elif silent:
        note(f"{log.path}: {choices(silent, 6)}: no unit; taken to be in SI units")
    for name in (name for name, unit in units.items() if unit is None):
        note(f"{log.path}: {name} [{log.units[name]}]: not a known unit; taken to be in SI units")
    return {n: Conversion(u.factor, u.offset) for n, u in units.items() if u and not u.si}
