"""What acts on a run from outside: events, faults, stimuli, and what a session sets."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..base.errors import InputError
from ..fmi.instance import Instance, RefusedValueError
from ..interface.expansion import parse_values
from ..interface.fmi_types import Value
from ..interface.units import IDENTITY
from ..interface.values import Given
from ..interface.variables import Variable
from ..system.conditions import COMPARE, compared, number_of
from ..system.description import System
from ..system.names import main_port
from ..system.parts import Condition, Event, Port, literal
from ..system.scenario import parse_set_values
from ..system.times import first_step, in_seconds, seconds
from .drives import Tuning, of_kind, stored, tunings_of
from .exchanged import exchanged, sourced
from .fault_windows import NO_CUTS, Cut, Window, fault_functions
from .occurrence import Occurrence
from .requests import Answer, Request, Requests

LARGEST = sys.float_info.max

DOUBLES = ("Real", "Float64")
"""The types that a float64 is, in FMI 2.0 and 3.0."""


class LogLine(NamedTuple):
    """A line of the log: what happened at a step; of what is set the value, how often, and last."""

    step: int
    text: str
    value: float | str | None = None
    times: int = 1
    last_step: int = 0
    last: float | str | None = None

    def with_times(self, system: System) -> str:
        """The line, with its times."""
        first = seconds(system.time_ns(self.step))
        value = "" if self.value is None else f" = {_written(self.value)}"
        line = f"t = {first}: {self.text}{value}"
        if self.last is None:
            return line
        last = seconds(system.time_ns(self.last_step))
        return (
            f"{line}; set {self.times} times, the last at t = {last}: "
            f"{self.text} = {_written(self.last)}"
        )


def _written(value: float | str) -> str:
    """What was set as the system file writes it; texts are so, numbers when the log is read."""
    return value if isinstance(value, str) else literal(value)


class SettableNumber(NamedTuple):
    """A number that can be set in the run, and the other place of its value, if there is one."""

    port: Port
    variable: Variable
    slot: int | None
    low: float
    high: float


class Scenario:
    """The events and faults of one run.

    log has the events, a line each, in order; what a session sets many times has one line.
    fault_functions are those of the connections that have faults, by target.
    """

    def __init__(
        self,
        system: System,
        instances: Sequence[Instance],
        slots: Mapping[Port, int],
        values: npt.NDArray[np.float64],
        cuts: Mapping[Port, Cut] = NO_CUTS,
    ) -> None:
        """Values holds the signals of now whenever a method is called, at the places in slots."""
        self._lines: list[LogLine] = []
        self._line_of: dict[Port, int] = {}
        self._applied: dict[object, Callable[[int], Sequence[str]]] = {}
        self._system, self._slots, self._values = system, slots, values
        self._instances = {instance.name: instance for instance in instances}
        self._passed = system.once(sourced)
        self._held = {port: slots[port] for port in system.once(exchanged).held if port in slots}
        self._pending: list[Occurrence] = []
        for i, event in enumerate(system.events):
            self._add_event(f"events[{i}]", event)
        windows = []
        for i, fault in enumerate(system.faults):
            given = fault.parameters.items()
            parameters = {n: number_of(system, fault.target, v) for n, v in given}
            in_numbers = replace(fault, parameters=parameters)
            windows.append(Window(in_numbers, system.step_ns, system.start_ns))
            self._pending += windows[-1].occurrences(f"faults[{i}]")
        self.fault_functions = fault_functions(windows, system.step_ns, cuts)
        self.tunings = tunings_of(system)
        self._due = self._next_step(0)
        self.done_requests: list[Event] = []
        """The requests that were done, as events at their communication points."""
        self._requested: list[Occurrence] = []
        self._settable: dict[str, Port] = {}
        self._scalars: dict[str, SettableNumber] = {}

    def _add_event(self, place: str, event: Event) -> None:
        system, absence = self._system, f"{event.when} never held"
        if event.at_ns is not None:
            absence = f"no step began at or after t = {seconds(event.at_ns)}"
        at_ns = system.start_ns if event.at_ns is None else event.at_ns
        first = first_step(at_ns, system.step_ns, system.start_ns)
        period = math.lcm(*(system.period(port.component) for port in event.set))
        happen, not_happened = self._setter(place, event), f"{place} did not happen: {absence}"
        self._pending.append(
            Occurrence(first, math.inf, period, event.when, happen, not_happened, sets=True)
        )

    @property
    def request_due(self) -> float:
        """The first step at which a request is due; infinite where there is none."""
        return min((occurrence.first for occurrence in self._requested), default=math.inf)

    def take(self, requests: Requests, step: int) -> None:
        """Have requests done before the first step from this one on that their component takes.

        They come behind the events of the system, in their order. One that its FMU refuses is
        answered by an InputError, and the run goes on.
        """
        for request in requests.take():
            period = self._system.period(request.port.component)
            due = -(-step // period) * period
            event = Event({request.port: request.value})
            try:
                act = self._setter("set", event)
            except InputError as error:  # a number that its slot does not hold
                requests.settle(request, error)
                continue
            happen = partial(self._do, requests, request, act)
            occurrence = Occurrence(due, math.inf, period, None, happen)
            self._requested.append(occurrence)
            self._pending.append(occurrence)
            self._due = min(self._due, due)

    def _do(
        self,
        requests: Requests,
        request: Request,
        happen: Callable[[int], Sequence[str]],
        step: int,
    ) -> Sequence[str]:
        """Do a request at a step, and answer it; the lines for the log."""
        port, self._requested = request.port, [o for o in self._requested if o.first > step]
        try:
            lines = happen(step)
        except RefusedValueError as error:
            requests.settle(request, InputError(f"set: {port}: {error}"))
            return ()
        except Exception as error:
            requests.settle(request, error)
            raise
        time = self._system.time_ns(step)
        self.done_requests.append(Event({port: request.value}, at_ns=math.floor(time)))
        self._applied.pop(port, None)
        self._applied[port] = happen
        instance = self._instances[port.component]
        (value,) = instance.get([instance.interface.by_name[port.variable]])
        line = LogLine(step, lines[0]).with_times(self._system)
        requests.settle(request, Answer(in_seconds(time), value, line))
        return lines

    @property
    def log(self) -> list[str]:
        """What happened, a line each."""
        return [line.with_times(self._system) for line in self._lines]

    def renew(self, instances: Sequence[Instance]) -> None:
        """Act on other instances of the same components from now on."""
        self._instances.clear()
        self._instances.update({instance.name: instance for instance in instances})

    def saved(self) -> tuple[Any, ...]:
        """What has happened, for restore(); what was set is in the FMUs."""
        log = [*self._lines], dict(self._line_of), dict(self._applied)
        happened = log, [*self._pending], self._due
        faults = [function.saved() for function in self.fault_functions.values()]
        return happened, faults, [tuning.taken for tuning in self.tunings]

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved."""
        ((lines, line_of, applied), pending, self._due), faults, taken = saved
        self._lines, self._line_of, self._applied = [*lines], dict(line_of), dict(applied)
        self._pending = [*pending]
        for function, fault in zip(self.fault_functions.values(), faults, strict=True):
            function.restore(fault)
        for tuning, count in zip(self.tunings, taken, strict=True):
            tuning.taken = count

    def apply_again(self, step: int) -> None:
        """Set once more what events, and set(), have set before."""
        for happen in self._applied.values():
            happen(step)

    def before_step(self, step: int) -> None:
        """Do what is due at communication point `step`, before the step that begins there.

        Steps come in order. SimulationError where a component refuses a value.
        """
        if step < self._due:
            return
        self._tune(step)
        for occurrence in self._pending[:]:
            if occurrence.due(step) == step and self._holds(occurrence.when):
                self._pending.remove(occurrence)
                self._lines += [LogLine(step, line) for line in occurrence.happen(step)]
                if occurrence.sets:
                    self._applied[occurrence] = occurrence.happen
        self._due = self._next_step(step + 1)

    def _next_step(self, step: int) -> float:
        """The first step from this one on at which something may be due."""
        due = [occurrence.due(step) for occurrence in self._pending]
        due += [tuning.due for tuning in self.tunings]
        return min(due, default=math.inf)

    def _tune(self, step: int) -> None:
        """Set the parameters that stimuli drive and that change now, those of an FMU together."""
        changing: dict[str, list[Tuning]] = {}
        for tuning in self.tunings:
            if tuning.due == step:
                changing.setdefault(tuning.port.component, []).append(tuning)
        for name, tunings in changing.items():
            variables = [tuning.variable for tuning in tunings]
            values = [of_kind(tuning.variable.kind, tuning.take()) for tuning in tunings]
            self._instances[name].set(variables, values)

    def tuned_at_start(self, name: str) -> dict[str, Value]:
        """The values of the parameters of a component that stimuli drive, at the start or now."""
        return {
            tuning.port.variable: of_kind(tuning.variable.kind, tuning.value)
            for tuning in self.tunings
            if tuning.port.component == name
        }

    def set(self, values: Mapping[str, Given], step: int) -> None:
        """Set what an event could set, now, at communication point step; of arrays also all.

        An FMU gets its numbers by one call, after what is no number. InputError where there is
        none of that name, or where a value does not fit; SimulationError where a component refuses
        it.
        """
        numbers: dict[str, list[tuple[SettableNumber, float]]] = {}
        for name, value in values.items():
            scalar = self._scalars.get(name)
            if scalar and type(value) is float and scalar.low <= value <= scalar.high:
                numbers.setdefault(scalar.port.component, []).append((scalar, value))
            else:
                self._set_other(name, value, step)
        for pairs in numbers.values():
            self._put(pairs, step)
            for pair in pairs:
                scalar, value = pair
                self._note(scalar.port, partial(self._put, [pair]), value, step)

    def _set_other(self, name: str, value: Given, step: int) -> None:
        """Set what is no number, or was not set before."""
        port = self._settable.get(name) or self._settable_port(name, value)
        happen = self._setter(f"set: {name}", Event({port: value}))
        happen(step)
        self._note(port, happen, literal(value), step)  # now, as a list of its user's may change

    def _note(
        self, port: Port, happen: Callable[[int], Sequence[str]], value: float | str, step: int
    ) -> None:
        """Keep what was set: for FMUs that are loaded again, and for the log."""
        self._applied.pop(port, None)  # what is set last is set last again
        self._applied[port] = happen
        number = self._line_of.setdefault(port, len(self._lines))
        if number == len(self._lines):
            self._lines.append(LogLine(step, str(port), value))
        else:
            first = self._lines[number]
            self._lines[number] = first._replace(times=first.times + 1, last_step=step, last=value)

    def _settable_port(self, name: str, value: Given) -> Port:
        """The port of a name that can be set to a value, which is kept; InputError if it cannot."""
        component, _, variable = name.partition(".")
        interfaces = {n: instance.interface for n, instance in self._instances.items()}
        port = main_port(interfaces, Port(component, variable))
        parse_set_values(self._system, port, value, f"set: {name}")
        self._settable[name] = port
        v = interfaces[port.component].by_name.get(port.variable)
        if v and v.type in DOUBLES and not v.element and port not in self._passed:
            self._scalars[name] = SettableNumber(
                port, v, self._held.get(port), max(v.low, -LARGEST), min(v.high, LARGEST)
            )
        return port

    def _put(self, pairs: Sequence[tuple[SettableNumber, float]], _: int) -> Sequence[str]:
        """Set numbers of one component."""
        instance = self._instances[pairs[0][0].port.component]
        instance.set([scalar.variable for scalar, _ in pairs], [value for _, value in pairs])
        for scalar, value in pairs:
            if scalar.slot is not None:
                self._values[scalar.slot] = value
        return ()

    def pending(self) -> list[str]:
        """A line for each event that has not happened and each fault that has not begun."""
        return [occurrence.absence for occurrence in self._pending if occurrence.absence]

    def _holds(self, condition: Condition | None) -> bool:
        if condition is None:
            return True
        port, change, constant = compared(self._system, condition)
        value = float(self._values[self._slots[port]])
        if change != IDENTITY:
            value = change(value)
        return bool(COMPARE[condition.relation](value, constant))

    def _setter(self, place: str, event: Event) -> Callable[[int], Sequence[str]]:
        """What an event does.

        An element of an array that is connected in part is passed on from its slot; an input that
        is held there has in it what its FMU got.
        """
        calls: dict[str, tuple[list[Variable], list[Value]]] = {}
        placed: dict[int, float] = {}
        for port, value in event.set.items():
            interface = self._instances[port.component].interface
            for name, parsed in parse_values(interface, place, port.variable, value).items():
                element = Port(port.component, name)
                if element in self._passed:
                    exact(f"{place}: {element}", parsed)
                    placed[self._slots[element]] = float(parsed)
                else:
                    variables, set_values = calls.setdefault(port.component, ([], []))
                    variables.append(interface.by_name[name])
                    set_values.append(parsed)
                    if element in self._held:
                        placed[self._held[element]] = stored(interface, name, parsed)
        reason = f" ({event.when})" if event.when else ""
        lines = [f"{port} = {literal(value)}{reason}" for port, value in event.set.items()]

        def happen(_: int) -> Sequence[str]:
            for component, (variables, set_values) in calls.items():
                self._instances[component].set(variables, set_values)
            for slot, number in placed.items():
                self._values[slot] = number
            return lines

        return happen
