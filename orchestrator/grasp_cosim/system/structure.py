"""The parts of a system, as its checks and its readers see it, and the units of its values.

Units are named by a component's `units`, else declared by its FMU. What has neither is in SI.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from functools import cached_property
from typing import Any, Literal, TypeVar, get_args

from ..base.errors import InputError, choices, nearest
from ..base.registry import registered
from ..base.si_units import Unit
from ..base.text import on_a_screen
from ..interface.interface import Interface
from ..interface.units import IDENTITY, Conversion
from ..interface.values import Given
from ..interface.variables import Variable
from .parts import (
    Acceptance,
    Component,
    Connection,
    Event,
    Fault,
    Initialisation,
    Limit,
    Port,
    Realtime,
    SystemInput,
    SystemOutput,
)
from .record import Record
from .stimuli import Stimuli
from .times import Time, TimeGrid, in_seconds

Scheme = Literal["sequential", "jacobi"]
SCHEMES: tuple[str, ...] = get_args(Scheme)
Diverging = Literal["stop", "continue"]
DIVERGING: tuple[str, ...] = get_args(Diverging)

Derived = TypeVar("Derived")

MAX_NAMED_COMPONENTS, MAX_NAMED_PARTS = 4, 2
"""So many components, and connections or values, are named in the repr() of a system."""


@dataclass(frozen=True, repr=False)
class Structure:
    """Components, their connections, and the experiment.

    Times are in nanoseconds, and exact: see times.py. From start to stop it is a whole multiple of
    step_ns, and of the step of each component. notes are what its reader decided or did not use, a
    line each. roles name the component that plays a role; where they do not, the component of that
    name plays it. presets are values under a name, like {"bench": {"sensor_1.noise.seed": 1}}.
    input drives inputs without a connection, and tunable parameters. metrics are names of groups of
    ours. record says what is recorded. inputs and outputs are those of the system itself, which an
    archive may have, by name. limits are conditions that must not hold. verdict has the limits of a
    run with limits, with a bench or in real time. as_read is settings.summary() when it was read.
    steered says that a session has it, which may set any input without a source.
    """

    name: str
    components: tuple[Component, ...]
    connections: tuple[Connection, ...]
    step_ns: Time
    stop_ns: Time
    scheme: Scheme
    events: tuple[Event, ...] = field(default=(), hash=False)
    faults: tuple[Fault, ...] = field(default=(), hash=False)
    initialisation: Initialisation = Initialisation()
    notes: tuple[str, ...] = field(default=(), compare=False)
    roles: Mapping[str, str] = field(default_factory=dict, hash=False)
    presets: Mapping[str, Mapping[str, Given]] = field(default_factory=dict, hash=False)
    diverging: Diverging = "stop"
    input: Stimuli | None = field(default=None, hash=False)
    realtime: Realtime = Realtime()
    metrics: tuple[str, ...] = ()
    start_ns: Time = 0
    record: Record = Record()
    inputs: Mapping[str, SystemInput] = field(default_factory=dict, hash=False)
    outputs: Mapping[str, SystemOutput] = field(default_factory=dict, hash=False)
    limits: tuple[Limit, ...] = ()
    verdict: Acceptance = Acceptance()
    as_read: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)
    steered: bool = False

    def __repr__(self) -> str:
        """Its experiment, its components with their FMUs, and how many connections there are."""
        step, stop = in_seconds(self.step_ns), in_seconds(self.stop_ns)
        names = [f"{c.name} ({c.fmu.stem})" for c in self.components]
        values = [f"{c.name}.{n} = {v}" for c in self.components for n, v in c.values.items()]
        lines = [
            f"System {self.name}",
            f"  experiment   {stop:.6g} s in steps of {1e3 * step:.6g} ms, {self.scheme}",
            f"  components   {choices(names, MAX_NAMED_COMPONENTS)}",
            f"  connections  {len(self.connections)}: {choices(self.connections, MAX_NAMED_PARTS)}",
            f"  values       {choices(values, MAX_NAMED_PARTS)}",
        ]
        return on_a_screen(lines)

    def _repr_html_(self) -> str:
        """The diagram of its connections, and its experiment, as notebooks show them."""
        return str(registered("html", "System")(self))

    @property
    def total_steps(self) -> int:
        """The number of communication steps from the start to the stop time."""
        return int((self.stop_ns - self.start_ns) // self.step_ns)

    @property
    def time_grid(self) -> TimeGrid:
        """The communication points as a run counts them."""
        return TimeGrid.of(self.start_ns, self.step_ns)

    def time_ns(self, step: int) -> Time:
        """The time of a communication point.

        Args:
            step: Its number, counted from the start.

        Returns:
            The time in ns.
        """
        return self.start_ns + step * self.step_ns

    @cached_property
    def recorded(self) -> dict[Port, Variable]:
        """The signals that a run records, in the order of the system: no arrays, no binaries."""
        return self.record.chosen(self.components, self.acted_on)

    @cached_property
    def acted_on(self) -> frozenset[Port]:
        """The inputs that a fault, an event or a column of stimuli gives values that no output has.

        Of a session also those without a source, which it may set.
        """
        ports = {fault.target for fault in self.faults}
        ports |= {*(self.input.columns if self.input else ())}
        for event in self.events:
            ports |= {element for port in event.set for element in self.elements(port)}
        inputs = {
            Port(component.name, v.name): v
            for component in self.components
            for v in component.interface.inputs
        }
        if self.steered:
            connected = {connection.target for connection in self.connections}
            ports |= {p for p, v in inputs.items() if v.is_number and p not in connected}
        return frozenset(ports & inputs.keys())

    @cached_property
    def watched(self) -> dict[Port, Variable]:
        """The outputs but those that are left out; they must be finite, and must not run away."""
        return self.record.watched(self.components)

    @cached_property
    def observed(self) -> dict[Port, Variable]:
        """What is watched or recorded, in the order of the system: metrics get all of it."""
        if self.recorded == self.watched:
            return self.recorded
        either = {**self.watched, **self.recorded}
        return {
            port: either[port]
            for component in self.components
            for v in component.interface.variables
            if (port := Port(component.name, v.name)) in either
        }

    @property
    def observed_names(self) -> frozenset[str]:
        """The names of all that metrics may need: what is observed, and the system's outputs."""
        return frozenset({*map(str, self.observed), *self.outputs})

    @property
    def recorded_names(self) -> frozenset[str]:
        """Those of them that are recorded."""
        of_system = (name for name in self.outputs if self.record.has(name))
        return frozenset({*map(str, self.recorded), *of_system})

    @cached_property
    def by_name(self) -> dict[str, Component]:
        """The components by name, in their order."""
        return {component.name: component for component in self.components}

    def once(self, work: Callable[[Any], Derived]) -> Derived:
        """What a function makes of the system but for values of parameters, worked out once.

        Args:
            work: A function of the system only.

        Returns:
            What the function returned the first time.
        """
        if work not in self._results:
            self._results[work] = work(self)
        result: Derived = self._results[work]
        return result

    @cached_property
    def _results(self) -> dict[Callable[[Any], Any], Any]:
        return {}

    def __getstate__(self) -> dict[str, Any]:
        """Only the things that it was made of: other processes work out the rest themselves."""
        return {f.name: getattr(self, f.name) for f in fields(self)}

    def step_of(self, component: Component) -> Time:
        """The communication step of a component: its own, or else that of the system.

        Args:
            component: A component of this system.

        Returns:
            The step in ns.
        """
        return self.step_ns if component.step_ns is None else component.step_ns

    def period(self, name: str) -> int:
        """The step of a component, counted in communication steps of the system.

        Args:
            name: The name of the component.

        Returns:
            How many, at least 1.

        Raises:
            InputError: There is no such component.
        """
        return int(self.step_of(self.component(name, name)) // self.step_ns)

    def elements(self, port: Port) -> tuple[Port, ...]:
        """The elements of an array, in their order; of a scalar itself.

        Args:
            port: A component and one of its variables.

        Returns:
            A port for each element.
        """
        array = self.component(port.component, port).interface.arrays.get(port.variable)
        if array is None:
            return (port,)
        return tuple(Port(port.component, name) for name in array.names)

    def component(self, name: str, place: object) -> Component:
        """The component of a name.

        Args:
            name: The name of a component.
            place: Where the name comes from, at the beginning of the message.

        Returns:
            The component.

        Raises:
            InputError: There is no such component.
        """
        if name not in self.by_name:
            raise InputError(f"{place}: no component {name!r}; {nearest(name, self.by_name)}")
        return self.by_name[name]


def signal_units(system: Structure) -> dict[Port, Unit | None]:
    """The unit of each Real or Integer signal; None where none is told, or it is not defined."""
    return {
        port: unit_of(system.component(port.component, str(port)).interface, v)
        for port, v in system.observed.items()
        if v.kind in ("Real", "Integer")
    }


def unit_of(interface: Interface, variable: Variable) -> Unit | None:
    """The unit that a variable has, without its offset where that is a difference."""
    unit = interface.unit(variable)
    return unit.without_offset if unit and variable.relative else unit


def parameter_in_si(system: Structure, place: str, port: Port) -> Conversion:
    """The conversion of a parameter to SI base units; InputError where its unit is not defined."""
    interface = system.component(port.component, place).interface
    variable = interface.by_name.get(port.variable)
    unit = unit_of(interface, variable) if variable else None
    if unit:
        return Conversion(unit.factor, unit.offset)
    if variable and variable.kind == "Real" and variable.unit:
        raise InputError(
            f"{place}: {port} is in {variable.unit!r}: cannot be told in SI units; must be named: "
            f"{naming(port.component, port.variable)}"
        )
    return IDENTITY


def naming(component: str, variable: str) -> str:
    """The entry of a system file in which the unit of a variable is to be named."""
    return f'[components.{component}] units = {{ "{variable}" = "..." }}'
