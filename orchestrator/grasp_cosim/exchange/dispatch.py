"""From the rows of the master's loop to the listeners: checked, extended, decimated.

A signal that runs away is told from one that is large, jumps, rises steadily or overshoots. Of its
size |x| the moments count at which it first reaches its scale, ten times that, and so on. What
diverges takes no longer for each decade than for the one before: it grows exponentially, or faster.
A jump passes decades in one step; a ramp takes ten times as long for each, a power t^n the n-th
root of ten times; a stable response ends.

A distance may be that to nothing: inf, or the largest double. Where every input that a signal goes
to says that it takes inf, its size is not looked at.
"""

import os
import time
from collections.abc import Collection, Mapping, Sequence
from contextlib import ExitStack
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.checks import EXACT
from ..base.errors import SimulationError
from ..base.system_calls import end_fork
from ..interface.fmi_types import limits
from ..interface.units import IDENTITY
from ..system.connectors import taps
from ..system.description import System
from ..system.parts import Port
from ..system.settings import run_settings
from ..system.times import in_seconds, seconds
from ..system.validity import transforms
from .energy import ExchangeEnergy, bonds
from .listener import Experiment, Leisurely, Listener, Signal, Texts

DECADES = 6
"""A signal is looked at from so many decades above its scale on; over as many it has to grow."""

UNEVEN = 2.5
"""Times as long as another that one of these may take: the peaks of an oscillation are apart."""

SLOWER = 1.25
"""Times as long as for the first half of these that the second half may take."""

FAR = 1e15
"""Times its scale, or 1, from which a signal has run away however it came there: of what it should
be, a float64 has no digit left.
"""

NEVER = np.nan
"""A size that no value reaches, not even inf."""

ON = 'or let it go on: diverging = "continue"'


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
        whole: Listener | None = None,
    ) -> None:
        """Slots are the columns of the rows, texts those of Strings, which are numbers there.

        whole gets every row, of all signals that are observed.
        """
        self._owner = os.getpid()
        self._listeners, self._whole = tuple(listeners), whole
        self._leisurely = [one for one in listeners if isinstance(one, Leisurely)]
        self.took = 0.0
        """s that the listeners took for their blocks."""
        self._every = every
        self._columns = np.array([slots[port] for port in system.observed], np.intp)
        observed = {
            port: Signal(
                str(port),
                v.unit,
                v.kind,
                v.description or "",
                texts.get(port, Texts()),
                wide=v.type == "UInt64",
            )
            for port, v in system.observed.items()
        }
        watched = {port: observed[port] for port in system.watched}
        self._watched = _places(observed.values(), watched.values())
        self._watched_signals = tuple(watched.values())
        sources = {connection.source for connection in system.connections}
        self._unconnected = [port not in sources for port in watched]
        open_ended = to_open_ends(system)
        self._divergence = Divergence(system, watched, open_ended)
        self._unwatched = Unwatched(system, observed)
        self._goes_on = system.diverging == "continue"
        self._may_be_infinite = np.array([self._goes_on or port in open_ended for port in watched])
        self._runaways: list[str] = []
        self._taps = Taps(system, slots, texts)
        self._energy = ExchangeEnergy(system.once(bonds), slots, system.once(transforms))
        worked_out = (*self._taps.signals, *self._energy.signals)
        every_signal = (*observed.values(), *worked_out)
        recorded = [observed[port] for port in system.recorded]
        recorded += [signal for signal in worked_out if system.record.has(signal.name)]
        self.signals = tuple(recorded)
        self._recorded = _places(every_signal, self.signals)
        self._block = np.empty((len(every_signal), 0))
        self.pending: tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]] | None = None
        """The last row, where decimation has left it out so far."""
        self.settings = run_settings(system)
        experiment = Experiment.of(self.settings)
        with ExitStack() as begun:
            for listener in self._listeners:
                listener.begin(experiment, self.signals)
                begun.callback(listener.end, False)
            if whole:
                whole.begin(experiment, every_signal)
            begun.pop_all()  # whoever has begun is ended here only where the next one fails

    @property
    def log(self) -> list[str]:
        """A line for each signal that ran away in a run that went on, or that is not as it was."""
        return [*self._runaways, *self._unwatched.log]

    def __call__(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Hand rows on; SimulationError at the first value that is not finite or has run away.

        Its row is the last that is kept.
        """
        end_fork(self._owner)
        if len(rows) > self._block.shape[1]:
            self._block = np.empty((len(self._block), len(rows)))
        columns = self._block[:, : len(rows)].T  # each of them in one piece, which is fast
        observed = columns[:, : len(self._columns)]
        observed[:] = rows[:, self._columns]
        count, wrong = self._check(steps, _chosen(observed, self._watched))
        self._unwatched(steps[:count], observed[:count])
        steps, columns = steps[:count], columns[:count]
        first = len(self._columns)
        energies = first + len(self._taps.signals)
        columns[:, first:energies] = self._taps(rows[:count])
        columns[:, energies:] = self._energy(rows[:count])
        if self._whole:
            self._whole.block(steps, columns)
        columns = _chosen(columns, self._recorded)
        self.pending = None
        wanted = slice(-int(steps[0]) % self._every, None, self._every)
        if len(steps[wanted]):
            self._hand_on(steps[wanted], columns[wanted])
        if steps[-1] % self._every:
            self.pending = steps[-1:].copy(), columns[-1:].copy()
        if wrong:
            raise SimulationError(wrong)

    def saved(self) -> tuple[Any, ...]:
        """What the rows until now came to, for restore()."""
        told = [*self._runaways], self._divergence.saved(), self._unwatched.saved()
        return told, self._energy.saved(), self.pending

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved; what the listeners got is their own concern."""
        (runaways, divergence, unwatched), energy, self.pending = saved
        self._runaways = [*runaways]
        self._divergence.restore(divergence)
        self._unwatched.restore(unwatched)
        self._energy.restore(energy)

    def _check(
        self, steps: npt.NDArray[np.int64], outputs: npt.NDArray[np.float64]
    ) -> tuple[int, str]:
        """The number of rows to keep, and what is wrong in the last of them, if anything is."""
        good, sizes = len(steps), largest(outputs)
        if not np.isfinite(sizes).all():
            valid = np.isfinite(outputs) | (np.isinf(outputs) & self._may_be_infinite)
            if not valid.all():
                good = int(valid.all(axis=1).argmin())
                sizes = largest(outputs[:good])
        runaway = self._divergence(steps[:good], outputs[:good], sizes)
        if runaway and not self._goes_on:
            return runaway[0] + 1, f"{runaway[1]}; {ON}"
        if runaway:
            self._runaways.append(f"{runaway[1]}; the run went on")
        if good == len(steps):
            return good, ""
        i = int(valid[good].argmin())
        name, value = self._watched_signals[i].name, outputs[good, i]
        line = f"{name} = {value} at step {steps[good]}: must be finite"
        if not np.isnan(value):
            line += f", {ON}"
        if self._unconnected[i]:
            line += f'; it goes to no input: --record "!{name}" leaves it out'
        return good + 1, line

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

    def _hand_on(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        start = time.perf_counter()
        for listener in self._listeners:
            listener.block(steps, rows)
        self.took += time.perf_counter() - start


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

    def __call__(self, rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """The outputs in the order of the signals; not finite where a value is beyond a float64."""
        values: npt.NDArray[np.float64] = rows[:, self._columns]
        if self._changes:
            with np.errstate(over="ignore", invalid="ignore"):
                for i, change in self._changes:
                    values[:, i] = change(values[:, i])
        return values


def _places(of: Collection[Signal], some: Collection[Signal]) -> npt.NDArray[np.intp] | None:
    """The places of some signals among others, in their order; None for all of them."""
    if len(some) == len(of):
        return None
    place_of = {signal.name: place for place, signal in enumerate(of)}
    return np.array([place_of[signal.name] for signal in some], np.intp)


def _chosen(
    columns: npt.NDArray[np.float64], places: npt.NDArray[np.intp] | None
) -> npt.NDArray[np.float64]:
    """The columns at these places, each of them in one piece."""
    return columns if places is None else columns.T[places].T


class Unwatched:
    """Looks at what is recorded besides the outputs, and says once where it is not as it was.

    That is a whole number of 64 bits which a float64 does not hold exactly, since nothing goes by
    it, or any number that is not finite.
    """

    def __init__(self, system: System, observed: Mapping[Port, Signal]) -> None:
        """Over the columns of what is observed."""
        self._system, self._signals = system, tuple(observed.values())
        self._places = np.array(
            [
                place
                for place, port in enumerate(observed)
                if port not in system.watched or _is_long(system, port)
            ],
            np.intp,
        )
        is_integer = [self._signals[place].kind == "Integer" for place in self._places]
        self._limits = np.where(is_integer, float(EXACT), np.inf)
        self._log: dict[int, str] = {}

    def saved(self) -> dict[int, str]:
        """What was said until now, for restore()."""
        return dict(self._log)

    def restore(self, saved: dict[int, str]) -> None:
        """Go back to what was saved."""
        self._log = dict(saved)

    @property
    def log(self) -> list[str]:
        """A line for each of these signals, in the order of the system."""
        return [self._log[i] for i in sorted(self._log)]

    def __call__(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Look at rows of all that is observed."""
        if not len(self._places):
            return
        columns = rows[:, self._places]
        beyond = ~(largest(columns) < self._limits)  # true of nan, too
        for i in np.flatnonzero(beyond).tolist():
            if i not in self._log:
                row = int((~(np.abs(columns[:, i]) < self._limits[i])).argmax())
                self._log[i] = self._line(i, int(steps[row]), columns[row, i])

    def _line(self, i: int, step: int, value: float) -> str:
        signal = self._signals[self._places[i]]
        time = seconds(self._system.time_ns(step))
        if signal.kind == "Integer":
            held = "recorded to the 53 bits that a float64 holds"
            return f"{signal.name} is {value:.0f} at t = {time}: {held}"
        return f"{signal.name} is {value} at t = {time}: recorded as it is"


def _is_long(system: System, port: Port) -> bool:
    """True for a whole number of 64 bits, which need not fit into a float64."""
    component = system.component(port.component, str(port)).loaded
    _, high = limits(component.by_name[port.variable].type, component.version)
    return isinstance(high, int) and high >= EXACT


def to_open_ends(system: System) -> frozenset[Port]:
    """The outputs that go to inputs alone that take inf, as the distance to nothing in range."""
    sources: dict[Port, bool] = {}
    for connection in system.connections:
        target = connection.target
        interface = system.component(target.component, str(target)).interface
        takes_it = interface.by_name[target.variable].infinite
        sources[connection.source] = takes_it and sources.get(connection.source, True)
    return frozenset(port for port, all_take_it in sources.items() if all_take_it)


def largest(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The largest magnitude in each column; not finite where one of its values is not."""
    if not len(rows):
        return np.zeros(rows.shape[1])
    highest: npt.NDArray[np.float64] = np.maximum(rows.max(axis=0), -rows.min(axis=0))
    return highest


class Divergence:
    """Looks at every row of a run until the first signal has run away.

    The scale of a signal is its nominal value, or its first value other than 0 if that is greater.
    Without a nominal value it is 1, in the signal's unit or in the SI unit, whichever is greater.
    """

    def __init__(
        self,
        system: System,
        outputs: Mapping[Port, Signal],
        open_ended: Collection[Port] = (),
    ) -> None:
        """Over the columns of the outputs; only those that are Real, and have an end, count."""
        self._system, self._signals = system, tuple(outputs.values())
        self._scales = np.array([_scale(system, port) for port in outputs])
        self._limits = np.array(
            [
                0.0 if signal.kind == "Real" and port not in open_ended else NEVER
                for port, signal in outputs.items()
            ]
        )
        self._reached: list[tuple[int, ...]] = [() for _ in outputs]
        self._over = False

    def saved(self) -> tuple[Any, ...]:
        """What the rows until now came to, for restore()."""
        return self._scales.copy(), self._limits.copy(), [*self._reached], self._over

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved."""
        self._scales[:], self._limits[:], reached, self._over = saved
        self._reached = [*reached]

    def __call__(
        self,
        steps: npt.NDArray[np.int64],
        rows: npt.NDArray[np.float64],
        sizes: npt.NDArray[np.float64],
    ) -> tuple[int, str] | None:
        """The first signal that runs away in a block of rows, (len(steps), len(outputs)).

        Its row, and a line that says so. None where there is none, and after the first. sizes are
        largest(rows). Blocks of any length come to the same.
        """
        if self._over or not rows.size:
            return None
        grown = np.flatnonzero((sizes >= self._limits) & (sizes > 0.0)).tolist()
        found = [(row, i) for i in grown if (row := self._follow(i, steps, rows[:, i])) is not None]
        if not found:
            return None
        self._over = True
        row, i = min(found, key=lambda f: (f[0], -abs(float(rows[f])) / float(self._scales[f[1]])))
        signal, time = self._signals[i], seconds(self._system.time_ns(int(steps[row])))
        size = f"{rows[row, i]:.3g} {signal.unit or ''}".rstrip()
        text = f"{signal.name} ran away: {size} at t = {time}"
        if _grows(self._reached[i]):
            decade = (self._reached[i][-1] - self._reached[i][-4]) / 3
            length = decade * in_seconds(self._system.step_ns)
            text += f", ten times as much every {length:.2g} s"
        return row, f"{text}; look at the signs and gains, or try a shorter step"

    def _follow(
        self, i: int, steps: npt.NDArray[np.int64], column: npt.NDArray[np.float64]
    ) -> int | None:
        """Note the decades that a signal reaches; the row in which it has run away, if it has."""
        peaks = np.maximum.accumulate(np.abs(column))
        if not self._limits[i]:
            first = peaks[np.flatnonzero(peaks)[0]]
            self._limits[i] = self._scales[i] = max(self._scales[i], first)
        while (row := int(np.searchsorted(peaks, self._limits[i]))) < len(peaks):
            self._reached[i] = *self._reached[i], int(steps[row])
            limit, scale = float(self._limits[i]), float(self._scales[i])
            if limit >= FAR * max(1.0, scale) or _grows(self._reached[i]):
                return row
            self._limits[i] = 10.0 * limit
        return None


def _scale(system: System, port: Port) -> float:
    """The nominal value of an output, or else 1 in its unit or the SI unit."""
    interface = system.component(port.component, str(port)).interface
    variable = interface.by_name[port.variable]
    unit = interface.unit(variable)
    if variable.magnitude is not None or unit is None or not unit.factor:
        return variable.nominal
    return max(1.0, 1.0 / abs(unit.factor))


def _grows(reached: Sequence[int]) -> bool:
    """True if the last decades took about equally long, and the later ones no longer than before.

    Each took a step at least, so that a jump is no growth.
    """
    if len(reached) <= DECADES:
        return False
    spans = np.diff(reached[-DECADES - 1 :])
    before, after = np.split(spans, 2)
    even = 0 < spans.max() <= UNEVEN * spans.min()
    return bool(even and after.sum() <= SLOWER * before.sum())
