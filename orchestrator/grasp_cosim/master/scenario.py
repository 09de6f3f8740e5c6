"""Events at run time: what happens at which communication point."""

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..fmi.instance import Instance
from ..interface.interface import Value, Variable
from ..system.description import System
from ..system.parts import Condition, Event, Fault, Port, first_step, literal, seconds
from ..system.scenario_checks import check_setting
from .fault_windows import Window, fault_functions

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
    have faults, by target: see fault_windows.py.
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
            _PendingEvent(f"events[{i}]", event, system, instances, slots, values)
            for i, event in enumerate(system.events)
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
                window.end()
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
        event = _PendingEvent(
            place,
            Event({port: value}),
            self._system,
            self._instances,
            self._slots,
            self._values,
        )
        self._note(step, event.happen())

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
