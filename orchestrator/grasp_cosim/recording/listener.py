"""What listens to a run: blocks of rows, one row per recorded communication point."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import numpy.typing as npt

from ..system.description import System
from ..system.parts import NANOSECONDS


@dataclass(frozen=True, slots=True)
class Signal:
    """A recorded column: name like plant.gap[1], unit (None without one), kind, description.

    The kind is Real, Integer or Boolean.
    """

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


COLUMN: Mapping[str, type[np.generic]] = {
    "Real": np.float64,
    "Integer": np.int64,
    "Boolean": np.bool_,
}
"""The element type of a column by its signal's kind."""


def times(steps: npt.NDArray[np.int64], step_ns: int) -> npt.NDArray[np.float64]:
    """The communication points in s: k * step_ns / 1e9."""
    return steps * step_ns / NANOSECONDS


def columns(
    signals: Sequence[Signal], rows: npt.NDArray[np.float64]
) -> dict[str, npt.NDArray[Any]]:
    """The columns of rows by name, each of its signal's element type.

    Real ones are views. An Integer is exact up to 2**53, as the rows are float64.
    """
    return {s.name: rows[:, i].astype(COLUMN[s.kind], copy=False) for i, s in enumerate(signals)}
