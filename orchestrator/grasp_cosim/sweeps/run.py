"""One run of a sweep, here or in another process, which may be of another machine."""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ..base.errors import InputError, SimulationError
from ..base.scratch import ScratchFolder
from ..interface.interface import Value
from ..master.simulation import simulate
from ..metrics.metric import Metric
from ..recording.result import UNITS
from ..system.description import System
from .rows import Row


@dataclass(frozen=True, slots=True)
class Task:
    """All that runs share: the system and a user's metrics."""

    system: System
    metrics: tuple[Metric, ...] = ()


@dataclass(frozen=True, slots=True)
class Outcome:
    """What came of the run with an index: the metrics by column, or the error, one line."""

    index: int
    metrics: Mapping[str, Value | None]
    error: str | None = None


@dataclass(frozen=True, slots=True)
class Packed:
    """A task as bytes, which a process unpacks once; `fmus` are the contents of its FMUs, if any.

    They travel to machines that do not have the files.
    """

    key: str
    task: bytes
    fmus: tuple[bytes, ...] = ()


def packed(task: Task, with_fmus: bool) -> Packed:
    """The task as bytes, with the contents of its FMUs for another machine or without."""
    components = task.system.components if with_fmus else ()
    fmus = tuple((c.native or c.fmu).read_bytes() for c in components)
    content = pickle.dumps(task)
    return Packed(hash_of([content, *fmus]), content, fmus)


def hash_of(contents: Iterable[bytes]) -> str:
    """A hash of the contents of files, in their order."""
    digest = hashlib.sha256()
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()


def run_row(task: Task, index: int, row: Row) -> Outcome:
    """Run a row; one that fails is an outcome, too. KeyboardInterrupt where it was interrupted."""
    try:
        result = simulate(task.system.with_settings(row, "sweep: {}".format), metrics=task.metrics)
        if not result.complete:
            raise KeyboardInterrupt
        metrics = {name: m for name, m in result.metrics.items() if name not in UNITS}
        return Outcome(index, dict(_flat("", metrics)))
    except (InputError, SimulationError) as error:
        return Outcome(index, {}, str(error))


_unpacked: dict[str, tuple[Task, ScratchFolder | None]] = {}
"""What this process has unpacked, by key; the folders of FMUs go with it."""

_one_at_a_time = threading.Lock()
"""All Python FMUs of a process share its modules, and a compiled loop keeps the others waiting."""


def run_packed(shared: Packed, rows: Mapping[int, Row]) -> list[Outcome]:
    """Do the runs of rows by index in this process."""
    with _one_at_a_time:
        if shared.key not in _unpacked:
            _unpacked[shared.key] = _unpack(shared)
        task, _ = _unpacked[shared.key]
        return [run_row(task, index, row) for index, row in rows.items()]


def _unpack(shared: Packed) -> tuple[Task, ScratchFolder | None]:
    """The task, whose FMUs are in a folder of this process where their contents came along."""
    task: Task = pickle.loads(shared.task)  # noqa: S301 - by packed(), through a pipe or a scheduler
    if not shared.fmus:
        return task, None
    folder = ScratchFolder()
    components = []
    for i, (component, content) in enumerate(zip(task.system.components, shared.fmus, strict=True)):
        path = Path(folder.name, str(i), component.fmu.name)
        path.parent.mkdir()
        path.write_bytes(content)
        components.append(replace(component, fmu=path, native=None))
    return replace(task, system=replace(task.system, components=tuple(components))), folder


def _flat(name: str, value: Any) -> Iterator[tuple[str, Value | None]]:
    """Columns: lists as name[1], name[2], ..., tables as name.key."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _flat(f"{name}.{key}" if name else key, entry)
    elif isinstance(value, list | tuple):
        for i, entry in enumerate(value, 1):
            yield from _flat(f"{name}[{i}]", entry)
    else:
        yield name, value
