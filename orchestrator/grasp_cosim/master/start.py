"""The start of a loop: all components are initialised at one communication point.

That is the beginning of the run, or where a loop with a bench is initialised again.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ..base.checks import exact
from ..base.errors import InputError, SimulationError
from ..exchange.listener import Texts
from ..fmi.instance import Instance
from ..interface.fmi_types import Value
from ..system.description import System
from ..system.faults import INITIAL
from ..system.parts import Component, Port
from ..system.times import in_seconds
from .drives import Drive, driven_at, stored
from .exchanged import exchanged, used
from .initialisation import Propagation
from .scenario import Scenario


@dataclass
class Start:
    """What the initialisation of a loop has to tell."""

    log: list[str] = field(default_factory=list)
    """Lines for the log."""
    asked_ends: list[tuple[Instance, float]] = field(default_factory=list)
    """The instances that asked for the end of the simulation, and the time in s."""
    peers: dict[str, dict[str, str]] = field(default_factory=dict)
    """The name and the build of the peer of each proxy, by component."""


@dataclass(frozen=True)
class Starter:
    """Initialises the instances of a system, and puts their values into the vector of the loop.

    slots are the places of values, texts the tables of the Strings among them, drives what drives
    inputs, by port.
    """

    system: System
    instances: Sequence[Instance]
    scenario: Scenario
    drives: dict[Port, Drive]
    slots: Mapping[Port, int]
    texts: Mapping[Port, Texts]

    def initialise_at(self, step: int, values: npt.NDArray[np.float64]) -> Start:
        """Initialise all instances at a communication point, and fill the vector of values.

        InputError where an FMU refuses or fails.
        """
        self._enter_initialization(step)
        start = Start()
        at = step or INITIAL
        faults = self.scenario.fault_functions
        propagation = Propagation(self.system, self.instances, faults, at)
        try:
            self._propagate(propagation, start)
        except SimulationError as error:
            raise InputError(str(error)) from error
        value_of = propagation.values
        value_of |= self._unconnected_inputs()
        self._fetch_missing(value_of)
        start.asked_ends = self._asked_ends()
        self._fill(values, value_of, step)
        for instance in self.instances:
            instance.quieten()
        start.peers = {c.name: _peer_of(c, i) for c, i in self._pairs if c.is_proxy}
        return start

    @property
    def _pairs(self) -> list[tuple[Component, Instance]]:
        return list(zip(self.system.components, self.instances, strict=True))

    @property
    def _in_event_mode(self) -> list[Instance]:
        return [i for c, i in self._pairs if c.loaded.event_mode and not c.integrated]

    def _enter_initialization(self, step: int) -> None:
        """Give each instance its start values, and the times of the experiment."""
        begin = in_seconds(self.system.time_ns(step))
        for component, instance in self._pairs:
            values = {
                **component.values,
                **driven_at(self.system, self.drives, component.name, step),
                **self.scenario.tuned_at_start(component.name),
            }
            instance.enter_initialization(values, told_stop(self.system, component), begin)

    def _propagate(self, propagation: Propagation, start: Start) -> None:
        """Pass values on until inputs and outputs agree, in and after initialisation mode."""
        start.log += propagation.run()
        for instance in self.instances:
            instance.exit_initialization()
        start.log += propagation.after_exit()
        in_event_mode = self._in_event_mode
        for instance in in_event_mode:
            instance.enter_step_mode()
        if in_event_mode:
            start.log += propagation.after_exit()

    def _unconnected_inputs(self) -> dict[Port, Value]:
        """What inputs without a source start with, where that is given or declared."""
        start_values: dict[Port, Value] = {}
        for port in self.system.once(exchanged).held:
            component = self.system.component(port.component, port)
            interface = component.loaded
            declared = interface.by_name[port.variable].start_value
            value = component.values.get(port.variable, declared)
            if isinstance(value, float | int):
                start_values[port] = stored(interface, port.variable, value)
        return start_values

    def _fetch_missing(self, value_of: dict[Port, Value]) -> None:
        """What was not passed on: locals, say, or elements of connected arrays without a source."""
        missing: dict[str, list[Port]] = {}
        for port in self.slots:
            if port not in self.drives and port not in value_of:
                missing.setdefault(port.component, []).append(port)
        for instance in self.instances:
            ports = missing.get(instance.name, [])
            if ports:
                by_name = instance.interface.by_name
                fetched = instance.get([by_name[port.variable] for port in ports])
                value_of |= zip(ports, fetched, strict=True)

    def _asked_ends(self) -> list[tuple[Instance, float]]:
        """Who has had an event by now, and asked for the end of the simulation in it."""
        in_event_mode = self._in_event_mode
        return [
            (instance, asked_end)
            for component, instance in self._pairs
            if (instance in in_event_mode or component.integrated)
            and (asked_end := instance.the_end()) is not None
        ]

    def _fill(
        self, values: npt.NDArray[np.float64], value_of: Mapping[Port, Value], step: int
    ) -> None:
        """Put the values into the vector; InputError for an integer that no float64 holds."""
        grid, exact_ports = self.system.time_grid, self.system.once(used)
        for port, slot in self.slots.items():
            drive = self.drives.get(port)
            value = drive.at(grid.start + step * grid.step) if drive else value_of[port]
            if port in self.texts:
                value = self.texts[port].number(str(value))
            if port in exact_ports:
                exact(str(port), value, f"{value} at step {step}")
            values[slot] = float(value)


def told_stop(system: System, component: Component) -> float:
    """The stop time in s that a component is told: no step that is asked of it ends later.

    An FMU finds the end of a step as the sum of its begin and its length. The sum of two floats may
    round to more than the stop time: 0.2 + 0.1 > 0.3. Then it is told that sum, a few units in the
    last place later, so that its last step has the length of all others.
    """
    length = system.step_of(component)
    last = in_seconds(system.stop_ns - length) + in_seconds(length)
    return max(in_seconds(system.stop_ns), last)


def _peer_of(component: Component, instance: Instance) -> dict[str, str]:
    """The name and the build of a proxy's peer, which it knows once it is initialised."""
    by_name = instance.interface.by_name
    name_in_system = {of_fmu: name for name, of_fmu in component.rename.items()}
    names = {key: name_in_system.get(f"proxy.{key}", f"proxy.{key}") for key in ("name", "build")}
    declared = {key: name for key, name in names.items() if name in by_name}
    values = instance.get([by_name[name] for name in declared.values()])
    return {key: str(value) for key, value in zip(declared, values, strict=True)}
