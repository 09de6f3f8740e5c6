"""Listeners to a run: they get blocks of rows, one row per recorded communication point."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Protocol, runtime_checkable

import numpy as np
import numpy.typing as npt

from ..system.times import Time, TimeGrid, nearest_time

Steps = npt.NDArray[np.int64]
"""Numbers of steps."""

Floats = npt.NDArray[np.float64]
"""Numbers; of rows as (rows, columns)."""


class Texts:
    """The texts that a String has had so far, each once; rows hold their numbers in this list."""

    def __init__(self) -> None:
        self.listed: list[str] = []
        self._numbers: dict[str, int] = {}

    def number(self, text: str) -> int:
        """The number of a text, which is listed if it is new."""
        number = self._numbers.setdefault(text, len(self.listed))
        if number == len(self.listed):
            self.listed.append(text)
        return number

    def column(self, numbers: Floats) -> npt.NDArray[Any]:
        """The texts of these numbers, as an array of str objects."""
        return np.array([self.listed[int(number)] for number in numbers], object)


@dataclass(frozen=True, slots=True)
class Signal:
    """A recorded column: name like plant.gap[1], unit (None without one), kind, description.

    The kind is Real, Integer, Boolean or String. Rows have numbers in place of a String's texts,
    those of `texts`, which grows while the run goes on. An Integer that is wide may be beyond what
    an int64 holds: it is a UInt64.
    """

    name: str
    unit: str | None
    kind: str
    description: str = ""
    texts: Texts = field(default_factory=Texts, compare=False)
    wide: bool = False


@dataclass(frozen=True, slots=True)
class Experiment:
    """The run that is recorded: its name, communication step, stop and start in ns, its settings.

    `settings` are those of system.settings, as in run.json.
    """

    name: str
    step_ns: Time
    stop_ns: Time
    settings: Mapping[str, Any]
    start_ns: Time = 0

    @classmethod
    def of(cls, settings: Mapping[str, Any]) -> Experiment:
        """The experiment that settings describe."""
        step, stop, start = (
            nearest_time(settings.get(key, 0.0)) for key in ("step", "stop", "start")
        )
        return cls(settings["system"], step, stop, settings, start)

    @property
    def total_steps(self) -> int:
        """The number of communication steps from the start to the stop time."""
        return int((self.stop_ns - self.start_ns) // self.step_ns)

    def times(self, steps: Steps) -> Floats:
        """The communication points in s."""
        return TimeGrid.of(self.start_ns, self.step_ns).times(steps)


class Listener(Protocol):
    """Gets every recorded row once, in order, in blocks between chunks of steps."""

    def begin(self, experiment: Experiment, signals: Sequence[Signal]) -> None:
        """Called before the first row."""

    def block(self, steps: Steps, rows: Floats) -> None:
        """Rows as (len(steps), len(signals)); step k is at experiment.times(k).

        Booleans are 0.0 or 1.0, for Strings see Signal. The arrays are reused: copy what is kept.
        """

    def end(self, complete: bool) -> None:
        """Called once after the last row, also after a failure (complete is then False)."""


@dataclass(frozen=True, slots=True)
class Window:
    """A recording of a triggered run, of which there are several, without a row in two of them.

    `time` in s is that of the communication point at which its trigger came true first. It came
    true so many `times` in the window, of which the first are told where that begins. It is not
    `complete` where the run broke off before its end.
    """

    number: int
    time: float
    times: int = 1
    complete: bool = False

    @property
    def folder(self) -> str:
        """The name of its folder, in that of the run."""
        return f"window_{self.number:03d}"


@runtime_checkable
class OfWindows(Listener, Protocol):
    """A listener that is told where the windows of a triggered run begin and end.

    Others get the rows of all windows, one after the other.
    """

    def begin_run(self) -> None:
        """Called at the first row of a triggered run, be it recorded or not."""

    def begin_window(self, window: Window) -> None:
        """Called before the first row of a window."""

    def end_window(self, window: Window) -> None:
        """Called after its last row."""


@runtime_checkable
class OfAllRows(Listener, Protocol):
    """A listener that gets the rows between the windows of a triggered run, too."""

    @property
    def is_of_all_rows(self) -> bool:
        """True."""


class Selective(Listener, Protocol):
    """A listener that gets the signals of some names only."""

    @property
    def names(self) -> Collection[str]:
        """The names, also of signals that there may not be."""


@runtime_checkable
class Leisurely(Listener, Protocol):
    """A listener that puts work off, in a run that is paced by the clock, until there is time."""

    def spare(self, ns: float) -> bool:
        """Do as much as takes about so many ns; False if there was nothing, or nothing so short."""
