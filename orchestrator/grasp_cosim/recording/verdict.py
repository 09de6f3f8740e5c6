"""The verdict on a run with a bench, in real time or with limits: what it came to, and its limits.

It is worked out of what the run recorded, so of one that is read back it is the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..realtime.timing import Timing
from ..system.parts import Acceptance


@dataclass(frozen=True, slots=True)
class Criterion:
    """One line of a test protocol: what was looked at, its limit, and what it came to."""

    name: str
    """As in [verdict] of a system file."""
    what: str
    limit: float
    measured: float
    unit: str

    @property
    def passed(self) -> bool:
        """True if it is within its limit."""
        return self.measured <= self.limit

    def as_dict(self) -> dict[str, Any]:
        """Return the line as run.json has it."""
        return {
            "name": self.name,
            "what": self.what,
            "limit": self.limit,
            "measured": self.measured,
            "unit": self.unit,
            "passed": self.passed,
        }

    def __str__(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        return (
            f"{self.what}: {self.measured:.4g}{unit}; must be at most {self.limit:g}{unit} "
            f"(verdict.{self.name})"
        )


def judge(
    settings: Mapping[str, Any],
    steps: int,
    proxies: Mapping[str, Mapping[str, Any]],
    timing: Timing | None,
    exceeded: int,
    initialised_anew: int,
    finished: bool = True,
) -> tuple[Criterion, ...]:
    """Return the criteria that apply to a run of so many steps; none to a plain simulation.

    proxies are the figures of recording.proxies; exceeded is how many limits were; finished says
    that the run came to its end.
    """
    limits = Acceptance(**settings.get("acceptance", {}))
    criteria: list[tuple[str, str, float, str]] = []
    if proxies:
        criteria += _of_proxies([*proxies.values()], max(steps, 1))
        criteria.append(("initialised_anew", "times that the loop was initialised again",
                      initialised_anew, ""))  # fmt: skip
    if timing and proxies:
        share = timing.overruns / max(timing.steps, 1)
        criteria.append(("overruns", "steps that ended late", 100.0 * share, "%"))
    if timing:
        refused = len(timing.refused)
        criteria.append(("refused", "privileges that the system refused", refused, ""))
    if settings.get("limits"):
        criteria.append(("warnings", "limits that were exceeded", exceeded, ""))
    if criteria:
        criteria.insert(0, ("unfinished", "runs that did not come to their end", not finished, ""))
    return tuple(
        Criterion(name, description, _scaled(getattr(limits, name), unit), float(measured), unit)
        for name, description, measured, unit in criteria
    )


def _scaled(limit: float, unit: str) -> float:
    return 100.0 * limit if unit == "%" else float(limit)


def _of_proxies(
    figures: Sequence[Mapping[str, Any]], steps: int
) -> Iterator[tuple[str, str, float, str]]:
    """Name, what, value and unit of what came of the connections to all peers."""

    def worst(name: str) -> float:
        return max(float(f[name]) for f in figures)

    yield "lost", "losses of a peer", sum(len(f["lost"]) for f in figures), ""
    yield "missed", "steps without an answer in time", 100.0 * worst("missed") / steps, "%"
    implausible = 100.0 * worst("implausible") / steps
    yield "implausible", "answers that cannot have been measured", implausible, "%"
    yield "trips", "trips of a peer", sum(f["trips"] for f in figures), ""
    yield "limited", "commands beyond their limits", sum(f["limited"] for f in figures), ""
    yield "lead", "lead or lag of a peer's clock", worst("lead"), "s"
