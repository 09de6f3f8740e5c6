"""A study: a system, what varies in it and how; the values of run k are a pure function of k."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ..errors import InputError, choices
from ..recording.settings import settings
from ..study.metrics import UNITS, is_grasp
from ..system.description import System
from ..system.interface import Value, Variable
from .design import MOST, Design, Points
from .distributions import Distribution

RESERVED = ("index", "error", *UNITS)
"""Columns of the results that no parameter may be called."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that varies: it sets all variables, each like 'plant.object_width'.

    With ratio_to, another variable, it sets them to that many times its value.
    """

    name: str
    variables: tuple[str, ...]
    distribution: Distribution
    ratio_to: str | None = None


@dataclass(frozen=True, slots=True)
class Map:
    """A picture of a metric, of, over two parameters x and y; limit draws a line at that value."""

    x: str
    y: str
    of: str
    limit: float | None = None


@dataclass(frozen=True, slots=True)
class Pictures:
    """What is drawn of a study: a map, and the distributions of metrics."""

    map: Map | None = None
    distributions: tuple[str, ...] = ()


@dataclass(frozen=True)
class Study:
    """A checked study. The system has the fixed values already.

    seeds are variables that get another whole number in each run, each its own; outputs are
    signals whose last value is kept beside the metrics. InputError where anything does not fit.
    """

    name: str
    system: System
    parameters: tuple[Parameter, ...]
    design: Design
    seeds: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    pictures: Pictures = field(default=Pictures(), compare=False)

    def __post_init__(self) -> None:
        if not self.parameters:
            raise InputError(f"{self.name}: no [[parameters]]; must be at least one")
        self._check_names()
        self._check_outputs()
        for parameter in self.parameters:
            self._check_values(parameter)
        self.design.total(self._levels)
        self.system.with_values(self.values(0))

    @property
    def runs(self) -> int:
        """The number of runs."""
        return self.design.total(self._levels)

    def point(self, index: int) -> dict[str, Value]:
        """The parameters of a run by name, then its seeds by variable; index is 0, 1, ..."""
        row = self._points[index]
        values: dict[str, Value] = {
            p.name: p.distribution.at(float(u)) for p, u in zip(self.parameters, row, strict=True)
        }
        for k, name in enumerate(self.seeds):
            values[name] = self._first_seed + index * len(self.seeds) + k
        return values

    def values(self, index: int) -> dict[str, Value]:
        """What the variables of the system are set to in a run."""
        point = self.point(index)
        return {**self._driven(point), **{name: point[name] for name in self.seeds}}

    def variable(self, name: str) -> Variable:
        """The declared variable of 'component.variable'; InputError where there is none."""
        component, _, variable = name.partition(".")
        interface = self.system.component(component, f"{self.name}: {name}").interface
        if variable not in interface.by_name:
            raise InputError(
                f"{self.name}: {name}: {interface.path.name} has no variable {variable!r}; "
                f"valid: {choices(interface.by_name)}"
            )
        return interface.by_name[variable]

    @cached_property
    def identity(self) -> dict[str, str]:
        """A hash of all that decides the results: of the study, and of its FMUs' contents."""
        text = json.dumps(self._decisive(), sort_keys=True)
        fmus = hashlib.sha256()
        for component in self.system.components:
            fmus.update(hashlib.sha256(component.fmu.read_bytes()).digest())
        return {"study": hashlib.sha256(text.encode()).hexdigest(), "fmus": fmus.hexdigest()}

    def _decisive(self) -> dict[str, Any]:
        system = settings(self.system)
        del system["system"]
        for component in system["components"].values():
            del component["fmu"]
        return {
            "system": system,
            "parameters": [
                {**asdict(p), "distribution": _described(p.distribution)} for p in self.parameters
            ],
            "design": asdict(self.design),
            "seeds": self.seeds,
            "outputs": self.outputs,
        }

    @property
    def _levels(self) -> list[int | None]:
        return [p.distribution.levels for p in self.parameters]

    @cached_property
    def _points(self) -> Points:
        return self.design.points(self._levels)

    @cached_property
    def _first_seed(self) -> int:
        """By the study's seed, so that all of its runs have seeds that every variable takes."""
        limits = [self.variable(name) for name in self.seeds]
        low = int(max((v.low for v in limits if v.low > -(2**31)), default=0))
        high = int(min((v.high for v in limits if v.high < 2**31), default=2**31 - 1))
        room = high - low + 1 - self.runs * len(self.seeds)
        if room < 1:
            raise InputError(
                f"{self.name}: seeds: {self.runs * len(self.seeds)} of them, from {low} to {high}; "
                "must be fewer runs"
            )
        return low + int(np.random.default_rng([self.design.seed, MOST]).integers(room))

    def _driven(self, point: Mapping[str, Value]) -> dict[str, Value]:
        """The variables by the parameters: first those that stand alone, then the ratios."""
        values: dict[str, Value] = {}
        for p in sorted(self.parameters, key=lambda p: p.ratio_to is not None):
            value = point[p.name]
            if p.ratio_to is not None:
                reference = values.get(p.ratio_to)
                base = self.system.start(p.ratio_to) if reference is None else reference
                value = float(value) * float(base)
            values.update(dict.fromkeys(p.variables, value))
        return values

    def _check_names(self) -> None:
        names = [p.name for p in self.parameters]
        variables = [v for p in self.parameters for v in p.variables] + list(self.seeds)
        for what, listed in (("parameter", names), ("variable", variables)):
            twice = next((n for n in listed if listed.count(n) > 1), None)
            if twice is not None:
                raise InputError(f"{self.name}: {what} {twice!r} twice; must be there once")
        wrong = next((n for n in names if n in RESERVED or n in self.outputs), None)
        if wrong is not None:
            raise InputError(f"{self.name}: parameter {wrong!r}: is the name of a result")
        ratios = {v for p in self.parameters if p.ratio_to is not None for v in p.variables}
        for p in self.parameters:
            if p.ratio_to in ratios:
                raise InputError(
                    f"{self.name}: {p.name}: ratio_to = {p.ratio_to!r}: must not be set by a "
                    "ratio itself"
                )
        picture = self.pictures.map
        for name in (picture.x, picture.y) if picture else ():
            if name not in names:
                raise InputError(
                    f"{self.name}: figures.map: no parameter {name!r}; valid: {choices(names)}"
                )

    def _check_outputs(self) -> None:
        declared = [
            f"{c.name}.{v.name}" for c in self.system.components for v in c.interface.of("output")
        ]
        for name in self.outputs:
            if name not in declared:
                raise InputError(
                    f"{self.name}: outputs: no output {name!r}; valid: {choices(declared)}"
                )
        if not self.outputs and not is_grasp(declared):
            raise InputError(
                f"{self.name}: nothing to keep of a run; must have outputs = [...], or a system "
                "with a gripper plant and a controller"
            )

    def _check_values(self, parameter: Parameter) -> None:
        """The extremes of a parameter, where all others have their first ones, are valid."""
        point = {p.name: p.distribution.extremes[0] for p in self.parameters}
        if parameter.ratio_to is not None:
            self.system.start(parameter.ratio_to)
            numbers = parameter.distribution.extremes
            wrong = [x for x in numbers if isinstance(x, bool | str)]
            if wrong:
                raise InputError(f"{self.name}: {parameter.name}: {wrong[0]!r}: must be a number")
        for name in parameter.variables:
            kind = self.variable(name).kind
            if parameter.distribution.levels is None and kind != "Real":
                raise InputError(
                    f"{self.name}: {parameter.name}: {name} is of type {kind}; must have values"
                )
        for value in parameter.distribution.extremes:
            values = self._driven({**point, parameter.name: value})
            for name in parameter.variables:
                component, _, variable = name.partition(".")
                interface = self.system.component(component, self.name).interface
                interface.parse(f"{self.name}: {parameter.name}", variable, values[name])


def _described(distribution: Distribution) -> Sequence[Any]:
    return [type(distribution).__name__, repr(distribution)]
