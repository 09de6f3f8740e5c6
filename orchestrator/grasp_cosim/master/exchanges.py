"""The exchanges of force and position of a system, as the loop's table: see exchange/energy.py."""

from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from ..exchange.energy import Bond, bonds
from ..interface.units import IDENTITY
from ..system.description import System
from ..system.parts import Port
from ..system.validity import transforms
from . import loop

NO_EXCHANGES = np.zeros((0, loop.LAST_RECEIVED + 1))
"""The table of a system without any."""


def exchanges_of(system: System, slots: Mapping[Port, int]) -> npt.NDArray[np.float64]:
    """The table of a system, whose energies come after the values in slots."""
    return table_of(system.once(bonds), slots, system.once(transforms))


def table_of(
    found: Sequence[Bond],
    slots: Mapping[Port, int],
    of_inputs: Mapping[Port, tuple[float, float]],
) -> npt.NDArray[np.float64]:
    """The table, a row for each bond that was found.

    of_inputs are factor and offset of the connection to an input, as target = factor * source +
    offset, where they are not 1 and 0.
    """
    table = np.zeros((len(found), loop.LAST_RECEIVED + 1))
    for i, bond in enumerate(found):
        row = table[i]
        row[loop.HELD_FORCE], row[loop.POSITION] = slots[bond.force], slots[bond.position]
        row[loop.FORCE] = slots[bond.source]
        row[loop.RECEIVED] = slots[bond.received or bond.position]
        row[loop.ENERGY], row[loop.PERIOD] = len(slots) + i, bond.period
        row[loop.SCALE_TO_J] = bond.scale
        of_force = of_inputs.get(bond.force, IDENTITY)
        of_received = of_inputs.get(bond.received, IDENTITY) if bond.received else IDENTITY
        row[loop.FORCE_FACTOR], row[loop.FORCE_OFFSET] = of_force
        row[loop.POSITION_FACTOR], row[loop.POSITION_OFFSET] = of_received
    return table


def begin(exchanges: npt.NDArray[np.float64], values: npt.NDArray[np.float64]) -> None:
    """Begin the sums of a run with the values at its start."""
    for row in exchanges:
        values[int(row[loop.ENERGY])] = 0.0
        row[loop.LAST_POSITION] = values[int(row[loop.POSITION])]
        row[loop.LAST_FORCE], row[loop.LAST_RECEIVED] = loop.answered(row, values)
