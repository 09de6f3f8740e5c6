"""A run of a sweep: in this process, or in another one, to which the task travels with its FMUs."""

from __future__ import annotations

import hashlib
import pickle
import threading
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import NamedTuple

from ..base.checks import install_command
from ..base.errors import InputError, SimulationError
from ..base.parallel import deliver
from ..base.pickles import as_bytes
from ..base.scratch import ScratchFolder
from ..master.simulation import simulate
from ..metrics.groups import Group, register_group, script_groups
from ..metrics.metric import Metric
from ..recording.result import Result
from ..system.description import System
from .rows import Row
from .seeds import with_row
from .signal_store import Store
from .table import Outcome

Job = tuple[int, Row]
"""The number of a row, and the row in the units of its FMUs."""


@dataclass(frozen=True, slots=True)
class Task:
    """All that runs share: the system, a user's metrics, and where their signals are kept.

    `groups` are those of the system's metrics that a script registered: in another process they
    must be registered, too.
    """

    system: System
    metrics: tuple[Metric, ...] = ()
    signals: Store | None = None
    groups: Mapping[str, Group] = field(default_factory=dict)


def run_row(task: Task, index: int, row: Row, halt: threading.Event | None = None) -> Outcome:
    """Run a row; one that fails is an outcome, too. KeyboardInterrupt where it was interrupted.

    The outcome is delivered before the FMUs are ended, which may take the process along. Where its
    signals cannot be written, they are not there.
    """

    def finish(result: Result, error: SimulationError | None) -> None:
        if error is not None:
            deliver(Outcome(index, {}, str(error)))
        elif result.came_to_its_end:
            if task.signals:
                with suppress(OSError):
                    task.signals.write(index, task.signals.blocks(result))
            deliver(Outcome(index, result.measured.flat(), ended_at=result.ended_at))

    try:
        system = with_row(task.system, row)
        result = simulate(system, metrics=task.metrics, finish=finish, halt=halt)
        if halt and halt.is_set():
            raise KeyboardInterrupt
        return Outcome(index, result.measured.flat(), ended_at=result.ended_at)
    except (InputError, SimulationError) as error:
        return Outcome(index, {}, str(error))


class Packed(NamedTuple):
    """A task as bytes, which a process unpacks once, with what its FMUs hold for other machines."""

    key: str
    task: bytes
    fmus: tuple[bytes, ...] = ()


def packed(task: Task, with_fmus: bool) -> Packed:
    """The task as bytes, with the contents of its FMUs for another machine or without."""
    components = task.system.components if with_fmus else ()
    fmus = tuple(c.native.read_bytes() if c.native else c.content for c in components)
    try:
        content = as_bytes(replace(task, groups=script_groups(task.system.metrics)))
    except Exception as error:  # pickle has one for each reason
        raise InputError(
            f"{task.system.name}: cannot go to another process: {error}; must have Python code of "
            f"a module, or cloudpickle installed: {install_command('cloudpickle')}"
        ) from error
    return Packed(hashlib.sha256(b"".join((content, *fmus))).hexdigest(), content, fmus)


_unpacked: dict[str, tuple[Task, ScratchFolder | None]] = {}
"""What this process has unpacked, by key; the folders of FMUs go with it."""

_RUN_LOCK = threading.Lock()
"""All Python FMUs of a process share its modules, and a compiled loop keeps the others waiting."""


def run_packed(shared: Packed, job: Job) -> Outcome:
    """Do a run in this process."""
    with _RUN_LOCK:
        if shared.key not in _unpacked:
            _unpacked[shared.key] = _unpack(shared)
        return run_row(_unpacked[shared.key][0], *job)


def run_there(shared: Packed, job: Job) -> tuple[Outcome, dict[str, bytes]]:
    """Do a run in this process, on its own machine: its signals come along."""
    outcome = run_packed(shared, job)
    signals = _unpacked[shared.key][0].signals
    return outcome, signals.taken(job[0]) if signals else {}


def _unpack(shared: Packed) -> tuple[Task, ScratchFolder | None]:
    """The task, whose FMUs are in a folder of this process where their contents came along."""
    task: Task = pickle.loads(shared.task)  # noqa: S301 - by packed(), through a pipe or a scheduler
    for name, group in task.groups.items():
        register_group(name, group)
    if not shared.fmus:
        return task, None
    folder = ScratchFolder()
    components = []
    for i, (component, content) in enumerate(zip(task.system.components, shared.fmus, strict=True)):
        if component.code:
            components.append(component)
            continue
        path = Path(folder.name, str(i), component.fmu.name)
        path.parent.mkdir()
        path.write_bytes(content)
        twin = path if component.native else None
        components.append(replace(component, fmu=path, native=twin))
    system = replace(task.system, components=tuple(components))
    signals = replace(task.signals, folder=Path(folder.name, "signals")) if task.signals else None
    return replace(task, system=system, signals=signals), folder
