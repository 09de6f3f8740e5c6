"""What acts on a run from outside: events, faults of connections, stimuli.

Which kinds of faults there are: system/faults.py.
"""

from __future__ import annotations

import math
import operator
from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..fmi.instance import Instance
from ..interface.interface import Value, Variable
from ..system.description import System
from ..system.faults import FAULTS, INITIAL, Act, Draws
from ..system.parts import Condition, Event, Fault, Port, first_step, literal, seconds
from ..system.scenario import check_setting
from ..system.stimuli_checks import driven, is_linear, samples_of

FaultFunction = Callable[[float, int], float]
"""Changes a value passed at a step number."""

_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


class Scenario:
    """The events and faults of one run.

    log says what happened, a line each, in order. fault_functions are those of the connections that
    have faults, by target.
    """

    def __init__(
        self,
        system: System,
        instances: Sequence[Instance],
        slots: Mapping[Port, int],
        values: npt.NDArray[np.float64],
    ) -> None:
        """Values holds the outputs of now whenever a method is called, at the places in slots."""
        self.log: list[str] = []
        self._system, self._instances = system, instances
        self._slots, self._values = slots, values
        self._events = [
            self._pending(f"events[{i}]", event) for i, event in enumerate(system.events)
        ]
        self._windows = [
            Window(f"faults[{i}]", self._in_numbers(fault), system.step_ns, system.start_ns)
            for i, fault in enumerate(system.faults)
        ]
        self.fault_functions = fault_functions(self._windows, system.step_ns)
        self._due = self.next_step(0)
        self._settable: set[Port] = set()

    def before_step(self, step: int) -> None:
        """Do what is due at communication point `step`, before the step that begins there.

        Steps come in order. SimulationError where a component refuses a value.
        """
        if self._due is None or step < self._due:
            return
        for event in self._events[:]:
            if event.next_step(step) == step and self._holds(event.event.when):
                self._events.remove(event)
                self._note(step, event.happen())
        for window in self._windows:
            if window.may_begin(step) and self._holds(window.fault.when):
                window.begin(step)
                self._note(step, [f"{window} begins"])
            elif window.must_end(step):
                window.ended = True
                self._note(step, [f"{window} ends"])
        self._due = self.next_step(step + 1)

    def set(self, name: str, value: Value, step: int) -> None:
        """Set what an event could set, now, at communication point step.

        InputError where there is none of that name, or where the value does not fit;
        SimulationError where the component refuses it.
        """
        component, _, variable = name.partition(".")
        port, place = Port(component, variable), f"set: {name}"
        if port not in self._settable:
            check_setting(self._system, port, value, place)
            self._settable.add(port)
        self._note(step, self._pending(place, Event({port: value})).happen())

    def _pending(self, name: str, event: Event) -> _PendingEvent:
        return _PendingEvent(name, event, self._system, self._instances, self._slots, self._values)

    def next_step(self, step: int) -> int | None:
        """The first step from this one on that needs before_step, as things are; None: none does.

        That is the step itself while a condition is pending there.
        """
        steps = [event.next_step(step) for event in self._events]
        steps += [k for w in self._windows if (k := w.next_step(step)) is not None]
        return min(steps, default=None)

    def pending(self) -> list[str]:
        """A line for each event that has not happened and each fault that has not begun."""
        events = [f"{event.name} did not happen: {event.reason()}" for event in self._events]
        faults = [f"{w.name} did not begin: {w}" for w in self._windows if not w.begun]
        return events + faults

    def _note(self, step: int, lines: Sequence[str]) -> None:
        self.log += [f"t = {seconds(self._system.time_ns(step))}: {line}" for line in lines]

    def _holds(self, condition: Condition | None) -> bool:
        if condition is None:
            return True
        value = float(self._values[self._slots[condition.port]])
        return _COMPARE[condition.relation](value, self._number(condition.port, condition.value))

    def _number(self, port: Port, value: Value) -> float:
        """The number of a constant for a port, which may be the name of an item."""
        if not isinstance(value, str):
            return value
        interface = next(i.interface for i in self._instances if i.name == port.component)
        return interface.by_name[port.variable].items[value]

    def _in_numbers(self, fault: Fault) -> Fault:
        """The fault with numbers in the place of names of items."""
        given = {n: self._number(fault.target, v) for n, v in fault.parameters.items()}
        return replace(fault, parameters=given)


class _PendingEvent:
    """An event that has not happened yet, with the calls that it makes."""

    def __init__(
        self,
        name: str,
        event: Event,
        system: System,
        instances: Sequence[Instance],
        slots: Mapping[Port, int],
        values: npt.NDArray[np.float64],
    ) -> None:
        """An element of an array that is connected in part has a slot, and is passed on from it."""
        self.name = name
        self.event = event
        self._period = math.lcm(*(system.period(port.component) for port in event.set))
        at_ns = system.start_ns if event.at_ns is None else event.at_ns
        self._first = first_step(at_ns, system.step_ns, system.start_ns)
        self._calls: dict[str, tuple[Instance, list[Variable], list[Value]]] = {}
        self._placed: dict[int, float] = {}
        self._values = values
        by_name = {instance.name: instance for instance in instances}
        for port, value in event.set.items():
            instance = by_name[port.component]
            if port in slots:
                number = instance.interface.parse(name, port.variable, value)
                exact(f"{name}: {port}", number)
                self._placed[slots[port]] = float(number)
                continue
            _, variables, given = self._calls.setdefault(port.component, (instance, [], []))
            variables.append(instance.interface.by_name[port.variable])
            given.append(instance.interface.parse(name, port.variable, value))

    def next_step(self, step: int) -> int:
        """The first step from this one on at which it can happen."""
        return -(-max(step, self._first) // self._period) * self._period

    def happen(self) -> list[str]:
        """Set what it sets; lines for the log that say so."""
        for instance, variables, values in self._calls.values():
            instance.set(variables, values)
        for slot, number in self._placed.items():
            self._values[slot] = number
        reason = f" ({self.event.when})" if self.event.when else ""
        return [f"{port} = {literal(value)}{reason}" for port, value in self.event.set.items()]

    def reason(self) -> str:
        """Return why it has not happened."""
        if self.event.when is not None:
            return f"{self.event.when} never held"
        return f"no step began at or after t = {seconds(self.event.at_ns or 0)}"


class Window:
    """The steps in which a fault acts. With a condition they are only known when it begins."""

    def __init__(self, name: str, fault: Fault, step_ns: int, start_ns: int = 0) -> None:
        self.name = name
        self.fault = fault
        self.begun = False
        self.ended = False
        self._earliest = first_step(fault.start_ns, step_ns, start_ns)
        self._end: float = math.inf
        if fault.end_ns is not None:
            self._end = first_step(fault.end_ns, step_ns, start_ns)
        self._first: float = self._earliest or INITIAL
        if fault.when is not None:
            self._first = math.inf

    def __str__(self) -> str:
        return f"{self.fault.target}: {self.fault.kind}"

    def acts(self, step: int) -> bool:
        """Return True if the fault acts on the values passed in this step."""
        return self._first <= step < self._end

    def may_begin(self, step: int) -> bool:
        """Return True if it begins at this step, provided that its condition holds."""
        return not self.begun and self._earliest <= step < self._end

    def begin(self, step: int) -> None:
        """Act from this step on, at the latest."""
        self.begun = True
        self._first = min(self._first, step)

    def must_end(self, step: int) -> bool:
        """Return True if it has begun, and this step is behind its last one."""
        return self.begun and not self.ended and step >= self._end

    def next_step(self, step: int) -> int | None:
        """Return the first step from this one on at which it may begin or must end, or None."""
        if not self.begun:
            earliest = max(step, self._earliest)
            return earliest if earliest < self._end else None
        return None if self.ended or self._end == math.inf else max(step, int(self._end))


def fault_functions(windows: Sequence[Window], step_ns: int) -> Mapping[Port, FaultFunction]:
    """Return for each connection that has faults, by target, all of them one after the other."""
    chains: dict[Port, list[tuple[Act, Window]]] = {}
    kinds: Counter[tuple[Port, str]] = Counter()
    for window in windows:
        fault, key = window.fault, (window.fault.target, window.fault.kind)
        act = FAULTS[fault.kind].start(fault.parameters, Draws(fault, kinds[key]), step_ns)
        chains.setdefault(fault.target, []).append((act, window))
        kinds[key] += 1
    return {target: partial(_in_turn, chain) for target, chain in chains.items()}


def _in_turn(chain: Sequence[tuple[Act, Window]], value: float, step: int) -> float:
    for act, window in chain:
        value = act(value, step, window.acts(step))
    return value


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
