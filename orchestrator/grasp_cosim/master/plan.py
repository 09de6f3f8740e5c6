"""The flat plan: a system turned into vectors of values and bound calls.

One vector holds the Real values, one the Integer and Boolean ones. In each, all outputs come first
(they are recorded), then the inputs that have a wire. The values of a component stand together, so
that one FMI call moves them all.
"""

import ctypes
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..errors import SimulationError
from ..fmi.fmi2 import Call
from ..system.description import System
from ..system.interface import Interface, Value, Variable
from ..system.parts import NANOSECONDS, Port

REAL = ("Real",)
INTEGER = ("Integer", "Boolean")
"""The kinds of variables that share a vector, in their order in it."""

Move = tuple[memoryview, int, int]
"""A vector, the place of a wired input in it and that of its source."""


class Instance(Protocol):
    """What the master needs of a component; FmuInstance is one, a test's mock another."""

    @property
    def name(self) -> str:
        """The component's name in the system."""

    @property
    def interface(self) -> Interface:
        """What it declares."""

    def enter_initialization(self, values: Mapping[str, Value], stop: float) -> None:
        """Set start values and enter initialisation mode; the experiment ends at stop in s."""

    def exit_initialization(self) -> None:
        """Leave initialisation mode."""

    def setters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        """Calls that pass float64 and int32 buffers to inputs, in the order of their kinds."""

    def getters(self, variables: Sequence[Variable], reals: Any, integers: Any) -> list[Call]:
        """Calls that fetch outputs into such buffers."""

    def stepper(self, time: ctypes.c_double, step: float) -> Call:
        """The call that advances by step seconds from the time in the box."""

    def failure(self, status: int, time: float) -> SimulationError:
        """The error for a call that returned a bad status at time in s."""


@dataclass(frozen=True, slots=True)
class Signal:
    """A recorded output: name, unit (None without one), kind and place in its vector."""

    name: str
    unit: str | None
    kind: str
    slot: int


@dataclass(frozen=True, slots=True)
class Link:
    """A component in the plan: where its inputs come from, and its calls."""

    instance: Instance
    moves: tuple[Move, ...]
    send: tuple[Call, ...]
    receive: tuple[Call, ...]
    step: tuple[Call, ...]
    """Send, advance and receive, in one go."""


@dataclass(frozen=True, slots=True)
class Plan:
    """The vectors, what is recorded of them, and the components in their order of execution."""

    reals: npt.NDArray[np.float64]
    integers: npt.NDArray[np.int32]
    signals: tuple[Signal, ...]
    links: tuple[Link, ...]


def make_plan(system: System, instances: Sequence[Instance], time: ctypes.c_double) -> Plan:
    """The plan of a system; time is the box the calls read the current time in s from."""
    reals = _Vector(np.float64, REAL, system, instances)
    integers = _Vector(np.int32, INTEGER, system, instances)
    return Plan(
        reals.values,
        integers.values,
        tuple(_signals(instances, reals, integers)),
        tuple(_link(system, instance, reals, integers, time) for instance in instances),
    )


class _Vector:
    """The values of some kinds, and the place of each port."""

    def __init__(
        self,
        dtype: npt.DTypeLike,
        kinds: Sequence[str],
        system: System,
        instances: Sequence[Instance],
    ) -> None:
        self.kinds = kinds
        self._sources = {wire.target: wire.source for wire in system.wires}
        ports = [
            Port(instance.name, variable.name)
            for causality in ("output", "input")
            for instance in instances
            for variable in self.exchanged(instance, causality)
        ]
        self.slots = {port: slot for slot, port in enumerate(ports)}
        self.values = np.zeros(len(ports), dtype)

    def exchanged(self, instance: Instance, causality: str) -> list[Variable]:
        """All outputs, or the wired inputs, of a component that belong into this vector."""
        return [
            v
            for kind in self.kinds
            for v in instance.interface.of(causality)
            if v.kind == kind
            and (causality == "output" or Port(instance.name, v.name) in self._sources)
        ]

    def part(self, instance: Instance, causality: str) -> npt.NDArray[Any]:
        """The view of the vector that holds these variables."""
        variables = self.exchanged(instance, causality)
        first = self.slots[Port(instance.name, variables[0].name)] if variables else 0
        return self.values[first : first + len(variables)]

    def moves(self, instance: Instance) -> list[Move]:
        """How the sources of the wired inputs get into their places."""
        view = memoryview(self.values)  # type: ignore[arg-type]  # numpy's stubs for 3.11
        targets = [Port(instance.name, v.name) for v in self.exchanged(instance, "input")]
        return [(view, self.slots[port], self.slots[self._sources[port]]) for port in targets]


def _link(
    system: System, instance: Instance, reals: _Vector, integers: _Vector, time: ctypes.c_double
) -> Link:
    calls = {}
    for causality, bind in (("input", instance.setters), ("output", instance.getters)):
        variables = [
            *reals.exchanged(instance, causality),
            *integers.exchanged(instance, causality),
        ]
        calls[causality] = bind(
            variables, reals.part(instance, causality), integers.part(instance, causality)
        )
    advance = instance.stepper(time, system.step_ns / NANOSECONDS)
    return Link(
        instance,
        (*reals.moves(instance), *integers.moves(instance)),
        tuple(calls["input"]),
        tuple(calls["output"]),
        (*calls["input"], advance, *calls["output"]),
    )


def _signals(instances: Sequence[Instance], reals: _Vector, integers: _Vector) -> list[Signal]:
    signals = []
    for instance in instances:
        for variable in instance.interface.of("output"):
            port = Port(instance.name, variable.name)
            vector = reals if variable.kind in REAL else integers
            if port in vector.slots:
                signals.append(Signal(str(port), variable.unit, variable.kind, vector.slots[port]))
    return signals
