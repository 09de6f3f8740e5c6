"""The memory that a component's process and that of the master share, and the commands between."""

import mmap
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from ..interface.interface import Interface
from ..interface.variables import Variable
from .instance import CLOCK, dtype

STEP, FETCH = b"S", b"F"
"""Pass pending inputs on and step; pass them on and fetch outputs. Pickles are longer."""

LOGGED = "FMU: "
"""So begins what an FMU logged, among the lines that its process prints."""

SHARED_BYTES = 1 << 26
"""Of shared memory; only what is used of it takes memory."""


class SharedMemory:
    """The memory behind the file with the given descriptor, which both processes see."""

    def __init__(self, descriptor: int) -> None:
        self._memory = mmap.mmap(descriptor, SHARED_BYTES)
        self.clock: npt.NDArray[np.float64] = self._view(np.float64, len(CLOCK), 0)
        """That of Instance.stepper."""
        self.step: npt.NDArray[np.float64] = self._view(np.float64, 1, self.clock.nbytes)
        """The length of the step in s."""
        self._used = self.clock.nbytes + self.step.nbytes

    def add(
        self, interface: Interface, variables: Sequence[Variable]
    ) -> tuple[npt.NDArray[np.bool_], npt.NDArray[Any]]:
        """A mark that values of the variables are pending, and space for them.

        Both processes add the same variables in the same order and get the same space.
        """
        begin, count = self._used, len(variables)
        self._used += 8 + 8 * count
        element = dtype(interface.version, variables[0].type)
        return self._view(np.bool_, 1, begin), self._view(element, count, begin + 8)

    def saved(self) -> bytes:
        """The content of the space that was given out, for restore()."""
        return self._memory[: self._used]

    def clear(self) -> None:
        """Nothing is pending in it."""
        self._memory[: self._used] = bytes(self._used)

    def restore(self, saved: bytes) -> None:
        """Go back to what was saved."""
        self._memory[: len(saved)] = saved

    def _view(self, element: npt.DTypeLike, count: int, offset: int) -> npt.NDArray[Any]:
        return np.frombuffer(self._memory, element, count, offset)
