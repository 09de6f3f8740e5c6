"""An input that stimuli drive, as the loop sees it: its value at the beginning of each step."""

from __future__ import annotations

from array import array
from bisect import bisect_right
from dataclasses import dataclass

from ..interface.interface import Value
from ..system.description import System
from ..system.parts import Port
from ..system.stimuli_checks import driven, is_linear, samples_of


@dataclass(slots=True)
class Drive:
    """The samples of an input at times in ns, and its slot; row is the last one until now.

    The compiled loop has the same in a table, with the same bits.
    """

    slot: int
    times: array[int]
    samples: array[float]
    linear: bool
    row: int = 0

    def at(self, time: int) -> float:
        """The value at a time, which is not before that of the last call."""
        times, samples, row = self.times, self.samples, self.row
        if row + 1 < len(times) and times[row + 1] <= time:
            row = self.row = bisect_right(times, time, row + 1) - 1
        if not self.linear or time <= times[row] or row + 1 == len(times):
            return samples[row]
        share = float(times[row + 1] - time) / float(times[row + 1] - times[row])
        return share * samples[row] + (1.0 - share) * samples[row + 1]


def drives_of(system: System, slots: dict[Port, int]) -> dict[Port, Drive]:
    """The drive of each input that stimuli drive."""
    found: dict[Port, Drive] = {}
    if system.input is None:
        return found
    times = array("q", system.input.times)
    for port in driven(system):
        variable = system.component(port.component, str(port)).interface.by_name[port.variable]
        linear, samples = is_linear(system.input, variable), samples_of(system, port)
        found[port] = Drive(slots[port], times, samples, linear)
    return found


def at_start(system: System, drives: dict[Port, Drive], name: str) -> dict[str, Value]:
    """The values at the start of the inputs of a component that are driven."""
    found: dict[str, Value] = {}
    for port, drive in drives.items():
        if port.component == name:
            kind = system.component(name, name).interface.by_name[port.variable].kind
            value = drive.at(system.start_ns)
            found[port.variable] = (
                value if kind == "Real" else int(value) if kind == "Integer" else value != 0.0
            )
    return found
