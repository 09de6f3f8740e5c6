"""A whole sweep: the runs of its rows, those done before left out, and the table of all."""

from __future__ import annotations

import json
import os
from collections.abc import Generator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, wait
from contextlib import closing, nullcontext
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any

from ..base.errors import InputError, SimulationError
from ..base.numerals import counted
from ..base.parallel import Crew, Lost
from ..base.progress import Progress, phase
from ..metrics.in_si import in_si
from ..metrics.metric import Function, Metric, available, check_portable, chosen, metrics_of
from ..system.description import System
from ..system.settings import settings
from .cluster import said
from .rows import Row, as_rows, settings_of, unit_of
from .run import Outcome, Task, hash_of, packed, run_packed
from .store import opened
from .table import Table, check_format, made

AHEAD = 100
"""Runs that an executor is given before others have ended."""

KILLED = "KilledWorker"
"""The name of Dask's error where a run ended its worker, several times; the others go on."""

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


def kept_runs(out: Path) -> int:
    """The number of runs that are kept of a sweep that was ended before all were done."""
    path = _beside(out)
    return max(path.read_bytes().count(b"\n") - 1, 0) if path.exists() else 0


def _beside(table: Path) -> Path:
    return table.with_name(f"{table.name}.rows")


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


def _identity(task: Task, rows: Sequence[Row]) -> str:
    """A hash of all that decides the results."""
    system = settings(task.system)
    del system["system"]
    for component in system["components"].values():
        del component["fmu"]
    decisive = {
        "system": system,
        "rows": rows,
        "metrics": [m.origin or m.name for m in task.metrics],
    }
    contents = [c.fmu.read_bytes() for c in task.system.components]
    return hash_of([json.dumps(decisive, sort_keys=True).encode(), *contents])


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
                    raise SimulationError(f"sweep: run {index}: {said(failure)}") from failure
                submit(1)
    finally:
        for future in pending:
            future.cancel()
