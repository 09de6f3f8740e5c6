"""From the rows of the master's loop to the listeners: checked, extended, decimated."""

import os
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.errors import SimulationError
from ..base.system_calls import end_fork
from ..interface.units import IDENTITY
from ..system.connectors import taps
from ..system.description import System
from ..system.parts import Port
from ..system.settings import run_settings
from ..system.validity import transforms
from .divergence import Divergence, largest, to_open_ends
from .energy import ExchangeEnergy, bonds
from .inexact import InexactSignals
from .listener import Experiment, Floats, Leisurely, Listener, Signal, Steps, Texts

CONTINUE_ADVICE = 'or let it go on: diverging = "continue"'


class Dispatcher:
    """Takes rows of all values and hands every n-th one on, and the last.

    Listeners get the signals that are recorded, in the order of the system, then those that are
    worked out of every row. The outputs end the run where they run away or are not finite, recorded
    or not; any other signal is only recorded, as it is.
    """

    def __init__(
        self,
        system: System,
        slots: Mapping[Port, int],
        listeners: Sequence[Listener],
        every: int = 1,
        texts: Mapping[Port, Texts] = MappingProxyType({}),
        every_row: Listener | None = None,
    ) -> None:
        """Begin the listeners of a run.

        Args:
            system: The system that runs.
            slots: The columns of the rows, by output or connected input.
            listeners: Get the recorded rows.
            every: Every how many steps a row is recorded; the last one always is.
            texts: The tables of the texts of Strings, whose numbers are in the rows.
            every_row: Gets every row, of all signals that are observed.

        Raises:
            InputError: A listener cannot begin.
        """
        self._owner = os.getpid()
        self._listeners, self._every_row = tuple(listeners), every_row
        self._leisurely = [listener for listener in listeners if isinstance(listener, Leisurely)]
        self.listener_seconds = 0.0
        """The time in s that the listeners took for their blocks."""
        self._every = every
        self._columns = np.array([slots[port] for port in system.observed], np.intp)
        observed = {port: _signal(system, port, texts) for port in system.observed}
        watched = {port: observed[port] for port in system.watched}
        self._watched = _places(observed.values(), watched.values())
        self._watched_signals = tuple(watched.values())
        sources = {connection.source for connection in system.connections}
        self._unconnected = [port not in sources for port in watched]
        open_ended = to_open_ends(system)
        self._divergence = Divergence(system, watched, open_ended)
        self._inexact = InexactSignals(system, observed)
        self._goes_on = system.diverging == "continue"
        self._may_be_infinite = np.array([self._goes_on or port in open_ended for port in watched])
        self._runaways: list[str] = []
        self._taps = Taps(system, slots, texts)
        self._energy = ExchangeEnergy(system.once(bonds), slots, system.once(transforms))
        computed = (*self._taps.signals, *self._energy.signals)
        every_signal = (*observed.values(), *computed)
        recorded = [observed[port] for port in system.recorded]
        recorded += [signal for signal in computed if system.record.has(signal.name)]
        self.signals = tuple(recorded)
        self._recorded = _places(every_signal, self.signals)
        self._block = np.empty((len(every_signal), 0))
        self.pending: tuple[Steps, Floats] | None = None
        """The last row, where decimation has left it out so far."""
        self.settings = run_settings(system)
        experiment = Experiment.of(self.settings)
        with ExitStack() as ends:
            for listener in self._listeners:
                listener.begin(experiment, self.signals)
                ends.callback(listener.end, False)
            if every_row:
                every_row.begin(experiment, every_signal)
            ends.pop_all()  # a listener that has begun is ended here only where the next one fails

    @property
    def log(self) -> list[str]:
        """A line for each signal that ran away in a run that went on, or that is not as it was."""
        return [*self._runaways, *self._inexact.log]

    def __call__(self, steps: Steps, rows: Floats) -> None:
        """Hand rows on; SimulationError at the first value that is not finite or has run away.

        Its row is the last that is kept.
        """
        end_fork(self._owner)
        if len(rows) > self._block.shape[1]:
            self._block = np.empty((len(self._block), len(rows)))
        columns = self._block[:, : len(rows)].T  # each of them in one piece, which is fast
        observed = columns[:, : len(self._columns)]
        observed[:] = rows[:, self._columns]
        count, message = self._check(steps, _selected(observed, self._watched))
        self._inexact(steps[:count], observed[:count])
        steps, columns = steps[:count], columns[:count]
        first_tap = len(self._columns)
        first_energy = first_tap + len(self._taps.signals)
        columns[:, first_tap:first_energy] = self._taps(rows[:count])
        columns[:, first_energy:] = self._energy(rows[:count])
        if self._every_row:
            self._every_row.block(steps, columns)
        columns = _selected(columns, self._recorded)
        self.pending = None
        nth = slice(-int(steps[0]) % self._every, None, self._every)
        if len(steps[nth]):
            self._hand_on(steps[nth], columns[nth])
        if steps[-1] % self._every:
            self.pending = steps[-1:].copy(), columns[-1:].copy()
        if message:
            raise SimulationError(message)

    def saved(self) -> tuple[Any, ...]:
        """What the rows until now came to, for restore()."""
        checks = [*self._runaways], self._divergence.saved(), self._inexact.saved()
        return checks, self._energy.saved(), self.pending

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved; what the listeners got is their own concern."""
        (runaways, divergence, inexact), energy, self.pending = saved
        self._runaways = [*runaways]
        self._divergence.restore(divergence)
        self._inexact.restore(inexact)
        self._energy.restore(energy)

    def _check(self, steps: Steps, outputs: Floats) -> tuple[int, str]:
        """The number of rows to keep, and what is wrong in the last of them, if anything is."""
        valid_rows, sizes = len(steps), largest(outputs)
        if not np.isfinite(sizes).all():
            valid = np.isfinite(outputs) | (np.isinf(outputs) & self._may_be_infinite)
            if not valid.all():
                valid_rows = int(valid.all(axis=1).argmin())
                sizes = largest(outputs[:valid_rows])
        runaway = self._divergence(steps[:valid_rows], outputs[:valid_rows], sizes)
        if runaway:
            row, message = runaway
            if not self._goes_on:
                return row + 1, f"{message}; {CONTINUE_ADVICE}"
            self._runaways.append(f"{message}; the run went on")
        if valid_rows == len(steps):
            return valid_rows, ""
        column = int(valid[valid_rows].argmin())
        value = float(outputs[valid_rows, column])
        return valid_rows + 1, self._not_finite(column, int(steps[valid_rows]), value)

    def _not_finite(self, column: int, step: int, value: float) -> str:
        """The message on an output, by its column, that has no finite value at a step."""
        name = self._watched_signals[column].name
        message = f"{name} = {value} at step {step}: must be finite"
        if not np.isnan(value):
            message += f", {CONTINUE_ADVICE}"
        if self._unconnected[column]:
            message += f'; it goes to no input: --record "!{name}" leaves it out'
        return message

    def spare(self, ns: float) -> bool:
        """Give a listener that puts work off so many ns for it; False if none had any to do."""
        return any(listener.spare(ns) for listener in self._leisurely)

    def end(self, complete: bool) -> None:
        """Hand the last row on and end the listeners, each of them even where another fails."""
        end_fork(self._owner)
        with ExitStack() as stack:
            for listener in reversed(self._listeners):
                stack.callback(listener.end, complete)
            pending, self.pending = self.pending, None
            if pending is not None:
                self._hand_on(*pending)

    def _hand_on(self, steps: Steps, rows: Floats) -> None:
        start = time.perf_counter()
        for listener in self._listeners:
            listener.block(steps, rows)
        self.listener_seconds += time.perf_counter() - start


def _signal(system: System, port: Port, texts: Mapping[Port, Texts]) -> Signal:
    """The signal of an output or input that is observed."""
    variable = system.observed[port]
    return Signal(
        str(port),
        variable.unit,
        variable.kind,
        variable.description or "",
        texts.get(port, Texts()),
        wide=variable.type == "UInt64",
    )


class Taps:
    """The outputs of the system itself, from rows of all values."""

    def __init__(
        self, system: System, slots: Mapping[Port, int], texts: Mapping[Port, Texts]
    ) -> None:
        """Slots are the columns of the rows, texts those of Strings."""
        by_name = system.once(taps)
        self.signals = tuple(
            Signal(name, tap.unit, tap.kind, tap.description, texts.get(tap.source, Texts()))
            for name, tap in by_name.items()
        )
        self._columns = np.array([slots[tap.source] for tap in by_name.values()], np.intp)
        changes = [tap.change for tap in by_name.values()]
        self._changes = [(i, change) for i, change in enumerate(changes) if change != IDENTITY]

    def __call__(self, rows: Floats) -> Floats:
        """The outputs in the order of the signals; not finite where a value is beyond a float64."""
        values: Floats = rows[:, self._columns]
        if self._changes:
            with np.errstate(over="ignore", invalid="ignore"):
                for i, change in self._changes:
                    values[:, i] = change(values[:, i])
        return values


def _places(
    signals: Collection[Signal], selected: Collection[Signal]
) -> npt.NDArray[np.intp] | None:
    """The places of selected signals among all, in their order; None where these are all."""
    if len(selected) == len(signals):
        return None
    place_of = {signal.name: place for place, signal in enumerate(signals)}
    return np.array([place_of[signal.name] for signal in selected], np.intp)


def _selected(columns: Floats, places: npt.NDArray[np.intp] | None) -> Floats:
    """The columns at these places, each of them in one piece."""
    return columns if places is None else columns.T[places].T
