"""The flat plan: a system turned into one vector of values and a program for the loop.

In the vector what is fetched comes first: the outputs, and whatever else is recorded, or named in a
condition. Then come the inputs that have a source, which are passed. The Real values of a component
stand together, so that one FMI call moves them all; values of another type have a buffer of their
type next to the vector. Of a String that is fetched the vector has, at its end, the number of its
text in a table of those seen so far; a connection between Strings is a call.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from ..base.calls import Call
from ..exchange.bounds import Bounds
from ..exchange.listener import Texts
from ..fmi.instance import CLOCK, Instance, dtype
from ..interface.variables import Variable
from ..realtime.pacer import Pacer
from ..system.description import System
from ..system.parts import Connection, Port
from ..system.times import in_seconds
from ..system.validity import transforms
from .drives import Drive
from .exchanged import exchanged, used
from .exchanges import NO_EXCHANGES
from .loop import (
    CALL,
    COPY,
    DRIVE,
    EXCHANGE,
    HELD,
    LOAD,
    LOAD_LONG,
    RAISED,
    SCALE,
    STEP,
    STORE,
    WATCH,
)
from .scenario import Scenario

LONG = 8
"""Bytes of a whole number that a float64 may not hold exactly."""

Operation = tuple[int, int, int, int, int]
"""Kind, first and last of its range, period and phase."""


@dataclass(frozen=True, slots=True)
class Plan:
    """Everything the loop works on.

    operations refer to connections (source, target, factor, offset), casts (buffer, index, slot),
    drives and calls. clock is the loop's. warned has two numbers for each call: how many warnings
    it has returned, and the time in s of the step in which it returned the first.
    """

    values: npt.NDArray[np.float64]
    clock: npt.NDArray[np.float64]
    operations: list[Operation] = field(default_factory=list)
    connections: list[tuple[int, int, float, float]] = field(default_factory=list)
    casts: list[tuple[int, int, int]] = field(default_factory=list)
    buffers: list[npt.NDArray[Any]] = field(default_factory=list)
    drives: list[Drive] = field(default_factory=list)
    watches: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros((0, HELD + 1)))
    """Conditions that the loop looks at after each step: those of Planner.watched, in its order."""
    exchanges: npt.NDArray[np.float64] = field(default_factory=NO_EXCHANGES.copy)
    """Exchanges of energy, with the columns that loop.py names."""
    bounds: Bounds = field(default_factory=lambda: Bounds(0))
    """What the compiled loop compares the first values of each row with."""
    calls: list[Call] = field(default_factory=list)
    owners: list[Instance | None] = field(default_factory=list)
    """By call, the instance that it is made to; None for a call of the master's own."""
    warned: npt.NDArray[np.float64] = field(default_factory=lambda: np.zeros(0))
    raised: list[BaseException] = field(default_factory=list)
    """Errors of the Python calls that returned RAISED: they must not pass through compiled code."""


@dataclass(eq=False)
class Planner:
    """Makes the plan of a system: collects its parts in the order of execution.

    Over the given vector of values; slots are those of exchanged(), texts by String. The
    scenario is asked at the start of each macro step, after the pacer of a run in real time.
    """

    system: System
    instances: Mapping[str, Instance]
    slots: Mapping[Port, int]
    values: npt.NDArray[np.float64]
    scenario: Scenario
    texts: Mapping[Port, Texts]
    drives: Mapping[Port, Drive]
    watches: npt.NDArray[np.float64]
    exchanges: npt.NDArray[np.float64]
    bounds: Bounds
    pacer: Pacer | None = None

    def __post_init__(self) -> None:
        self.stamps = 0
        self.transforms = self.system.once(transforms)
        self.exchanged = self.system.once(exchanged)
        self.used = self.system.once(used)
        self.arriving: dict[str, list[Connection]] = {name: [] for name in self.instances}
        for connection in self.system.connections:
            self.arriving[connection.target.component].append(connection)
        self.driven: dict[str, list[Drive]] = {name: [] for name in self.instances}
        for port, drive in self.drives.items():
            self.driven[port.component].append(drive)
        self.strings: dict[str, list[Port]] = {name: [] for name in self.instances}
        for port in self.texts:
            self.strings[port.component].append(port)
        self.made = Plan(
            self.values,
            np.zeros(len(CLOCK)),
            watches=self.watches,
            exchanges=self.exchanges,
            bounds=self.bounds,
        )
        self.view: Any = memoryview(self.values)  # type: ignore[arg-type]  # numpy's 3.11 stubs

    def plan(self) -> Plan:
        """The program of a macro step in the scheme of the system, and what it works on."""
        if self.pacer is not None:
            self._python(self.pacer, 1, 0)
        if self.system.events or self.system.faults or self.scenario.tunings:
            self._python(self.scenario.before_step, 1, 0)
        names = list(self.instances)
        if self.system.scheme == "sequential":
            for name in names:
                last = self.system.period(name) - 1
                self._move(name, last)
                self._stamp()
                self._pass(name, last)
                self._step(name)
                self._stamp()
        else:
            for name in names:
                self._move(name, 0)
            self._stamp()
            for name in names:
                self._pass(name, 0)
                self._stamp()
            for name in names:
                self._step(name)
                self._stamp()
        self._operation(EXCHANGE, 0, len(self.exchanges), 1, 0)
        for i in range(len(self.watches)):
            self._operation(WATCH, i, i + 1, 1, 0)
        waits, *other_calls = self.made.calls
        if self.pacer is not None and all(c.native and not c.keeps_lock for c in other_calls):
            native = self.pacer.native(self.system.total_steps)
            self.made.calls[0] = Call(waits.python, native)
        return self.made

    def _move(self, name: str, phase: int) -> None:
        """What drives a component, the connections that end there, then their faults."""
        period, first = self.system.period(name), len(self.made.drives)
        self.made.drives.extend(self.driven[name])
        self._operation(DRIVE, first, len(self.made.drives), period, phase)
        connections = self.arriving[name]
        numbers = [c for c in connections if not self._is_string(c.target)]
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
            if self._is_string(connection.target):
                self._text(connection, period, phase)

    def _is_string(self, port: Port) -> bool:
        return self.instances[port.component].interface.by_name[port.variable].kind == "String"

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
        """Fetch the Strings of a component, if there are any to be fetched."""
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
        """Advance a component and fetch its values, at the end of its step."""
        period = self.system.period(name)
        step = in_seconds(period * self.system.step_ns)
        instance = self.instances[name]
        self._call(STEP, instance.stepper(self.made.clock, step), instance, period, period - 1)
        self._fetch(name, period - 1)
        self._fetch_texts(name, period - 1)

    def _pass(self, name: str, phase: int) -> None:
        """Pass all inputs that have a source, a call per FMI type."""
        instance, period = self.instances[name], self.system.period(name)
        for variables in self.exchanged.passed[name]:
            first, data = self._data(name, variables)
            if data.dtype != np.float64:
                self._casts(STORE, range(len(variables)), first, period, phase)
            self._call(CALL, instance.transfer("set", variables, data), instance, period, phase)

    def _fetch(self, name: str, phase: int) -> None:
        """Fetch what the run must know of a component, a call per FMI type.

        Of whole numbers of 64 bits those that are used must be exact as a float64; the others are
        only recorded, as far as that holds them.
        """
        instance, period = self.instances[name], self.system.period(name)
        for variables in self.exchanged.fetched[name]:
            first, data = self._data(name, variables)
            self._call(CALL, instance.transfer("get", variables, data), instance, period, phase)
            if data.dtype == np.float64:
                continue
            is_long = data.dtype.kind in "iu" and data.dtype.itemsize == LONG
            places = range(len(variables))
            exact = [i for i in places if is_long and Port(name, variables[i].name) in self.used]
            self._casts(LOAD_LONG, exact, first, period, phase)
            self._casts(LOAD, sorted({*places} - {*exact}), first, period, phase)

    def _data(self, name: str, variables: Sequence[Variable]) -> tuple[int, npt.NDArray[Any]]:
        """The first slot of variables of one FMI type, and what their values are moved in.

        That are their slots themselves, or a buffer of another type.
        """
        first, count = self.slots[Port(name, variables[0].name)], len(variables)
        element = dtype(self.instances[name].interface.version, variables[0].type)
        if element == np.float64:
            return first, self.made.values[first : first + count]
        self.made.buffers.append(np.zeros(count, element))
        return first, self.made.buffers[-1]

    def _casts(self, kind: int, places: Sequence[int], first: int, period: int, phase: int) -> None:
        """Move values at these places between the last buffer and the slots from the first on."""
        begin, buffer = len(self.made.casts), len(self.made.buffers) - 1
        self.made.casts.extend((buffer, i, first + i) for i in places)
        self._operation(kind, begin, len(self.made.casts), period, phase)

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
