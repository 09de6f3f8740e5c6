"""What acts on a run from outside: events, faults of connections, stimuli.

Which kinds of faults there are: system/faults.py.
"""

from __future__ import annotations

import math
import operator
import sys
from array import array
from bisect import bisect_right
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import partial
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..fmi.instance import Instance, dtype
from ..interface.expansion import parse_values
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.units import IDENTITY
from ..interface.values import Given
from ..interface.variables import Variable
from ..system.connectors import read_at
from ..system.description import System
from ..system.faults import FAULTS, INITIAL, Act, Draws, Remembering
from ..system.names import main_port
from ..system.parts import Condition, Event, Fault, Port, literal
from ..system.scenario import check_setting
from ..system.times import Time, first_step, seconds
from ..system.validity import driven_inputs, driven_parameters, is_linear, samples_of
from .exchanged import exchanged, sourced

_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


@dataclass(slots=True, eq=False)
class _Once:
    """What happens once: at a step from first on, before end, of its period, where `when` holds.

    What it does gives lines for the log; `otherwise` is the one where it has not happened. Where it
    sets values, these are to be set again in FMUs that are loaded anew.
    """

    first: int
    end: float
    period: int
    when: Condition | None
    happen: Callable[[int], Sequence[str]]
    otherwise: str = ""
    sets: bool = False

    def due(self, step: int) -> float:
        """The first step from this one on at which it can happen."""
        found = -(-max(step, self.first) // self.period) * self.period
        return found if found < self.end else math.inf


Cut = Callable[[float], float]
"""What becomes of a value that is passed where a connection is cut, for an analysis."""

LARGEST = sys.float_info.max

DOUBLES = ("Real", "Float64")
"""The types that a float64 is, in FMI 2.0 and 3.0."""

NO_CUTS: Mapping[Port, Cut] = MappingProxyType({})


class _Line(NamedTuple):
    """A line of the log: what happened at a step; of what is set the value, how often, and last."""

    step: int
    text: str
    value: float | str | None = None
    times: int = 1
    last_step: int = 0
    last: float | str | None = None

    def said(self, system: System) -> str:
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


class _Scalar(NamedTuple):
    """A number that can be set in the run, and where its value is besides, if anywhere."""

    port: Port
    variable: Variable
    slot: int | None
    low: float
    high: float


class Scenario:
    """The events and faults of one run.

    log says what happened, a line each, in order; what a session sets many times has one line.
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
        self._lines: list[_Line] = []
        self._line_of: dict[Port, int] = {}
        self._applied: dict[object, Callable[[int], Sequence[str]]] = {}
        self._system, self._slots, self._values = system, slots, values
        self._instances = {instance.name: instance for instance in instances}
        self._passed = system.once(sourced)
        self._held = {port: slots[port] for port in system.once(exchanged).held if port in slots}
        self._pending: list[_Once] = []
        for i, event in enumerate(system.events):
            self._add_event(f"events[{i}]", event)
        windows = []
        for i, fault in enumerate(system.faults):
            given = {n: self._number(fault.target, v) for n, v in fault.parameters.items()}
            numbers = replace(fault, parameters=given)
            windows.append(Window(numbers, system.step_ns, system.start_ns))
            self._pending += windows[-1].ends(f"faults[{i}]")
        self.fault_functions = fault_functions(windows, system.step_ns, cuts)
        self.tunings = tunings_of(system)
        self._due = self._next_step(0)
        self._settable: dict[str, Port] = {}
        self._scalars: dict[str, _Scalar] = {}

    def _add_event(self, place: str, event: Event) -> None:
        system, otherwise = self._system, f"{event.when} never held"
        if event.at_ns is not None:
            otherwise = f"no step began at or after t = {seconds(event.at_ns)}"
        at_ns = system.start_ns if event.at_ns is None else event.at_ns
        first = first_step(at_ns, system.step_ns, system.start_ns)
        period = math.lcm(*(system.period(port.component) for port in event.set))
        happen, said = self._setter(place, event), f"{place} did not happen: {otherwise}"
        self._pending.append(_Once(first, math.inf, period, event.when, happen, said, sets=True))

    @property
    def log(self) -> list[str]:
        """What happened, a line each."""
        return [line.said(self._system) for line in self._lines]

    def renew(self, instances: Sequence[Instance]) -> None:
        """Act on other instances of the same components from now on."""
        self._instances.clear()
        self._instances.update({instance.name: instance for instance in instances})

    def saved(self) -> tuple[Any, ...]:
        """What has happened, for restore(); what was set is in the FMUs."""
        said = [*self._lines], dict(self._line_of), dict(self._applied)
        happened = said, [*self._pending], self._due
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
        for once in self._pending[:]:
            if once.due(step) == step and self._holds(once.when):
                self._pending.remove(once)
                self._lines += [_Line(step, line) for line in once.happen(step)]
                if once.sets:
                    self._applied[once] = once.happen
        self._due = self._next_step(step + 1)

    def _next_step(self, step: int) -> float:
        """The first step from this one on at which something may be due."""
        due = [once.due(step) for once in self._pending]
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
            tuning.port.variable: of_kind(tuning.variable.kind, tuning.now)
            for tuning in self.tunings
            if tuning.port.component == name
        }

    def set(self, name: str, value: Given, step: int) -> None:
        """Set what an event could set, now, at communication point step; of an array also all.

        InputError where there is none of that name, or where the value does not fit;
        SimulationError where the component refuses it.
        """
        scalar = self._scalars.get(name)
        happen: Callable[[int], Sequence[str]]
        said: float | str
        if scalar and type(value) is float and scalar.low <= value <= scalar.high:
            port, happen, said = scalar.port, partial(self._put, scalar, value), value
        else:
            port = self._settable.get(name) or self._settable_port(name, value)
            happen = self._setter(f"set: {name}", Event({port: value}))
            said = literal(value)  # now, as a list of its user's may change
        happen(step)
        self._applied.pop(port, None)  # what is set last is set last again
        self._applied[port] = happen
        number = self._line_of.setdefault(port, len(self._lines))
        if number == len(self._lines):
            self._lines.append(_Line(step, str(port), said))
        else:
            first = self._lines[number]
            self._lines[number] = first._replace(times=first.times + 1, last_step=step, last=said)

    def _settable_port(self, name: str, value: Given) -> Port:
        """The port of a name that can be set to a value, which is kept; InputError if it cannot."""
        component, _, variable = name.partition(".")
        interfaces = {n: instance.interface for n, instance in self._instances.items()}
        port = main_port(interfaces, Port(component, variable))
        check_setting(self._system, port, value, f"set: {name}")
        self._settable[name] = port
        v = interfaces[port.component].by_name.get(port.variable)
        if v and v.type in DOUBLES and not v.element and port not in self._passed:
            self._scalars[name] = _Scalar(
                port, v, self._held.get(port), max(v.low, -LARGEST), min(v.high, LARGEST)
            )
        return port

    def _put(self, scalar: _Scalar, value: float, _: int) -> Sequence[str]:
        """Set a number."""
        self._instances[scalar.port.component].set([scalar.variable], [value])
        if scalar.slot is not None:
            self._values[scalar.slot] = value
        return ()

    def pending(self) -> list[str]:
        """A line for each event that has not happened and each fault that has not begun."""
        return [once.otherwise for once in self._pending if once.otherwise]

    def _holds(self, condition: Condition | None) -> bool:
        if condition is None:
            return True
        port, change = read_at(self._system, condition.port)
        value = float(self._values[self._slots[port]])
        if change != IDENTITY:
            value = change(value)
        return _COMPARE[condition.relation](value, self._number(port, condition.value))

    def _number(self, port: Port, value: Value) -> float:
        """The number of a constant for a port, which may be the name of an item."""
        if not isinstance(value, str):
            return value
        return self._instances[port.component].interface.by_name[port.variable].items[value]

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
                    variables, given = calls.setdefault(port.component, ([], []))
                    variables.append(interface.by_name[name])
                    given.append(parsed)
                    if element in self._held:
                        placed[self._held[element]] = stored(interface, name, parsed)
        reason = f" ({event.when})" if event.when else ""
        lines = [f"{port} = {literal(value)}{reason}" for port, value in event.set.items()]

        def happen(_: int) -> Sequence[str]:
            for component, (variables, given) in calls.items():
                self._instances[component].set(variables, given)
            for slot, number in placed.items():
                self._values[slot] = number
            return lines

        return happen


class Window:
    """The steps in which a fault acts. With a condition they are only known when it begins."""

    def __init__(self, fault: Fault, step_ns: Time, start_ns: Time = 0) -> None:
        self.fault = fault
        self._earliest = first_step(fault.start_ns, step_ns, start_ns)
        self._end: float = math.inf
        if fault.end_ns is not None:
            self._end = first_step(fault.end_ns, step_ns, start_ns)
        first: float = (self._earliest or INITIAL) if fault.when is None else math.inf
        self.acting = False, first
        """Whether it has begun, and from which step on it acts."""

    def acts(self, step: int) -> bool:
        """Return True if the fault acts on the values passed in this step."""
        return self.acting[1] <= step < self._end

    def ends(self, place: str) -> list[_Once]:
        """Its beginning, and its end where it has one."""
        name = f"{self.fault.target}: {self.fault.kind}"

        def begin(step: int) -> Sequence[str]:
            self.acting = True, min(self.acting[1], step)
            return [f"{name} begins"]

        otherwise = f"{place} did not begin: {name}"
        found = [_Once(self._earliest, self._end, 1, self.fault.when, begin, otherwise)]
        if self._end < math.inf:
            said = f"{name} ends"
            end = _Once(int(self._end), math.inf, 1, None, lambda _: [said] * self.acting[0])
            found.append(end)
        return found


class FaultFunction:
    """Changes a value passed at a step number: the faults of a connection, one after the other.

    A cut of that connection comes after them.
    """

    def __init__(self, cut: Cut | None) -> None:
        self._cut = cut
        self._chain: list[tuple[Act, Window]] = []

    def add(self, act: Act, window: Window) -> None:
        """Add a fault to the end."""
        self._chain.append((act, window))

    def __call__(self, value: float, step: int) -> float:
        """What becomes of the value."""
        for act, window in self._chain:
            value = act(value, step, window.acts(step))
        return self._cut(value) if self._cut else value

    def saved(self) -> list[tuple[Any, ...]]:
        """When the faults began, and what they remember, for restore()."""
        return [
            (window.acting, act.saved() if isinstance(act, Remembering) else None)
            for act, window in self._chain
        ]

    def restore(self, saved: list[tuple[Any, ...]]) -> None:
        """Go back to what was saved."""
        for (act, window), (acting, memory) in zip(self._chain, saved, strict=True):
            window.acting = acting
            if isinstance(act, Remembering):
                act.restore(memory)


def fault_functions(
    windows: Sequence[Window], step_ns: Time, cuts: Mapping[Port, Cut] = NO_CUTS
) -> Mapping[Port, FaultFunction]:
    """Return for each connection that has faults or a cut, by target, all of them in turn."""
    targets = dict.fromkeys([*(window.fault.target for window in windows), *cuts])
    functions = {target: FaultFunction(cuts.get(target)) for target in targets}
    kinds: Counter[tuple[Port, str]] = Counter()
    for window in windows:
        fault, key = window.fault, (window.fault.target, window.fault.kind)
        act = FAULTS[fault.kind].start(fault.parameters, Draws(fault, kinds[key]), step_ns)
        functions[fault.target].add(act, window)
        kinds[key] += 1
    return functions


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
    def now(self) -> float:
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
    found: dict[Port, Drive] = {}
    if system.input is None:
        return found
    times = ticks_of(system)
    for port in driven_inputs(system):
        variable = system.component(port.component, str(port)).interface.by_name[port.variable]
        linear, samples = is_linear(system.input, variable), samples_of(system, port)
        found[port] = Drive(slots[port], times, samples, linear)
    return found


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
