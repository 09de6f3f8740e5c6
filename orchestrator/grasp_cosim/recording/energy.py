"""Energy of a sampled exchange of force and position: what sample and hold creates or loses.

A force acts on a component, its position goes back to whatever puts out the force: a power bond. In
continuous time the work that the force does on the component is the work that its source gives
away. Co-simulated, they differ: the component moves under a force that is held over its step, and
the source puts out forces for positions that it saw at the communication points. The difference
belongs to neither; the exchange has created it:

    E_k = sum of F_held (x_k - x_k-1)  -  sum of 1/2 (F_k + F_k-1) (s_k - s_k-1)

F_held is the input of the component after its step, x its position, F the output of the source and
s the position the source has received. Positive: energy was created, and the loop is that much less
damped than its equations; negative: lost. For a sampled spring on a mass E_k is exactly the drift
of kinetic and spring energy, the latter at the position that the spring has seen; each step adds
1/2 k (x_k - x_k-1)^2 where the force is held from the start of the step.

The first sum is exact, as the force is constant while the component moves: Stramigioli, Secchi, van
der Schaft, Fantuzzi, Sampled data systems passivity and discrete port-Hamiltonian systems, IEEE
Trans. Robotics 21(4), 2005; it is what a passivity observer adds up (Hannaford, Ryu, Time-domain
passivity control of haptic interfaces, IEEE Trans. Robotics and Automation 18(1), 2002). That
sample and hold feeds energy into a passive loop: Colgate, Schenkel, Passivity of a class of
sampled-data systems, J. Robotic Systems 14(1), 1997. The difference of the two works over a power
bond as the measure of the coupling error: the residual energy of Sadjina, Kyllingstad, Skjong,
Pedersen, Energy conservation and power bonds in co-simulations, Engineering with Computers 33,
2017. The sign here is that of energy added to the system.

Limits. The second sum is a trapezoid: exact for a force linear in the position, else in error by
the second order of the step, as for damping, where the exchange itself is of the first order. What
the source does with a force before it puts it out (filters, delays of its own) is its own affair.
A source that receives the position by way of another component, or not at all, is taken to have
seen it at the same moment: the delay on that way is then not counted. A fault on one of the
connections is part of the exchange, and what it adds is counted.
"""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ..interface.interface import Interface, Variable
from ..system.description import System
from ..system.parts import Component, Connection, Port
from .listener import Signal

Floats = npt.NDArray[np.float64]

FORCE = {"N": (1, 1, -2, 0, 0, 0, 0, 0)}
POSITION = {"m": (0, 1, 0, 0, 0, 0, 0, 0)}
"""The SI unit of a quantity and its exponents in the order of units.BASE."""

IDENTITY = (1.0, 0.0)


@dataclass(frozen=True, slots=True)
class Bond:
    """A connected input force[j] of a component with an output position[j], and where each goes.

    index is j, None for a plain force and position. force is the input, source the output connected
    to it, position the output. seen is the input of the source's component that is connected to
    position, None where it has none. period is the source's own step in base steps. scale is the
    energy in J of one unit of force times one of position.
    """

    component: str
    index: int | None
    force: Port
    source: Port
    position: Port
    seen: Port | None
    period: int
    scale: float

    @property
    def signal(self) -> Signal:
        """The recorded signal: energy in J created (positive) or lost since the start."""
        suffix = "" if self.index is None else f"[{self.index}]"
        return Signal(
            f"{self.component}.exchange_energy{suffix}",
            "J",
            "Real",
            f"Energy created (positive) or lost by the sampled exchange of {self.force} "
            f"and {self.position}",
        )


def bonds(system: System) -> tuple[Bond, ...]:
    """The bonds of a system, in the order of its components and their inputs.

    A component has one for each connected Real input force[j], or force, in a unit of force that
    has beside it an output position[j], or position, in a unit of length.
    """
    return tuple(
        bond
        for component in system.components
        for variable in component.interface.of("input")
        if (bond := _bond(system, component, variable))
    )


def _bond(system: System, component: Component, force: Variable) -> Bond | None:
    """The bond of an input, None where it has none."""
    match = re.fullmatch(r"force(?:\[(\d+)\])?", force.name)
    connection = _connection_to(system, Port(component.name, force.name))
    if not match or not connection:
        return None
    interface = component.interface
    position = interface.by_name.get(force.name.replace("force", "position"))
    taken = force.name.replace("force", "exchange_energy") in interface.by_name
    if not position or position.causality != "output" or taken:
        return None
    factors = _in_si(interface, force, FORCE), _in_si(interface, position, POSITION)
    if None in factors:
        return None
    place = Port(component.name, position.name)
    source = system.component(connection.source.component, str(connection.source))
    return Bond(
        component.name,
        int(match[1]) if match[1] else None,
        connection.target,
        connection.source,
        place,
        _seen(system, place, source),
        system.period(source.name),
        float(np.prod(factors)),  # type: ignore[arg-type]  # no None is left in it
    )


def _connection_to(system: System, target: Port) -> Connection | None:
    return next(
        (connection for connection in system.connections if connection.target == target), None
    )


def _seen(system: System, position: Port, source: Component) -> Port | None:
    """The first input of the source's component that is connected to the position."""
    inputs = (Port(source.name, v.name) for v in source.interface.of("input"))
    connections = (_connection_to(system, port) for port in inputs)
    return next((w.target for w in connections if w and w.source == position), None)


def _in_si(
    interface: Interface, variable: Variable, quantity: Mapping[str, tuple[int, ...]]
) -> float | None:
    """The SI value of one unit of a Real variable; None where it is not of that quantity."""
    ((name, exponents),) = quantity.items()
    if variable.kind != "Real" or variable.shape or variable.unit is None:
        return None
    unit = interface.units.get(variable.unit)
    if unit is None:
        return 1.0 if variable.unit == name else None
    return unit.factor if unit.exponents == exponents else None


class ExchangeEnergy:
    """Turns rows of values into rows of energies in J, a column per bond, block after block.

    Every communication point must come by, in order, from step 0 on: no decimation. The energies
    do not depend on how the rows are cut into blocks, to the bit.
    """

    def __init__(
        self,
        bonds: Sequence[Bond],
        column: Mapping[Port, int],
        transforms: Mapping[Port, tuple[float, float]] | None = None,
    ) -> None:
        """The column of a port is the place of that output or connected input in a row.

        transforms are factor and offset of the connection to an input, as target = factor * source
        + offset, where they are not 1 and 0: the source's forces and the positions it has seen are
        taken in the units of the component that moves.
        """
        self.signals = tuple(bond.signal for bond in bonds)
        self._ledgers = [
            (
                [i for i, bond in enumerate(bonds) if bond.period == period],
                _Ledger([b for b in bonds if b.period == period], column, transforms or {}),
            )
            for period in dict.fromkeys(bond.period for bond in bonds)
        ]
        self._rows = 0

    def __call__(self, rows: Floats) -> Floats:
        """Energies as (len(rows), len(bonds)) of rows as (n, all columns)."""
        energies = np.empty((len(rows), len(self.signals)))
        # The master reports values that are not finite; they are none of this function's concern.
        with np.errstate(invalid="ignore", over="ignore"):
            for places, ledger in self._ledgers:
                energies[:, places] = ledger.add(self._rows, rows)
        self._rows += len(rows)
        return energies


class _Ledger:
    """The sums of some bonds of the same period, up to the last row; a column for each."""

    def __init__(
        self,
        bonds: Sequence[Bond],
        column: Mapping[Port, int],
        transforms: Mapping[Port, tuple[float, float]],
    ) -> None:
        self._period = bonds[0].period
        self._scale = np.array([bond.scale for bond in bonds])
        self._held, self._position, self._source, self._seen = np.array(
            [
                [column[port] for port in (b.force, b.position, b.source, b.seen or b.position)]
                for b in bonds
            ]
        ).T
        of_force = [transforms.get(bond.force, IDENTITY) for bond in bonds]
        of_seen = [transforms.get(bond.seen, IDENTITY) if bond.seen else IDENTITY for bond in bonds]
        self._of_force, self._of_seen = np.array(of_force).T, np.array(of_seen).T
        self._of_seen[0, self._of_seen[0] == 0.0] = np.inf  # hides all motion
        none = np.empty((0, len(bonds)))
        self._moved = self._answered = (none, none)
        self._total = np.zeros((1, len(bonds)))

    def add(self, first: int, rows: Floats) -> Floats:
        """The energies at each of the rows, which are those of the steps from first on."""
        earned = np.zeros((len(rows), len(self._scale)))
        held = np.concatenate((self._moved[0], rows[:, self._held]))
        position = np.concatenate((self._moved[1], rows[:, self._position]))
        _add_last(earned, held[1:] * (position[1:] - position[:-1]))
        # A source with a step of its own answers for what it saw at the ends of that step.
        ends = slice(-first % self._period, None, self._period)
        force = np.concatenate((self._answered[0], self._forces(rows[ends])))
        seen = np.concatenate((self._answered[1], self._positions(rows[ends])))
        _add_last(earned[ends], -0.5 * (force[1:] + force[:-1]) * (seen[1:] - seen[:-1]))
        self._moved = held[-1:], position[-1:]
        self._answered = force[-1:], seen[-1:]
        # One sum after the other from the carried total on: the same bits for any blocks.
        total = np.cumsum(np.concatenate((self._total, self._scale * earned)), axis=0)
        self._total = total[-1:]
        return total[1:]

    def _forces(self, rows: Floats) -> Floats:
        """Return the outputs of the sources, in the units of the held forces."""
        factor, offset = self._of_force
        forces: Floats = factor * rows[:, self._source] + offset
        return forces

    def _positions(self, rows: Floats) -> Floats:
        """Return the positions that the sources have seen, in the units of the positions."""
        factor, offset = self._of_seen
        positions: Floats = (rows[:, self._seen] - offset) / factor
        return positions


def _add_last(sums: Floats, changes: Floats) -> None:
    """Add the changes in place; the first row of a run has none."""
    sums[len(sums) - len(changes) :] += changes
