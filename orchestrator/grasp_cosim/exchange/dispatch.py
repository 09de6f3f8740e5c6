"""From the rows of the master's loop to the listeners: checked, extended, decimated."""

import os
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from ..base.errors import SimulationError
from ..base.system_calls import end_fork
from ..interface.units import IDENTITY, Conversion
from ..system.connectors import Tap, taps
from ..system.description import System
from ..system.parts import Port
from ..system.settings import run_settings
from .bounds import Bounds
from .divergence import Divergence, largest, to_open_ends
from .energy import bonds
from .inexact import InexactSignals
from .listener import (
    Experiment,
    Floats,
    Leisurely,
    Listener,
    OfAllRows,
    OfWindows,
    Selective,
    Signal,
    Steps,
    Texts,
    Window,
)
from .trigger import TriggeredRows

CONTINUE_ADVICE = 'or let it go on: diverging = "continue"'


class Dispatcher:
    """Takes rows of all values and hands every n-th one on, and the last.

    Of a triggered recording only those that are in its windows.

    Listeners get the signals that are recorded, in the order of the system, then its own outputs
    and the energies of its exchanges. The outputs of components end the run where they run away or
    are not finite, recorded or not; any other signal is only recorded, as it is.
    """

    def __init__(
        self,
        system: System,
        slots: Mapping[Port, int],
        listeners: Sequence[Listener],
        every: int = 1,
        texts: Mapping[Port, Texts] = MappingProxyType({}),
        every_row: Selective | None = None,
        bounds: Bounds | None = None,
    ) -> None:
        """Begin the listeners of a run.

        Args:
            system: The system that runs.
            slots: The columns of the rows, by output or connected input. The energies are behind.
            listeners: Get the recorded rows.
            every: Every how many steps a row is recorded; the last one always is.
            texts: The tables of the texts of Strings, whose numbers are in the rows.
            every_row: Gets every row of the signals that it names.
            bounds: Bounds that the loop compares values with; without, all rows are looked at.

        Raises:
            InputError: A listener cannot begin.
        """
        self._owner = os.getpid()
        self._listeners, self._every_row = tuple(listeners), every_row
        self._of_windows = [listener for listener in listeners if isinstance(listener, OfWindows)]
        self._leisurely = [listener for listener in listeners if isinstance(listener, Leisurely)]
        self.listener_seconds = 0.0
        """The time in s that the listeners took for their blocks."""
        self._every = every
        observed = {port: _signal(system, port, texts) for port in system.observed}
        watched = {port: observed[port] for port in system.watched}
        self._watched = np.array([slots[port] for port in watched], np.intp)
        self._watched_signals = tuple(watched.values())
        sources = {connection.source for connection in system.connections}
        self._unconnected = [port not in sources for port in watched]
        open_ended = to_open_ends(system)
        self._divergence = Divergence(system, watched, open_ended)
        self._bounds = bounds or Bounds(max(slots.values(), default=-1) + 1)
        self._inexact = InexactSignals(system, observed, slots)
        self._goes_on = system.diverging == "continue"
        self._may_be_infinite = np.array([self._goes_on or port in open_ended for port in watched])
        self._runaways: list[str] = []
        column_of = {port: _Column(signal, slots[port]) for port, signal in observed.items()}
        computed = _computed(system, slots, texts)
        every_column = [*column_of.values(), *computed]
        recorded = [column_of[port] for port in system.recorded]
        recorded += [c for c in computed if system.record.has(c.signal.name)]
        self._recorded = _Columns(recorded)
        self.signals = self._recorded.signals
        self.pending: tuple[Steps, Floats] | None = None
        """The last row, where decimation has left it out so far."""
        trigger = system.record.trigger
        self._of_all_rows = [x for x in listeners if trigger and isinstance(x, OfAllRows)]
        self._of_recorded_rows = [x for x in listeners if x not in self._of_all_rows]
        self.trigger = TriggeredRows(system, trigger, slots) if trigger else None
        """What decides on the rows of a triggered recording; None of any other."""
        self._begun = False
        self.settings = run_settings(system)
        experiment = Experiment.of(self.settings)
        with ExitStack() as ends:
            for listener in self._listeners:
                listener.begin(experiment, self.signals)
                ends.callback(listener.end, False)
            if every_row:
                names = every_row.names
                self._for_every_row = _Columns([c for c in every_column if c.signal.name in names])
                every_row.begin(experiment, self._for_every_row.signals)
            ends.pop_all()  # a listener that has begun is ended here only where the next one fails

    @property
    def log(self) -> list[str]:
        """A line for each window, and each signal that ran away in a run that went on, or that is
        not as it was.
        """
        windows = self.trigger.log if self.trigger else ()
        return [*windows, *self._runaways, *self._inexact.log]

    def __call__(self, steps: Steps, rows: Floats) -> None:
        """Hand rows on; SimulationError at the first value that is not finite or has run away.

        Its row is the last that is kept.
        """
        end_fork(self._owner)
        count, message = self._check(steps, rows)
        steps, rows = steps[:count], rows[:count]
        self._inexact(steps, rows)
        if self._every_row:
            self._every_row.block(steps, self._for_every_row(rows))
        self.pending = None
        nth = slice(-int(steps[0]) % self._every, None, self._every)
        if self.trigger:
            self._begin_run()
            recorded = self._recorded(rows[nth])
            for listener in self._of_all_rows:
                listener.block(steps[nth], recorded)
            self.trigger(self, steps, rows, steps[nth], recorded)
        elif len(steps[nth]):
            self.hand_on(steps[nth], self._recorded(rows[nth]))
        if steps[-1] % self._every and (self.trigger is None or self.trigger.is_open):
            self.pending = steps[-1:].copy(), self._recorded(rows[-1:])
        if message:
            raise SimulationError(message)

    def saved(self) -> tuple[Any, ...]:
        """What the rows until now came to, for restore()."""
        checks = [*self._runaways], self._divergence.saved(), self._inexact.saved()
        return checks, self.pending, self.trigger.saved() if self.trigger else None

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved; what the listeners got is their own concern."""
        (runaways, divergence, inexact), self.pending, windows = saved
        if self.trigger:
            self.trigger.restore(windows)
        self._runaways = [*runaways]
        self._divergence.restore(divergence)
        self._inexact.restore(inexact)
        self._put_bounds()
        self._bounds.exceeded[0] = 1  # maybe by a row that waits

    def _put_bounds(self) -> None:
        self._bounds.put(self._watched, self._divergence.bounds, self._may_be_infinite)

    def _check(self, steps: Steps, rows: Floats) -> tuple[int, str]:
        """The number of rows to keep, and what is wrong in the last of them, if anything is."""
        if not self._bounds.may_be_exceeded:
            return len(steps), ""
        count, message = self._look_at(steps, rows[:, self._watched])
        self._put_bounds()
        return count, message

    def _look_at(self, steps: Steps, outputs: Floats) -> tuple[int, str]:
        """As _check(), of the outputs of components."""
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
                self.hand_on(*pending)
            if self.trigger:
                self.trigger.end(self, complete)

    def _begin_run(self) -> None:
        """Tell the listeners that a triggered run has begun, once."""
        if not self._begun:
            self._begun = True
            for listener in self._of_windows:
                listener.begin_run()

    def begin_window(self, window: Window) -> None:
        """Tell the listeners of the window whose rows come now."""
        for listener in self._of_windows:
            listener.begin_window(window)

    def end_window(self, window: Window) -> None:
        """Tell the listeners of the window whose rows came."""
        for listener in self._of_windows:
            listener.end_window(window)

    def hand_on(self, steps: Steps, rows: Floats) -> None:
        """Hand rows that are recorded on to the listeners."""
        start = time.perf_counter()
        for listener in self._of_recorded_rows:
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


class _Column(NamedTuple):
    """A signal, its column in the rows of the loop, and what converts that."""

    signal: Signal
    place: int
    change: Conversion = IDENTITY


def _computed(
    system: System, slots: Mapping[Port, int], texts: Mapping[Port, Texts]
) -> list[_Column]:
    """The outputs of the system itself, then the energies, whose columns are behind the slots."""
    of_taps = [
        _Column(_of_tap(name, tap, texts), slots[tap.source], tap.change)
        for name, tap in system.once(taps).items()
    ]
    energies = [_Column(bond.signal, len(slots) + i) for i, bond in enumerate(system.once(bonds))]
    return of_taps + energies


def _of_tap(name: str, tap: Tap, texts: Mapping[Port, Texts]) -> Signal:
    """The signal of an output of the system itself."""
    return Signal(name, tap.unit, tap.kind, tap.description, texts.get(tap.source, Texts()))


class _Columns:
    """Takes the values of signals out of rows of all values."""

    def __init__(self, columns: Sequence[_Column]) -> None:
        self.signals = tuple(column.signal for column in columns)
        self._places = np.array([column.place for column in columns], np.intp)
        changes = [column.change for column in columns]
        self._changes = [(i, change) for i, change in enumerate(changes) if change != IDENTITY]

    def __call__(self, rows: Floats) -> Floats:
        """Their values, as (len(rows), len(signals)); inf where one is beyond a float64."""
        values: Floats = rows[:, self._places]
        with np.errstate(over="ignore", invalid="ignore"):
            for i, change in self._changes:
                values[:, i] = change(values[:, i])
        return values
