"""The folder of a run, on disk while it runs, its rows and run.json next to them."""

import os
import platform
import time
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from datetime import UTC, datetime
from hashlib import sha256
from pathlib import Path
from typing import Any, Literal, Self, TypedDict, get_args

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..base.files import make_folder, of_any_format, remove, unwritable
from ..base.registry import names
from ..base.scratch import PREFIX, SUFFIX, Lock
from ..base.typed_json import Decoder, json_in
from ..exchange.listener import Experiment, Listener, Signal
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
            self._origin |= _from(of, self._place)
            self._to_si = dict(of.to_si)
        else:
            if of.input and of.input.path:
                self._origin["input_path"] = _path_from(self._place, Path(of.input.path))
            conversions = in_si(of, ()).conversions
            self._to_si = {name: c for name, c in conversions.items() if name in of.recorded_names}
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

    def finish(self, result: RecordedRun) -> None:
        """Write the run.json of a result that ended, in whatever way; not if rows are missing.

        SimulationError where that fails.
        """
        if self._begun and not self._broken:
            with writing(self._folder / SETTINGS):
                self._write_settings(result)

    def _write_settings(self, result: RecordedRun) -> None:
        origin = dict(self._origin)
        if result.components:
            origin["fmus"] = fmus_of(result.components, self._place)
        replace(result, origin=origin).to_json(self._place / SETTINGS)

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
                remove(self._place, *DRAWN, *of_any_format(ANY_PICTURE, *_groups(settings)))
            remove(self._place, SETTINGS, SIGNALS, ARROW)
            if self._signals:
                self._file.begin(self._experiment, self._signals)
            self._begun = True
            self._write(steps, rows)
            of, columns = self._signals, rows[:1].T
            begun = RecordedRun(
                self._experiment.settings, self._experiment.times(steps[:1]),
                {s.name: typed(s, column) for s, column in zip(of, columns, strict=True)},
                {s.name: s.unit for s in of}, None, False, {s.name: s.description for s in of},
                to_si=self._to_si, of_every_step=OfEveryStep(Measured({}, (), ()), {}),
            )  # fmt: skip
            self._write_settings(begun)
        except OSError as error:
            path = Path(error.filename or self._place)
            if path.is_relative_to(self._place):
                path = self._folder / path.relative_to(self._place)
            raise InputError(unwritable(path, error)) from error


def save_run(result: RecordedRun, folder: Path, form: Form) -> None:
    """Write a result into a folder, as Result.save()."""
    with RunFolder(folder, result, form=form) as into:
        result.replay(into)
        into.finish(result)


class GroupsOfRun(TypedDict, total=False):
    """What _groups() reads of run.json."""

    metrics: list[str]


def _groups(settings: Path) -> Sequence[str]:
    """The groups of metrics of the run of a run.json, whose pictures have their names.

    All that there are where it is damaged.
    """
    try:
        content = json_in(str(settings), settings.read_bytes())
        return Decoder().decoded(GroupsOfRun, str(settings), content).get("metrics", [])
    except InputError:
        return names("groups")


def _from(run: RecordedRun, folder: Path) -> dict[str, Any]:
    """The origin of a run, its paths from another folder where they are from its own."""
    origin = dict(run.origin)
    if run.folder is None:
        return origin

    def moved(path: str) -> str:
        return _path_from(folder, Path(run.folder or "", path))

    if "fmus" in origin:
        origin["fmus"] = {
            name: {**fmu, "path": moved(fmu["path"])} if "path" in fmu else fmu
            for name, fmu in origin["fmus"].items()
        }
    if "input_path" in origin:
        origin["input_path"] = moved(origin["input_path"])
    return origin


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
