"""The verdict on a run with a bench, in real time or with limits: what it came to, and its limits.

Limits of metrics are for any run.

It is worked out of what the run recorded, so of one that is read back it is the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from ..metrics.metric import Value
from ..realtime.timing import Timing
from ..system.parts import Acceptance

NO_METRICS: Mapping[str, Value] = {}
NO_UNITS: Mapping[str, str | None] = {}


@dataclass(frozen=True, slots=True)
class Criterion:
    """One line of a test protocol: what was looked at, its limit, and what it came to."""

    name: str
    """As in [verdict] of a system file."""
    what: str
    limit: float | None
    """The highest value; None where only `low` is one."""
    measured: float | None
    """What it came to; None for a metric that has no value, which is not within its limit."""
    unit: str
    low: float | None = None
    """The lowest value of a metric, if there is one."""

    @property
    def passed(self) -> bool:
        """True if it is within its limit."""
        if self.measured is None:
            return False
        is_high_enough = self.low is None or self.measured >= self.low
        return is_high_enough and (self.limit is None or self.measured <= self.limit)

    @property
    def must(self) -> str:
        """What it must be, in words: "at most 1 %"."""
        low, high = (None if x is None else self._in_unit(f"{x:g}") for x in (self.low, self.limit))
        if low is None:
            return f"at most {high}"
        if high is None:
            return f"at least {low}"
        return low if self.low == self.limit else f"from {low} to {high}"

    def _in_unit(self, number: str) -> str:
        return f"{number} {self.unit}" if self.unit else number

    def as_dict(self) -> dict[str, Any]:
        """Return the line as run.json has it."""
        low = {} if self.low is None else {"low": self.low}
        return {
            "name": self.name,
            "what": self.what,
            "limit": self.limit,
            **low,
            "measured": self.measured,
            "unit": self.unit,
            "passed": self.passed,
        }

    def __str__(self) -> str:
        measured = "no value" if self.measured is None else self._in_unit(f"{self.measured:.4g}")
        return f"{self.what}: {measured}; must be {self.must} (verdict.{self.name})"


class Verdict(tuple[Criterion, ...]):
    """The criteria of a run. It prints as those that are not within their limits."""

    __slots__ = ()

    def __repr__(self) -> str:
        """One line, which an assertion of a test shows."""
        failed = [str(criterion) for criterion in self if not criterion.passed]
        if not failed:
            return f"passed all {len(self)} criteria"
        return f"failed {len(failed)} of {len(self)} criteria: {'. '.join(failed)}"


def judge(
    settings: Mapping[str, Any],
    steps: int,
    proxies: Mapping[str, Mapping[str, Any]],
    timing: Timing | None,
    exceeded: int,
    initialised_anew: int,
    finished: bool = True,
    metrics: Mapping[str, Value] = NO_METRICS,
    metric_units: Mapping[str, str | None] = NO_UNITS,
) -> Verdict:
    """Return the criteria that apply to a run of so many steps; none to a plain simulation, unless
    its metrics have limits.

    proxies are the figures of recording.proxies; exceeded is how many limits were; finished says
    that the run came to its end. metrics are single values, by name or name[1], with the units of
    their names.
    """
    acceptance = dict(settings.get("acceptance", {}))
    of_metrics = [*_of_metrics(acceptance.pop("metrics", {}), metrics, metric_units)]
    limits = Acceptance(**acceptance)
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
    if criteria or of_metrics:
        criteria.insert(0, ("unfinished", "runs that did not come to their end", not finished, ""))
    of_run = [
        Criterion(name, description, _scaled(getattr(limits, name), unit), float(measured), unit)
        for name, description, measured, unit in criteria
    ]
    return Verdict((*of_run, *of_metrics))


def _of_metrics(
    limits: Mapping[str, Mapping[str, float | None]],
    metrics: Mapping[str, Value],
    units: Mapping[str, str | None],
) -> Iterator[Criterion]:
    """A criterion for each value of a metric that has limits; one that has no value is one, too."""
    for name, bounds in limits.items():
        columns = [c for c in metrics if name in (c, c.partition("[")[0])]
        for column in columns or [name]:
            value, unit = metrics.get(column), units.get(column.partition("[")[0])
            yield Criterion(
                f"metrics.{name}",
                column.replace("_", " "),
                bounds.get("high"),
                None if value is None else float(value),
                "" if unit in (None, "1") else str(unit),
                bounds.get("low"),
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
