"""What is recorded, and is not as the FMU has it: said once of each signal."""

from collections.abc import Mapping

import numpy as np

from ..base.checks import EXACT
from ..interface.fmi_types import limits
from ..system.description import System
from ..system.parts import Port
from ..system.times import seconds
from .divergence import largest
from .listener import Floats, Signal, Steps


class InexactSignals:
    """Checks the recorded signals that are no outputs, and notes once which are inexact.

    That is any number that is not finite. It is also a whole number of 64 bits which a float64 does
    not hold exactly and on which nothing depends.
    """

    def __init__(
        self, system: System, observed: Mapping[Port, Signal], slots: Mapping[Port, int]
    ) -> None:
        """Of what is observed; slots are the columns of the rows."""
        self._system = system
        ports = [p for p in observed if p not in system.watched or _is_long(system, p)]
        self._signals = [observed[port] for port in ports]
        self._places = np.array([slots[port] for port in ports], np.intp)
        is_integer = [signal.kind == "Integer" for signal in self._signals]
        self._limits = np.where(is_integer, float(EXACT), np.inf)
        self._log: dict[int, str] = {}

    def saved(self) -> dict[int, str]:
        """The notes until now, for restore()."""
        return dict(self._log)

    def restore(self, saved: dict[int, str]) -> None:
        """Go back to what was saved."""
        self._log = dict(saved)

    @property
    def log(self) -> list[str]:
        """A line for each of these signals, in the order of the system."""
        return [self._log[i] for i in sorted(self._log)]

    def __call__(self, steps: Steps, rows: Floats) -> None:
        """Look at rows of all values."""
        if not len(self._places):
            return
        columns = rows[:, self._places]
        beyond = ~(largest(columns) < self._limits)  # true of nan, too
        for i in np.flatnonzero(beyond).tolist():
            if i not in self._log:
                row = int((~(np.abs(columns[:, i]) < self._limits[i])).argmax())
                self._log[i] = self._line(i, int(steps[row]), columns[row, i])

    def _line(self, i: int, step: int, value: float) -> str:
        signal = self._signals[i]
        time = seconds(self._system.time_ns(step))
        if signal.kind == "Integer":
            note = "recorded to the 53 bits that a float64 holds"
            return f"{signal.name} is {value:.0f} at t = {time}: {note}"
        return f"{signal.name} is {value} at t = {time}: recorded as it is"


def _is_long(system: System, port: Port) -> bool:
    """True for a whole number of 64 bits, which need not fit into a float64."""
    component = system.component(port.component, str(port)).loaded
    _, high = limits(component.by_name[port.variable].type, component.version)
    return isinstance(high, int) and high >= EXACT
