"""A signal that runs away, which ends a run, told from one that is large, jumps or rises steadily.

Of its size |x| the moments count at which it first reaches its scale, ten times that, and so on.
What diverges takes no longer for each decade than for the one before: it grows exponentially, or
faster. A jump passes decades in one step; a ramp takes ten times as long for each, a power t^n the
n-th root of ten times; a stable response ends.

A distance may be that to nothing: inf, or the largest double. Where every input that a signal goes
to says that it takes inf, its size is not looked at.
"""

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from ..system.description import System
from ..system.parts import Port
from ..system.times import in_seconds, seconds
from .listener import Floats, Signal, Steps

DECADES = 6
"""A signal is looked at from so many decades above its scale on; over as many it has to grow."""

MAX_UNEVENNESS = 2.5
"""Times as long as another that one of these may take: the peaks of an oscillation are apart."""

MAX_SLOWDOWN = 1.25
"""Times as long as for the first half of these that the second half may take."""

MAX_SCALES = 1e15
"""Times its scale, or 1, from which a signal has run away however it came there: of what it should
be, a float64 has no digit left.
"""

NEVER = np.nan
"""A size that no value reaches, not even inf."""


def to_open_ends(system: System) -> frozenset[Port]:
    """The outputs that go only to inputs that take inf, as the distance to nothing in range."""
    sources: dict[Port, bool] = {}
    for connection in system.connections:
        target = connection.target
        interface = system.component(target.component, str(target)).interface
        takes_infinity = interface.by_name[target.variable].infinite
        sources[connection.source] = takes_infinity and sources.get(connection.source, True)
    return frozenset(port for port, all_take_it in sources.items() if all_take_it)


def largest(rows: Floats) -> Floats:
    """The largest magnitude in each column; not finite where one of its values is not."""
    if not len(rows):
        return np.zeros(rows.shape[1])
    highest: Floats = np.maximum(rows.max(axis=0), -rows.min(axis=0))
    return highest


class Divergence:
    """Looks at every row of a run until the first signal has run away.

    The scale of a signal is its nominal value, or its first value other than 0 if that is greater.
    Without a nominal value it is 1, in the signal's unit or in the SI unit, whichever is greater.
    """

    def __init__(
        self,
        system: System,
        outputs: Mapping[Port, Signal],
        open_ended: Collection[Port] = (),
    ) -> None:
        """Over the columns of the outputs; only those that are Real, and have an end, count."""
        self._system, self._signals = system, tuple(outputs.values())
        self._scales = np.array([_scale(system, port) for port in outputs])
        self._limits = np.array(
            [
                0.0 if signal.kind == "Real" and port not in open_ended else NEVER
                for port, signal in outputs.items()
            ]
        )
        self._reached: list[tuple[int, ...]] = [() for _ in outputs]
        self._over = False

    def saved(self) -> tuple[Any, ...]:
        """What the rows until now came to, for restore()."""
        return self._scales.copy(), self._limits.copy(), [*self._reached], self._over

    def restore(self, saved: tuple[Any, ...]) -> None:
        """Go back to what was saved."""
        self._scales[:], self._limits[:], reached, self._over = saved
        self._reached = [*reached]

    @property
    def bounds(self) -> Floats:
        """The magnitudes from which on the outputs are looked at; nan where they never are."""
        return np.full(len(self._limits), NEVER) if self._over else self._limits

    def __call__(
        self,
        steps: Steps,
        rows: Floats,
        sizes: Floats,
    ) -> tuple[int, str] | None:
        """The first signal that runs away in a block of rows, (len(steps), len(outputs)).

        Its row, and a line that says so. None where there is none, and after the first. sizes are
        largest(rows). Blocks of any length come to the same.
        """
        if self._over or not rows.size:
            return None
        grown = np.flatnonzero((sizes >= self._limits) & (sizes > 0.0)).tolist()
        runaways: list[tuple[int, int]] = []
        for column in grown:
            row = self._follow(column, steps, rows[:, column])
            if row is not None:
                runaways.append((row, column))
        if not runaways:
            return None
        self._over = True

        def first_and_largest(place: tuple[int, int]) -> tuple[int, float]:
            return place[0], -abs(float(rows[place])) / float(self._scales[place[1]])

        row, i = min(runaways, key=first_and_largest)
        signal, time = self._signals[i], seconds(self._system.time_ns(int(steps[row])))
        size = f"{rows[row, i]:.3g} {signal.unit or ''}".rstrip()
        text = f"{signal.name} ran away: {size} at t = {time}"
        if _grows(self._reached[i]):
            decade = (self._reached[i][-1] - self._reached[i][-4]) / 3
            length = decade * in_seconds(self._system.step_ns)
            text += f", ten times as much every {length:.2g} s"
        return row, f"{text}; look at the signs and gains, or try a shorter step"

    def _follow(self, i: int, steps: Steps, column: Floats) -> int | None:
        """Note the decades that a signal reaches; the row in which it has run away, if it has."""
        peaks = np.maximum.accumulate(np.abs(column))
        if not self._limits[i]:
            first = peaks[np.flatnonzero(peaks)[0]]
            self._limits[i] = self._scales[i] = max(self._scales[i], first)
        while (row := int(np.searchsorted(peaks, self._limits[i]))) < len(peaks):
            self._reached[i] = *self._reached[i], int(steps[row])
            limit, scale = float(self._limits[i]), float(self._scales[i])
            if limit >= MAX_SCALES * max(1.0, scale) or _grows(self._reached[i]):
                return row
            self._limits[i] = 10.0 * limit
        return None


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
    earlier, later = np.split(spans, 2)
    is_even = 0 < spans.max() <= MAX_UNEVENNESS * spans.min()
    return bool(is_even and later.sum() <= MAX_SLOWDOWN * earlier.sum())
