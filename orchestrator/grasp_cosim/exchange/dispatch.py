"""From the rows of the master's loop to the listeners: checked, extended, decimated."""

import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from ..base.errors import SimulationError
from ..system.description import System
from ..system.parts import Port
from ..system.settings import run_settings
from ..system.validity import transforms
from .divergence import Divergence, largest
from .energy import ExchangeEnergy, bonds
from .listener import Experiment, Leisurely, Listener, Signal, Texts


class Dispatcher:
    """Takes rows of all values and hands every n-th one on, and the last.

    Listeners get the outputs in the order of the system, then the derived signals, which
    are computed from every row.
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

        whole gets every row.
        """
        self._listeners, self._whole = tuple(listeners), whole
        self._leisurely = [one for one in listeners if isinstance(one, Leisurely)]
        self.took = 0.0
        """s that the listeners took for their blocks."""
        self._every = every
        self._columns = np.array([slots[port] for port in system.recorded], np.intp)
        outputs = {
            port: Signal(str(port), v.unit, v.kind, v.description or "", texts.get(port, Texts()))
            for port, v in system.recorded.items()
        }
        self._divergence = Divergence(system, outputs)
        self._goes_on = system.diverging == "continue"
        self.log: list[str] = []
        """A line for each signal that ran away in a run that went on."""
        self._energy = ExchangeEnergy(system.once(bonds), slots, system.once(transforms))
        self.signals = (*outputs.values(), *self._energy.signals)
        self._block = np.empty((len(self.signals), 0))
        self.pending: tuple[npt.NDArray[np.int64], npt.NDArray[np.float64]] | None = None
        """The last row, where decimation has left it out so far."""
        self.settings = run_settings(system)
        experiment = Experiment.of(self.settings)
        with ExitStack() as begun:
            for listener in (*self._listeners, *([whole] if whole else [])):
                listener.begin(experiment, self.signals)
                begun.callback(listener.end, False)
            begun.pop_all()  # whoever has begun is ended here only where the next one fails

    def __call__(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Hand rows on; SimulationError at the first value that is not finite or has run away.

        Its row is the last that is kept.
        """
        if len(rows) > self._block.shape[1]:
            self._block = np.empty((len(self.signals), len(rows)))
        columns = self._block[:, : len(rows)].T  # each of them in one piece, which is fast
        outputs = columns[:, : len(self._columns)]
        outputs[:] = rows[:, self._columns]
        count, wrong = self._check(steps, outputs)
        steps, columns = steps[:count], columns[:count]
        columns[:, len(self._columns) :] = self._energy(rows[:count])
        if self._whole:
            self._whole.block(steps, columns)
        self.pending = None
        wanted = slice(-int(steps[0]) % self._every, None, self._every)
        if len(steps[wanted]):
            self._hand_on(steps[wanted], columns[wanted])
        if steps[-1] % self._every:
            self.pending = steps[-1:].copy(), columns[-1:].copy()
        if wrong:
            raise SimulationError(wrong)

    def _check(
        self, steps: npt.NDArray[np.int64], outputs: npt.NDArray[np.float64]
    ) -> tuple[int, str]:
        """The number of rows to keep, and what is wrong in the last of them, if anything is."""
        good, sizes = len(steps), largest(outputs)
        if not np.isfinite(sizes).all():
            good = int(np.isfinite(outputs).all(axis=1).argmin())
            sizes = largest(outputs[:good])
        runaway = self._divergence(steps[:good], outputs[:good], sizes)
        if runaway and not self._goes_on:
            return runaway.row + 1, f'{runaway.text}; or let it go on: diverging = "continue"'
        if runaway:
            self.log.append(f"{runaway.text}; the run went on")
        if good == len(steps):
            return good, ""
        i = int(np.isfinite(outputs[good]).argmin())
        name, value = self.signals[i].name, outputs[good, i]
        return good + 1, f"{name} = {value} at step {steps[good]}: must be finite"

    def flush(self) -> None:
        """Hand the last row on, where decimation has left it out."""
        pending, self.pending = self.pending, None
        if pending is not None:
            self._hand_on(*pending)

    def spare(self, ns: float) -> bool:
        """Give a listener that puts work off so many ns for it; False if none had any to do."""
        return any(listener.spare(ns) for listener in self._leisurely)

    def end(self, complete: bool) -> None:
        """Hand the last row on and end the listeners, each of them even where another fails."""
        with ExitStack() as stack:
            for listener in reversed(self._listeners):
                stack.callback(listener.end, complete)
            self.flush()

    def _hand_on(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        start = time.perf_counter()
        for listener in self._listeners:
            listener.block(steps, rows)
        self.took += time.perf_counter() - start
