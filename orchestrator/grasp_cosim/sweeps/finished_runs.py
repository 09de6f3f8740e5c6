"""The runs of a sweep that are done, kept next to its table until all are: a line of JSON each."""

from __future__ import annotations

import errno
import hashlib
import json
import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict
from importlib.metadata import version
from io import FileIO
from pathlib import Path
from typing import Any, TypedDict

from ..base.errors import InputError, SimulationError, choices
from ..base.files import make_folder
from ..base.identity import parts_of
from ..base.scratch import SUFFIX, Lock
from ..base.typed_json import Decoder, json_in
from ..metrics.metric import Metric
from ..recording.memory import writing
from ..system.settings import settings
from .rows import Row
from .run import Task
from .table import Outcome
from .table_files import check_format

PACKAGE = "grasp-cosim"

MAX_DIFFERENCES = 3
"""Things in which runs differ that are named at most."""

Head = TypedDict("Head", {"runs of": Mapping[str, str]})
"""The first line of the file: a hash of each thing that decides the results, by its name."""


_DECODER = Decoder()


def keep(file: FileIO, outcome: Outcome) -> None:
    """Keep the outcome of a run from now on; SimulationError where that fails."""
    try:
        write_line(file, json.dumps(asdict(outcome)).encode() + b"\n")  # columns in their order
    except OSError as error:
        raise SimulationError(
            f"{file.name!r}: {error.strerror}; with more space the same command goes on"
        ) from error


def as_line(content: Any) -> bytes:
    """A line of JSON."""
    return json.dumps(content, sort_keys=True).encode() + b"\n"


def write_line(file: FileIO, line: bytes) -> None:
    """Write a line at the end of a file; OSError where there is no space for all of it."""
    end = file.seek(0, os.SEEK_END)
    if file.write(line) < len(line):  # which is no error to it
        file.truncate(end)
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@contextmanager
def opened(table: Path, identity: Mapping[str, str], done: dict[int, Outcome]) -> Iterator[FileIO]:
    """The file of the runs that are `done`, which these are read from, for one process at a time.

    It is made where there is none, and removed without an error. The lock goes with the process,
    however that ends. InputError where another process has it, or it is of other runs: `identity`
    has a hash of each thing that decides them, by what it is called.
    """
    check_format(table)
    path = table.with_name(f"{table.name}.rows")
    make_folder(path.parent)
    lock = Lock(path.with_name(path.name + SUFFIX))
    if not lock.taken():
        raise InputError(
            f"{path}: another process does runs of it; wait for its end, or name another --out"
        )
    try:
        with closing(FileIO(path, "a")) as file:
            found_head, *lines = path.read_bytes().splitlines(keepends=True) or [b""]
            head = as_line({"runs of": identity})
            has_runs = found_head.endswith(b"\n") and bool(lines)
            if not has_runs and found_head != head:
                with writing(path, InputError):
                    file.truncate(0)
                    write_line(file, head)
            elif found_head != head:
                difference = _difference(found_head, identity)
                raise InputError(
                    f"{path}: has runs that differ in {difference}; remove it, or name another "
                    "--out"
                )
            if lines and not lines[-1].endswith(b"\n"):  # torn by a kill
                file.truncate(path.stat().st_size - len(lines.pop()))
            outcomes = [_outcome(path, number, line) for number, line in enumerate(lines, 2)]
            done |= {outcome.index: outcome for outcome in outcomes}
            yield file
        path.unlink()  # closed, as Windows wants it
    finally:
        lock.release()


def _outcome(path: Path, number: int, line: bytes) -> Outcome:
    """The outcome that a line of the file of runs holds; InputError where it holds none."""
    place = f"{path}: line {number}"
    try:
        return _DECODER.decoded(Outcome, place, json_in(place, line))
    except InputError as error:
        raise InputError(f"{place} is damaged; remove the file, or name another --out") from error


def _difference(head: bytes, identity: Mapping[str, str]) -> str:
    """What the runs in the first line of a file differ in."""
    try:
        earlier = _DECODER.decoded(Head, "head", json_in("head", head))["runs of"]
    except InputError:
        return "all that is known of them"
    names = [n for n in {**identity, **earlier} if earlier.get(n) != identity.get(n)]
    return choices(names, MAX_DIFFERENCES)


def identity_of(task: Task, rows: Sequence[Row], metrics: Sequence[Metric]) -> dict[str, str]:
    """A hash of each thing that decides the results, by what it is called in a message."""
    decisive: dict[str, Any] = {"the rows": rows, "the version of grasp-cosim": version(PACKAGE)}
    if signals := task.signals:
        decisive["the signals"] = [signals.every, {n: a.signals for n, a in signals.arrays.items()}]
    decisive |= {f"the system's {key}": value for key, value in settings(task.system).items()}
    fmus = {f"the FMU of {c.name}": c.content for c in task.system.components}
    identity = {name: _hash_of(as_line(value)) for name, value in decisive.items()}
    identity |= {name: _hash_of(content) for name, content in fmus.items()}
    for metric in metrics:
        for part, part_hash in parts_of(metric.function).items():
            identity[f"metric {metric.name!r}, its {part}"] = part_hash
    return identity


def _hash_of(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
