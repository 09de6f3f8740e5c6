"""The folder of a run, on disk while it runs, its rows and run.json next to them."""

import os
import platform
import re
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, Self, TypedDict, get_args

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError, SimulationError
from ..base.files import make_folder, of_any_format, remove, unwritable
from ..base.registry import names
from ..base.scratch import PREFIX, SUFFIX, Lock
from ..base.typed_json import Decoder, json_in
from ..exchange.listener import Experiment, Listener, Signal, Window
from ..metrics.in_si import in_si
from ..metrics.metric import Measured
from ..system.description import System
from ..system.parts import Component
from .arrow import ArrowListener
from .csv import CsvListener
from .memory import Rows, typed, writing
from .recorded_run import OfEveryStep, RecordedRun

SIGNALS, ARROW, SETTINGS = "signals.csv", "signals.arrow", "run.json"
"""The files of a run's folder, of which it has one of the former two."""

WINDOW = re.compile(r"window_\d{3,}")
"""The folders of the windows of a triggered run, in its folder. Each is the folder of a run."""

ANY_PICTURE = "signals"
"""The stem of the picture of a result that is of no group of metrics with one more."""

DRAWN = ("report.html", "signals.mf4", *of_any_format("timing"))
"""The files that may be made of a run in its folder, next to its picture."""

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

    The rows of a triggered run are in the folders of its windows.
    """

    def __init__(
        self,
        folder: str | Path,
        of: System | RecordedRun,
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
        self._origin = origin(of.components, command, self._place)
        if isinstance(of, RecordedRun):
            self._origin |= _moved(of.origin, of.folder, self._place)
            self._to_si = dict(of.to_si)
        else:
            if of.input and of.input.path:
                self._origin["input_path"] = _path_from(self._place, Path(of.input.path))
            conversions = in_si(of, ()).conversions
            self._to_si = {name: c for name, c in conversions.items() if name in of.recorded_names}
        self._form = form
        self._file = self._rows_file()
        self._file_is_open = False
        self._begun, self._broken, self._is_triggered = False, False, False
        self._window: Window | None = None
        """The one whose folder is made with its first row."""
        self._waiting: deque[Rows | Callable[[], None]] = deque()
        self._row_ns, self._at_last_ns = FIRST_GUESS, 0.0
        self._lock = Lock(self._place / SUFFIX)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Let others into the folder."""
        self._lock.release()

    def _rows_file(self, window: str = "") -> Listener:
        """What writes the rows, into the folder of a window of that name."""
        name = ARROW if self._form == "arrow" else SIGNALS
        kind = ArrowListener if self._form == "arrow" else CsvListener
        return kind(self._folder / window / name, self._place / window / name)

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Nothing is written yet."""
        self._experiment, self._signals = experiment, tuple(signals)

    def begin_run(self) -> None:
        """Take the folder for a triggered run; errors as of block()."""
        self._is_triggered = True
        self._take_the_folder(np.empty(0, np.int64), np.empty((0, len(self._signals))))

    def begin_window(self, window: Window) -> None:
        """Take note of a window."""
        self._do(partial(setattr, self, "_window", window))

    def end_window(self, window: Window) -> None:
        """Close the file of a window."""
        self._do(self._close_file)

    def _do(self, work: Callable[[], None]) -> None:
        """Do it behind the rows that wait."""
        if self._waiting:
            self._waiting.append(work)
        else:
            work()

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
        while self._waiting and callable(work := self._waiting[0]):
            self._waiting.popleft()
            work()
        start = time.perf_counter_ns()
        count = max(int(ns / self._row_ns), int(start > self._at_last_ns))
        if not self._waiting or count < 1:
            return False
        steps, rows = self._waiting.popleft()  # type: ignore[misc]  # no work is in front
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
                    work = self._waiting.popleft()
                    if callable(work):
                        work()
                    else:
                        self._write(*work)
            finally:
                self._close_file(complete)

    def finish(self, result: RecordedRun) -> None:
        """Write the run.json of a result that ended, in whatever way; not if rows are missing.

        SimulationError where that fails.
        """
        if not self._begun or self._broken:
            return
        parts: tuple[RecordedRun, ...] = (*result.windows, result)
        for part in parts:
            place = part.subfolder if self._is_triggered else ""
            with writing(self._folder / place / SETTINGS):
                self._write_settings(part, place)

    def _write_settings(self, result: RecordedRun, window: str = "") -> None:
        origin = _moved(self._origin, self._place, self._place / window)
        if result.components:
            origin["fmus"] = fmus_of(result.components, self._place / window)
        replace(result, origin=origin).to_json(self._place / window / SETTINGS)

    def _write(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        if not self._signals:
            return
        with self._whole_only_if_written():
            if self._window:
                self._open_window(self._window, steps, rows)
            else:
                self._file.block(steps, rows)

    def _open_window(
        self, window: Window, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]
    ) -> None:
        """Make the folder of a window, with its first rows; SimulationError where that fails."""
        name, self._window = window.folder, None
        with writing(self._folder / name):
            make_folder(self._place / name)
            remove(self._place / name, SETTINGS, SIGNALS, ARROW)
        self._file = self._rows_file(name)
        try:
            self._open_file()
        except InputError as error:  # the run goes on already
            raise SimulationError(str(error)) from error
        self._file.block(steps, rows)
        with writing(self._folder / name / SETTINGS):
            self._write_settings(replace(self._begun_run(steps, rows), window=window), name)

    def _open_file(self) -> None:
        self._file.begin(self._experiment, self._signals)
        self._file_is_open = True

    def _close_file(self, complete: bool = True) -> None:
        """Close the file of the rows, if it is open."""
        if self._file_is_open:
            self._file_is_open = False
            with self._whole_only_if_written():
                self._file.end(complete)

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
            if _is_of_a_run(self._place):
                remove(self._place, *DRAWN, *of_any_format(ANY_PICTURE, *_groups(settings)))
            remove(self._place, SETTINGS, SIGNALS, ARROW)
            _remove_windows(self._place)
            self._begun = True
            begun = self._begun_run(steps, rows)
            if self._is_triggered:
                begun = replace(begun, steps_done=0)
            elif self._signals:
                self._open_file()
                self._write(steps, rows)
            self._write_settings(begun)
        except OSError as error:
            path = Path(error.filename or self._place)
            if path.is_relative_to(self._place):
                path = self._folder / path.relative_to(self._place)
            raise InputError(unwritable(path, error)) from error

    def _begun_run(
        self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]
    ) -> RecordedRun:
        """What is known as the first of these rows comes, of which there may be none."""
        of, columns = self._signals, rows[:1].T
        return RecordedRun(
            self._experiment.settings, self._experiment.times(steps[:1]),
            {s.name: typed(s, column) for s, column in zip(of, columns, strict=True)},
            {s.name: s.unit for s in of}, None, False, {s.name: s.description for s in of},
            to_si=self._to_si, of_every_step=OfEveryStep(Measured({}, (), ()), {}),
        )  # fmt: skip


def window_folders(folder: Path) -> list[Path]:
    """The folders of the windows of a triggered run in its folder, in their order."""
    return [path for path in _called_windows(folder) if "window" in (_older(path) or {})]


def _called_windows(folder: Path) -> list[Path]:
    """The folders in a folder that have the names of windows, in the order of their numbers."""
    folders = [path for path in folder.glob("window_*") if WINDOW.fullmatch(path.name)]
    return sorted(
        (path for path in folders if path.is_dir()),
        key=lambda path: int(path.name.removeprefix("window_")),
    )


def _remove_windows(place: Path) -> None:
    """Remove the windows of an older run, and what a kill left of one.

    Another run in a folder of such a name, and what else is in their folders, stays.
    """
    for folder in _called_windows(place):
        if (folder / SETTINGS).is_file() and "window" not in (_older(folder) or {}):
            continue
        pictures = of_any_format(ANY_PICTURE, *_groups(folder / SETTINGS))
        remove(folder, SETTINGS, *DRAWN, *pictures, SIGNALS, ARROW)
        if not folder.is_symlink() and not any(folder.iterdir()):
            folder.rmdir()


def save_run(result: RecordedRun, folder: Path, form: Form) -> None:
    """Write a result into a folder, as Result.save()."""
    with RunFolder(folder, result, form=form) as into:
        result.replay(into)
        into.finish(result)


class OlderRun(TypedDict, total=False):
    """What is read of the run.json of an older run."""

    metrics: list[str]
    windows: list[Any]
    window: Mapping[str, Any]


def _is_of_a_run(folder: Path) -> bool:
    """True if a folder has the files of a run, and not only a run.json of something else."""
    if not (folder / SETTINGS).is_file():
        return False
    has_rows = any((folder / name).is_file() for name in (SIGNALS, ARROW))
    return has_rows or "windows" in (_older(folder) or {})


def _older(folder: Path) -> OlderRun | None:
    """What the run.json in a folder says, nothing where there is none; None if it is damaged."""
    settings = folder / SETTINGS
    if not settings.is_file():
        return {}
    try:
        content = json_in(str(settings), settings.read_bytes())
        return Decoder().decoded(OlderRun, str(settings), content)
    except InputError:
        return None


def _groups(settings: Path) -> Sequence[str]:
    """The groups of metrics of the run of a run.json, whose pictures have their names.

    All that there are where it is damaged.
    """
    older = _older(settings.parent) if settings.is_file() else None
    return names("groups") if older is None else older.get("metrics", [])


def _moved(origin: Mapping[str, Any], old: Path | None, new: Path) -> dict[str, Any]:
    """The origin of a run, its paths from a new folder where they are from the old one."""
    if old is None or old == new:
        return dict(origin)

    def moved(entry: Mapping[str, Any], key: str) -> dict[str, Any]:
        return {**entry, key: _path_from(new, old / entry[key])} if key in entry else dict(entry)

    fmus = {name: moved(fmu, "path") for name, fmu in origin.get("fmus", {}).items()}
    return moved(origin, "input_path") | ({"fmus": fmus} if fmus else {})


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


def origin(components: Sequence[Component], command: Sequence[str], folder: Path) -> dict[str, Any]:
    """The date now, the versions of what makes the run, which FMUs those are, and the command.

    The folder is that of the run, from which the paths of the FMUs are.
    """
    from importlib.metadata import version

    return {
        "date": now().isoformat(timespec="seconds"),
        "versions": {
            "python": platform.python_version(),
            **{name: version(name) for name in ("grasp-cosim", "numpy", "fmpy")},
        },
        "fmus": fmus_of(components, folder),
        "command": list(command),
    }


def fmus_of(components: Sequence[Component], folder: Path) -> dict[str, dict[str, Any]]:
    """Which FMUs run, by component; their paths from the folder, but in a temporary one."""
    fmus: dict[str, dict[str, Any]] = {
        c.name: {"guid": c.loaded.guid, "tool": c.loaded.tool, "sha256": file_hash(c.loaded.path)}
        for c in components
    }
    for c in components:
        if c.fmu.exists() and not any(part.startswith(PREFIX) for part in c.fmu.parts):
            fmus[c.name]["path"] = _path_from(folder, c.fmu)
    for c in components:
        if c.native:  # the FMU whose place it takes
            fmus[c.name]["native_twin_of"] = c.interface.guid
    return fmus


def _path_from(folder: Path, path: Path) -> str:
    """The way from a folder to a file, without links, which it would not lead through."""
    return os.path.relpath(os.path.realpath(path), os.path.realpath(folder))


def file_hash(path: Path) -> str | None:
    """The SHA-256 of a file; None of what is a folder."""
    return sha256(path.read_bytes()).hexdigest() if path.is_file() else None
