"""Memory for values and commands between the master's process and that of a component.

A macro step is one round trip. The master puts inputs and the time into the shared memory, sends
STEP and waits for the status; the component's process passes the inputs on that are pending, steps,
fetches all outputs into the shared memory and answers. Everything else is a CALL of a method.
"""

import mmap
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..interface.interface import Interface, Variable
from .instance import dtype

STEP, FETCH, CALL = b"S", b"F", b"C"
"""Pass pending inputs on and step; pass them on and fetch outputs; a method and its arguments."""

ANSWER = 255
"""Instead of an FMI status: an answer follows that is more than that, an error for instance."""

LOGGED = "FMU: "
"""So begins what an FMU logged, among the lines that its process prints."""

SIZE = 1 << 26
"""Bytes of shared memory; only what is used of it takes memory."""


class SharedMemory:
    """The shared memory, behind the file with the given descriptor."""

    def __init__(self, descriptor: int) -> None:
        self._memory = mmap.mmap(descriptor, SIZE)
        self.clock: npt.NDArray[np.float64] = self._view(np.float64, 1, 0)
        """Time in s at the beginning of the step."""
        self.step: npt.NDArray[np.float64] = self._view(np.float64, 1, 8)
        """Its length in s."""
        self._used = 16

    def add(
        self, interface: Interface, variables: Sequence[Variable]
    ) -> tuple[npt.NDArray[np.bool_], npt.NDArray[Any]]:
        """Room for values of the variables, and a mark that they are pending.

        Both processes add the same variables in the same order and get the same room.
        """
        element = dtype(interface.version, variables[0].type)
        pending = self._view(np.bool_, 1, self._used)
        data = self._view(element, len(variables), self._used + 8)
        self._used += 8 + 8 * len(variables)
        return pending, data

    def _view(self, element: npt.DTypeLike, count: int, offset: int) -> npt.NDArray[Any]:
        return np.frombuffer(self._memory, element, count, offset)
