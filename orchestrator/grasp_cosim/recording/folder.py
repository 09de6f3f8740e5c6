"""The folder of a run, on disk while it runs: its rows, and run.json beside them."""

import os
import platform
import time
from collections import deque
from collections.abc import Sequence
from dataclasses import replace
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Any, Literal, Self, get_args

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError
from ..base.files import of_any_format, remove, unwritable, write_json
from ..base.higher import groups
from ..base.scratch import SUFFIX, Lock
from ..exchange.listener import Experiment, Signal
from ..metrics.in_si import in_si
from ..system.description import System
from .arrow import ArrowListener
from .csv import CsvListener
from .load import ARROW, SETTINGS, SIGNALS, TEXT
from .memory import TYPES, Rows
from .result import OF_ANY, Result

DRAWN = ("report.html", "signals.mf4", *of_any_format("timing"))
"""The files that may be made of a run in its folder, beside its picture."""

Form = Literal["csv", "arrow"]
FORMS: tuple[str, ...] = get_args(Form)
FILES = (SIGNALS, ARROW)

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
        self._origin = origin(system, command)
        self._to_si = in_si(system, ()).conversions
        self._file: CsvListener | ArrowListener
        if form == "arrow":
            self._file = ArrowListener(folder / ARROW)
        else:
            self._file = CsvListener(folder / SIGNALS, in_place=True)
        self._begun, self._broken = False, False
        self._waiting: deque[Rows] = deque()
        self._row_ns, self._at_last_ns = FIRST_GUESS, 0.0
        self._lock = Lock(folder / SUFFIX)

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
        done = min(count, len(steps))
        self._write(steps[:done], rows[:done])
        end = time.perf_counter_ns()
        # one that was held up by something else does not count for much
        self._row_ns = min(1.5 * self._row_ns, (end - start) / done)
        self._at_last_ns = end + (end - start) / SHARE
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
            replace(result, origin=self._origin).to_json(self._folder / SETTINGS)

    def _write(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        if not self._signals:
            return
        self._broken = True
        self._file.block(steps, rows)
        self._broken = False

    def _take_the_folder(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Remove the older run, its data last, and begin ours; a kill leaves one of them or none.

        Without run.json there is no run in the folder.
        """
        settings = self._folder / SETTINGS
        try:
            self._folder.mkdir(parents=True, exist_ok=True)
            if not self._lock.taken():  # for as long as this process lives
                raise InputError(
                    f"{self._folder}: another process records a run in it; must end first, or --out"
                    " be another folder"
                )
            if settings.is_file() and any((self._folder / name).is_file() for name in FILES):
                remove(self._folder, *DRAWN, *of_any_format(OF_ANY.stem, *groups()))
            remove(self._folder, SETTINGS, *FILES)
            if self._signals:
                self._file.begin(self._experiment, self._signals)
            self._begun = True
            self._write(steps, rows)
            write_json(settings, self._unfinished())
        except OSError as error:
            raise InputError(unwritable(Path(error.filename or self._folder), error)) from error

    def _unfinished(self) -> dict[str, Any]:
        """The run.json of a run that goes on: see Result.to_json()."""
        types = {kind: str(np.dtype(own)) for kind, own in TYPES.items()}
        signals = self._signals
        return {
            "wall_time": None,
            "complete": False,
            **self._experiment.settings,
            "units": {s.name: s.unit for s in signals},
            "to_si": {name: c._asdict() for name, c in self._to_si.items()},
            "types": {s.name: types.get(s.kind, TEXT) for s in signals},
            "descriptions": {s.name: s.description for s in signals},
            "metric_units": {},
            "missing_metrics": [],
            "log": [],
            "rejections": {},
            **self._origin,
        }


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
