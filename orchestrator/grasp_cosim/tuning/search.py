"""The search: differential evolution (scipy, the extra `tune`) over whole generations of runs.

A point is a set of gains, run in each condition. The search for the limits as they are has half of
the budget. The other half goes to the same search with the first limit times each of SCALES, each
beginning at the best of all points so far, so that there are points on both sides of that limit.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, replace
from itertools import repeat

import numpy as np
import numpy.typing as npt

from ..checks import extra_module, number, whole
from ..errors import InputError
from ..parallel import Crew, Lost
from ..progress import Progress
from ..sweep.run import Job, Outcome, Task, run_job
from .problem import Condition, Problem

SCALES = (2.0, 4.0, 0.5)
"""Of the first limit, where the best is looked for besides."""

PER_GAIN = 3
"""Points of a generation, for each gain."""

LEAST = 12
"""Points of a generation at least: fewer are soon all alike."""

SPREAD = 0.4
"""Of a first generation about the best point so far, as a share of the way between the bounds."""

EVOLUTION = {"strategy": "best1bin", "mutation": (0.4, 0.9), "recombination": 0.9}
"""Of the method: greedy, as there are few generations; gains act together, so that most cross."""

NOWHERE = 1e3
"""What a missing value counts as in the search, in limits exceeded: more than any that is there."""

MOST = 1_000_000
"""Points at most."""

Shares = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Point:
    """A set of gains, and what it reaches in the worst condition, by metric, in SI units.

    None where a run of it failed, of which `error` tells, or has no such value.
    """

    gains: tuple[float, ...]
    figures: Mapping[str, float | None]
    error: str | None = None

    def keeps(self, limits: Mapping[str, float]) -> bool:
        """True if it has all figures, and they keep the limits."""
        return not self.broken(limits) and None not in self.figures.values()

    def broken(self, limits: Mapping[str, float]) -> list[str]:
        """The limits that it does not keep; where it has no figure, it does not."""
        return [name for name, most in limits.items() if _above(self.figures[name], most)]


@dataclass(frozen=True, slots=True)
class Checked:
    """A condition that was not tuned for: what the gains of the system reach there, and the new."""

    name: str
    start: Point
    tuned: Point


@dataclass(frozen=True)
class Tuning:
    """What a search found; `points` are all that it tried, that of the system's gains first.

    `tuned` is the best that keeps the limits, None where none does.
    """

    problem: Problem
    limits: Mapping[str, float]
    points: tuple[Point, ...]
    budget: int
    seed: int
    checks: tuple[Checked, ...] = ()

    @property
    def start(self) -> Point:
        """The gains of the system as it is."""
        return self.points[0]

    @property
    def tuned(self) -> Point | None:
        """The best of the points that keep the limits, of equals the first."""
        kept = [p for p in self.points if p.keeps(self.limits)]
        return min(kept, key=lambda p: _value(p, self.problem.minimise), default=None)

    @property
    def front(self) -> tuple[Point, ...]:
        """Points that keep all limits but the first, and that none beats.

        Beaten are those that another one equals in what is to be least, and in what the first
        limit is on, and is better in one of them. In the order of the latter. Of equals the first.
        """
        others = dict(list(self.limits.items())[1:])
        kept = [p for p in self.points if p.keeps({**others, **self._no_limit})]
        pairs = [tuple(_value(p, name) for name in self.problem.names[:2]) for p in kept]
        return tuple(kept[i] for i in non_dominated(pairs))

    @property
    def _no_limit(self) -> dict[str, float]:
        return dict.fromkeys(list(self.limits)[:1], math.inf)


def non_dominated(pairs: Sequence[tuple[float, ...]]) -> list[int]:
    """Indices of the pairs that no other one is as good as, and better in one; less is better.

    In the order of the second number; of equal pairs the first.
    """
    found: list[int] = []
    least = math.inf
    for i in sorted(range(len(pairs)), key=lambda i: (pairs[i][1:], pairs[i][0], i)):
        if pairs[i][0] < least:
            least = pairs[i][0]
            found.append(i)
    return found


def tune(
    problem: Problem,
    budget: int,
    seed: int = 0,
    workers: int | None = None,
    progress: bool = False,
) -> Tuning:
    """Search for the best gains with at most `budget` points, each a run in each condition.

    workers are processes, by default as many as there are processors; the result is the same to
    the bit on any number. progress shows on standard error how far it is.

    InputError without scipy, where the budget is less than a generation, or where a limit is to be
    what the system's own gains reach, and these reach nothing.
    """
    extra_module("scipy.optimize", "it searches the gains", "tune")
    size = max(LEAST, PER_GAIN * len(problem.gains))
    must = f"a whole number {size + 1} to {MOST}, for {len(problem.gains)} gains"
    whole("budget", budget, size + 1, MOST, must=must)
    whole("seed", seed, 0, must="a whole number from 0")
    total = budget * len(problem.conditions) + 2 * len(problem.checks)
    with (
        Progress("tune", total, shown=progress) as bar,
        Crew(workers or os.cpu_count() or 1) as crew,
    ):
        runs = Runs(problem, crew, bar)
        runs.points([problem.start])
        search = Search(runs, _limits(problem, runs.known[problem.start]), budget, seed, size)
        search.all()
        found = Tuning(problem, search.limits, tuple(runs.known.values()), budget, seed)
        return replace(found, checks=_checks(found, runs))


class Runs:
    """The points of a problem, each run once; workers only compute, what is next is said here."""

    def __init__(self, problem: Problem, crew: Crew, bar: Progress) -> None:
        self.problem, self._crew, self._bar = problem, crew, bar
        self.known: dict[tuple[float, ...], Point] = {}

    def points(self, wanted: Iterable[tuple[float, ...]]) -> list[Point]:
        """The points of these gains; those that are not known yet are run all at once."""
        asked = list(wanted)
        new = [gains for gains in dict.fromkeys(asked) if gains not in self.known]
        found = self.measured([(gains, self.problem.conditions) for gains in new])
        self.known.update(zip(new, found, strict=True))
        return [self.known[gains] for gains in asked]

    def measured(
        self, wanted: Sequence[tuple[tuple[float, ...], Sequence[Condition]]]
    ) -> list[Point]:
        """What gains reach in conditions, a point for each pair of them."""
        pairs = [(gains, condition) for gains, chosen in wanted for condition in chosen]
        jobs = [
            (
                Task(condition.system, (), self.problem.metrics),
                Job(i, self.problem.values(gains)),
            )
            for i, (gains, condition) in enumerate(pairs)
        ]
        outcomes: dict[int, Outcome] = {}
        with closing(self._crew.results(_run, jobs)) as results:
            for (_, job), found in results:
                if isinstance(found, Lost):
                    found = Outcome(job.index, {}, f"the process of the run {found.end}")
                outcomes[job.index] = found
                self._bar.update()
        in_order = iter(outcomes[i] for i in range(len(jobs)))
        return [
            self._point(gains, [next(in_order) for _ in conditions]) for gains, conditions in wanted
        ]

    def _point(self, gains: tuple[float, ...], outcomes: Sequence[Outcome]) -> Point:
        figures = {name: self._worst(name, outcomes) for name in self.problem.names}
        return Point(gains, figures, next((o.error for o in outcomes if o.error), None))

    def _worst(self, name: str, outcomes: Sequence[Outcome]) -> float | None:
        """The greatest of a metric's values over its entries and the runs; None where one lacks."""
        values = [
            value
            for o in outcomes
            for value in [v for k, v in o.metrics.items() if k.partition("[")[0] == name] or [None]
        ]
        numbers = [float(v) for v in values if v is not None]
        return max(numbers) if numbers and len(numbers) == len(values) else None


def _run(pair: tuple[Task, Job]) -> Outcome:
    return run_job(*pair)


class Search:
    """Searches one after the other, on the same points."""

    def __init__(
        self, runs: Runs, limits: Mapping[str, float], budget: int, seed: int, size: int
    ) -> None:
        self._runs, self.limits, self._problem = runs, limits, runs.problem
        self._budget, self._seed, self._size = budget, seed, size

    def all(self) -> None:
        """For the limits as they are, then with other first ones."""
        self._one(self.limits, max(self._budget // 2, self._size + 1), 0)
        scales = SCALES if self.limits else ()
        for k, scale in enumerate(scales, start=1):
            first = next(iter(self.limits))
            limits = {**self.limits, first: scale * self.limits[first]}
            share = (self._budget - len(self._runs.known)) // (len(scales) - k + 1)
            self._one(limits, len(self._runs.known) + share, k)

    def _one(self, limits: Mapping[str, float], most: int, k: int) -> None:
        """Evolve a generation as long as there are at most so many points."""
        from scipy.optimize import NonlinearConstraint, differential_evolution

        def enough(*_: object, **__: object) -> bool:
            return len(self._runs.known) + self._size > most

        if enough():
            return
        rng = np.random.default_rng([self._seed, k])
        first = self._first(limits, rng)
        self._runs.points(self._gains(row) for row in first)
        differential_evolution(
            self._over(lambda p: [_value(p, self._problem.minimise)], flat=True),
            [(0.0, 1.0)] * len(self._problem.gains),
            constraints=NonlinearConstraint(
                self._over(lambda p: self._excess(p, limits)), -np.inf, 0.0
            ),
            init=first,
            maxiter=0 if enough() else self._budget,
            callback=enough,
            rng=rng,
            vectorized=True,
            updating="deferred",
            polish=False,
            tol=0.0,
            **EVOLUTION,
        )

    def _over(
        self, of: Callable[[Point], list[float]], flat: bool = False
    ) -> Callable[[Shares], Shares]:
        """The same of shares, shape (gains,) or (gains, points): shape ([of], points)."""

        def found(shares: Shares) -> Shares:
            points = self._runs.points(self._gains(row) for row in np.atleast_2d(shares.T))
            if flat:
                return np.array([value for point in points for value in of(point)])
            values = np.array([of(point) for point in points]).T
            return values[:, 0] if shares.ndim == 1 else values

        return found

    def _gains(self, shares: Shares) -> tuple[float, ...]:
        return tuple(g.at(float(u)) for g, u in zip(self._problem.gains, shares, strict=True))

    def _shares(self, gains: tuple[float, ...]) -> list[float]:
        return [g.share(x) for g, x in zip(self._problem.gains, gains, strict=True)]

    def _first(self, limits: Mapping[str, float], rng: np.random.Generator) -> Shares:
        """A first generation: half the best points so far, half others about the best of them.

        Best are those that exceed the limits least, then those with the least. Points that are all
        alike stay so, hence the others; the first ones of all are anywhere between the bounds.
        """
        from scipy.stats import qmc

        def rank(point: Point) -> tuple[float, float]:
            excess = math.fsum(max(x, 0.0) for x in self._excess(point, limits))
            return excess, _value(point, self._problem.minimise)

        best = sorted(self._runs.known.values(), key=rank)[: self._size // 2]
        shares = np.array([self._shares(point.gains) for point in best])
        spread = qmc.LatinHypercube(shares.shape[1], rng=rng).random(self._size - len(best))
        if len(best) > 1:
            spread = np.clip(shares[0] + SPREAD * (spread - 0.5), 0.0, 1.0)
        return np.vstack([shares, spread])

    def _excess(self, point: Point, limits: Mapping[str, float]) -> list[float]:
        """How far a point is above each limit, as a share of it; last, if there is a value at all.

        A limit of 0 or less is taken in the unit of its metric.
        """
        values = [(point.figures[name], most) for name, most in limits.items()]
        found = [
            NOWHERE if x is None else min((x - most) / (most if most > 0.0 else 1.0), NOWHERE)
            for x, most in values
        ]
        return [*found, NOWHERE if point.figures[self._problem.minimise] is None else 0.0]


def _limits(problem: Problem, start: Point) -> dict[str, float]:
    """The limits as numbers; InputError where one is of gains that reach nothing."""
    found = {}
    for name, given in problem.limits.items():
        own = start.figures[name]
        if given is None and own is None:
            why = start.error or f"a run of them has no {name}"
            raise InputError(
                f"limit {name}: is what the system's own gains reach, but {why}; must be a number"
            )
        found[name] = number(f"limit {name}", own if given is None else given)
    return found


def _checks(found: Tuning, runs: Runs) -> tuple[Checked, ...]:
    """The checks of what was found, none where nothing was."""
    if found.tuned is None:
        return ()
    checks = found.problem.checks
    before, after = (
        runs.measured(list(zip(repeat(gains), ([c] for c in checks), strict=False)))
        for gains in (found.start.gains, found.tuned.gains)
    )
    return tuple(Checked(c.name, a, b) for c, a, b in zip(checks, before, after, strict=True))


def _value(point: Point, name: str) -> float:
    """A figure of a point, infinite where it has none."""
    value = point.figures[name]
    return math.inf if value is None else value


def _above(value: float | None, most: float) -> bool:
    return value is None or value > most
