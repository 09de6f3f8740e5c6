"""The timing of a paced run, as plain data. Times are in s."""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from math import inf
from typing import Any, NamedTuple, Self

from ..base.errors import InputError


class Overrun(NamedTuple):
    """A step that ended late: its number, the time it began at, by how much, what caused it.

    took is the wall time of what caused it.
    """

    step: int
    time: float
    late: float
    culprit: str
    took: float


class Spread(NamedTuple):
    """Durations of a part; `worst_at` is the simulated time at which the worst step began."""

    median: float
    p99: float
    p999: float
    worst: float
    worst_at: float


class Histogram(NamedTuple):
    """counts[i] values are from edges[i] up to, and without, edges[i + 1]."""

    edges: tuple[float, ...]
    counts: tuple[int, ...]


@dataclass(frozen=True)
class Timing:
    """The timing of a run: how well it kept to the clock.

    factor is what was asked for, real_time_factor what came of it. overruns and culprits, by
    name, count all of them; listed are the first ones. parts and histograms are by name: step (the
    time it computes), start (how late it begins), each component, exchange (the rest of the step),
    recording (handing rows on), between (what else is between two steps: the loop, the progress,
    the caller of Session.step). A part that never happened is in neither.
    """

    factor: float
    period: float
    overrun: str
    granted: tuple[str, ...]
    refused: tuple[str, ...]
    steps: int
    real_time_factor: float
    overruns: int
    listed: tuple[Overrun, ...]
    culprits: Mapping[str, int]
    parts: Mapping[str, Spread]
    histograms: Mapping[str, Histogram]

    def as_dict(self) -> dict[str, Any]:
        """Return the timing as run.json has it."""
        return {
            "factor": self.factor,
            "period": self.period,
            "overrun": self.overrun,
            "granted": list(self.granted),
            "refused": list(self.refused),
            "steps": self.steps,
            "real_time_factor": self.real_time_factor,
            "overruns": {
                "count": self.overruns,
                "culprits": dict(self.culprits),
                "listed": [o._asdict() for o in self.listed],
            },
            "parts": {
                name: dict(zip(SPREAD_KEYS, part, strict=True)) for name, part in self.parts.items()
            },
            "histograms": {
                name: {key: list(values) for key, values in h._asdict().items()}
                for name, h in self.histograms.items()
            },
        }

    @classmethod
    def from_dict(cls, place: str, found: Any) -> Self:
        """Read what as_dict() gave; InputError, naming the `place`, if it is something else."""
        try:
            overruns = found["overruns"]
            timing = cls(
                **{key: kind(found[key]) for key, kind in PLAIN.items()},
                granted=tuple(map(str, found["granted"])),
                refused=tuple(map(str, found["refused"])),
                overruns=int(overruns["count"]),
                listed=tuple(
                    Overrun(*(kind(o[key]) for key, kind in Overrun.__annotations__.items()))
                    for o in overruns["listed"]
                ),
                culprits={str(name): int(n) for name, n in overruns["culprits"].items()},
                parts={
                    name: Spread(*(float(part[key]) for key in SPREAD_KEYS))
                    for name, part in found["parts"].items()
                },
                histograms={
                    name: Histogram(tuple(map(float, h["edges"])), tuple(map(int, h["counts"])))
                    for name, h in found["histograms"].items()
                },
            )
            timing._check()
        except (KeyError, TypeError, ValueError, AttributeError) as error:
            raise InputError(
                f"{place}: is damaged ({type(error).__name__}: {error}); "
                "must be what `grasp-cosim run --realtime --out` wrote"
            ) from error
        return timing

    def _check(self) -> None:
        """ValueError where the figures cannot be of one run: whoever draws them relies on it."""
        times = [t for o in self.listed for t in (o.late, o.took)]
        times += [t for part in self.parts.values() for t in part[:-1]]
        rules = {
            "period must be > 0": 0.0 < self.period < inf,
            "times must be finite and not negative": all(0.0 <= t < inf for t in times),
            "there must be a histogram of each part": self.parts.keys() == self.histograms.keys(),
            "histograms must have counts between edges": all(map(_whole, self.histograms.values())),
            "overruns must be from those listed to all steps": len(self.listed)
            <= self.overruns
            <= self.steps,
            "there must be a list of overruns": bool(self.listed) == bool(self.overruns),
            "culprits must be those of all overruns": sum(self.culprits.values()) == self.overruns
            and {o.culprit for o in self.listed} <= self.culprits.keys(),
        }
        for rule, kept in rules.items():
            if not kept:
                raise ValueError(rule)


def _whole(histogram: Histogram) -> bool:
    edges, counts = histogram
    return (
        len(edges) == len(counts) + 1
        and all(0.0 <= a < b < inf for a, b in pairwise(edges))
        and min(counts, default=-1) >= 0
        and sum(counts) > 0
    )


SPREAD_KEYS = ("median", "p99", "p99.9", "worst", "worst_at")
"""The fields of a Spread as run.json names them."""

PLAIN = {"factor": float, "period": float, "overrun": str, "steps": int, "real_time_factor": float}
"""The fields of a Timing that run.json has as they are."""
