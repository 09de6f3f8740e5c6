"""The stimuli of a run: they drive inputs, and tunable parameters where they change."""

from __future__ import annotations

import math
from array import array
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from ..fmi.instance import dtype
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.description import System
from ..system.parts import Port
from ..system.validity import driven_inputs, driven_parameters, is_linear, samples_of


@dataclass(slots=True)
class Drive:
    """The samples of an input at times in counts, and its slot; row is the last one until now.

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


@dataclass(slots=True, eq=False)
class Tuning:
    """A tunable parameter that stimuli drive: before which steps it gets which value.

    Only where the value changes, at communication points of its component. `taken` of them are set.
    """

    port: Port
    variable: Variable
    at_start: float
    steps: Sequence[int]
    values: Sequence[float]
    taken: int = 0

    @property
    def due(self) -> float:
        """The next step before which it gets another value."""
        return self.steps[self.taken] if self.taken < len(self.steps) else math.inf

    @property
    def value(self) -> float:
        """The value that it has."""
        return self.values[self.taken - 1] if self.taken else self.at_start

    def take(self) -> float:
        """The value that is due; it is taken to be set."""
        self.taken += 1
        return self.values[self.taken - 1]


def tunings_of(system: System) -> list[Tuning]:
    """The tunable parameters that stimuli drive."""
    if system.input is None:
        return []
    times = np.asarray(ticks_of(system), np.int64)
    tunings = []
    for port in driven_parameters(system):
        interval = system.period(port.component) * system.time_grid.step
        points = np.maximum(-((system.time_grid.start - times) // interval), 0)
        samples = np.asarray(samples_of(system, port), np.float64)
        last = np.append(points[1:] != points[:-1], True)  # of the rows up to a point, its value
        points, samples = points[last], samples[last]
        at_start = float(samples[0])
        changes = np.diff(samples, prepend=at_start) != 0.0
        steps = points[changes] * system.period(port.component)
        tunings.append(
            Tuning(
                port,
                system.component(port.component, str(port)).interface.by_name[port.variable],
                at_start,
                steps.tolist(),
                samples[changes].tolist(),
            )
        )
    return tunings


def ticks_of(system: System) -> array[int]:
    """The times of the rows of stimuli in counts of the run's grid.

    A row is taken to the nanosecond: one that is that near to a communication point is at it.
    """
    grid, rows = system.time_grid, system.input.times if system.input else ()
    if grid.per_nanosecond == 1:
        return array("q", rows)
    counts = array("q")
    for time in rows:
        exact_time = grid.per_nanosecond * time
        nearest_point = round(Fraction(exact_time - grid.start, grid.step))
        point = grid.start + nearest_point * grid.step
        counts.append(point if 2 * abs(point - exact_time) <= grid.per_nanosecond else exact_time)
    return counts


def drives_of(system: System, slots: dict[Port, int]) -> dict[Port, Drive]:
    """The drive of each input that stimuli drive."""
    drives: dict[Port, Drive] = {}
    if system.input is None:
        return drives
    times = ticks_of(system)
    for port in driven_inputs(system):
        variable = system.component(port.component, str(port)).interface.by_name[port.variable]
        linear, samples = is_linear(system.input, variable), samples_of(system, port)
        drives[port] = Drive(slots[port], times, samples, linear)
    return drives


def driven_at(system: System, drives: dict[Port, Drive], name: str, step: int) -> dict[str, Value]:
    """The values at a communication point of the inputs of a component that are driven."""
    by_name = system.component(name, name).interface.by_name
    grid = system.time_grid
    return {
        port.variable: of_kind(by_name[port.variable].kind, drive.at(grid.start + step * grid.step))
        for port, drive in drives.items()
        if port.component == name
    }


def stored(interface: Interface, name: str, value: Value) -> float:
    """A number as an FMU of that interface has it, which may have fewer digits."""
    element = dtype(interface.version, interface.by_name[name].type)
    return float(element.type(value))


def of_kind(kind: str, number: float) -> Value:
    """The value of a variable that is no String for a number on its connection."""
    return number if kind == "Real" else int(number) if kind == "Integer" else number != 0.0
