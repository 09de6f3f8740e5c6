"""A macro step of a session as a function of its states and inputs, and its derivatives.

The states of a macro step are those of the FMUs, and signals that the master holds for a component.
These are of components that step before their source.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ..base.errors import InputError, nearest
from ..master.session import Session
from ..system.connectors import read_at
from ..system.parts import Port, as_signal
from .state_space import Matrix

RELATIVE_MOVE = 6e-6
"""By how much of itself a value is moved: the cube root of the rounding of a float, at which what
that and the curvature do to a central difference are equally small.
"""

MIN_MAGNITUDE = 1e-2
"""A value that is smaller is moved as if it were so large, in its unit."""


@dataclass(slots=True)
class Cut:
    """Opens the loop at a connection: notes the value that it brings, and passes on another one."""

    brought: float = 0.0
    """What the connection brought last, in the unit of the input."""
    value: float | None = None
    """What is passed on instead; None for what the connection brings."""

    def __call__(self, brought: float) -> float:
        """Note the value that the connection brings, and return the one that is passed on."""
        self.brought = brought
        return brought if self.value is None else self.value


CutOutput = tuple[Cut, tuple[float, float]]
"""The cut of a connection from an output, and the factor and offset of that connection."""


class MacroStep:
    """The macro step from a moment of a session on, as a function of x, the states, and u, the
    inputs there.
    """

    def __init__(
        self,
        session: Session,
        steps: int,
        inputs: Sequence[Port],
        outputs: Sequence[str],
        cuts: dict[Port, Cut],
        cut_outputs: dict[Port, CutOutput],
    ) -> None:
        """Do the step once, from the present state of the session.

        Args:
            session: It stands at the moment about which the model is.
            steps: The base steps of a macro step.
            inputs: The inputs u.
            outputs: The names of the outputs y.
            cuts: By the input at which the loop is opened.
            cut_outputs: The same cuts, by the output that is connected to that input.

        Raises:
            InputError: There is no such output, or the states of an FMU are not known.
        """
        self._session, self._master, self._steps = session, session.master, steps
        self._start = session.save()
        self._inputs = [(port, cuts.get(port)) for port in inputs]
        self._outputs = [self._reader(name, cuts, cut_outputs) for name in outputs]
        signals = self._held_signals(outputs)
        self._slots = [self._master.slots[port] for port in signals]
        self._numbers = [instance.numbers() for instance in self._master.instances]
        ends = itertools.accumulate(map(len, self._numbers), initial=0)
        self._slices = [slice(*pair) for pair in itertools.pairwise(ends)]
        self.states = [*self._names_of_numbers(), *map(str, signals)]
        """The names of the states, in the order of x."""
        self.x = self._states()
        session.step(steps)
        self.u = np.array([self._input_value(port, cut) for port, cut in self._inputs])

    def __call__(self, x: Matrix, u: Matrix) -> tuple[Matrix, Matrix] | None:
        """The states at the end of the step, and the outputs; None where an FMU refuses x."""
        self._session.restore(self._start)
        for instance, part, numbers in zip(
            self._master.instances, self._slices, self._numbers, strict=True
        ):
            if not np.array_equal(x[part], numbers) and not instance.take_numbers(x[part]):
                return None
        signals = x[len(x) - len(self._slots) :]
        self._master.values[self._slots] = signals
        for (port, cut), value in zip(self._inputs, u.tolist(), strict=True):
            if cut:
                cut.value = value
            else:
                self._session.set(str(port), value)
        values_at_start = self._master.values.copy()
        self._session.step(self._steps)
        return self._states(), np.array([read(values_at_start) for read in self._outputs])

    def _held_signals(self, outputs: Sequence[str]) -> list[Port]:
        """The signals of the rows that may be held from one step to the next, in their order."""
        system, slots = self._session.system, self._master.slots
        ports = {connection.source for connection in system.connections}
        ports |= {read_at(system, as_signal("output", name))[0] for name in outputs}
        return sorted((port for port in ports if port in slots), key=lambda port: slots[port])

    def _names_of_numbers(self) -> list[str]:
        """A name for each number of the states of the FMUs, like plant.state[1]."""
        components = self._session.system.components
        return [
            f"{component.name}.state[{i}]"
            for component, numbers in zip(components, self._numbers, strict=True)
            for i in range(1, len(numbers) + 1)
        ]

    def _states(self) -> Matrix:
        numbers = [instance.numbers() for instance in self._master.instances]
        return np.concatenate([*numbers, self._master.values[self._slots]])

    def _input_value(self, port: Port, cut: Cut | None) -> float:
        """The value of an input in the step that was just done."""
        if cut:
            return cut.brought
        return float(self._master.read(port))

    def _reader(
        self, name: str, cuts: dict[Port, Cut], cut_outputs: dict[Port, CutOutput]
    ) -> Callable[[Matrix], float]:
        """What an output is, from the values of the master at the beginning of the step."""
        port, conversion = read_at(self._session.system, as_signal("output", name))
        if port in cuts:
            return lambda _: cuts[port].brought
        if port in cut_outputs:
            cut, (factor, offset) = cut_outputs[port]
            return lambda _: conversion((cut.brought - offset) / factor)
        slots = self._master.slots
        if port not in slots or port in self._master.texts:
            raise InputError(f"output {name!r}: no number of the run; {nearest(name, slots)}")
        return lambda values: conversion(float(values[slots[port]]))


def differences(macro_step: MacroStep) -> tuple[Matrix, Matrix, Matrix, Matrix]:
    """A, B, C and D about the x and u of the step; a state that takes no move is held."""
    x, u = macro_step.x, macro_step.u
    a, c = _derivatives(lambda moved: macro_step(moved, u), x)
    b, d = _derivatives(lambda moved: macro_step(x, moved), u)
    return a, b, c, d


def _derivatives(
    function: Callable[[Matrix], tuple[Matrix, Matrix] | None], point: Matrix
) -> tuple[Matrix, Matrix]:
    """The derivatives of both results of a function by each element of its argument.

    They are central differences; of an element that cannot be moved they are zero.
    """
    results = function(point)
    assert results is not None  # noqa: S101 - nothing was moved
    matrices = tuple(np.zeros((len(result), len(point))) for result in results)
    for i, value in enumerate(point.tolist()):
        move = RELATIVE_MOVE * max(abs(value), MIN_MAGNITUDE)
        low = function(_replaced(point, i, value - move))
        high = function(_replaced(point, i, value + move))
        if low is None or high is None:
            continue
        distance = (value + move) - (value - move)
        for matrix, low_result, high_result in zip(matrices, low, high, strict=True):
            matrix[:, i] = (high_result - low_result) / distance
    return matrices[0], matrices[1]


def _replaced(point: Matrix, i: int, value: float) -> Matrix:
    """A copy of a point with another value of its element i."""
    moved = point.copy()
    moved[i] = value
    return moved
