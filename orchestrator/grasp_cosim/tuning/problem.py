"""What is tuned: gains between bounds, the metric that is to be least, limits on others."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

from ..checks import known, number
from ..errors import InputError
from ..metrics.metric import Metric, available, check_portable, registered
from ..system.description import System

DIGITS = 4
"""Significant digits of the gains that are tried: what is printed is what was run."""


@dataclass(frozen=True, slots=True)
class Gain:
    """A gain between two bounds, that of the first of its variables, like 'controller.gain'.

    The others keep their ratios to it. Bounds of one sign are searched by the logarithm.
    """

    variables: tuple[str, ...]
    low: float
    high: float

    def __post_init__(self) -> None:
        for bound in (self.low, self.high):
            number(f"{self.name}: bound", bound)
        if not self.low < self.high or not math.isfinite(self.high - self.low):
            said = f"{self.name}: bounds {self.low!r} to {self.high!r}"
            raise InputError(f"{said}: must have the lower one first, and be finite")

    @property
    def name(self) -> str:
        """The first variable."""
        return self.variables[0]

    def at(self, share: float) -> float:
        """The value at a share, 0 to 1, of the way between the bounds, in DIGITS digits."""
        if self._logarithmic:
            value = self.low * (self.high / self.low) ** share
        else:
            value = self.low + share * (self.high - self.low)
        return min(max(float(f"{value:.{DIGITS}g}"), self.low), self.high)

    def share(self, value: float) -> float:
        """Where a value lies between the bounds, 0 to 1; beyond them, the nearer one."""
        inner = min(max(value, self.low), self.high)
        if self._logarithmic:
            return math.log(inner / self.low) / math.log(self.high / self.low)
        return (inner - self.low) / (self.high - self.low)

    @property
    def _logarithmic(self) -> bool:
        return self.low * self.high > 0.0


@dataclass(frozen=True, slots=True)
class Condition:
    """A system under a name; those of a problem differ in what is not tuned."""

    name: str
    system: System


@dataclass(frozen=True)
class Problem:
    """A checked problem: of all gains that keep the limits, those that make `minimise` least.

    `minimise` and the keys of `limits` are metrics, in their SI units; what counts is the greatest
    of their values, over a metric's entries and over the `conditions`. A limit of None is what the
    system's own gains reach. `checks` are conditions that are run at the end, not tuned for.
    `metrics` are those beside the ones that every result is asked for. InputError where anything
    does not fit.
    """

    gains: tuple[Gain, ...]
    minimise: str
    limits: Mapping[str, float | None]
    conditions: tuple[Condition, ...]
    checks: tuple[Condition, ...] = ()
    metrics: tuple[Metric, ...] = field(default=(), compare=False)

    def __post_init__(self) -> None:
        if not self.gains or not self.conditions:
            missing = "gain" if not self.gains else "condition"
            raise InputError(f"no {missing} to tune for; must be at least one")
        check_portable(self.metrics)
        if self.minimise in self.limits:
            raise InputError(
                f"limit {self.minimise}: is on what is to be least; must be on another"
            )
        for name in (self.minimise, *self.limits):
            self.metric(name)
        variables = [v for gain in self.gains for v in gain.variables]
        twice = next((v for v in variables if variables.count(v) > 1), None)
        if twice is not None:
            raise InputError(f"{twice}: is varied twice; must be there once")
        for name in variables:
            self._check_kind(name)
        for corner in ([g.low for g in self.gains], [g.high for g in self.gains]):
            self.system.with_values(self.values(tuple(corner)))

    @property
    def system(self) -> System:
        """The system of the first condition, whose gains are those to compare with."""
        return self.conditions[0].system

    @property
    def names(self) -> tuple[str, ...]:
        """The metrics that are asked for: what is least, then the limits."""
        return (self.minimise, *self.limits)

    @cached_property
    def start(self) -> tuple[float, ...]:
        """The gains of the system as it is, by gain."""
        return tuple(self.system.start(gain.name) for gain in self.gains)

    def values(self, gains: tuple[float, ...]) -> dict[str, float]:
        """The values of all variables that these gains set."""
        return {
            name: value * self._ratios[name]
            for gain, value in zip(self.gains, gains, strict=True)
            for name in gain.variables
        }

    def metric(self, name: str) -> Metric:
        """The metric of that name; InputError where the system permits none."""
        declared = [str(port) for port in self.system.recorded]
        there, missing = available(registered(self.metrics), declared, self.system.roles)
        found = {m.name: m for m in there}
        if name not in found and missing:
            raise InputError(f"metric {name!r}: cannot be had: {missing[0]}")
        known("no metric", name, found)
        return found[name]

    def unit(self, gain: Gain) -> str | None:
        """The unit of a gain, as its FMU declares it."""
        component, _, variable = gain.name.partition(".")
        return self.system.component(component, gain.name).interface.by_name[variable].unit

    @cached_property
    def _ratios(self) -> dict[str, float]:
        """By variable, its ratio to the first one of its gain."""
        found = {}
        for gain in self.gains:
            first = self.system.start(gain.name)
            for name in gain.variables[1:]:
                if not first:
                    raise InputError(f"{gain.name}: starts at 0: no ratio of {name} to it")
                found[name] = self.system.start(name) / first
            found[gain.name] = 1.0
        return found

    def _check_kind(self, name: str) -> None:
        component, _, variable = name.partition(".")
        interface = self.system.component(component, name).interface
        known(f"{name}: {interface.path.name} has no variable", variable, interface.by_name)
        kind = interface.by_name[variable].kind
        if kind != "Real":
            raise InputError(f"{name}: is of type {kind}; must be a Real")
