"""Energy of a sampled exchange of force and position: what sample and hold creates or loses.

    E_k = sum of F_held (x_k - x_k-1)  -  sum of 1/2 (F_k + F_k-1) (s_k - s_k-1)

F_held is the input of the component after its step, and x is its position. F is the output of the
source, and s is the position that the source has received. Positive: energy was created, and the
loop is that much less damped than its equations; negative: lost. The reasons, the sources and the
limits are in docs/explanation/co_simulation.md. account() in master/loop.py adds the terms up.
"""

import re
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..base.si_units import known_unit
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.description import System
from ..system.parts import Component, Port
from ..system.record import ENERGY
from .listener import Signal


@dataclass(frozen=True, slots=True)
class Bond:
    """A connected input force[j] of a component with an output position[j], and where each goes.

    index is j, None for a plain force and position. force is the input, source the output connected
    to it, position the output. received is the input of the source's component that is connected to
    position, None where it has none. period is the source's own step in base steps. scale is the
    energy in J of one unit of force times one of position.
    """

    component: str
    index: int | None
    force: Port
    source: Port
    position: Port
    received: Port | None
    period: int
    scale: float

    @property
    def signal(self) -> Signal:
        """The recorded signal: energy in J created (positive) or lost since the start."""
        suffix = "" if self.index is None else f"[{self.index}]"
        return Signal(
            f"{self.component}.{ENERGY}{suffix}",
            "J",
            "Real",
            f"Energy created (positive) or lost by the sampled exchange of {self.force} "
            f"and {self.position}",
        )


def bonds(system: System) -> tuple[Bond, ...]:
    """The bonds of a system, in the order of its components and their inputs.

    A component has one for each connected Real input force[j], or force, in a unit of force. It
    must also have an output position[j], or position, in a unit of length.
    """
    sources = {connection.target: connection.source for connection in system.connections}
    return tuple(
        bond
        for component in system.components
        for variable in component.interface.of("input")
        if (bond := _bond(system, component, variable, sources))
    )


def _bond(
    system: System, component: Component, force: Variable, sources: Mapping[Port, Port]
) -> Bond | None:
    match = re.fullmatch(r"force(?:\[(\d+)\])?", force.name)
    target = Port(component.name, force.name)
    if not match or target not in sources:
        return None
    interface = component.interface
    position = interface.by_name.get(force.name.replace("force", "position"))
    taken = force.name.replace("force", ENERGY) in interface.by_name
    if not position or position.causality != "output" or taken:
        return None
    factors = _in_si(interface, force, "N"), _in_si(interface, position, "m")
    if None in factors:
        return None
    source, moved = sources[target], Port(component.name, position.name)
    inputs = system.component(source.component, str(source)).interface.of("input")
    receiving = (Port(source.component, v.name) for v in inputs)
    return Bond(
        component.name,
        int(match[1]) if match[1] else None,
        target,
        source,
        moved,
        next((port for port in receiving if sources.get(port) == moved), None),
        system.period(source.component),
        float(np.prod(factors)),  # type: ignore[arg-type]  # no None is left in it
    )


def _in_si(interface: Interface, variable: Variable, quantity: str) -> float | None:
    """The SI value of one unit of a Real variable; None where it is no unit of that quantity."""
    unit, of_quantity = interface.unit(variable), known_unit(quantity)
    if variable.kind != "Real" or variable.shape or not unit or not of_quantity:
        return None
    return unit.factor if unit.measures(of_quantity) else None
