"""One run of a study: what it needs, and what is kept of it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InputError, SimulationError
from ..interface.interface import Value
from ..master.simulation import simulate
from ..metrics.metric import Metric
from ..recording.result import UNITS
from ..system.description import System


@dataclass(frozen=True, slots=True)
class Task:
    """All that runs share: the system, the signals whose last value is kept, a user's metrics."""

    system: System
    outputs: tuple[str, ...]
    metrics: tuple[Metric, ...] = ()


@dataclass(frozen=True, slots=True)
class Job:
    """A run to do: its index, and the start values of variables."""

    index: int
    values: Mapping[str, Value]


@dataclass(frozen=True, slots=True)
class Outcome:
    """The outcome of a run: the metrics by column, or the error, one line."""

    index: int
    metrics: Mapping[str, Value | None]
    error: str | None = None


def run_job(task: Task, job: Job) -> Outcome:
    """Run a job; one that fails is an outcome, too. KeyboardInterrupt where it was interrupted."""
    try:
        result = simulate(task.system.with_values(job.values), metrics=task.metrics)
        if not result.complete:
            raise KeyboardInterrupt
        metrics = {name: m for name, m in result.metrics.items() if name not in UNITS}
        last = {name: result[name][-1:].tolist()[0] for name in task.outputs}
        return Outcome(job.index, dict(_flat("", {**metrics, **last})))
    except (InputError, SimulationError) as error:
        return Outcome(job.index, {}, str(error))


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
