"""A whole study: its runs, those done before left out, and what they come to."""

import json
import os
from collections.abc import Generator, Iterable
from contextlib import closing
from dataclasses import asdict, dataclass
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..files import remove_parts, write_text
from ..parallel import Crew, Lost
from ..progress import Progress, phase
from .cluster import run_on_cluster
from .run import Job, Outcome, Task, run_job
from .sensitivity import Sensitivity, sensitivity
from .store import Store
from .study import Study
from .table import Table, check_parquet, make_table, write_parquet

RUNS = "runs.parquet"
SENSITIVITY = "sensitivity.json"


@dataclass(frozen=True)
class Sweep:
    """A study that is done. resumed is how many of its runs were there before."""

    study: Study
    folder: Path
    outcomes: tuple[Outcome, ...]
    resumed: int

    @cached_property
    def table(self) -> Table:
        """A row per run."""
        return make_table(self.study, self.outcomes)

    def numbers(self, column: str) -> npt.NDArray[np.float64]:
        """A column of the table as numbers, NaN throughout where no run came to have it."""
        if column in self.table.columns:
            return self.table.numbers(column)
        return np.full(len(self.outcomes), np.nan)

    @property
    def failed(self) -> int:
        """The number of runs with an error."""
        return sum(outcome.error is not None for outcome in self.outcomes)

    @cached_property
    def sensitivities(self) -> tuple[Sensitivity, ...]:
        """The indices of each metric that varies, in a saltelli design; of any other none."""
        if self.study.design.kind != "saltelli":
            return ()
        names = [p.name for p in self.study.parameters]
        found = (
            sensitivity(name, names, self.table.numbers(name), self.study.design.seed)
            for name in self.table.metrics
        )
        return tuple(s for s in found if s is not None)

    def as_json(self) -> dict[str, Any]:
        """The summary as plain values for JSON."""
        return {
            "study": self.study.name,
            "design": self.study.design.kind,
            "folder": str(self.folder),
            "runs": len(self.outcomes),
            "resumed": self.resumed,
            "failed": self.failed,
            "first_error": next((o.error for o in self.outcomes if o.error is not None), None),
            "metrics": self.table.summary(),
            "units": {n: self.study.unit(n) for n in self.table.metrics},
            "sensitivity": [asdict(s) for s in self.sensitivities],
        }


def sweep(
    study: Study,
    folder: Path,
    workers: int | None = None,
    scheduler: str | None = None,
    progress: bool = False,
) -> Sweep:
    """Do the runs of a study that its folder does not have yet, then write runs.parquet there.

    workers are processes on this machine, by default as many as it has processors; with scheduler,
    the address of a Dask cluster, the runs are done there. The results are the same to the bit.
    A finished run is in the folder at once: after a kill the same call goes on. progress shows
    on standard error how far it is.

    InputError where the folder has another study's runs, or another process is at it, or an extra
    is missing; SimulationError where workers do not start, the cluster fails or a run cannot be
    written; KeyboardInterrupt at Ctrl-C.
    """
    check_parquet()
    if workers is not None and workers < 1:
        raise InputError(f"workers = {workers}: must be at least 1")
    store = Store(folder)
    with store.locked():
        done = store.open(study)
        remove_parts(folder, RUNS, SENSITIVITY)
        resumed = len(done)
        left = [i for i in range(study.runs) if i not in done]
        jobs = (Job(i, study.values(i)) for i in left)
        task = Task(study.system, study.outputs, study.metrics)
        if scheduler is not None and left:
            results = run_on_cluster(scheduler, task, jobs)
        else:
            results = run_here(task, jobs, min(workers or os.cpu_count() or 1, len(left)))
        bar = Progress(study.name, study.runs, shown=progress, initial=resumed)
        with phase(f"{study.name}, {len(left)} runs"), bar, closing(results):
            for outcome in results:
                store.keep(outcome)
                done[outcome.index] = outcome
                bar.update()
        finished = Sweep(study, folder, tuple(done[i] for i in range(study.runs)), resumed)
        write_parquet(finished.table, study, folder / RUNS)
        if finished.sensitivities:
            found = [asdict(s) for s in finished.sensitivities]
            write_text(folder / SENSITIVITY, json.dumps(found, indent=2) + "\n")
        return finished


def run_here(task: Task, jobs: Iterable[Job], workers: int) -> Generator[Outcome, None, None]:
    """Yield the outcomes of the jobs, in the order in which they end, of processes of this machine.

    Closing the iterator ends the runs. SimulationError where a process cannot start.
    """
    with Crew(workers) as crew, closing(crew.results(partial(run_job, task), jobs)) as results:
        for job, found in results:
            if isinstance(found, Lost):
                found = Outcome(job.index, {}, f"the process of the run {found.end}")
            yield found
