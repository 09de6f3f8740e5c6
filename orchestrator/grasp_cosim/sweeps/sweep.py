"""A whole sweep: the runs of its rows, those done before left out, and the table of all.

A run is done here, in another process, or on another machine, to which the FMUs travel. Those that
are done are kept beside the table until all are: a line of JSON each.
"""

from __future__ import annotations

import errno
import hashlib
import json
import os
import pickle
import threading
from collections.abc import Generator, Iterator, Mapping, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import closing, contextmanager, nullcontext
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from io import FileIO
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

from ..base.checks import extra_module
from ..base.errors import InputError, SimulationError, choices
from ..base.files import make_folder
from ..base.identity import parts_of
from ..base.parallel import Crew, Lost, deliver
from ..base.progress import Progress, phase
from ..base.scratch import SUFFIX, Lock, ScratchFolder
from ..base.text import counted
from ..master.simulation import simulate
from ..metrics.in_si import in_si
from ..metrics.metric import Function, Metric, available, check_portable, chosen, metrics_of
from ..recording.memory import writing
from ..recording.result import Result
from ..system.description import System
from ..system.settings import settings
from .rows import Row, as_rows, check_units, labels_of, read_rows, settings_of, unit_of
from .table import Outcome, Table, check_format, made

AHEAD = 100
"""Runs that an executor is given before others have ended."""

KILLED = "KilledWorker"
"""The name of Dask's error where a run ended its worker, several times; the others go on."""

FEW = 3
"""Things in which runs differ that are named at most."""

CONNECT = 10.0
"""s, to find the scheduler and a worker of a cluster."""

Job = tuple[int, Row]
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

    rows are mappings of places, as with_settings() has them, to values in SI units; or columns by
    place, where a single value is that of each row; or a data frame, as of as_rows(); or the path
    of a table. The index of a pandas DataFrame is that of the table's to_pandas().

    metrics are worked out beside those of the system. The table is written to `out`, a .csv or
    .parquet file; until all are done, finished runs are kept beside it, and the same call goes on.
    workers are processes here, by default one for each processor; an executor of concurrent.futures
    takes their place, and gets the FMUs. The table is the same to the bit in each case; a run that
    fails is an error in its row. native is as of System.natively().

    InputError where the rows do not fit the system, nothing would be measured, or `out` has runs of
    something else; SimulationError where processes do not start or a run cannot be kept;
    KeyboardInterrupt at Ctrl-C.
    """
    if isinstance(rows, str | Path):
        rows = read_rows(Path(rows))
        check_units(system, rows)
    rows_in_si = as_rows(rows)
    if workers is not None and (workers < 1 or executor):
        raise InputError(f"workers = {workers}: must be at least 1, and without an executor")
    observed = system.shown
    own_metrics = chosen(metrics, system.metrics, observed, system.roles)
    check_portable(own_metrics)
    all_metrics = metrics_of(system.metrics, own_metrics)
    in_si(system, all_metrics)
    measured, missing = available(all_metrics, observed, system.roles)
    if not measured:
        because = f" ({'; '.join(missing)})" if missing else ""
        raise InputError(
            f"{system.name}: has no metric{because}; name a file of yours by --metrics"
        )
    units = {p: unit_of(system, p) for p in dict.fromkeys(p for row in rows_in_si for p in row)}
    task = Task(system.natively(native), own_metrics)
    settings_of_runs = settings_of(task.system, rows_in_si)
    file = Path(out) if out is not None else None
    done: dict[int, Outcome] = {}
    identity = identity_of(task, settings_of_runs, all_metrics) if file else {}
    with opened(file, identity, done) if file else nullcontext() as store:
        to_do = [(i, row) for i, row in enumerate(settings_of_runs) if i not in done]
        results = _elsewhere(executor, task, to_do) if executor else _here(task, to_do, workers)
        bar = Progress("sweep", len(rows_in_si), shown=progress, initial=len(done))
        with phase(f"sweep, {counted(len(to_do), 'run')}"), bar, closing(results):
            for outcome in results:
                if store:
                    keep(store, outcome)
                done[outcome.index] = outcome
                bar.update()
        outcomes = [done[i] for i in range(len(rows_in_si))]
        table = made(rows_in_si, outcomes, units, measured, labels_of(rows))
        if file:
            table.write(file)
    return table


# ------------------------------------------------------------------------- a run


@dataclass(frozen=True, slots=True)
class Task:
    """All that runs share: the system and a user's metrics."""

    system: System
    metrics: tuple[Metric, ...] = ()


def run_row(task: Task, index: int, row: Row) -> Outcome:
    """Run a row; one that fails is an outcome, too. KeyboardInterrupt where it was interrupted.

    The outcome is delivered before the FMUs are ended, which may take the process along.
    """

    def finish(result: Result, error: SimulationError | None) -> None:
        if error is not None:
            deliver(Outcome(index, {}, str(error)))
        elif result.came_to_its_end:
            deliver(Outcome(index, result.measured.flat(), ended_at=result.ended_at))

    try:
        system = task.system.with_settings(row, "sweep: {}".format)
        result = simulate(system, metrics=task.metrics, finish=finish)
        if not result.came_to_its_end:
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
    fmus = tuple((c.native or c.fmu).read_bytes() for c in components)
    content = pickle.dumps(task)
    return Packed(_hash_of(content, *fmus), content, fmus)


def _hash_of(*contents: bytes) -> str:
    return hashlib.sha256(b"".join(contents)).hexdigest()


_unpacked: dict[str, tuple[Task, ScratchFolder | None]] = {}
"""What this process has unpacked, by key; the folders of FMUs go with it."""

_one_at_a_time = threading.Lock()
"""All Python FMUs of a process share its modules, and a compiled loop keeps the others waiting."""


def run_packed(shared: Packed, job: Job) -> Outcome:
    """Do a run in this process."""
    with _one_at_a_time:
        if shared.key not in _unpacked:
            _unpacked[shared.key] = _unpack(shared)
        return run_row(_unpacked[shared.key][0], *job)


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


def _here(task: Task, jobs: Sequence[Job], workers: int | None) -> Outcomes:
    """The outcomes of processes of this machine, in the order in which they end."""
    run, count = (
        partial(run_packed, packed(task, with_fmus=False)),
        min(workers or os.cpu_count() or 1, len(jobs)),
    )
    with Crew(count) as crew, closing(crew.results(run, jobs)) as results:
        for (index, _), found in results:
            if isinstance(found, Lost):
                yield Outcome(index, {}, f"the process of the run {found.end}")
            else:
                yield found


def _elsewhere(executor: Executor, task: Task, jobs: Sequence[Job]) -> Outcomes:
    """The outcomes of an executor, in the order in which they end; closing it cancels the rest."""
    left = iter(jobs)
    shared: Any = packed(task, with_fmus=True)
    if client := getattr(executor, "_client", None):
        # Dask: it goes to each worker once, and again if the one that has it dies
        shared = client.submit(Packed._make, shared, pure=False)
    pending: dict[Future[Outcome], int] = {}
    try:
        while True:
            for job in islice(left, AHEAD - len(pending)):
                pending[executor.submit(run_packed, shared, job)] = job[0]
            if not pending:
                break
            for future in wait(pending, return_when=FIRST_COMPLETED).done:
                index, failure = pending.pop(future), future.exception()
                if failure is None:
                    yield future.result()
                elif type(failure).__name__ == KILLED:
                    yield Outcome(index, {}, "the worker of the run died, several times")
                else:
                    raise SimulationError(f"sweep: run {index}: {_said(failure)}") from failure
    finally:
        for future in pending:
            future.cancel()


@contextmanager
def cluster(address: str) -> Iterator[Executor]:
    """The executor of the Dask cluster whose scheduler is at an address like tcp://host:8786."""
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


def keep(file: FileIO, outcome: Outcome) -> None:
    """Keep the outcome of a run from now on; SimulationError where that fails."""
    try:
        write_line(file, as_line(asdict(outcome)))
    except OSError as error:
        said = f"{file.name!r}: {error.strerror}"
        raise SimulationError(f"{said}; with room for it the same command goes on") from error


def as_line(content: Any) -> bytes:
    """A line of JSON."""
    return json.dumps(content).encode() + b"\n"


def write_line(file: FileIO, line: bytes) -> None:
    """Write a line at the end of a file; OSError where there is no room for all of it."""
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
        said = f"{path}: another process does runs of it"
        raise InputError(f"{said}; wait for its end, or name another --out")
    try:
        with closing(FileIO(path, "a")) as file:
            first, *lines = path.read_bytes().splitlines(keepends=True) or [b""]
            head = as_line({"runs of": identity})
            if not first.endswith(b"\n"):
                with writing(path, InputError):
                    file.truncate(0)
                    write_line(file, head)
            elif first != head:
                raise InputError(
                    f"{path}: has runs that differ in {_difference(first, identity)}; remove it, "
                    "or name another --out"
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
    try:
        outcome = Outcome(**json.loads(line))
        whole = isinstance(outcome.index, int) and isinstance(outcome.metrics, dict)
    except (ValueError, TypeError):
        whole = False
    if not whole:
        raise InputError(
            f"{path}: line {number} is damaged; remove the file, or name another --out"
        )
    return outcome


def _difference(first: bytes, identity: Mapping[str, str]) -> str:
    """What the runs that the first line of a file tells of differ in."""
    try:
        was = dict(json.loads(first)["runs of"])
    except (ValueError, TypeError, KeyError):
        was = {}
    names = [n for n in {**identity, **was} if was.get(n) != identity.get(n)]
    return choices(names, FEW) if was else "all that is known of them"


def identity_of(task: Task, rows: Sequence[Row], metrics: Sequence[Metric]) -> dict[str, str]:
    """A hash of each thing that decides the results, by what it is called in a message."""
    decisive = {"the rows": rows, "the version of grasp-cosim": version("grasp-cosim")}
    decisive |= {f"the system's {key}": value for key, value in settings(task.system).items()}
    fmus = {f"the FMU of {c.name}": c.fmu.read_bytes() for c in task.system.components}
    return {
        **{name: _hash_of(json.dumps(v, sort_keys=True).encode()) for name, v in decisive.items()},
        **{name: _hash_of(content) for name, content in fmus.items()},
        **{
            f"metric {m.name!r}, its {part}": found
            for m in metrics
            for part, found in parts_of(m.function).items()
        },
    }
