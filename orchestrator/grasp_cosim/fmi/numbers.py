"""The state of a block as numbers, which may be read and moved one by one: fmus/README.md.

They are in the bytes of a state behind its head, the phase and the time, inputs and parameters.
"""

from typing import Any

import numpy as np
import numpy.typing as npt
from fmpy.fmi1 import FMICallException

from ..interface.interface import Interface

NUMBERS = np.dtype("<f8")
"""What they are, on any machine."""


def state_numbers(slave: Any, interface: Interface) -> npt.NDArray[np.float64]:
    """Those of the state of an FMU that was made here, of which FMPy has the instance."""
    begin = _first(interface)
    return np.frombuffer(_content(slave), NUMBERS, offset=begin).astype(np.float64)


def take_numbers(slave: Any, interface: Interface, numbers: npt.NDArray[np.float64]) -> bool:
    """Have it go on from other ones; False where it refuses them, as one must be a whole number."""
    moved = _content(slave)[: _first(interface)] + numbers.astype(NUMBERS).tobytes()
    try:
        state = slave.deserializeFMUState(moved)
    except FMICallException:
        return False
    try:
        slave.setFMUState(state)
    finally:
        slave.freeFMUState(state)
    return True


def _content(slave: Any) -> bytes:
    """The bytes of the state that it is in."""
    state = slave.getFMUState()
    try:
        content: bytes = slave.serializeFMUState(state)
    finally:
        slave.freeFMUState(state)
    return content


def _first(interface: Interface) -> int:
    """The byte at which they begin."""
    from ..fmu_export.slave import HEAD  # only here: few runs ask for numbers

    saved_variables = [v for v in interface.variables if v.causality in ("input", "parameter")]
    phase_and_time = 2
    return HEAD + NUMBERS.itemsize * (phase_and_time + len(saved_variables))
