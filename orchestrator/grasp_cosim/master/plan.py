"""The flat plan: a system turned into one vector of values and a program for the loop.

In the vector the outputs come first, then the inputs that have a connection. The Real values of a
component stand together, so that one FMI call moves them all; values of another type have a
buffer of their type beside the vector. Of a String output the vector has, at its end, the number of
its text in a table of those seen so far; a connection between Strings is a call.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..exchange.listener import Texts
from ..fmi.instance import CLOCK, Instance, dtype
from ..interface.interface import Interface, Variable
from ..realtime.pacer import Pacer
from ..system.description import System
from ..system.parts import Connection, Port
from ..system.times import in_seconds
from ..system.validity import driven, transforms
from .loop import CALL, COPY, DRIVE, LOAD, LOAD_LONG, RAISED, SCALE, STEP, STORE
from .scenario import Drive, Scenario

Operation = tuple[int, int, int, int, int]
"""Kind, first and last of its range, period and phase."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything the loop works on.

    operations refer to connections (source, target, factor, offset), casts (buffer, index, slot),
    drives and calls. clock is the loop's.
    """

    values: npt.NDArray[np.float64]
    clock: npt.NDArray[np.float64]
    operations: list[Operation] = field(default_factory=list)
    connections: list[tuple[int, int, float, float]] = field(default_factory=list)
    casts: list[tuple[int, int, int]] = field(default_factory=list)
    buffers: list[npt.NDArray[Any]] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    calls: list[Call] = field(default_factory=list)
    owners: list[Instance | None] = field(default_factory=list)
    """By call, the instance that it is made to; None for a call of the master's own."""
    raised: list[BaseException] = field(default_factory=list)
    """Errors of the Python calls that returned RAISED: they must not pass through compiled code."""


def slots_of(system: System) -> dict[Port, int]:
    """The place of each output, and of each number that is an input with a source; Strings last.

    With an element of an array all others have one, too: an array is passed whole.
    """
    connected = {*(connection.target for connection in system.connections), *driven(system)}
    for component in system.components:
        for array in component.loaded.arrays.values():
            elements = {Port(component.name, name) for name in array.names}
            if not connected.isdisjoint(elements):
                connected |= elements
    ports = [
        Port(component.name, v.name)
        for causality in ("output", "input")
        for component in system.components
        for _, variables in _by_type(component.loaded, causality)
        for v in variables
        if causality == "output" or Port(component.name, v.name) in connected
    ]
    ports += [port for port, v in system.recorded.items() if v.kind == "String"]
    return {port: slot for slot, port in enumerate(ports)}


@dataclass(eq=False)
class Planner:
    """Makes the plan of a system: collects its parts in the order of execution.

    Over the given vector of values; slots are those of slots_of(), texts by String output. The
    scenario is asked at the start of each macro step, after the pacer of a run in real time.
    """

    system: System
    instances: Mapping[str, Instance]
    slots: Mapping[Port, int]
    values: npt.NDArray[np.float64]
    scenario: Scenario
    texts: Mapping[Port, Texts]
    drives: Mapping[Port, Drive]
    pacer: Pacer | None = None

    def __post_init__(self) -> None:
        self.stamps = 0
        self.transforms = self.system.once(transforms)
        self.arriving: dict[str, list[Connection]] = {name: [] for name in self.instances}
        for connection in self.system.connections:
            self.arriving[connection.target.component].append(connection)
        self.driven: dict[str, list[Drive]] = {name: [] for name in self.instances}
        for port, drive in self.drives.items():
            self.driven[port.component].append(drive)
        self.strings: dict[str, list[Port]] = {name: [] for name in self.instances}
        for port in self.texts:
            self.strings[port.component].append(port)
        self.made = Plan(self.values, np.zeros(len(CLOCK)))
        self.view: Any = memoryview(self.values)  # type: ignore[arg-type]  # numpy's 3.11 stubs

    def plan(self) -> Plan:
        """The program of a macro step in the scheme of the system, and what it works on."""
        if self.pacer is not None:
            self._python(self.pacer, 1, 0)
        if self.system.events or self.system.faults:
            self._python(self.scenario.before_step, 1, 0)
        names = list(self.instances)
        if self.system.scheme == "sequential":
            for name in names:
                last = self.system.period(name) - 1
                self._move(name, last)
                self._stamp()
                self._transfer(name, "input", last)
                self._step(name)
                self._stamp()
        else:
            for name in names:
                self._move(name, 0)
            self._stamp()
            for name in names:
                self._transfer(name, "input", 0)
                self._stamp()
            for name in names:
                self._step(name)
                self._stamp()
        waits, *others = self.made.calls
        if self.pacer is not None and all(c.native and not c.keeps_lock for c in others):
            native = self.pacer.native(self.system.total_steps)
            self.made.calls[0] = Call(waits.python, native)
        return self.made

    def _move(self, name: str, phase: int) -> None:
        """What drives a component, the connections that end there, then their faults."""
        period, first = self.system.period(name), len(self.made.drives)
        self.made.drives.extend(self.driven[name])
        self._operation(DRIVE, first, len(self.made.drives), period, phase)
        connections = self.arriving[name]
        numbers = [connection for connection in connections if connection.target in self.slots]
        for kind in (COPY, SCALE):
            first = len(self.made.connections)
            for connection in numbers:
                transform = self.transforms[connection.target]
                if (transform == (1.0, 0.0)) == (kind == COPY):
                    ends = self.slots[connection.source], self.slots[connection.target]
                    self.made.connections.append((*ends, *transform))
            self._operation(kind, first, len(self.made.connections), period, phase)
        for connection in connections:
            if connection.target in self.scenario.fault_functions:
                self._fault(connection.target, period, phase)
            if connection.target not in self.slots:
                self._text(connection, period, phase)

    def _stamp(self) -> None:
        """The end of a segment of the step: see realtime.timing.Meter."""
        if self.pacer is not None:
            self._call(CALL, self.pacer.stamp(self.stamps), None, 1, 0)
            self.stamps += 1

    def _fault(self, target: Port, period: int, phase: int) -> None:
        fault, slot, view = self.scenario.fault_functions[target], self.slots[target], self.view

        def act(step: int) -> None:
            view[slot] = fault(view[slot], step)

        self._python(act, period, phase)

    def _text(self, connection: Connection, period: int, phase: int) -> None:
        target = self.instances[connection.target.component]
        taken_in = target.interface.by_name[connection.target.variable]
        texts, slot = self.texts[connection.source], self.slots[connection.source]
        view = self.view

        def pass_on(_: int) -> None:
            target.set([taken_in], [texts.listed[int(view[slot])]])

        self._python(pass_on, period, phase)

    def _fetch_texts(self, name: str, phase: int) -> None:
        """Fetch the String outputs of a component, if it has any."""
        instance, view = self.instances[name], self.view
        ports = self.strings[name]
        variables = [instance.interface.by_name[port.variable] for port in ports]

        def fetch(_: int) -> None:
            for port, text in zip(ports, instance.get(variables), strict=True):
                view[self.slots[port]] = self.texts[port].number(str(text))

        if ports:
            self._python(fetch, self.system.period(name), phase)

    def _python(self, function: Callable[[int], None], period: int, phase: int) -> None:
        clock = memoryview(self.made.clock)  # type: ignore[arg-type]

        def call() -> int:
            function(int(clock[1]))
            return 0

        self._call(CALL, Call(call), None, period, phase)

    def _step(self, name: str) -> None:
        """Advance a component and fetch its outputs, at the end of its own step."""
        period = self.system.period(name)
        step = in_seconds(period * self.system.step_ns)
        instance = self.instances[name]
        self._call(STEP, instance.stepper(self.made.clock, step), instance, period, period - 1)
        self._transfer(name, "output", period - 1)
        self._fetch_texts(name, period - 1)

    def _transfer(self, name: str, causality: str, phase: int) -> None:
        """Pass all connected inputs, or fetch all outputs, a call per FMI type."""
        instance, period = self.instances[name], self.system.period(name)
        for fmi_type, variables in _by_type(instance.interface, causality):
            taken = [v for v in variables if Port(name, v.name) in self.slots]
            if not taken:
                continue
            first, count = self.slots[Port(name, taken[0].name)], len(taken)
            data: npt.NDArray[Any] = self.made.values[first : first + count]
            element = dtype(instance.interface.version, fmi_type)
            cast = element != np.float64
            casts = (len(self.made.casts), len(self.made.casts) + count)
            if cast:
                data = np.zeros(count, element)
                buffer = len(self.made.buffers)
                self.made.casts.extend((buffer, i, first + i) for i in range(count))
                self.made.buffers.append(data)
            if cast and causality == "input":
                self._operation(STORE, *casts, period, phase)
            action = "set" if causality == "input" else "get"
            self._call(CALL, instance.transfer(action, taken, data), instance, period, phase)
            if cast and causality == "output":
                long = element.kind in "iu" and element.itemsize == 8
                self._operation(LOAD_LONG if long else LOAD, *casts, period, phase)

    def _call(self, kind: int, call: Call, owner: Instance | None, period: int, phase: int) -> None:
        self._operation(kind, len(self.made.calls), len(self.made.calls) + 1, period, phase)
        self.made.calls.append(call if call.native else Call(self._guarded(call.python)))
        self.made.owners.append(owner)

    def _guarded(self, function: Callable[[], int]) -> Callable[[], int]:
        def call() -> int:
            try:
                return function()
            except BaseException as error:
                self.made.raised.append(error)
                return RAISED

        return call

    def _operation(self, kind: int, first: int, last: int, period: int, phase: int) -> None:
        if last > first:
            self.made.operations.append((kind, first, last, period, phase))


def _by_type(interface: Interface, causality: str) -> list[tuple[str, list[Variable]]]:
    """The scalar numbers of a causality, by FMI type, those of float64 first."""
    found: dict[str, list[Variable]] = {}
    for v in interface.of(causality):
        if v.is_number:
            found.setdefault(v.type, []).append(v)
    return sorted(found.items(), key=lambda item: item[0] not in ("Real", "Float64"))
