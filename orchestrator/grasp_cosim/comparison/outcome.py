"""What came of a comparison and of a qualification, as data: their words and pages are of these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

from ..interface.units import Conversion
from ..metrics.metric import Metric
from ..system.description import System
from .bands import Compared
from .interface_difference import Difference as InterfaceDifference
from .judge import Curves
from .side import Difference, Side


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class ComparisonData:
    """Two runs next to each other over the time that both have, in the units of the first.

    It is true where the two are alike: `if compare(a, b):`.
    """

    a: Side
    """The first run, which is the reference."""
    b: Side
    """The second run."""
    begin: float
    """The beginning of the time that both have, in s."""
    end: float
    """Its end, in s."""
    signals: tuple[Compared, ...]
    """The signals that both have, those farthest out of their bands first."""
    metrics: tuple[Compared, ...]
    """The metrics that both have, in the same order."""
    curves: tuple[Curves, Curves]
    """By name the signals of a and those of b that were compared."""
    metric_definitions: tuple[Metric, ...]
    """The metrics that were worked out."""
    absent: tuple[str, ...]
    """The names of metrics of which neither run has a value."""
    only: tuple[tuple[str, ...], tuple[str, ...]]
    """The names of signals that only a has, then of those that only b has."""
    only_metrics: tuple[tuple[str, ...], tuple[str, ...]]
    """The same of metrics."""
    differences: tuple[Difference, ...] = ()
    """How the settings differ, where both are runs."""
    notes: tuple[str, ...] = ()
    """Remarks, a line each."""
    numerics: tuple[str, ...] = ("its range", "every second sample")
    """What the derived bands are from, in words."""
    names: tuple[str, str] = ("A", "B")
    """What the two runs are called."""

    @property
    def unfinished(self) -> tuple[str, ...]:
        """The names of the runs that did not come to their end."""
        sides = zip(self.names, (self.a, self.b), strict=True)
        return tuple(name for name, s in sides if s.result and not s.result.came_to_its_end)

    @property
    def alike(self) -> bool:
        """True if both came to their ends, and all that was compared is inside its band."""
        return not self.unfinished and all(c.inside for c in (*self.signals, *self.metrics))

    def __bool__(self) -> bool:
        return self.alike


@dataclass(frozen=True, slots=True, eq=False)
class Swap:
    """A system with its FMU, and with the candidate unless a difference blocks that."""

    system: System
    """The system with the original."""
    component: str
    """The name of the component."""
    candidate: Path
    """The path of the candidate."""
    differences: tuple[InterfaceDifference, ...]
    """How its interface differs from that of the original, the worst first."""
    swapped: System | None
    """The system with the candidate; None where a difference blocks that."""
    back: Mapping[str, Conversion | None]
    """By signal, how outputs of the candidate are converted to the units of the original; None
    where that cannot be.
    """
    nominals: Mapping[str, float | None]
    """The nominal values of all signals that the FMUs declare, in their units."""

    @property
    def original(self) -> Path:
        """The FMU that the candidate is to replace."""
        return self.system.component(self.component, "swap").fmu


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class QualificationData:
    """The verdict and all that led to it; true where the candidate is qualified."""

    swap: Swap
    """The system with the original and with the candidate, and how their interfaces differ."""
    comparison: ComparisonData | None = None
    """That of the two runs, in which the notes are the lines of the log that only the candidate's
    run has; None where the candidate did not run.
    """
    failure: str | None = None
    """Why the candidate did not run to the end; None where it did, or was not run."""

    @property
    def signals(self) -> tuple[Compared, ...]:
        """The signals that were compared, the worst first."""
        return () if self.comparison is None else self.comparison.signals

    @property
    def metrics(self) -> tuple[Compared, ...]:
        """The metrics that were compared, the worst first."""
        return () if self.comparison is None else self.comparison.metrics

    @property
    def blocks(self) -> tuple[InterfaceDifference, ...]:
        """The differences that kept the candidate from being run."""
        return tuple(d for d in self.swap.differences if d.severity == "blocks")

    @property
    def qualified(self) -> bool:
        """True if the candidate may take the original's place: all that there was to compare."""
        c = self.comparison
        return c is not None and not self.failure and c.alike and bool(c.signals or c.metrics)

    def __bool__(self) -> bool:
        return self.qualified
