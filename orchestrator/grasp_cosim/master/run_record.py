"""What one run keeps of its rows: the recorded signals, and what its metrics need of every step."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.checks import known
from ..exchange.bounds import Bounds
from ..exchange.dispatch import Dispatcher
from ..exchange.listener import Listener, Signal, Texts, Window
from ..exchange.trigger import check_every
from ..interface.units import Conversion
from ..metrics.groups import check_groups, chosen, metrics_of
from ..metrics.in_si import in_si
from ..metrics.metric import Function, Metric, Signals, measure, needed
from ..recording.memory import Columns, EveryRow, MemoryListener, WindowRows
from ..recording.proxies import of_proxies, proxy_figures, proxy_lines
from ..recording.recorded_run import OfEveryStep
from ..system.description import System
from ..system.parts import Port
from ..system.settings import run_settings, start_values
from ..system.times import in_seconds


class RunRecord:
    """Receives the rows of the master and keeps what the result of the run is made of.

    Every n-th row goes to the memory and to the listeners, of a triggered run those in its windows.
    Where the metrics need more than that, be it more signals or every row, a temporary file has
    what they need.
    """

    def __init__(
        self,
        system: System,
        metrics: Sequence[Metric | Function | str],
        every: int,
        in_real_time: bool,
    ) -> None:
        """Choose the metrics. InputError, before any FMU is loaded, where they cannot be had."""
        check_every(system, every)
        self._system, self.every = system, every
        self.metrics = chosen(metrics, system.metrics, system.observed_names, system.roles)
        """The metrics of this run in addition to those of the system."""
        self._all_metrics = metrics_of(system.metrics, self.metrics)
        self.group_notes = check_groups(system)
        """Lines for the log on groups of metrics of the system that are not available."""
        _check_limits(system, self._all_metrics)
        self._in_si = in_si(system, self._all_metrics)
        self.is_triggered = system.record.trigger is not None
        """True if only windows around a trigger are recorded."""
        self._memory = WindowRows() if self.is_triggered else MemoryListener(every, in_real_time)
        self._every_row: EveryRow | None = None
        signals = needed(self._all_metrics, system.observed_names, system.roles) | of_proxies(
            system.observed_names
        )
        is_thinned = every > 1 or (self.is_triggered and (self._all_metrics or signals))
        if is_thinned or not signals <= system.recorded_names:
            self._every_row = EveryRow(signals)

    def begin(
        self,
        slots: Mapping[Port, int],
        texts: Mapping[Port, Texts],
        bounds: Bounds,
        listeners: Sequence[Listener],
    ) -> None:
        """Begin the listeners; slots, texts and bounds are those of the master."""
        receivers = (self._memory, *listeners)
        self.dispatcher = Dispatcher(
            self._system, slots, receivers, self.every, texts, self._every_row, bounds
        )
        self._at_start = self.saved()

    def receive(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Take rows of all values of the master, and the numbers of their steps."""
        self.dispatcher(steps, rows)

    def saved(self) -> list[Any]:
        """What was recorded until now, for restore()."""
        saved: list[Any] = [self.dispatcher.saved(), self._memory.saved()]
        if self._every_row:
            saved.append(self._every_row.saved())
        return saved

    def restore(self, saved: Sequence[Any]) -> None:
        """Go back to what was saved."""
        self.dispatcher.restore(saved[0])
        self._memory.restore(saved[1])
        if self._every_row:
            self._every_row.restore(saved[2])

    def has_metrics(self, metrics: Sequence[Metric | Function | str]) -> bool:
        """Return True if a record with these metrics in addition would have the same ones."""
        system = self._system
        more = chosen(metrics, system.metrics, system.observed_names, system.roles)
        all_metrics = metrics_of(system.metrics, more)
        return len(all_metrics) == len(self._all_metrics) and all(
            new is old for new, old in zip(all_metrics, self._all_metrics, strict=True)
        )

    def restart(self) -> None:
        """Go back to before the first row."""
        self.restore(self._at_start)

    def start_over(self) -> None:
        """As restart(), where no saved state needs the rows."""
        dispatcher, _, *every_row = self._at_start
        self.dispatcher.restore(dispatcher)
        self._memory.start_over()
        if self._every_row:
            self._every_row.restore(*every_row)

    def take_start_values(self, system: System) -> None:
        """Describe the run by the same system with other start values from now on."""
        self._system = system
        self.dispatcher.settings = run_settings(system)
        self.group_notes = check_groups(system)

    @property
    def settings(self) -> Mapping[str, Any]:
        """The settings of the run, as its result has them."""
        return self.dispatcher.settings

    @property
    def signals(self) -> Sequence[Signal]:
        """The signals that are recorded."""
        return self.dispatcher.signals

    @property
    def unit_notes(self) -> tuple[str, ...]:
        """Lines for the log on signals without a unit, which the metrics take to be in SI."""
        return self._in_si.notes

    def columns(self) -> Columns:
        """Time in s and the columns of the recorded signals by name, until now."""
        return self._memory.columns(self.dispatcher.pending)

    def windows(self, count: int) -> list[tuple[Window, slice]]:
        """The windows of a triggered run until now, and where their rows are in so many."""
        return self._memory.windows(count) if isinstance(self._memory, WindowRows) else []

    def conversions(self) -> dict[str, Conversion]:
        """How those of the recorded signals that are not in SI are converted, by name."""
        names = {signal.name for signal in self.signals}
        return {name: c for name, c in self._in_si.conversions.items() if name in names}

    def figures_of_every_row(self) -> OfEveryStep | None:
        """What is worked out of every row, where fewer rows or signals are recorded."""
        if self._every_row is None:
            return None
        if self._every_row.lost:
            return OfEveryStep.without(*self.columns()) if self.is_triggered else None
        time, columns = self._every_row.columns()
        system = self._system
        conversions = self._in_si.conversions
        signals = Signals(time, columns, system.roles, conversions, start_values(system))
        return OfEveryStep(measure(signals, self._all_metrics), proxy_figures(time, columns))

    def proxy_log(self) -> list[str]:
        """Lines for the log on the proxies of the run."""
        if not of_proxies(self._system.observed):
            return []
        if self._every_row and not self._every_row.lost:
            time, columns = self._every_row.columns()
        else:
            time, columns = self._memory.columns()
        return proxy_lines(time, columns, in_seconds(self._system.step_ns))

    def loss_log(self) -> list[str]:
        """A line for the log where the rows for the metrics, or those of windows, are not kept."""
        lines = []
        if self._every_row and self._every_row.lost:
            outcome = "are not there" if self.is_triggered else "are of the rows that were recorded"
            lines.append(f"{self._every_row.lost}: the metrics {outcome}")
        if isinstance(self._memory, WindowRows) and self._memory.lost:
            lines.append(f"{self._memory.lost}: the result has no rows; those of --out are whole")
        return lines

    def trigger_log(self) -> list[str]:
        """A line for the log on a trigger that never came true."""
        trigger = self.dispatcher.trigger
        return [*trigger.absence] if trigger else []


def _check_limits(system: System, metrics: Sequence[Metric]) -> None:
    """InputError at the first limit of [verdict.metrics] for a metric that there is not."""
    sized = [m.of(system.observed_names, system.roles) for m in metrics]
    names = [name for m in sized for name in dict.fromkeys((m.name, *m.columns))]
    for limit in system.verdict.metrics:
        known(f"{system.name}: verdict.metrics: no metric", limit.name, names)
