"""Swap qualification: whether an FMU may take the place of another in the closed loop.

First what the candidate declares otherwise. Where nothing of that blocks, the closed loop runs with
the original and with the candidate, and each signal and metric of the two is compared in its band.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from math import isclose
from pathlib import Path

from ..base.checks import choice, known
from ..base.errors import InputError, SimulationError
from ..interface.expansion import values_of
from ..interface.interface import Interface, Value
from ..interface.read import describe
from ..interface.units import IDENTITY, Conversion, conversion
from ..master.simulation import simulate
from ..metrics.in_si import in_si
from ..metrics.metric import Metric, metrics_of
from ..recording.result import Result
from ..system.changes import converted, replaced
from ..system.description import System
from ..system.parts import ISOLATIONS, NANOSECONDS, Component, Isolation
from ..system.structure import SCHEMES, between, output_units
from ..system.validity import transforms
from .bands import FEWEST_STEPS, SHARE, Bands, Compared, Curves, Reference, every_second
from .compare import Comparison
from .interface_difference import (
    SEVERITIES,
    Difference,
    feedthrough_differences,
    interface_differences,
    use_of,
)
from .side import differences, side_of
from .tube import Curve

END = Metric(
    "end_of_run", lambda run: float(run.time[-1]), "s", "where an FMU asked for the end, else stop"
)
"""Compared where one of the runs ends before the stop time."""


@dataclass(frozen=True, slots=True)
class Swap:
    """The system with the original, and with the candidate unless a difference blocks that.

    differences are the worst first. back converts outputs of the candidate to the units of the
    original, by signal name, None where that cannot be. nominals are those of all signals.
    """

    system: System
    component: str
    candidate: Path
    differences: tuple[Difference, ...]
    swapped: System | None
    back: Mapping[str, Conversion | None]
    nominals: Mapping[str, float | None]

    @property
    def original(self) -> Path:
        """The FMU that the candidate is to replace."""
        return self.system.component(self.component, "swap").fmu


@dataclass(frozen=True, slots=True)
class Qualification:
    """The verdict and all that led to it; signals and metrics the worst first.

    failure is why the candidate did not run to the end, None where it did or was not run. numerics
    are the other runs of the original that derived bands are from. runs are the signals of the
    original and of the candidate, by name and in the original's units. log is what the candidate's
    run tells and the original's does not. `asked` are the metrics, `absent` those that neither run
    has a value of, `results` the runs.
    """

    swap: Swap
    signals: tuple[Compared, ...] = ()
    metrics: tuple[Compared, ...] = ()
    failure: str | None = None
    numerics: tuple[str, ...] = ()
    runs: tuple[Curves, Curves] = ({}, {})
    log: tuple[str, ...] = ()
    asked: tuple[Metric, ...] = ()
    absent: tuple[str, ...] = ()
    results: tuple[Result, Result] | None = None

    @property
    def blocks(self) -> tuple[Difference, ...]:
        """The differences that kept the candidate from being run."""
        return tuple(d for d in self.swap.differences if d.severity == "blocks")

    @property
    def outside(self) -> tuple[Compared, ...]:
        """The signals and metrics that are out of their bands."""
        return tuple(c for c in (*self.signals, *self.metrics) if not c.inside)

    @property
    def uncompared(self) -> tuple[str, ...]:
        """The signals of the original that the candidate's run lacks, or has in no such unit."""
        return tuple(name for name in self.runs[0] if name not in self.runs[1])

    @property
    def comparison(self) -> Comparison | None:
        """Both runs as those of a comparison; None where the candidate did not run."""
        if self.results is None or not self.signals:
            return None
        names = (self.swap.original.name, self.swap.candidate.name)
        a, b = (side_of(*of) for of in zip(self.results, names, strict=True))
        curves, other = ({c.name: run[c.name] for c in self.signals} for run in self.runs)
        return Comparison(
            a,
            b,
            0.0,
            float(min(a.time[-1], b.time[-1])),
            self.signals,
            self.metrics,
            (curves, other),
            self.asked,
            differences(*self.results),
            self.log,
            self.absent,
            only=(self.uncompared, ()),
            names=("original", "candidate"),
        )

    @property
    def qualified(self) -> bool:
        """True if the candidate may take the original's place: all that there was to compare."""
        compared = self.signals or self.metrics
        return bool(compared) and not (self.blocks or self.failure or self.outside)


def qualify(
    system: System,
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
    """Compare a candidate FMU with that of a component, as declared and in the closed loop.

    The candidate may be a component of another system, with its names, units and values. An FMU has
    the names and units of the component it is to replace, as far as they fit it; rename maps the
    system's names to the candidate's, units variables of the candidate to the names of their units,
    where it declares none or a wrong one. values like {'plant.object_width': 0.06}
    are set in both systems, in the unit of the original, or in the one that has such a variable.
    bands are derived where they are not given. The candidate runs in a process of its own, which a
    crash does not leave, unless isolation says otherwise. metrics are compared beside those of the
    system. InputError where the input is wrong or the original refuses,
    SimulationError where the original fails, KeyboardInterrupt at Ctrl-C.
    """
    choice("isolation", isolation, ISOLATIONS)
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
    run = _run(swap.system, progress and "original")
    asked += (END,) if _ended_early(run) else ()
    side = side_of(run, swap.original.name)
    side = replace(side, to_si={n: c for n, c in more.items() if n not in run} | dict(run.to_si))
    span_ns, step_ns = swap.system.stop_ns - swap.system.start_ns, swap.system.step_ns
    shift = max(SHARE * span_ns, FEWEST_STEPS * step_ns) / NANOSECONDS
    original = Reference(side, asked, shift, bands or Bands(), swap.nominals)
    original.check_bands(metrics=(END.name,))
    result, failure = _tried(swap.swapped, progress)
    again: list[Curves] = []
    numerics: list[str] = []
    if original.derives:
        again, numerics = _other_numerics(swap.system, original.curves, progress)
    theirs = _converted(side_of(result, "").curves(), swap) if result else {}
    if result and _ended_early(result) and END not in asked:
        original = replace(original, asked=(*asked, END))
    singly = original.values(theirs)
    return Qualification(
        swap,
        original.signals(theirs, again),
        () if failure else original.metrics(singly, again),
        failure,
        tuple(numerics),
        (original.curves, theirs),
        _remarks(run, result) if result else (),
        original.asked,
        () if failure else original.absent(singly),
        (run, result) if result else None,
    )


def _tried(swapped: System, progress: bool) -> tuple[Result | None, str | None]:
    """The candidate's run as far as it got, and why it did not get to the end."""
    try:
        return _run(swapped, progress and "candidate"), None
    except SimulationError as error:
        return error.result, str(error)
    except InputError as error:  # does not load, or refuses its initialisation
        return None, str(error)


def _run(system: System, progress: str | bool) -> Result:
    result = simulate(system, progress=progress)
    if not result.complete:
        raise KeyboardInterrupt
    return result


def _ended_early(result: Result) -> bool:
    """True if an FMU asked for the end before the stop time."""
    return result.complete and bool(result.time[-1] < result.settings["stop"])


def _other_numerics(
    system: System, original: Curves, progress: bool
) -> tuple[list[Curves], list[str]]:
    """The original thinned, with twice the step and in the other scheme, as far as it runs so.

    And what they are, in words.
    """
    runs = every_second(original)
    said = ["every second sample"]
    for name, other in _variants(system):
        try:
            run = _run(other, progress and f"original, {name}")
            runs.append(side_of(run, name).curves())
            said.append(name)
        except (InputError, SimulationError) as error:
            said.append(f"not {name}: {error}")
    return runs, said


def _variants(system: System) -> Iterator[tuple[str, System]]:
    twice, spans = 2 * system.step_ns, [c.step_ns or 0 for c in system.components]
    if not any(span % twice for span in (system.stop_ns - system.start_ns, *spans)):
        step = twice / NANOSECONDS
        yield f"step {step:g} s", system.with_experiment(step=step)
    for scheme in SCHEMES:
        if scheme != system.scheme:
            yield f"scheme {scheme}", system.with_experiment(scheme=scheme)


def _remarks(reference: Result, result: Result) -> tuple[str, ...]:
    """Lines that only the candidate's run said, and on what is not compared."""
    texts = [name for name in reference if name not in reference.numbers]
    said = [line for line in result.log if line not in reference.log]
    return (*said, *(f"{name} is a String: not compared" for name in texts))


def _converted(curves: Curves, swap: Swap) -> dict[str, Curve]:
    """The signals in the original's units, but for those that cannot be."""
    return {
        name: Curve(c.time, change(c.values), c.held)
        for name, c in curves.items()
        if (change := swap.back.get(name, IDENTITY)) is not None
    }


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
    theirs = now.sized(describe(fmu)).renamed(now.rename, "rename")
    theirs = theirs.in_units(now.units, "units")
    _check_renamed(rename, ours, theirs)
    names = (*theirs.by_name, *(n for n in theirs.arrays if n not in ours.arrays))
    extra = {f"{component}.{name}": name for name in names if name not in ours.by_name}
    own = {n: v for n, v in now.values.items() if n not in ours.by_name}
    own |= {extra[key]: value for key, value in values.items() if key in extra}
    common = {key: value for key, value in values.items() if key not in extra}
    system = system.with_settings(common, "--set ".__add__)
    use = use_of(system, component)
    differences = [
        *interface_differences(ours, theirs, use, own),
        *feedthrough_differences(ours, theirs, use),
    ]
    swapped = None
    if not any(d.severity == "blocks" for d in differences):
        given = {n: v for n, v in use.values.items() if n in theirs.by_name}
        given = converted(given, ours, theirs) | dict(now.values)
        for name, value in own.items():
            text = f"--set {component}.{name}"
            given |= values_of(theirs, text, name, value, text=True)
        place = replace(now, name=component, values=given, isolation=isolation)
        try:
            components = [place if c.name == component else c for c in system.components]
            swapped = replace(system, components=tuple(components))
        except InputError as error:
            differences.append(Difference("blocks", "system", component, str(error)))
    differences.sort(key=lambda d: SEVERITIES.index(d.severity))
    back = {
        f"{component}.{v.name}": theirs.conversion(v.name, ours)
        for v in ours.of("output")
        if v.name in theirs.by_name
    }
    back |= _between(swapped, system, component) if swapped else {}
    nominals = {
        f"{c.name}.{v.name}": v.magnitude if isinstance(v.magnitude, float) else None
        for c in system.components
        for v in c.interface.of("output")
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
        place, same = f"{found.name}: {c}", there.get((c.source, c.target))
        if same and (same.factor, same.offset) != (None, None):
            factor, offset = same.factor or 1.0, same.offset or 0.0
        else:
            factor, offset = between(found, place, c.source, c.target)
        own = passed[c.target]
        if not (isclose(own[0], factor) and isclose(own[1], offset)):
            raise InputError(
                f"{place}: has factor = {own[0]:g}, offset = {own[1]:g}, which the connections of "
                f"{system.name}, on which the candidate runs, do not have; must be units of its "
                f"component instead, in [components.{name}] or --set"
            )
    return component


def _check_renamed(rename: Mapping[str, str], ours: Interface, theirs: Interface) -> None:
    """InputError where the candidate's variables get names that the original does not have."""
    for new, name in rename.items():
        for called in theirs.arrays[new].names if new in theirs.arrays else (new,):
            entry = f"rename: {new!r} = {name!r}"
            known(f"{entry}: the original has no variable", called, ours.by_name, see=ours.listing)


def _between(source: System, target: System, name: str) -> dict[str, Conversion | None]:
    """The conversions of the outputs of a component whose units both systems tell."""
    ends = output_units(source), output_units(target)
    return {
        str(port): conversion(start, end)
        for port in ends[0].keys() & ends[1].keys()
        if port.component == name and (start := ends[0][port]) and (end := ends[1][port])
    }
