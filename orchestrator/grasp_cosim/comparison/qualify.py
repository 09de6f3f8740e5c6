"""Swap qualification: whether an FMU may take the place of another in the closed loop.

First what the candidate declares otherwise. Where nothing of that blocks, the closed loop runs with
the original and with the candidate, and each signal and metric of the two is compared in its band.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from math import isclose
from pathlib import Path

from ..base.checks import choice, known
from ..base.errors import InputError, SimulationError
from ..interface.expansion import parse_values
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.read import describe
from ..interface.renaming import in_units, renamed
from ..interface.units import conversion
from ..master.simulation import simulate
from ..metrics.groups import metrics_of
from ..metrics.in_si import in_si
from ..metrics.metric import Metric
from ..recording.result import Result
from ..system.changes import converted, replaced
from ..system.description import System, as_system
from ..system.overrides import as_overrides
from ..system.parts import ISOLATIONS, Component, Connection, Isolation
from ..system.structure import SCHEMES, unit_of
from ..system.times import NANOSECONDS, in_seconds
from ..system.validity import connection_transform, transforms
from .bands import SHARE, Bands, plain
from .compare import FEWEST_STEPS, judge
from .interface_difference import (
    SEVERITIES,
    Difference,
    interface_differences,
    use_of,
)
from .outcome import QualificationData, Swap
from .side import Side, differences, side_of
from .words import short_qualification

END = Metric(
    "end_of_run", lambda run: float(run.time[-1]), "s", "where an FMU asked for the end, else stop"
)
"""Compared where one of the runs ends before the stop time."""


class Qualification(QualificationData):
    """Whether a candidate may take the place of an FMU: true where it is qualified.

    The verdict and all that led to it are as of a QualificationData.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        """The verdict and its reason, the worst signals and metrics, and the interface."""
        return short_qualification(self)

    def _repr_html_(self) -> str:
        """The same, as notebooks show it."""
        from .page import short_qualification_html  # only here: pages take long to import

        return short_qualification_html(self)


def qualify(
    system: System | str | Path,
    component: str,
    candidate: str | Path | Component,
    *,
    rename: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
    values: Mapping[str, Value] | None = None,
    bands: Bands | None = None,
    isolation: Isolation = "process",
    progress: bool = False,
    metrics: Sequence[Metric] = (),
) -> Qualification:
    """Find out whether an FMU may take the place of a component.

    Both are compared as they are declared, and as they run in the closed loop. The candidate runs
    in a process of its own, so that its crash is a result. Bands that are not stated are derived
    from the original, which is run with other numerics for that.

    Args:
        system: The system with the original, or the path of a system file.
        component: The name of the component.
        candidate: The path of the FMU; or a component of another system, with its names, units and
            values. An FMU has the names and units of the component, as far as they fit it.
        rename: The candidate's names of variables by those of the system.
        units: The units of variables of the candidate, where it declares none or a wrong one.
        values: Start values for both systems, by names like "plant.object_width", in the unit of
            the original, or of the one that has such a variable.
        bands: How far signals and metrics may be apart, as read_bands() has it from a file. What it
            does not name is derived from runs of the original.
        isolation: "process" runs the candidate in a process of its own, "none" in this one.
        progress: True shows on standard error how far the runs are.
        metrics: Metrics to be compared beside those of the system.

    Returns:
        The qualification, true where the candidate is qualified.

    Raises:
        InputError: An argument is wrong, or the original refuses.
        SimulationError: The original fails.
        KeyboardInterrupt: Ctrl-C.
    """
    choice("isolation", isolation, ISOLATIONS)
    system = as_system(system, "qualify")
    new = candidate if isinstance(candidate, Component) else Path(candidate)
    swap = prepare_swap(system, component, new, rename or {}, values or {}, isolation, units)
    if swap.swapped is None:
        return Qualification(swap)
    asked = tuple(m for m in metrics_of(system.metrics, metrics) if not m.reason)
    try:
        more = in_si(swap.swapped, asked).conversions
    except InputError as error:
        how = "of the candidate: --set components.NAME.units.VARIABLE=UNIT"
        raise InputError(f"{error}; {how}") from error
    run = simulate(swap.system, progress=progress and "original")
    ours = side_of(run, swap.original.name)
    ours = replace(ours, to_si={n: c for n, c in more.items() if n not in run} | dict(run.to_si))
    given = bands or Bands()
    given.check(ours.signals, (*ours.measured(asked), END.name))
    result, failure = _tried(swap.swapped, progress)
    if result is None:
        return Qualification(swap, failure=failure)
    early = any(r.ended_at is not None for r in (run, result))
    asked = () if failure else (*asked, END) if early else asked
    own = ours.measured(asked)
    again: list[Side] = []
    numerics: list[str] = []
    there = [given.of_metric(name) for name, value in own.items() if value is not None]
    if not all(entry and entry.wide for entry in (*map(given.of_signal, ours.signals), *there)):
        again, numerics = _other_numerics(swap.system, ours, progress)
    theirs = side_of(result, swap.candidate.name).converted(swap.back)
    both = own, replace(ours, time=theirs.time, signals=theirs.signals).measured(asked)
    span_ns, step_ns = swap.system.stop_ns - swap.system.start_ns, swap.system.step_ns
    shift = max(SHARE * span_ns, float(FEWEST_STEPS * step_ns)) / NANOSECONDS
    required = {*map(plain, own)}
    found = judge(ours, theirs, both, asked, again, given, shift, swap.nominals, required)
    texts = [f"{name} is a String: not compared" for name in ours.texts]
    found = replace(
        found,
        differences=differences(run, result),
        notes=(*(line for line in result.log if line not in run.log), *texts),
        numerics=tuple(numerics),
        names=("original", "candidate"),
    )
    return Qualification(swap, found, failure)


def _tried(swapped: System, progress: bool) -> tuple[Result | None, str | None]:
    """The candidate's run as far as it got, and why it did not get to the end."""
    try:
        return simulate(swapped, progress=progress and "candidate"), None
    except SimulationError as error:
        return error.result, str(error)
    except InputError as error:  # does not load, or refuses its initialisation
        return None, str(error)


def _other_numerics(system: System, original: Side, progress: bool) -> tuple[list[Side], list[str]]:
    """The original thinned, with twice the step, in the other scheme, if it runs so; in words."""
    runs = original.every_second()
    said = ["every second sample"]
    for name, other in _variants(system):
        try:
            run = simulate(other, progress=progress and f"original, {name}")
            runs.append(side_of(run, name))
            said.append(name)
        except (InputError, SimulationError) as error:
            said.append(f"not {name}: {error}")
    return runs, said


def _variants(system: System) -> Iterator[tuple[str, System]]:
    twice, spans = 2 * system.step_ns, [c.step_ns or 0 for c in system.components]
    if not any(span % twice for span in (system.stop_ns - system.start_ns, *spans)):
        step = in_seconds(twice)
        yield f"step {step:g} s", system.with_experiment(step=step)
    for scheme in SCHEMES:
        if scheme != system.scheme:
            yield f"scheme {scheme}", system.with_experiment(scheme=scheme)


def prepare_swap(
    system: System,
    component: str,
    candidate: Path | Component,
    rename: Mapping[str, str],
    values: Mapping[str, Value],
    isolation: Isolation,
    units: Mapping[str, str] | None = None,
) -> Swap:
    """The swap that qualify() describes; InputError where its arguments are wrong."""
    place = system.component(component, f"--as {component}")
    ours = place.interface
    was = candidate if isinstance(candidate, Component) else replace(place, values={})
    fmu = was.fmu if isinstance(candidate, Component) else candidate
    now = replaced(was, fmu, rename, units or {}, "")
    theirs = renamed(now.sized(describe(fmu)), now.rename, "rename")
    theirs = in_units(theirs, now.units, "units")
    _check_renamed(rename, ours, theirs)
    names = (*theirs.by_name, *(n for n in theirs.arrays if n not in ours.arrays))
    extra = {f"{component}.{name}": name for name in names if name not in ours.by_name}
    own = {n: v for n, v in now.values.items() if n not in ours.by_name}
    own |= {extra[key]: value for key, value in values.items() if key in extra}
    common = {key: value for key, value in values.items() if key not in extra}
    system = system.with_overrides(as_overrides(common, "--set {place}"))
    system = replace(system, record=system.record.with_outputs(system.components))
    use = use_of(system, component)
    differences = interface_differences(ours, theirs, use, own)
    swapped = None
    if not any(d.severity == "blocks" for d in differences):
        given = {n: v for n, v in use.values.items() if n in theirs.by_name}
        given = converted(given, ours, theirs) | dict(now.values)
        for name, value in own.items():
            text = f"--set {component}.{name}"
            given |= parse_values(theirs, text, name, value, text=True)
        place = replace(now, name=component, values=given, isolation=isolation)
        try:
            parts = tuple(place if c.name == component else c for c in system.components)
            record, _ = system.record.without_missing(system.components, parts)
            swapped = replace(system, components=parts, record=record)
        except InputError as error:
            differences.append(Difference("blocks", "system", component, str(error)))
    differences.sort(key=lambda d: SEVERITIES.index(d.severity))
    back = {}
    for v in (v for port, v in system.recorded.items() if port.component == component):
        if new := theirs.by_name.get(v.name):
            start, end = unit_of(theirs, new), unit_of(ours, v)
            both = conversion(start, end) if start and end else theirs.conversion(v.name, ours)
            back[f"{component}.{v.name}"] = both
    nominals = {
        str(port): v.magnitude if isinstance(v.magnitude, float) else None
        for port, v in system.recorded.items()
    }
    return Swap(system, component, fmu, tuple(differences), swapped, back, nominals)


def component_of(found: System, name: str, system: System) -> Component:
    """The component of that name in another system, as a candidate for the one in `system`.

    It runs on the connections of `system`. InputError where one of its own passes on other values
    than the same one does there, as by a factor: what the component puts out would be misread.
    """
    component = found.component(name, found.name)
    connected = {port for c in system.connections for port in (c.source, c.target)}
    there = {(c.source, c.target): c for c in system.connections}
    passed = transforms(found)
    for c in found.connections:
        if not any(port.component == name and port in connected for port in (c.source, c.target)):
            continue
        here = there.get((c.source, c.target), Connection(c.source, c.target))
        factor, offset = connection_transform(found, here)
        own = passed[c.target]
        if not (isclose(own[0], factor) and isclose(own[1], offset)):
            raise InputError(
                f"{found.name}: {c}: has factor = {own[0]:g}, offset = {own[1]:g}, which the "
                f"connections of {system.name}, on which the candidate runs, do not have; must be "
                f"units of its component instead, in [components.{name}] or --set"
            )
    return component


def _check_renamed(rename: Mapping[str, str], ours: Interface, theirs: Interface) -> None:
    """InputError where the candidate's variables get names that the original does not have."""
    for new, name in rename.items():
        for called in theirs.elements(new):
            entry = f"rename: {new!r} = {name!r}"
            known(f"{entry}: the original has no variable", called, ours.by_name, see=ours.listing)
