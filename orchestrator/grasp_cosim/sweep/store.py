"""A folder of finished runs: what they are of, and a part for each, written in one piece."""

import fcntl
import json
import os
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import InputError, SimulationError
from ..files import write_text
from ..numerals import counted

STUDY = "study.json"
PARTS = "parts"
LOCK = "lock"
FORMAT = 1


@dataclass(frozen=True, slots=True)
class Parts:
    """What is finished of a larger work in a folder, a part each, bound to what the work is."""

    folder: Path

    @contextmanager
    def locked(self) -> Iterator[None]:
        """Keep other processes out of the folder, which is made where there is none.

        The lock goes with the process, however that ends; its file stays. InputError where another
        one has it, OSError where the file system knows no locks.
        """
        self.folder.mkdir(parents=True, exist_ok=True)
        descriptor = os.open(self.folder / LOCK, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            self._lock(descriptor)
            yield
        finally:
            os.close(descriptor)

    def bind(self, identity: Mapping[str, str]) -> Iterator[Path]:
        """Bind the folder to a work, if it is new; the files of the parts that it has, in order.

        For who has it locked. InputError where it belongs to another work, or to other FMUs.
        """
        path, parts = self.folder / STUDY, self.folder / PARTS
        bound = {"format": FORMAT, **identity}
        if path.exists():
            self._check(path, bound)
        elif parts.exists():
            raise InputError(f"{parts}: runs without {STUDY}; --out must be another folder")
        else:
            write_text(path, json.dumps(bound, indent=2) + "\n")
        parts.mkdir(exist_ok=True)
        for torn in (*parts.glob("*.json.*.part"), *self.folder.glob(f"{STUDY}.*.part")):
            torn.unlink()
        return iter(sorted(parts.glob("*.json")))

    def write(self, index: int, content: Any) -> None:
        """Write a part: from then on, it is finished. SimulationError where that fails."""
        path = self.part(index)
        try:
            write_text(path, json.dumps(content) + "\n")
        except OSError as error:
            raise SimulationError(
                f"{path}: {error.strerror}; {counted(self.kept(), 'run')} kept, the same command "
                "goes on"
            ) from error

    def clear(self) -> None:
        """Remove all parts, and what they are bound to. For who has it locked."""
        shutil.rmtree(self.folder / PARTS, ignore_errors=True)
        (self.folder / STUDY).unlink(missing_ok=True)

    def part(self, index: int) -> Path:
        """The file of a part."""
        return self.folder / PARTS / _name(index)

    def kept(self) -> int:
        """The number of finished runs."""
        return sum(1 for _ in (self.folder / PARTS).glob("*.json"))

    def _lock(self, descriptor: int) -> None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            os.truncate(descriptor, 0)
            os.write(descriptor, f"{os.getpid()}\n".encode())
        except BlockingIOError as error:
            holder = os.read(descriptor, 20).decode("ascii", "replace").strip()
            which = f"process {holder}" if holder else "another process"
            raise InputError(
                f"{self.folder}: {which} is doing runs in it; must end first, or --out be another "
                "folder"
            ) from error
        except OSError as error:
            raise OSError(error.errno, error.strerror, str(self.folder / LOCK)) from error

    def _check(self, path: Path, bound: dict[str, object]) -> None:
        try:
            there = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise InputError(f"{path}: not readable: {error}; --out must be another") from error
        if there == bound:
            return
        same = isinstance(there, dict) and there.get("study") == bound["study"]
        what = "the same study with other FMUs" if same else "another study"
        raise InputError(
            f"{self.folder}: has the runs of {what}; --out must be another folder, or empty"
        )


def _name(index: int) -> str:
    return f"{index:07d}.json"
