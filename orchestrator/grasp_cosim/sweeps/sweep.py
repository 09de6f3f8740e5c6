"""A whole sweep: the runs of its rows, those done before left out, and the table of all."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any

from ..base.errors import InputError
from ..base.progress import Progress, phase
from ..base.text import counted
from ..metrics.in_si import in_si
from ..metrics.metric import Function, Metric, available, chosen, metrics_of
from ..system.description import System
from .kept import identity_of, keep, opened
from .places import elsewhere, here
from .rows import as_rows, check_units, labels_of, read_rows, settings_of, unit_of
from .run import Task
from .table import Outcome, Table, made


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
    workers are so many runs at a time, by default one for each processor: in threads where the FMUs
    are native and made here and the runs few, else in processes. A script needs no guard for these,
    and what it defines goes there, see as_bytes(). An executor of concurrent.futures takes their
    place, and gets the FMUs. The table is the same to the bit in each case; a run that fails is an
    error in its row. native is as of System.natively().

    InputError where the rows do not fit the system, nothing would be measured, a metric cannot go
    to another process, or `out` has runs of something else; SimulationError where processes do not
    start or a run cannot be kept; KeyboardInterrupt at Ctrl-C.
    """
    if isinstance(rows, str | Path):
        rows = read_rows(Path(rows))
        check_units(system, rows)
    rows_in_si = as_rows(rows)
    if workers is not None and (workers < 1 or executor):
        raise InputError(f"workers = {workers}: must be at least 1, and without an executor")
    observed = system.shown
    own_metrics = chosen(metrics, system.metrics, observed, system.roles)
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
        results = elsewhere(executor, task, to_do) if executor else here(task, to_do, workers)
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
