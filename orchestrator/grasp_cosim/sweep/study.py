"""A study: a system, what varies in it and how; the values of run k are a pure function of k."""

import hashlib
import json
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, dataclass, field
from functools import cached_property
from pathlib import PurePath
from typing import Any, Literal, get_args

import numpy as np

from ..checks import known
from ..errors import InputError, choices, nearest
from ..interface.interface import Value, Variable
from ..interface.units import IDENTITY, Conversion
from ..metrics.metric import Metric, available, check_portable, registered
from ..metrics.units import in_si
from ..numerals import in_milli
from ..system.description import System
from ..system.parts import Port
from ..system.readings import between
from ..system.settings import settings
from .design import MOST, Design, Points
from .distributions import Distribution

STATISTICS = ("least", "p5", "median", "p95", "greatest", "mean")
"""The statistics of a metric, besides how many runs have one."""

Cell = Literal["mean", "greatest"]
CELLS: tuple[str, ...] = get_args(Cell)

PROXIES = "proxies."
"""The beginning of the columns that a system with proxies has besides."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that varies: it sets all variables, each like 'plant.object_width'.

    It is in the unit of the first of them. With ratio_to, another variable, it sets them to that
    many times its value. What has another unit gets it converted.
    """

    name: str
    variables: tuple[str, ...]
    distribution: Distribution
    ratio_to: str | None = None


@dataclass(frozen=True, slots=True)
class Map:
    """A picture of a metric, of, over two parameters x and y; limit draws a line at that value.

    cell says what of runs that share a cell is shown.
    """

    x: str
    y: str
    of: str
    limit: float | None = None
    cell: Cell = "mean"


@dataclass(frozen=True, slots=True)
class Curve:
    """A picture of a metric, or of one of its columns, of, over the parameter x; else as a Map."""

    x: str
    of: str
    limit: float | None = None
    cell: Cell = "mean"


@dataclass(frozen=True, slots=True)
class Pictures:
    """The pictures of a study: maps, the distributions of metrics, and curves."""

    maps: tuple[Map, ...] = ()
    distributions: tuple[str, ...] = ()
    curves: tuple[Curve, ...] = ()


@dataclass(frozen=True, slots=True)
class Limit:
    """The most that a statistic of a metric may be over all runs, in the unit of the metric.

    With reference, the name of another variant, it is that of how far the metric of each run is
    from that of the same run there.
    """

    metric: str
    statistic: str
    most: float
    reference: str | None = None


@dataclass(frozen=True)
class Study:
    """A checked study. The system has the fixed values already.

    seeds are variables that get another whole number in each run, each its own, but see _noise();
    outputs are signals whose last value is kept beside the metrics; metrics are those beside the
    ones that every result is asked for. variant is the name of this one among several of the same
    design. InputError where anything does not fit.
    """

    name: str
    system: System
    parameters: tuple[Parameter, ...]
    design: Design
    seeds: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    pictures: Pictures = field(default=Pictures(), compare=False)
    metrics: tuple[Metric, ...] = ()
    limits: tuple[Limit, ...] = field(default=(), compare=False)
    variant: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        if not self.parameters:
            raise InputError(f"{self.name}: no [[parameters]]; must be at least one")
        check_portable(self.metrics)
        in_si(self.system, registered(self.metrics))
        self._check_names()
        self._check_outputs()
        for name in self.seeds:
            kind = self.variable(name).kind
            if kind != "Integer":
                said = f"{self.name}: seeds: {name} is of type {kind}"
                raise InputError(f"{said}; must be an Integer")
        for parameter in self.parameters:
            for name in (*parameter.variables, *filter(None, [parameter.ratio_to])):
                self.variable(name)
        for parameter in self._references_first:
            self._check_values(parameter)
        self._check_pictures()
        for limit in self.limits:
            self.columns_of(limit.metric, "limits")
        try:
            self.design.total(self._levels)
        except InputError as error:
            raise InputError(f"{self.name}: {error}") from error
        self.system.with_values(self.values(0))

    @property
    def title(self) -> str:
        """The name of its file without the suffix; without a file, that of the system's."""
        name = self.name.removesuffix(f", {self.variant}")
        return PurePath(name if name.endswith(".toml") else self.system.name).stem

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
            values[name] = self._first_seed + self._noise(index) * len(self.seeds) + k
        return values

    def values(self, index: int) -> dict[str, Value]:
        """Return the values of the variables of the system in a run."""
        point = self.point(index)
        return {**self._driven(point), **{name: point[name] for name in self.seeds}}

    def variable(self, name: str) -> Variable:
        """The declared variable of 'component.variable'; InputError where there is none."""
        component, _, variable = name.partition(".")
        interface = self.system.component(component, f"{self.name}: {name}").interface
        said = f"{self.name}: {name}: {interface.path.name} has no variable"
        known(said, variable, interface.by_name, see=interface.listing)
        return interface.by_name[variable]

    @cached_property
    def identity(self) -> dict[str, str]:
        """A hash of all that decides the results: of the study, and of its FMUs' contents."""
        text = json.dumps(self._decisive(), sort_keys=True)
        fmus = hash_of(c.fmu.read_bytes() for c in self.system.components)
        return {"study": hashlib.sha256(text.encode()).hexdigest(), "fmus": fmus}

    def _decisive(self) -> dict[str, Any]:
        system = settings(self.system)
        del system["system"]
        for component in system["components"].values():
            del component["fmu"]
        return {
            "system": system,
            "parameters": [
                {**asdict(p), "distribution": [type(p.distribution).__name__, repr(p.distribution)]}
                for p in self.parameters
            ],
            "design": asdict(self.design),
            "seeds": self.seeds,
            "outputs": self.outputs,
            **({"metrics": [m.origin or m.name for m in self.metrics]} if self.metrics else {}),
        }

    @property
    def _references_first(self) -> list[Parameter]:
        return sorted(self.parameters, key=lambda p: p.ratio_to is not None)

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

    def _noise(self, index: int) -> int:
        """Return the number of the seeds; in a saltelli row A and all A with one of B share it.

        Noise is then another parameter that stays while one changes, not a part of each's effect.
        """
        if self.design.kind != "saltelli":
            return index
        row, place = divmod(index, len(self.parameters) + 2)
        return 2 * row + (place == 1)

    def _driven(self, point: Mapping[str, Value]) -> dict[str, Value]:
        """The variables by the parameters: first those that stand alone, then the ratios."""
        values: dict[str, Value] = {}
        for p in self._references_first:
            value = point[p.name]
            if p.ratio_to is not None:
                reference = values.get(p.ratio_to)
                base = self.system.start(p.ratio_to) if reference is None else reference
                value = float(value) * float(base)
            values.update({name: self._meant(p, name, value) for name in p.variables})
        return values

    def _meant(self, parameter: Parameter, name: str, value: Value) -> Value:
        """The value of a parameter in the unit of one of its variables."""
        change = self._changes[parameter.name][name]
        return value if change == IDENTITY else change(float(value))

    @cached_property
    def _changes(self) -> dict[str, dict[str, Conversion]]:
        """By parameter and variable, the conversion from the unit in which the parameter is.

        That is the unit of its first variable, or of the one that its ratio refers to.
        """
        return {
            p.name: {
                name: between(
                    self.system,
                    f"{self.name}: {p.name}",
                    Port(*(p.ratio_to or p.variables[0]).split(".", 1)),
                    Port(*name.split(".", 1)),
                )
                for name in p.variables
            }
            for p in self.parameters
        }

    def _check_names(self) -> None:
        names = [p.name for p in self.parameters]
        variables = [v for p in self.parameters for v in p.variables] + list(self.seeds)
        for what, listed in (("parameter", names), ("variable", variables)):
            twice = next((n for n in listed if listed.count(n) > 1), None)
            if twice is not None:
                raise InputError(f"{self.name}: {what} {twice!r} twice; must be there once")
        metrics = [name for m in registered(self.metrics) for name in (m.name, *m.columns)]
        taken = {"index", "error", *metrics, *self.outputs, *self.seeds}
        wrong = next((n for n in names if n in taken or n.startswith(PROXIES)), None)
        if wrong is not None:
            raise InputError(
                f"{self.name}: parameter {wrong!r}: is the name of a result or seed; must be "
                "another name"
            )
        ratios = {v for p in self.parameters if p.ratio_to is not None for v in p.variables}
        for p in self.parameters:
            if p.ratio_to in ratios:
                raise InputError(
                    f"{self.name}: {p.name}: ratio_to = {p.ratio_to!r}: must not be set by a "
                    "ratio itself"
                )

    def _check_pictures(self) -> None:
        """InputError where a picture is of something that will not be there, or no number."""
        numeric = [
            p.name
            for p in self.parameters
            if not any(isinstance(x, str) for x in p.distribution.extremes)
        ]
        results = [*(c for m in self.expected for c in m.columns), *self.outputs]
        columns = [*numeric, *self.seeds, *results]
        for kind, name in self._varied_in_pictures():
            known(f"{self.name}: figures.{kind}: no parameter", name, numeric, " with numbers")
        for picture in self.pictures.maps:
            if picture.x == picture.y:
                raise InputError(
                    f"{self.name}: figures.map: x = y = {picture.x!r}; must be two parameters"
                )
        whole = {m.name for m in self.expected}
        curves = [c.of for c in self.pictures.curves if c.of not in whole]
        for name in (*(m.of for m in self.pictures.maps), *self.pictures.distributions, *curves):
            if not (name in columns or name.startswith(PROXIES) or self.metric_of(name)):
                raise InputError(
                    f"{self.name}: figures: no column {name!r} in the results; "
                    f"{nearest(name, columns)}"
                )

    def _varied_in_pictures(self) -> Iterator[tuple[str, str]]:
        """The parameters that pictures are over, after what kind of picture that is."""
        for picture in self.pictures.maps:
            yield "map", picture.x
            yield "map", picture.y
        for curve in self.pictures.curves:
            yield "curve", curve.x

    @cached_property
    def expected(self) -> list[Metric]:
        """The metrics that the outputs of the system permit."""
        return available(registered(self.metrics), self._declared, self.system.roles)[0]

    def metric_of(self, column: str) -> Metric | None:
        """The metric whose column this is; of a user's metric any column with its name."""
        name, bracket, _ = column.partition("[")
        found = next((m for m in self.expected if m.name == name), None)
        if found is None or column in found.columns or (bracket and not found.entries):
            return found
        return None

    def columns_of(self, name: str, place: str) -> tuple[str, ...]:
        """The columns of a result of that name; InputError, which begins with the place, if none.

        Those are all entries of a metric, one entry like impact_velocity[1], or an output.
        """
        for metric in self.expected:
            if name in (metric.name, *metric.columns):
                return metric.columns if name == metric.name else (name,)
        known(
            f"{self.name}: {place}: no result",
            name,
            [*(m.name for m in self.expected), *self.outputs],
        )
        return (name,)

    def unit(self, column: str) -> str | None:
        """The unit of a parameter, metric or output; "1" for a share, None where it has none."""
        parameter = next((p for p in self.parameters if p.name == column), None)
        if parameter is not None:
            own = self.variable(parameter.variables[0]).unit
            return own if parameter.ratio_to is None else "1"
        if column in self.outputs:
            return self.variable(column).unit
        metric = self.metric_of(column)
        return metric.unit if metric else None

    def shown(self, column: str) -> tuple[float, str]:
        """The factor and the unit in which tables and pictures show a column, "" for a number."""
        metric = self.metric_of(column)
        return (metric.factor, metric.display_unit) if metric else in_milli(self.unit(column))

    @property
    def _declared(self) -> list[str]:
        """All outputs that a run records."""
        return [str(port) for port in self.system.recorded]

    def _check_outputs(self) -> None:
        declared = self._declared
        for name in self.outputs:
            known(f"{self.name}: outputs: no output", name, declared)
        if not self.outputs and not self.expected:
            reasons = available(registered(self.metrics), declared, self.system.roles)[1]
            raise InputError(
                f"{self.name}: nothing to keep of a run; must have outputs = [...], or a system "
                f"whose signals metrics need{f' ({choices(reasons)})' if reasons else ''}"
            )

    def _check_values(self, parameter: Parameter) -> None:
        """InputError where a value of a parameter is not of the type and range of its variables."""
        place = f"{self.name}: {parameter.name}"
        for name in parameter.variables:
            kind = self.variable(name).kind
            if parameter.distribution.levels is None and kind != "Real":
                raise InputError(f"{place}: {name} is of type {kind}; must have values")
        for value in self._extremes(parameter, place):
            for name in parameter.variables:
                component, _, variable = name.partition(".")
                interface = self.system.component(component, self.name).interface
                interface.parse(place, variable, self._meant(parameter, name, value))

    def _extremes(self, parameter: Parameter, place: str) -> Iterator[Value]:
        """Values of the variables that must be valid for all to be."""
        extremes = parameter.distribution.extremes
        if parameter.ratio_to is None:
            yield from extremes
            return
        kind = self.variable(parameter.ratio_to).kind
        if kind not in ("Real", "Integer"):
            raise InputError(
                f"{place}: ratio_to = {parameter.ratio_to!r}: is of type {kind}; must be a number"
            )
        for x in extremes:
            if isinstance(x, bool | str) or not abs(x) <= sys.float_info.max:
                raise InputError(f"{place}: {x!r}: must be a number, and finite")
        for reference in self._references(parameter.ratio_to, place):
            yield from (float(x) * reference for x in extremes)

    def _references(self, name: str, place: str) -> tuple[float, ...]:
        """The least and the greatest that a ratio may refer to."""
        for p in self.parameters:
            if name in p.variables:
                numbers = [float(x) for x in p.distribution.extremes]
                return min(numbers), max(numbers)
        try:
            return (self.system.start(name),)
        except InputError as error:
            raise InputError(f"{place}: ratio_to: {error}") from error


def hash_of(contents: Iterable[bytes]) -> str:
    """Return a hash of the contents of files, in their order."""
    digest = hashlib.sha256()
    for content in contents:
        digest.update(hashlib.sha256(content).digest())
    return digest.hexdigest()
