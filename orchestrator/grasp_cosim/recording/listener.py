"""What listens to a run: blocks of rows, one row per recorded communication point."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ..system.description import System


@dataclass(frozen=True, slots=True)
class Signal:
    """A recorded column: name like plant.gap[1], unit (None without one), kind, description."""

    name: str
    unit: str | None
    kind: str
    description: str = ""


class Listener(Protocol):
    """Gets every recorded row once, in order, in blocks between chunks of steps."""

    def begin(self, system: System, signals: Sequence[Signal]) -> None:
        """Called before the first row."""

    def block(self, steps: npt.NDArray[np.int64], rows: npt.NDArray[np.float64]) -> None:
        """Rows as (len(steps), len(signals)); step k is at t = k * system.step_ns.

        Booleans are 0.0 or 1.0. The arrays are reused: copy what is kept.
        """

    def end(self, complete: bool) -> None:
        """Called once after the last row, also after a failure (complete is then False)."""
