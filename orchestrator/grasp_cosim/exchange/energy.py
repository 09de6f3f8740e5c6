"""Energy of a sampled exchange of force and position: what sample and hold creates or loses.

    E_k = sum of F_held (x_k - x_k-1)  -  sum of 1/2 (F_k + F_k-1) (s_k - s_k-1)

F_held is the input of the component after its step, and x is its position. F is the output of the
source, and s is the position that the source has received. Positive: energy was created, and the
loop is that much less damped than its equations; negative: lost. The reasons, the sources and the
limits are in docs/explanation/co_simulation.md.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

from ..base.si_units import known_unit
from ..interface.interface import Interface
from ..interface.variables import Variable
from ..system.description import System
from ..system.parts import Component, Port
from ..system.record import ENERGY
from .listener import Floats, Signal

IDENTITY = (1.0, 0.0)


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


class ExchangeEnergy:
    """Turns rows of values into rows of energies in J, a column per bond, block after block.

    Every communication point must come by, in order, from step 0 on: no decimation. The energies
    do not depend on how the rows are cut into blocks, to the bit.
    """

    def __init__(
        self,
        bonds: Sequence[Bond],
        column: Mapping[Port, int],
        transforms: Mapping[Port, tuple[float, float]] = MappingProxyType({}),
    ) -> None:
        """The column of a port is the place of that output or connected input in a row.

        transforms are factor and offset of the connection to an input, as target = factor * source
        + offset, where they are not 1 and 0: the source's forces and the positions it has seen are
        taken in the units of the component that moves.
        """
        self.signals = tuple(bond.signal for bond in bonds)
        self._ledgers = [_Ledger(bond, column, transforms) for bond in bonds]
        self._rows = 0

    def saved(self) -> tuple[Any, ...]:
        """The sums until now, for restore()."""
        return self._rows, [ledger.carried for ledger in self._ledgers]

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved."""
        self._rows, carried = saved
        for ledger, sums in zip(self._ledgers, carried, strict=True):
            ledger.carried = sums

    def __call__(self, rows: Floats) -> Floats:
        """Energies as (len(rows), len(bonds)) of rows as (n, all columns)."""
        energies = np.empty((len(self.signals), len(rows)))
        # The master reports values that are not finite; they are none of this function's concern.
        with np.errstate(invalid="ignore", over="ignore"):
            for place, ledger in enumerate(self._ledgers):
                energies[place] = ledger.add(self._rows, rows)
        self._rows += len(rows)
        return energies.T


class _Ledger:
    """The sum of a bond up to the last row."""

    def __init__(
        self,
        bond: Bond,
        column: Mapping[Port, int],
        transforms: Mapping[Port, tuple[float, float]],
    ) -> None:
        self._period, self._scale = bond.period, bond.scale
        self._mover = [column[bond.force], column[bond.position]]
        self._answerer = [column[bond.source], column[bond.received or bond.position]]
        self._of_force = transforms.get(bond.force, IDENTITY)
        self._of_received = transforms.get(bond.received, IDENTITY) if bond.received else IDENTITY
        self.carried = np.empty((2, 0)), np.empty((2, 0)), np.zeros(1)
        """The last that moved, the last that answered, and the sum."""

    def add(self, first: int, rows: Floats) -> Floats:
        """The energy at each of the rows, which are those of the steps from first on."""
        earned = np.zeros(len(rows))
        last_moved, last_answered, sum_ = self.carried
        held_force, position = moved = _joined(last_moved, rows[:, self._mover].T)
        _add_last(earned, held_force[1:] * np.diff(position))
        # A source with its own step answers for what it received at the ends of that step.
        ends = slice(-first % self._period, None, self._period)
        answers = self._in_units(rows[ends, self._answerer])
        force, received = answered = _joined(last_answered, answers)
        _add_last(earned[ends], -0.5 * (force[1:] + force[:-1]) * np.diff(received))
        # One sum after the other from the carried total on: the same bits for any blocks.
        total = np.cumsum(np.concatenate((sum_, self._scale * earned)))
        self.carried = moved[:, -1:], answered[:, -1:], total[-1:]
        return total[1:]

    def _in_units(self, answered: Floats) -> Floats:
        """Force and position of the source in the units of the component that moves."""
        if self._of_force == self._of_received == IDENTITY:
            return answered.T
        force, received = answered.T
        force_factor, force_offset = self._of_force
        position_factor, position_offset = self._of_received
        position = (received - position_offset) / position_factor
        return np.array((force_factor * force + force_offset, position))


def _joined(earlier: Floats, later: Floats) -> Floats:
    """The earlier columns, then the later ones, with each row in one piece, which is fast."""
    shape = 2, earlier.shape[1] + later.shape[1]
    return np.concatenate((earlier, later), axis=1, out=np.empty(shape))


def _add_last(sums: Floats, changes: Floats) -> None:
    """Add the changes in place; the first row of a run has none."""
    sums[len(sums) - len(changes) :] += changes
