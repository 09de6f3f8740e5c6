"""A whole sweep: the runs of its rows, those done before left out, and the table of all.

A run is done here, in another process, or on another machine, to which the FMUs travel. Those that
are done are kept beside the table until all are: a line of JSON each.
"""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import threading
from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import closing, contextmanager, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from io import FileIO
from itertools import islice
from pathlib import Path
from typing import Any

from ..base.checks import extra_module
from ..base.errors import InputError, SimulationError
from ..base.parallel import Crew, Lost
from ..base.progress import Progress, phase
from ..base.scratch import SUFFIX, Lock, ScratchFolder
from ..base.text import counted
from ..master.simulation import simulate
from ..metrics.in_si import in_si
from ..metrics.metric import Function, Metric, available, check_portable, chosen, metrics_of
from ..recording.result import UNITS
from ..system.description import System
from ..system.settings import settings
from .rows import Row, as_rows, settings_of, unit_of
from .table import Outcome, Table, check_format, made

AHEAD = 100
"""Runs that an executor is given before others have ended."""

KILLED = "KilledWorker"
"""The name of Dask's error where a run ended its worker, several times; the others go on."""

CONNECT = 10.0
"""s, to find the scheduler and a worker of a cluster."""

Outcomes = Generator[Outcome, None, None]


def sweep(
    system: System,
    rows: Any,
    *,
    metrics: Sequence[Metric | Function | str] = (),
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    native: bool | None = None,
    progress: bool = False,
) -> Table:
    """Run the system once for each row, and return a table of rows and metrics.

    rows are mappings of places in the system file, as with_settings() has them, to values in SI
    units; or columns by place, a pandas DataFrame, or the path of a CSV file. metrics are worked
    out beside those of the system. With `out`, the path of a .csv or .parquet file, the table is
    written there; until all are done, finished runs are kept in a file beside it, and the same call
    goes on where it was ended. workers are processes here, by default as many as there are
    processors; an executor of concurrent.futures takes their place, and that of a Dask client gets
    the FMUs along. native is as of System.natively(). The table is the same to the bit in each
    case; a run that fails is an error in its row. progress shows how far it is on standard error.

    InputError where the rows do not fit the system, nothing would be measured, or `out` has runs of
    something else; SimulationError where processes do not start or a run cannot be kept;
    KeyboardInterrupt at Ctrl-C.
    """
    found = as_rows(rows)
    if workers is not None and (workers < 1 or executor):
        raise InputError(f"workers = {workers}: must be at least 1, and without an executor")
    recorded = {str(port) for port in system.recorded}
    own = chosen(metrics, system.metrics, recorded, system.roles)
    asked = _measured(system, own, recorded)
    units = {p: unit_of(system, p) for p in dict.fromkeys(p for row in found for p in row)}
    task = Task(system.natively(native), own)
    given = settings_of(task.system, found)
    file = Path(out) if out is not None else None
    if file:
        check_format(file)
    kept = opened(_beside(file), _identity(task, given)) if file else nullcontext()
    with kept as store:
        done: dict[int, Outcome] = dict(store.done) if store else {}
        left = [(i, row) for i, row in enumerate(given) if i not in done]
        results = _elsewhere(executor, task, left) if executor else _here(task, left, workers)
        bar = Progress("sweep", len(found), shown=progress, initial=len(done))
        with phase(f"sweep, {counted(len(left), 'run')}"), bar, closing(results):
            for outcome in results:
                done[outcome.index] = outcome
                if store:
                    store.keep(outcome)
                bar.update()
        table = made(found, [done[i] for i in range(len(found))], units, asked)
        if file and store:
            table.write(file)
            store.remove()
    return table


def _measured(system: System, own: tuple[Metric, ...], recorded: set[str]) -> list[Metric]:
    """The metrics that the system permits; InputError if there is none, or a unit is wrong."""
    check_portable(own)
    asked = metrics_of(system.metrics, own)
    in_si(system, asked)
    there, missing = available(asked, recorded, system.roles)
    if not there:
        because = f" ({'; '.join(missing)})" if missing else ""
        raise InputError(
            f"{system.name}: has no metric{because}; name a file of yours by --metrics"
        )
    return there


# ------------------------------------------------------------------------- a run


@dataclass(frozen=True, slots=True)
class Task:
    """All that runs share: the system and a user's metrics."""

    system: System
    metrics: tuple[Metric, ...] = ()


def run_row(task: Task, index: int, row: Row) -> Outcome:
    """Run a row; one that fails is an outcome, too. KeyboardInterrupt where it was interrupted."""
    try:
        result = simulate(task.system.with_settings(row, "sweep: {}".format), metrics=task.metrics)
    except (InputError, SimulationError) as error:
        return Outcome(index, {}, str(error))
    if not result.complete:
        raise KeyboardInterrupt
    metrics = {name: m for name, m in result.metrics.items() if name not in UNITS}
    return Outcome(index, dict(_flat("", metrics)))


def _flat(name: str, value: Any) -> Iterator[tuple[str, Any]]:
    """Columns: lists as name[1], name[2], ..., tables as name.key."""
    if isinstance(value, Mapping):
        for key, entry in value.items():
            yield from _flat(f"{name}.{key}" if name else key, entry)
    elif isinstance(value, list | tuple):
        for i, entry in enumerate(value, 1):
            yield from _flat(f"{name}[{i}]", entry)
    else:
        yield name, value


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
    return Packed(_hash_of([content, *fmus]), content, fmus)


def _hash_of(contents: Iterable[bytes]) -> str:
    """A hash of the contents of files, in their order."""
    digest = hashlib.sha256()
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()


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


# ------------------------------------------------------------------------- where runs are done


def _here(task: Task, jobs: Sequence[tuple[int, Row]], workers: int | None) -> Outcomes:
    """The outcomes of processes of this machine, in the order in which they end."""
    shared, count = packed(task, with_fmus=False), min(workers or os.cpu_count() or 1, len(jobs))
    ones = ({i: row} for i, row in jobs)
    with Crew(count) as crew, closing(crew.results(partial(run_packed, shared), ones)) as results:
        for (index, *_), found in results:
            if isinstance(found, Lost):
                yield Outcome(index, {}, f"the process of the run {found.end}")
            else:
                yield from found


def _same(shared: Any) -> Any:
    return shared


def _elsewhere(executor: Executor, task: Task, jobs: Sequence[tuple[int, Row]]) -> Outcomes:
    """The outcomes of an executor, in the order in which they end; closing it cancels the rest."""
    left = iter(jobs)
    shared: Any = packed(task, with_fmus=True)
    if client := getattr(executor, "_client", None):  # Dask: it goes to each worker once,
        shared = client.submit(_same, shared, pure=False)  # and again if the one that has it dies
    pending: dict[Future[list[Outcome]], int] = {}

    def submit(count: int) -> None:
        for index, row in islice(left, count):
            pending[executor.submit(run_packed, shared, {index: row})] = index

    try:
        submit(AHEAD)
        while pending:
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                index, failure = pending.pop(future), future.exception()
                if failure is None:
                    yield from future.result()
                elif type(failure).__name__ == KILLED:
                    yield Outcome(index, {}, "the worker of the run died, several times")
                else:
                    raise SimulationError(f"sweep: run {index}: {_said(failure)}") from failure
                submit(1)
    finally:
        for future in pending:
            future.cancel()


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of the Dask cluster whose scheduler is at an address like tcp://host:8786.

    InputError without the extra `dask`, a scheduler or a worker.
    """
    dask = extra_module("distributed", "it talks to Dask clusters", "dask")
    try:
        client = dask.Client(address, timeout=CONNECT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"--scheduler {address}: {_said(error)}; must be one that runs") from error
    with client:
        try:
            client.wait_for_workers(1, timeout=CONNECT)
        except TimeoutError as error:
            raise InputError(f"--scheduler {address}: no worker; must have at least one") from error
        executor: Executor = client.get_executor(pure=False)
        yield executor


def _said(error: BaseException) -> str:
    """The first line of an error, or its name where it has none."""
    return (str(error).splitlines() or [type(error).__name__])[0]


# ------------------------------------------------------------------------- what is kept


@dataclass
class Store:
    """The file of the runs that are done, open and locked; `done` are their outcomes by index."""

    path: Path
    file: FileIO
    done: dict[int, Outcome]

    def keep(self, outcome: Outcome) -> None:
        """Keep the outcome of a run from now on; SimulationError where that fails."""
        try:
            self.file.write(json.dumps(asdict(outcome)).encode() + b"\n")
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


def _identity(task: Task, rows: Sequence[Row]) -> str:
    """A hash of all that decides the results."""
    system = settings(task.system)
    del system["system"]
    for component in system["components"].values():
        del component["fmu"]
    metrics = [m.origin or m.name for m in task.metrics]
    decisive = {"system": system, "rows": rows, "metrics": metrics}
    contents = [c.fmu.read_bytes() for c in task.system.components]
    return _hash_of([json.dumps(decisive, sort_keys=True).encode(), *contents])


def kept_runs(out: Path) -> int:
    """The number of runs that are kept of a sweep that was ended before all were done."""
    path = _beside(out)
    return max(path.read_bytes().count(b"\n") - 1, 0) if path.exists() else 0


def _beside(table: Path) -> Path:
    return table.with_name(f"{table.name}.rows")
