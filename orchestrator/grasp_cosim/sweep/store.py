"""The folder of a study: what it is of, and a part per finished run, each written in one piece."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from ..errors import InputError
from ..recording.result import write_text
from .run import Outcome
from .study import Study

STUDY = "study.json"
PARTS = "parts"
FORMAT = 1


@dataclass(frozen=True, slots=True)
class Store:
    """The finished runs of one study in a folder."""

    folder: Path

    def open(self, study: Study) -> dict[int, Outcome]:
        """Bind the folder to the study, if it is new; the outcomes that it has, by index.

        InputError where it belongs to another study, or to other FMUs.
        """
        path, parts = self.folder / STUDY, self.folder / PARTS
        bound = {"format": FORMAT, **study.identity}
        if path.exists():
            self._check(path, bound)
        elif parts.exists():
            raise InputError(f"{parts}: runs without {STUDY}; --out must be another folder")
        else:
            write_text(path, json.dumps(bound, indent=2) + "\n")
        parts.mkdir(exist_ok=True)
        for torn in parts.glob("*.part"):
            torn.unlink()
        found = (_read(part) for part in sorted(parts.glob("*.json")))
        return {outcome.index: outcome for outcome in found}

    def keep(self, outcome: Outcome) -> None:
        """Write a part: from then on, the run is finished."""
        path = self.folder / PARTS / f"{outcome.index:07d}.json"
        write_text(path, json.dumps(asdict(outcome)) + "\n")

    def kept(self) -> int:
        """The number of finished runs."""
        return sum(1 for _ in (self.folder / PARTS).glob("*.json"))

    def _check(self, path: Path, bound: dict[str, object]) -> None:
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, UnicodeDecodeError, ValueError) as error:
            raise InputError(f"{path}: not readable: {error}; --out must be another") from error
        if there == bound:
            return
        same = isinstance(there, dict) and there.get("study") == bound["study"]
        what = "the same study with other FMUs" if same else "another study"
        raise InputError(
            f"{self.folder}: has the runs of {what}; --out must be another folder, or empty"
        )


def _read(path: Path) -> Outcome:
    try:
        return Outcome(**json.loads(path.read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, ValueError, TypeError) as error:
        raise InputError(
            f"{path}: not readable as a run: {error}; must be removed, the run is then done again"
        ) from error
