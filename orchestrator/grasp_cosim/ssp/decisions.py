"""What an archive leaves to the tool that reads it: times, order of execution, names."""

import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, replace
from heapq import heappop, heappush
from typing import Any

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from si_units import known_unit

from ..base.errors import InputError, choices
from ..interface.interface import Value
from ..system.parts import (
    LONGEST,
    NANOSECONDS,
    Component,
    Connection,
    Solver,
    in_nanoseconds,
)
from .annotations import Beside, Extras, Steps
from .connectors import Part
from .document import at, child, same
from .elements import Path


def times(
    file: str, root: Any, parts: Iterable[Part], given: float | None, notes: list[str]
) -> tuple[int, int]:
    """The start time in ns, that of the archive or 0, and the stop time.

    That is the one given, or of the archive, or the longest that its FMUs name.
    """
    experiment = child(root, "ssd:DefaultExperiment")
    attributes = {} if experiment is None else experiment.attrib
    start = float(attributes.get("startTime", "0"))
    place = file if experiment is None else at(file, experiment)
    start_ns = in_nanoseconds(f"{place}: startTime", start, zero=True, low=-LONGEST)
    if given is not None:
        return start_ns, in_nanoseconds("stop", given)
    if "stopTime" in attributes:
        return start_ns, in_nanoseconds(f"{place}: stopTime", float(attributes["stopTime"]))
    declared = [part.interface.experiment.get("stop_time") for part in parts]
    stop = max((float(time) for time in declared if time is not None), default=0.0)
    if not 0.0 < stop < math.inf:
        raise InputError(
            f"{file}: no stopTime in a DefaultExperiment; give one: --set experiment.stop=..."
        )
    notes.append(f"stop = {stop:g} s, the longest that its FMUs name; the archive names none")
    return start_ns, in_nanoseconds(f"{file}: stop time of its FMUs", stop)


def step_time(
    file: str,
    parts: Iterable[Part],
    span_ns: int,
    given_ns: int | None,
    annotated: Extras | None,
    steps: Steps,
    notes: list[str],
) -> int:
    """The step in ns: given, ours, another tool's, or the FMUs' smallest that divides the stop."""
    if given_ns is not None:
        return given_ns
    if annotated:
        return annotated.step_ns
    if steps.base_ns:
        notes.append(f"step = {steps.base_ns / NANOSECONDS:g} s, by {steps.said}")
        return steps.base_ns
    declared_steps = sorted({part.interface.step for part in parts if part.interface.step})
    for step in declared_steps:
        if not 0.0 < step * NANOSECONDS <= span_ns:
            continue
        step_ns = round(step * NANOSECONDS)
        if step_ns and span_ns % step_ns == 0 and math.isclose(step_ns / NANOSECONDS, step):
            notes.append(f"step = {step:g} s, the smallest that its FMUs name; SSP has none")
            return step_ns
    listed = choices(f"{step:g} s" for step in declared_steps)
    raise InputError(
        f"{file}: names no step, as SSP has none, and of those of its FMUs ({listed}) none "
        f"divides the stop of {span_ns / NANOSECONDS:g} s; give one: --set experiment.step=..."
    )


def flow_order(
    components: Sequence[Component], connections: Iterable[Connection]
) -> tuple[Component, ...]:
    """The components such that who gives goes before who takes; within a loop, and else, as given.

    The elements of an SSD are in no order of execution, often sorted by name, and a sequential
    scheme against the flow delays a value by a step. Inside a loop no order is better than that of
    the file.
    """
    places = {component.name: i for i, component in enumerate(components)}
    edges = {(places[c.source.component], places[c.target.component]) for c in connections}
    start, end = np.array([*edges], int).reshape(-1, 2).T
    flow = coo_array((np.ones(len(edges)), (start, end)), (len(places), len(places)))
    _, loops = connected_components(flow, connection="strong")
    members: dict[int, list[int]] = {}
    for i, loop in enumerate(loops.tolist()):
        members.setdefault(loop, []).append(i)
    between = {(loops[s], loops[t]) for s, t in edges if loops[s] != loops[t]}
    gives: dict[int, list[int]] = {loop: [] for loop in members}
    for source, target in between:
        gives[source].append(target)
    waits, left = Counter(target for _, target in between), Counter(loops.tolist())
    free = [i for i, loop in enumerate(loops) if not waits[loop]]  # sorted, so a heap
    order = []
    while free:
        order.append(components[place := heappop(free)])
        left[loops[place]] -= 1
        for after in gives[loops[place]] if not left[loops[place]] else ():
            waits[after] -= 1
            for i in members[after] if not waits[after] else ():
                heappush(free, i)
    return tuple(order)


class Called:
    """The names of a component's variables, its FMU's and the system's, and units by the latter."""

    def __init__(self, place: str, part: Part, beside: Beside) -> None:
        self._place, self._part, self._beside = place, part, beside
        renamed = part.interface.renamed(beside.rename, f"{place}: rename").variables
        pairs = zip(part.interface.variables, renamed, strict=True)
        self._new = {own: new for new, own in beside.rename.items()}  # of whole arrays, too
        self._new |= {own.name: new.name for own, new in pairs}
        own = {new: own for own, new in self._new.items()}
        self._units = {
            **_units(part),
            **{own.get(name, name): unit for name, unit in beside.units.items()},
        }

    def new(self, own: str) -> str:
        """The system's name of a variable of the FMU."""
        return self._new.get(own, own)

    def in_units(self) -> Part:
        """The part with the units that the archive names."""
        return replace(
            self._part, interface=self._part.interface.in_units(self._units, self._place)
        )

    def component(self, name: str, part: Part, values: Mapping[str, Value]) -> Component:
        """The component with these values, by the FMU's names."""
        own = {self.new(variable): value for variable, value in values.items()}
        units = {self.new(variable): unit for variable, unit in self._units.items()}
        more = {f.name: getattr(self._beside, f.name) for f in fields(Beside)} | {"units": units}
        if part.element.exchange and "CoSimulation" in part.interface.kinds:
            more["solver"] = self._beside.solver or Solver()
        return Component(name, part.interface.path, own, **more)


def _units(part: Part) -> dict[str, str]:
    """The units that connectors name for variables that have none in the FMU."""
    variables = part.interface.by_name
    connectors = {
        c.name: c.unit
        for c in part.element.connectors.values()
        if c.unit and (v := variables.get(c.name)) and v.kind == "Real" and v.unit is None
    }
    meant = {n: (unit, known_unit(unit.name)) for n, unit in connectors.items()}
    return {n: unit.name for n, (unit, known) in meant.items() if known and same(unit, known)}


def component_names(file: str, parts: Iterable[Path]) -> dict[Path, str]:
    """The components' names in the system, where a dot parts component and variable."""
    names = {path: "_".join(path).replace(".", "_") for path in parts}
    for name, count in Counter(names.values()).items():
        if count > 1:
            same = choices(".".join(path) for path in names if names[path] == name)
            raise InputError(f"{file}: components {same} would all be {name!r} here; must differ")
    return names


def renamed(names: Mapping[Path, str]) -> Iterator[str]:
    """Yield a note for each component that is called otherwise here."""
    for path, name in names.items():
        if name != ".".join(path):
            yield f"component {'.'.join(path)} is called {name} here"
