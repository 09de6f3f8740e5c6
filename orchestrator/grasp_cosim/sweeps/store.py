"""The runs of a sweep that are done, kept beside its table until all are: a line of JSON each."""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from io import FileIO
from pathlib import Path

from ..base.errors import InputError, SimulationError
from ..base.locks import SUFFIX, Lock
from ..base.numerals import counted
from .run import Outcome


@dataclass
class Store:
    """The file of the runs that are done, open and locked; `done` are their outcomes by index."""

    path: Path
    file: FileIO
    done: dict[int, Outcome]

    def keep(self, outcome: Outcome) -> None:
        """Keep the outcome of a run from now on; SimulationError where that fails."""
        line = json.dumps(asdict(outcome)).encode() + b"\n"
        try:
            self.file.write(line)
        except OSError as error:
            kept = counted(len(self.done), "run")
            raise SimulationError(
                f"{self.path}: {error.strerror}; {kept} kept, the same command goes on"
            ) from error
        self.done[outcome.index] = outcome

    def remove(self) -> None:
        """Remove the file, as all runs are done."""
        self.file.close()  # as Windows wants it
        self.path.unlink()


@contextmanager
def opened(path: Path, identity: str) -> Iterator[Store]:
    """The store in a file, which is made where there is none, for one process at a time.

    It is there while not all runs are done; whoever has finished removes it. The lock goes with the
    process, however that ends. InputError where another process has it, or it is of other runs.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    lock = Lock(path.with_name(path.name + SUFFIX))
    if not lock.taken():
        said = f"{path}: another process does runs of it"
        raise InputError(f"{said}; wait for its end, or name another --out")
    try:
        with closing(FileIO(path, "a")) as file:
            yield Store(path, file, _read(path, file, identity))
    finally:
        lock.release()


def _read(path: Path, file: FileIO, identity: str) -> dict[int, Outcome]:
    """The outcomes in the file, whose last line may be torn by a kill; that is cut off."""
    whole, newline, _ = path.read_bytes().rpartition(b"\n")
    file.truncate(len(whole) + len(newline))
    head = json.dumps({"runs of": identity}).encode()
    if not whole:
        file.write(head + b"\n")
        return {}
    first, *lines = whole.split(b"\n")
    if first != head:
        raise InputError(
            f"{path}: has runs of another system, other FMUs or other rows; remove it, or name "
            "another --out"
        )
    found = [Outcome(**json.loads(line)) for line in lines]
    return {outcome.index: outcome for outcome in found}
