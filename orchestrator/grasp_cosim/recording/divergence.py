"""A signal that runs away, told from one that is large, jumps, rises steadily or overshoots.

Of the size |x| of a signal the moments count at which it first reaches its scale, ten times that,
and so on. What diverges takes no longer for each decade than for the one before: it grows
exponentially, or faster. A jump passes decades in one step; a ramp takes ten times as long for
each, a power t^n the n-th root of ten times; a stable response ends. An oscillation counts with its
envelope.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from ..system.description import System
from ..system.parts import NANOSECONDS, Port
from .listener import Signal

DECADES = 6
"""A signal is looked at from so many decades above its scale on; over as many it has to grow."""

FEWER = 2
"""Decades above its scale by which a signal that still grows at the end of a run is noted."""

UNEVEN = 2.5
"""Times as long as another that one of these may take: the peaks of an oscillation are apart."""

SLOWER = 1.25
"""Times as long as for the first half of these that the second half may take."""

FAR = 1e15
"""Times its scale, its first value other than 0 or 1 from which a signal has run away however it
came there: of what it should be, a float64 has no digit left.
"""

FEW = 20.0
"""Steps a decade, below which the step itself is likely to be the reason."""


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

    The scale of a signal is its nominal value, or its first value if that is greater. Without a
    nominal value it is 1, in the signal's unit or in the SI unit, whichever is greater.
    """

    def __init__(self, system: System, outputs: Mapping[Port, Signal]) -> None:
        """Over the columns of the outputs; only those that are Real count."""
        self._system = system
        self._signals = tuple(outputs.values())
        self._scales = np.array([_scale(system, port) for port in outputs])
        self._far = np.zeros(len(outputs))
        self._limits = np.array([0.0 if s.kind == "Real" else np.inf for s in self._signals])
        self._reached: list[list[int]] = [[] for _ in outputs]
        self._begun, self._over = False, False

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
        if not self._begun:
            self._begun, self._scales = True, np.maximum(self._scales, np.abs(rows[0]))
        grown = np.flatnonzero((sizes >= self._limits) & (sizes > 0.0)).tolist()
        found = [(row, i) for i in grown if (row := self._follow(i, steps, rows[:, i])) is not None]
        if not found:
            return None
        self._over = True
        row, i = min(found, key=lambda f: (f[0], -abs(rows[f]) / self._scales[f[1]]))
        return Runaway(row, self._said(i, int(steps[row]), float(rows[row, i])))

    def still(self, end: int) -> str:
        """A line on the signal that has grown most, if it still grows exponentially at the step
        `end`, the last one, and nothing ran away; else empty.
        """
        most = max(range(len(self._reached)), key=lambda i: len(self._reached[i]), default=None)
        if self._over or most is None or not _grows(reached := self._reached[most], FEWER):
            return ""
        decade = reached[-1] - reached[-2]
        if end - reached[-1] > SLOWER * decade:
            return ""
        signal, seconds = self._signals[most], decade * self._system.step_ns / NANOSECONDS
        size = f"{0.1 * self._limits[most]:.3g} {signal.unit or ''}".rstrip()
        return (
            f"{signal.name} still grows at the end, beyond {size}, ten times as much every "
            f"{seconds:.2g} s, as if it ran away; {self._hint(decade)}"
        )

    def _follow(
        self, i: int, steps: npt.NDArray[np.int64], column: npt.NDArray[np.float64]
    ) -> int | None:
        """Note the decades that a signal reaches; the row in which it has run away, if it has."""
        peaks = np.maximum.accumulate(np.abs(column))
        if not self._far[i]:
            first = float(peaks[np.flatnonzero(peaks)[0]])
            self._far[i] = FAR * max(1.0, float(self._scales[i]), first)
            self._limits[i] = self._scales[i]
        while (row := int(np.searchsorted(peaks, self._limits[i]))) < len(peaks):
            self._reached[i].append(int(steps[row]))
            if self._limits[i] >= self._far[i] or _grows(self._reached[i]):
                return row
            self._limits[i] = 10.0 * float(self._limits[i])
        return None

    def _said(self, i: int, step: int, value: float) -> str:
        signal, reached = self._signals[i], self._reached[i]
        length = self._system.step_ns / NANOSECONDS
        decade = (reached[-1] - reached[-4]) / 3
        size = f"{value:.3g} {signal.unit or ''}".rstrip()
        moment = self._system.time_ns(step) / NANOSECONDS
        text = f"{signal.name} ran away: {size} at t = {moment:.9g} s"
        if _grows(reached):
            text += f", ten times as much every {decade * length:.2g} s"
        return f"{text}; {self._hint(decade)}"

    def _hint(self, decade: float) -> str:
        """The advice for a signal that takes so many steps for a decade."""
        turned = [c for c in self._system.connections if c.factor is not None and c.factor < 0.0]
        look = f"look at factor = {turned[0].factor:g} of {turned[0]}" if turned else ""
        if decade < FEW:
            scheme = ", or the scheme sequential" if self._system.scheme == "jacobi" else ""
            step = f"{self._system.step_ns / NANOSECONDS:g} s"
            return ", or ".join(filter(None, [look, f"try a shorter step than {step}{scheme}"]))
        return look or "look at the signs, factors and gains of its loop"


def _scale(system: System, port: Port) -> float:
    """The nominal value of an output, or else 1 in its unit or the SI unit."""
    interface = system.component(port.component, str(port)).interface
    variable = interface.by_name[port.variable]
    unit = interface.unit(variable)
    if variable.magnitude is not None or unit is None or not unit.factor:
        return variable.nominal
    return max(1.0, 1.0 / abs(unit.factor))


def _grows(reached: Sequence[int], decades: int = DECADES) -> bool:
    """True if the last decades took about equally long, and the later ones no longer than before.

    Each took a step at least, so that a jump is no growth.
    """
    if len(reached) <= decades:
        return False
    spans = np.diff(reached[-decades - 1 :])
    before, after = np.split(spans, 2)
    even = 0 < spans.max() <= UNEVEN * spans.min()
    return bool(even and after.sum() <= SLOWER * before.sum())
