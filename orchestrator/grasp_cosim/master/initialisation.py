"""Values at t = 0: passed on along the dependencies, algebraic loops found and solved.

The ports and what depends on what make a graph. A loop is cut at the input by which it is entered.
The values of the inputs that were cut are found by Newton's method.

What a proxy puts out was measured: it is taken once its inputs are set, and held until the first
step. A loop through one is cut there.

Many FMUs have the outputs of their start only after initialisation mode: these are read then, and
passed on along the same graph where they are others than before.
"""

from collections.abc import Callable, Container, Mapping, Sequence
from graphlib import TopologicalSorter
from itertools import groupby
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..base.errors import InputError, choices
from ..base.text import counted
from ..fmi.instance import Instance
from ..interface.fmi_types import Value
from ..interface.variables import Variable
from ..system.description import System
from ..system.faults import INITIAL
from ..system.parts import Connection, Initialisation, Port
from ..system.validity import transforms
from .drives import of_kind

Floats = npt.NDArray[np.float64]

DIFFERENCE = 1e-7
"""Relative change of an input for the derivatives of Newton's method."""

NAMED = 3
"""The most inputs that the line on the loops names; an error has their whole paths."""

ADVICE = (
    "must have a component without direct feedthrough in it, or [initialisation] "
    'loops = "iterate" with a tolerance that can be reached'
)


class Order(NamedTuple):
    """The order in which values are passed on in initialisation mode, and the loops in it.

    Each port is known when it is needed. An output depends on the inputs that its FMU declares for
    the initialisation, or else in general, or else on all. A loop is the path of its ports from the
    input at which it was cut, first = last. measured are outputs of proxies that were in a loop:
    they depend on nothing any more.
    """

    ports: Sequence[Port]
    loops: Sequence[Sequence[Port]]
    measured: Sequence[Port]


def order_ports(system: System) -> Order:
    """The order of a system."""
    graph = _graph(system)
    proxies = {component.name for component in system.components if component.is_proxy}
    inputs = {connection.target for connection in system.connections}
    measured: list[Port] = []
    while outputs := _measured_in_loops(graph, inputs, proxies):
        for port in outputs:
            graph[port] = []
        measured += outputs
    loops = cut_loops(graph, inputs)
    return Order(tuple(TopologicalSorter(graph).static_order()), loops, measured)


def _measured_in_loops(
    graph: Mapping[Port, list[Port]], inputs: Container[Port], proxies: Container[str]
) -> list[Port]:
    """The outputs of proxies that are in a loop."""
    if not proxies:
        return []
    loops = cut_loops({port: [*needed] for port, needed in graph.items()}, inputs)
    ports = dict.fromkeys(port for loop in loops for port in loop)
    return [port for port in ports if port.component in proxies and port not in inputs]


def cut_loops(graph: dict[Port, list[Port]], inputs: Container[Port]) -> list[tuple[Port, ...]]:
    """Cut the loops of a graph: the inputs at which they are cut depend on nothing any more.

    A depth-first search follows the values. If it comes back to a port of its path, it notes the
    loop, cuts it at its first input and continues from before that: many loops take one search.
    """
    users: dict[Port, list[Port]] = {port: [] for port in graph}
    for port, needed in graph.items():
        for source in needed:
            users[source].append(port)
    loops: list[tuple[Port, ...]] = []
    cut: set[Port] = set()
    finished: set[Port] = set()

    def search(start: Port) -> None:
        path: dict[Port, int] = {} if start in finished else {start: 0}
        following = [iter(users[port]) for port in path]
        while path:
            user = next((u for u in following[-1] if u not in finished and u not in cut), None)
            if user is None:
                finished.add(path.popitem()[0])
                following.pop()
            elif user not in path:
                path[user] = len(path)
                following.append(iter(users[user]))
            else:
                loop = [*path][path[user] :]
                entry = next(port for port in loop if port in inputs)
                at = loop.index(entry)
                loops.append((*loop[at:], *loop[:at], entry))
                cut.add(entry)
                graph[entry] = []
                for _ in loop[at:] if at else ():
                    path.popitem()
                    following.pop()

    for port in graph:
        search(port)
        for source in graph[port]:
            search(source)
    return loops


def _graph(system: System) -> dict[Port, list[Port]]:
    """For each port those it depends on, in the order of the system: the same in every process."""
    sources = {connection.target: connection.source for connection in system.connections}
    graph: dict[Port, list[Port]] = {}
    for component in system.components:
        name, interface = component.name, component.loaded
        inputs = tuple(v.name for v in interface.of("input"))
        ports_of: dict[tuple[str, ...], list[Port]] = {}  # the elements of an array share theirs
        connected = [p for i in inputs if (p := Port(name, i)) in sources]
        graph |= {port: [sources[port]] for port in connected}
        for v in interface.of("output"):
            declared = v.dependencies if v.initial_dependencies is None else v.initial_dependencies
            needed = inputs if declared is None else declared
            if needed not in ports_of:
                ports = (Port(name, i) for i in needed)
                ports_of[needed] = [port for port in ports if port in sources]
            graph[Port(name, v.name)] = ports_of[needed]
    return graph


class Propagation:
    """Passes values on between instances in initialisation mode, in the order of order_ports()."""

    def __init__(
        self,
        system: System,
        instances: Sequence[Instance],
        faults: Mapping[Port, Callable[[float, int], float]],
        step: int = INITIAL,
    ) -> None:
        """At the start, or at a communication point where the loop is initialised again."""
        self.system = system
        self._step = step
        self._ports, loops, self._measured = system.once(order_ports)
        self._proxies = {c.name for c in system.components if c.is_proxy}
        self._cuts = [loop[0] for loop in loops]
        self._in_loops = {port for loop in loops for port in loop}
        paths = "; ".join(" -> ".join(map(str, path)) for path in loops)
        self._loops = f"{system.name}: algebraic loop at t = 0: {paths}"
        self.values: dict[Port, Value] = {}
        self._instances = {instance.name: instance for instance in instances}
        self._connections = {connection.target: connection for connection in system.connections}
        self._transforms = system.once(transforms)
        self._faults = faults

    def run(self) -> list[str]:
        """Settle all values; a line for all algebraic loops that were iterated.

        InputError where a loop does not converge, or where loops are to be refused.
        """
        cuts, choice = self._cuts, self.system.initialisation
        notes: list[str] = []
        if self._measured:
            notes = [
                f"{choices(self._measured, NAMED)}: measured once at t = 0, before what goes round "
                "to the inputs of the proxy arrives there"
            ]
        if not cuts:
            self._pass_on({})
            return [*notes, *self._check_dependencies()]
        if choice.loops == "refuse":
            raise InputError(f"{self._loops}; {ADVICE}")
        for port in cuts:
            if self._kind(port) != "Real":
                raise InputError(
                    f"{self._loops}, and {port} is {self._kind(port)}: "
                    f"only loops of Real values can be iterated; {ADVICE}"
                )
        count, residual = self._solve(choice)
        # Other values may solve a loop that its start values solve: a note reports these.
        solution = f"solved in {counted(count, 'iteration')}"
        if not count:
            solution = "its start values solve it and are kept"
            if not any(self.values[port] for port in self._in_loops):
                solution = (
                    "all its values are 0 and are kept, which solves it if its FMUs work out "
                    "their outputs before the first step"
                )
        loops = "algebraic loop" if len(cuts) == 1 else f"{len(cuts)} algebraic loops"
        line = (
            f"{loops} at t = 0 through {choices(cuts, NAMED)}: {solution}, to a relative residual "
            f"of {residual:.1e}"
        )
        return [*notes, line, *self._check_dependencies()]

    def after_exit(self) -> list[str]:
        """Read all outputs again, out of initialisation mode, and pass on those that changed.

        An input at which a loop was cut is set in the first pass only: what comes back there later
        is in the values, and left to the first step. A line where inputs go on changing, as they do
        in a loop that only the dependencies in initialisation mode hide: they are left as they are.
        """
        moved = self._read([port for port in self._ports if port not in self._connections])
        left_alone: set[Port] = set()
        for _ in range(len(self._ports) + 1):
            inputs = self._pass_on_moved(moved, left_alone) if moved else []
            if not inputs:
                break
            left_alone = set(self._cuts)
        for port, connection in self._connections.items():
            if connection.source in moved:
                self.values[port] = self._arriving(connection)
        if not inputs:
            return []
        return [f"{choices(inputs, NAMED)}: what arrives goes on changing after the initialisation"]

    def _pass_on_moved(self, moved: set[Port], left_alone: set[Port]) -> list[Port]:
        """Pass on the outputs that moved, once along the data flow; return the inputs that changed.

        The outputs behind these are read, and added to `moved` where they changed.
        """
        changed: list[Port] = []
        behind: set[Port] = set()
        for (component, arriving), group in groupby(self._ports, self._end):
            ports = list(group)
            if not arriving:
                moved |= self._read([port for port in ports if port in behind])
                behind.difference_update(ports)
                continue
            connections = [self._connections[p] for p in ports if p not in left_alone]
            arrived = {c.target: self._arriving(c) for c in connections if c.source in moved}
            inputs = {p: x for p, x in arrived.items() if not _same(x, self.values[p])}
            if inputs:
                variables = [self._variable(port) for port in inputs]
                self._instances[component].set(variables, list(inputs.values()))
                self.values |= inputs
                changed += inputs
                behind |= self._depending(component, {port.variable for port in inputs})
        moved |= self._read([port for port in self._ports if port in behind])
        return changed

    def _depending(self, component: str, inputs: set[str]) -> set[Port]:
        """The outputs of a component that may depend on any of the inputs after initialisation."""
        return {
            Port(component, v.name)
            for v in self._instances[component].interface.of("output")
            if v.dependencies is None or not inputs.isdisjoint(v.dependencies)
        }

    def _read(self, outputs: Sequence[Port]) -> set[Port]:
        """Read outputs, component by component; return those that changed."""
        by_component: dict[str, list[Port]] = {}
        for port in outputs:
            if self._variable(port).supported and port.component not in self._proxies:
                by_component.setdefault(port.component, []).append(port)
        changed: set[Port] = set()
        for component, ports in by_component.items():
            values = self._instances[component].get([self._variable(port) for port in ports])
            for port, value in zip(ports, values, strict=True):
                if not _same(value, self.values[port]):
                    changed.add(port)
                    self.values[port] = value
        return changed

    def _solve(self, choice: Initialisation) -> tuple[int, float]:
        """Newton's method for the inputs that were cut; iterations and relative residual."""
        at = [(self._instances[port.component], self._variable(port)) for port in self._cuts]
        x = np.array([float(instance.get([variable])[0]) for instance, variable in at])
        nominal = np.array([variable.nominal for _, variable in at])
        for count in range(1, choice.iterations + 1):
            g = self._evaluate(x)
            residual = float(np.max(np.abs(g - x) / np.maximum(nominal, np.abs(g))))
            if not np.isfinite(residual):
                break
            # A start value is not taken for the solution because both are small.
            if residual <= choice.tolerance and (count > 1 or not residual):
                return count - 1, residual
            try:
                x = x - np.linalg.solve(self._slope(x, g, nominal) - np.eye(len(x)), g - x)
            except np.linalg.LinAlgError:
                break
        raise InputError(
            f"{self._loops}: does not converge to a relative residual of {choice.tolerance:g} in "
            f"{choice.iterations} iterations; {ADVICE}"
        )

    def _slope(self, x: Floats, g: Floats, nominal: Floats) -> Floats:
        """The derivatives of what comes back at the cuts, by what is put in there."""
        columns = []
        for i in range(len(x)):
            moved = x.copy()
            moved[i] += DIFFERENCE * max(nominal[i], abs(x[i]))
            columns.append((self._evaluate(moved) - g) / (moved[i] - x[i]))
        return np.array(columns).T

    def _evaluate(self, x: Floats) -> Floats:
        """Return the values that come back at the cuts when `x` is put in there."""
        self._pass_on(dict(zip(self._cuts, x.tolist(), strict=True)))
        arriving = [self._arriving(self._connections[port]) for port in self._cuts]
        return np.array(arriving, np.float64)

    def _pass_on(self, values_at_cuts: Mapping[Port, Value], again: bool = False) -> None:
        """Pass all on, with values given for inputs; `again`, what was measured is held."""
        for (component, arriving), group in groupby(self._ports, self._end):
            instance, ports = self._instances[component], list(group)
            variables = [self._variable(port) for port in ports]
            if arriving:
                values = [
                    values_at_cuts[p]
                    if p in values_at_cuts
                    else self._arriving(self._connections[p])
                    for p in ports
                ]
                instance.set(variables, values)
            elif again and component in self._proxies:
                continue
            else:
                taken = [(p, v) for p, v in zip(ports, variables, strict=True) if v.supported]
                ports = [port for port, _ in taken]
                values = instance.get([variable for _, variable in taken])
            self.values |= zip(ports, values, strict=True)

    def _end(self, port: Port) -> tuple[str, bool]:
        """Of ports that follow one another, those with the same are passed on in one call."""
        return port.component, port in self._connections

    def _arriving(self, connection: Connection) -> Value:
        value = self.values[connection.source]
        if self._kind(connection.target) == "String":
            return value
        factor, offset = self._transforms[connection.target]
        number = float(value)
        if (factor, offset) != (1.0, 0.0):
            number = factor * number + offset
        if connection.target in self._faults:
            number = self._faults[connection.target](number, self._step)
        return of_kind(self._kind(connection.target), number)

    def _check_dependencies(self) -> list[str]:
        """Pass on again while outputs change: a line for each that hides a dependency.

        Outputs that nothing is connected to may change each time they are read, like the time of
        day.
        """
        values_at_cuts = {port: self.values[port] for port in self._cuts}
        sources = {connection.source for connection in self._connections.values()}
        undeclared: list[Port] = []
        for _ in range(len(self._ports) + 1):
            previous = dict(self.values)
            self._pass_on(values_at_cuts, again=True)
            changed = [
                port
                for port, value in self.values.items()
                if port not in self._connections and value != previous[port] and value == value
            ]
            if not changed:
                return [
                    f"{port} changed at t = 0 with an input that it does not declare to depend on; "
                    "values were passed on again"
                    for port in dict.fromkeys(undeclared)
                ]
            undeclared.append(changed[0])  # the others may follow from it
        if sources.isdisjoint(changed):
            return [f"{port} changes each time it is read" for port in changed]
        raise InputError(
            f"{self.system.name}: the values at t = 0 do not settle, a loop through "
            f"{choices(dict.fromkeys(undeclared))} that the FMUs' dependencies do not show; "
            f"{ADVICE}"
        )

    def _variable(self, port: Port) -> Variable:
        return self._instances[port.component].interface.by_name[port.variable]

    def _kind(self, port: Port) -> str:
        return self._variable(port).kind


def _same(first: Value, second: Value) -> bool:
    """True for equal values, and for two that are both not a number."""
    return first == second or (first != first and second != second)
