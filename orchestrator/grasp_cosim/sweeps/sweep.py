"""A whole sweep: the runs of its rows, those done before left out, and the table of all."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from pathlib import Path
from typing import Any, Literal

from ..base.checks import whole
from ..base.errors import InputError, SimulationError
from ..base.progress import Progress, phase
from ..base.scratch import ScratchFolder
from ..base.text import counted
from ..metrics.groups import chosen, metrics_of
from ..metrics.in_si import in_si
from ..metrics.metric import Function, Metric, available
from ..system.description import System, as_system
from .executors import on_executor, on_this_machine
from .finished_runs import identity_of, keep, opened
from .rows import Row, as_rows, in_own_units, labels_of, overrides_of, unit_of
from .run import Task
from .seeds import seeds_of_runs
from .signal_store import Recorded, Store, arrays, begin, recording, times
from .table import Outcome, Table, table_of


def sweep(
    system: System | str | Path,
    rows: Any,
    *,
    metrics: Sequence[Metric | Function | str] = (),
    signals: Sequence[str] | str = (),
    every: int = 1,
    seed: Literal["run"] | None = None,
    out: str | Path | None = None,
    workers: int | None = None,
    executor: Executor | None = None,
    native: bool | None = None,
    progress: bool = False,
) -> Table:
    """Run a system once for each row of a table, and return a table of rows and metrics.

    The table is the same to the bit whatever runs it; a run that fails is an error in its row.

    Args:
        system: The system, or the path of a system file, .toml or .ssp.
        rows: Mappings of places, as System.with_settings() has them, to values; or columns by
            place, where a single value is that of each row; or a data frame; or the path of a
            table. A number is in the unit of its variable. The head of a column may name another
            one, "plant.object_width [mm]", and so may a value, (50, "mm"): the result has all in
            that of the variable. The index of a pandas DataFrame is that of the result's
            to_pandas().
        metrics: Metrics to be worked out in addition to those of the system: see simulate().
        signals: Signals to be kept of each run, named as for System.with_record(): to_xarray() of
            the result has them over run, time and finger. Each run writes its own to disk, into the
            Zarr store next to `out`, which ends in .zarr, else into a temporary folder.
        every: Every how many communication points of the signals are kept.
        seed: "run" gives all that is random another seed in each run, see seeds.py, so that rows
            may be alike: [{}] * 100. None leaves the seeds as they are.
        out: The file of the table, .csv or .parquet. Until all are done, finished runs are kept
            next to it, and the same call goes on.
        workers: How many runs at a time, by default one for each processor: in threads where the
            FMUs are native and made here and the runs few, else in processes. A script needs no
            guard for these, and what it defines goes there: see as_bytes().
        executor: An executor of concurrent.futures that does the runs instead, and gets the FMUs.
        native: Which FMUs run: see System.natively().
        progress: True shows on standard error how far the sweep is.

    Returns:
        The table, a row for each run in their order.

    Raises:
        InputError: The rows do not fit the system, nothing would be measured, a metric cannot go to
            another process, or `out` has runs of something else.
        SimulationError: Processes do not start, or a run cannot be kept.
        KeyboardInterrupt: Ctrl-C.

    Example:
        >>> from grasp_cosim import grasp_system, sweep
        >>> system = grasp_system().with_experiment(step=1e-3, stop=3.0)
        >>> rows = [{"plant.object_width": width} for width in (0.05, 0.07)]
        >>> table = sweep(system, rows)
        >>> [round(float(force), 2) for force in table["steady_contact_force[1]"]]
        [2.09, 3.39]
    """
    system = as_system(system, "sweep").untriggered()
    for component in system.components:
        if component.trace:
            raise InputError(
                f"sweep: components.{component.name}.trace: is a file of one run; must be left out"
            )
    place = f"--table {rows}" if isinstance(rows, str | Path) else "sweep"
    bare_rows = in_own_units(system, as_rows(rows, alike=seed is not None), place)
    whole("every", every, 1, must="a whole number, at least 1")
    if workers is not None and (workers < 1 or executor):
        raise InputError(f"workers = {workers}: must be at least 1, and without an executor")
    user_metrics, all_metrics, measured = _metrics(system, metrics, needed=not signals)
    places = dict.fromkeys(place for row in bare_rows for place in row)
    units = {place: unit_of(system, place) for place in places}
    seeds = seeds_of_runs(system, bare_rows, seed)
    file = Path(out) if out is not None else None
    coordinates = [{**row, **of_run} for row, of_run in zip(bare_rows, seeds, strict=True)]
    recorded = _recorded(system, signals, every, coordinates, measured, file) if signals else None
    if signals:
        system, _ = recording(system, signals)
    task = Task(system.natively(native), user_metrics, recorded.store if recorded else None)
    overrides = overrides_of(task.system, bare_rows)
    jobs = [*enumerate({**row, **of_run} for row, of_run in zip(overrides, seeds, strict=True))]
    done: dict[int, Outcome] = {}
    identity = identity_of(task, [row for _, row in jobs], all_metrics) if file else {}
    with opened(file, identity, done) if file else nullcontext() as lines:
        if recorded and file:
            begin(recorded, coordinates, identity, goes_on=bool(done))
            done = {i: o for i, o in done.items() if o.error or recorded.store.has(i)}
        remaining = [job for job in jobs if job[0] not in done]
        if executor:
            results = on_executor(executor, task, remaining)
        else:
            results = on_this_machine(task, remaining, workers)
        bar = Progress("sweep", len(jobs), shown=progress, initial=len(done))
        with phase(f"sweep, {counted(len(remaining), 'run')}"), bar, closing(results):
            for outcome in results:
                _check_written(task.signals, outcome)
                if lines:
                    keep(lines, outcome)
                done[outcome.index] = outcome
                bar.update()
        outcomes = [done[i] for i, _ in jobs]
        table = table_of(bare_rows, outcomes, units, measured, labels_of(rows), seeds, recorded)
        if file:
            table.write(file)
    return table


def _metrics(
    system: System, requested: Sequence[Metric | Function | str], needed: bool
) -> tuple[tuple[Metric, ...], Sequence[Metric], Sequence[Metric]]:
    """The metrics of the user's own, all, and those of them that the system permits.

    InputError where some are `needed` and there are none.
    """
    observed = system.observed_names
    user_metrics = chosen(requested, system.metrics, observed, system.roles)
    all_metrics = metrics_of(system.metrics, user_metrics)
    in_si(system, all_metrics)
    measured, missing = available(all_metrics, observed, system.roles)
    if needed and not measured:
        reasons = f" ({'; '.join(missing)})" if missing else ""
        raise InputError(
            f"{system.name}: has no metric{reasons}; name a file of yours by --metrics"
        )
    return user_metrics, all_metrics, measured


def _check_written(signals: Store | None, outcome: Outcome) -> None:
    """SimulationError where the signals of a run that came to its end are not there."""
    if signals and outcome.error is None and not signals.has(outcome.index):
        raise SimulationError(
            f"{signals.folder}: the signals of run {outcome.index} were not written; with more "
            "space the same call goes on"
        )


def _recorded(
    system: System,
    signals: Sequence[str] | str,
    every: int,
    rows: Sequence[Row],
    metrics: Sequence[Metric],
    out: Path | None,
) -> Recorded:
    """What is kept of the signals, and where: next to the table, else in a temporary folder."""
    time = times(system, rows, every)
    observing, signal_names = recording(system, signals)
    coordinates = {place for row in rows for place in row}
    names = [name for name in signal_names if name not in coordinates]
    scratch = None
    if out:
        folder = out.with_suffix(".zarr")
    else:
        scratch = ScratchFolder()
        folder = Path(scratch.name)
    store = Store(folder, arrays(observing, names, metrics), len(time), every)
    return Recorded(store, time, scratch)
