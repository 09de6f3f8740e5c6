"""A signal that runs away, told from one that is large, jumps, rises steadily or overshoots.

Of the size |x| of a signal the moments count at which it first reaches its scale, ten times that,
and so on. What diverges takes no longer for each decade than for the one before: it grows
exponentially, or faster. A jump passes decades in one step; a ramp takes ten times as long for
each, a power t^n the n-th root of ten times; a stable response ends.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..system.description import System
from ..system.parts import NANOSECONDS, Port, seconds
from .listener import Signal

DECADES = 6
"""A signal is looked at from so many decades above its scale on; over as many it has to grow."""

UNEVEN = 2.5
"""Times as long as another that one of these may take: the peaks of an oscillation are apart."""

SLOWER = 1.25
"""Times as long as for the first half of these that the second half may take."""

FAR = 1e15
"""Times its scale, or 1, from which a signal has run away however it came there: of what it should
be, a float64 has no digit left.
"""


def largest(rows: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """The largest magnitude in each column; not finite where one of its values is not."""
    if not len(rows):
        return np.zeros(rows.shape[1])
    highest: npt.NDArray[np.float64] = np.maximum(rows.max(axis=0), -rows.min(axis=0))
    return highest


class Runaway(NamedTuple):
    """The row of a block in which a signal ran away, and what is said of it, one line."""

    row: int
    text: str


class Divergence:
    """Looks at every row of a run until the first signal has run away.

    The scale of a signal is its nominal value, or its first value other than 0 if that is greater.
    Without a nominal value it is 1, in the signal's unit or in the SI unit, whichever is greater.
    """

    def __init__(self, system: System, outputs: Mapping[Port, Signal]) -> None:
        """Over the columns of the outputs; only those that are Real count."""
        self._system, self._signals = system, tuple(outputs.values())
        self._scales = np.array([_scale(system, port) for port in outputs])
        self._limits = np.array([0.0 if s.kind == "Real" else np.inf for s in self._signals])
        self._reached: list[list[int]] = [[] for _ in outputs]
        self._over = False

    def __call__(
        self,
        steps: npt.NDArray[np.int64],
        rows: npt.NDArray[np.float64],
        sizes: npt.NDArray[np.float64],
    ) -> Runaway | None:
        """The first signal that runs away in a block of finite rows, (len(steps), len(outputs)).

        sizes are largest(rows). None where there is none, and after the first. Blocks of any length
        come to the same.
        """
        if self._over or not rows.size:
            return None
        grown = np.flatnonzero((sizes >= self._limits) & (sizes > 0.0)).tolist()
        found = [(row, i) for i in grown if (row := self._follow(i, steps, rows[:, i])) is not None]
        if not found:
            return None
        self._over = True
        row, i = min(found, key=lambda f: (f[0], -abs(rows[f]) / self._scales[f[1]]))
        signal, time = self._signals[i], seconds(self._system.time_ns(int(steps[row])))
        size = f"{rows[row, i]:.3g} {signal.unit or ''}".rstrip()
        decade = (self._reached[i][-1] - self._reached[i][-4]) / 3
        text = f"{signal.name} ran away: {size} at t = {time}"
        if _grows(self._reached[i]):
            length = decade * self._system.step_ns / NANOSECONDS
            text += f", ten times as much every {length:.2g} s"
        return Runaway(row, f"{text}; {self._advice()}")

    def _follow(
        self, i: int, steps: npt.NDArray[np.int64], column: npt.NDArray[np.float64]
    ) -> int | None:
        """Note the decades that a signal reaches; the row in which it has run away, if it has."""
        peaks = np.maximum.accumulate(np.abs(column))
        if not self._limits[i]:
            first = peaks[np.flatnonzero(peaks)[0]]
            self._limits[i] = self._scales[i] = max(self._scales[i], first)
        while (row := int(np.searchsorted(peaks, self._limits[i]))) < len(peaks):
            self._reached[i].append(int(steps[row]))
            if self._limits[i] >= FAR * max(1.0, self._scales[i]) or _grows(self._reached[i]):
                return row
            self._limits[i] *= 10.0
        return None

    def _advice(self) -> str:
        turned = [c for c in self._system.connections if c.factor is not None and c.factor < 0.0]
        look = f"factor = {turned[0].factor:g} of {turned[0]}" if turned else "the signs and gains"
        return f"look at {look}, or try a shorter step"


def _scale(system: System, port: Port) -> float:
    """The nominal value of an output, or else 1 in its unit or the SI unit."""
    interface = system.component(port.component, str(port)).interface
    variable = interface.by_name[port.variable]
    unit = interface.unit(variable)
    if variable.magnitude is not None or unit is None or not unit.factor:
        return variable.nominal
    return max(1.0, 1.0 / abs(unit.factor))


def _grows(reached: Sequence[int]) -> bool:
    """True if the last decades took about equally long, and the later ones no longer than before.

    Each took a step at least, so that a jump is no growth.
    """
    if len(reached) <= DECADES:
        return False
    spans = np.diff(reached[-DECADES - 1 :])
    before, after = np.split(spans, 2)
    even = 0 < spans.max() <= UNEVEN * spans.min()
    return bool(even and after.sum() <= SLOWER * before.sum())
