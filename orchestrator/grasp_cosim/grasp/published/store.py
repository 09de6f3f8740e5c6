"""The finished grasps of an evaluation that goes on; at its end they are removed."""

import hashlib
import json
import shutil
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from zipfile import BadZipFile

import numpy as np

from ...errors import InputError
from ...files import in_one_piece
from ...recording.load import SETTINGS, result_with
from ...recording.result import Result
from ...sweep.store import Parts
from ...sweeps.run import hash_of
from ...system.description import System
from ...system.settings import settings
from .grasps import Run
from .tables import Setting, Source

FOLDER = "grasps"
"""Where they are, below the folder of the evaluation."""

SIGNALS = "signals.npz"
"""The signals of a grasp that figures show, which are there and back sooner than as CSV."""

KEPT = ("metrics", "times_at_sensor_contact", "overshoot", "touch_forces")
"""What is in the part of a grasp; a grasp that figures show has the folder of its run, too."""

DAMAGED = (OSError, EOFError, ValueError, KeyError, TypeError, IndexError, BadZipFile)
"""What reading a part that is damaged may raise."""

Job = tuple[System, Setting, int, Source]


@dataclass(frozen=True, slots=True)
class Grasps:
    """The grasps of these jobs that are finished, below the folder of their evaluation."""

    parts: Parts
    jobs: Sequence[Job]

    def open(self) -> dict[int, Run]:
        """The grasps that there are, by the index of the job; those of other jobs are removed.

        For who has the folder locked.
        """
        identity = _identity(self.jobs)
        try:
            there = self.parts.bind(identity)
        except InputError:
            self.parts.clear()
            there = self.parts.bind(identity)
        found = {}
        for path in there:
            with suppress(InputError, *DAMAGED):  # is done again
                found[int(path.stem)] = self._read(int(path.stem))
        return found

    def keep(self, index: int, run: Run) -> None:
        """Write a grasp; from then on it is finished."""
        if run.result:
            folder = self._folder(index)
            with in_one_piece(folder / SIGNALS) as part, part.open("wb") as file:
                np.savez(file, time=run.result.time, **run.result.signals)  # type: ignore[arg-type]
            run.result.to_json(folder / SETTINGS)
        known = {name: getattr(run, name) for name in KEPT}
        self.parts.write(index, {**known, "shown": run.result is not None})

    def remove(self) -> None:
        """Remove them all, with their folder."""
        shutil.rmtree(self.parts.folder, ignore_errors=True)

    def _read(self, index: int) -> Run:
        _, setting, case, _ = self.jobs[index]
        part = json.loads(self.parts.part(index).read_text("utf-8"))
        result = self._read_result(index) if part.pop("shown") else None
        times, forces = map(tuple, (part["times_at_sensor_contact"], part["touch_forces"]))
        return Run(setting, case, part["metrics"], times, part["overshoot"], forces, result)

    def _read_result(self, index: int) -> Result:
        with (self._folder(index) / SIGNALS).open("rb") as raw, np.load(raw) as file:
            columns = dict(file)
        return result_with(self._folder(index) / SETTINGS, columns.pop("time"), columns)

    def _folder(self, index: int) -> Path:
        return self.parts.part(index).with_suffix("")


def _identity(jobs: Sequence[Job]) -> Mapping[str, str]:
    """A hash of all that decides the results: of what is run, and of the FMUs' and our code."""
    system = jobs[0][0]
    asked = [settings(system), [job[1:] for job in jobs]]
    code = sorted(Path(__file__).parents[2].rglob("*.py"))
    return {
        "study": hashlib.sha256(json.dumps(asked).encode()).hexdigest(),
        "fmus": hash_of(file.read_bytes() for file in (*(c.fmu for c in system.components), *code)),
    }
