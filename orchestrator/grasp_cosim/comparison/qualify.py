"""Swap qualification: whether an FMU may take the place of another in the closed loop.

First what the candidate declares otherwise. If nothing of that blocks, the closed loop runs with
the original and with the candidate. Each signal and metric of the two is compared in its band.
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
from ..interface.units import Conversion, conversion
from ..interface.variables import Variable
from ..master.simulation import simulate
from ..metrics.groups import metrics_of
from ..metrics.in_si import in_si
from ..metrics.metric import Metric
from ..recording.result import Result
from ..system.changes import converted, replaced
from ..system.description import System, as_system
from ..system.entries import with_options
from ..system.overrides import Override, as_overrides
from ..system.parts import ISOLATIONS, Component, Connection, Isolation, Solver
from ..system.structure import SCHEMES, unit_of
from ..system.times import NANOSECONDS, in_seconds
from ..system.validity import connection_transform, transforms
from .bands import SHARE, Bands, plain
from .compare import FEWEST_STEPS, compared_by
from .interface_difference import (
    SEVERITIES,
    Difference,
    interface_differences,
    use_of,
)
from .judge import Judge
from .outcome import QualificationData, Swap
from .side import Side, differences, side_of, unread
from .summary import short_qualification

SET = "--set {place}"
"""The origin of what is set for a swap."""

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
        from .comparison_page import (
            short_qualification_html,  # only here: pages take long to import
        )

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
    solver: Mapping[str, float] | None = None,
    progress: bool = False,
    metrics: Sequence[Metric] = (),
) -> Qualification:
    """Find out whether an FMU may take the place of a component.

    Both are compared as they are declared, and as they run in the closed loop. The candidate runs
    in its own process, so that its crash is a result. Bands that are not stated are derived
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
        isolation: "process" runs the candidate in its own process, "none" in this one.
        solver: Options of the candidate's solver by their names, such as relative_tolerance. An FMU
            of both kinds then runs by model exchange. None keeps what its component has.
        progress: True shows on standard error how far the runs are.
        metrics: Metrics to be compared in addition to those of the system.

    Returns:
        The qualification, true where the candidate is qualified.

    Raises:
        InputError: An argument is wrong, or the original refuses.
        SimulationError: The original fails.
        KeyboardInterrupt: Ctrl-C.

    Example:
        >>> from grasp_cosim import grasp_system, qualify
        >>> system = grasp_system(native=False).with_experiment(step=2e-3, stop=0.1)
        >>> bool(qualify(system, "plant", system.by_name["plant"].fmu))
        True
    """
    choice("isolation", isolation, ISOLATIONS)
    system = as_system(system, "qualify")
    fmu = candidate if isinstance(candidate, Component) else Path(candidate)
    swap = prepare_swap(
        system, component, fmu, rename or {}, values or {}, isolation, units, solver
    )
    if swap.swapped is None:
        return Qualification(swap)
    definitions = tuple(m for m in metrics_of(system.metrics, metrics) if not m.reason)
    to_si = _conversions_of_candidate(swap.swapped, definitions)
    run = simulate(swap.system, progress=progress and "original")
    original = side_of(run, swap.original.name)
    missing = {name: change for name, change in to_si.items() if name not in run}
    original = replace(original, to_si={**missing, **run.to_si})
    stated = bands or Bands()
    stated.check(original.signals, (*original.measured(definitions), END.name))
    result, failure = _candidate_run(swap.swapped, progress)
    if result is None:
        return Qualification(swap, failure=failure)
    if failure:
        definitions = ()
    elif run.ended_at is not None or result.ended_at is not None:
        definitions = (*definitions, END)
    new = side_of(result, swap.candidate.name).converted(swap.back)
    original = replace(original, unread=unread(original, new, definitions))
    measured = original.measured(definitions)
    repetitions, numerics = _repetitions(swap.system, original, measured, stated, progress)
    measured_of_new = replace(original, time=new.time, signals=new.signals).measured(definitions)
    span_ns, step_ns = swap.system.stop_ns - swap.system.start_ns, swap.system.step_ns
    shift = max(SHARE * span_ns, float(FEWEST_STEPS * step_ns)) / NANOSECONDS
    judge = Judge(
        original, repetitions, stated, shift, swap.nominals, required={*map(plain, measured)}
    )
    texts = [f"{name} is a String: not compared" for name in original.texts]
    comparison = replace(
        compared_by(judge, new, (measured, measured_of_new), definitions),
        differences=differences(run, result),
        notes=(*(line for line in result.log if line not in run.log), *texts),
        numerics=tuple(numerics),
        names=("original", "candidate"),
    )
    return Qualification(swap, comparison, failure)


def _conversions_of_candidate(
    swapped: System, definitions: Sequence[Metric]
) -> Mapping[str, Conversion]:
    """How the signals that the metrics need are converted to SI; InputError where that fails."""
    try:
        return in_si(swapped, definitions).conversions
    except InputError as error:
        remedy = "of the candidate: --set components.NAME.units.VARIABLE=UNIT"
        raise InputError(f"{error}; {remedy}") from error


def _repetitions(
    system: System,
    original: Side,
    measured: Mapping[str, float | None],
    stated: Bands,
    progress: bool,
) -> tuple[list[Side], list[str]]:
    """Runs of the original with other numerics, and which; none where no band is derived."""
    of_metrics = [stated.of_metric(name) for name, value in measured.items() if value is not None]
    entries = (*map(stated.of_signal, original.signals), *of_metrics)
    if all(entry and entry.wide for entry in entries):
        return [], []
    return _other_numerics(system, original, progress)


def _candidate_run(swapped: System, progress: bool) -> tuple[Result | None, str | None]:
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
    numerics = ["every second sample"]
    for name, variant in _variants(system):
        try:
            run = simulate(variant, progress=progress and f"original, {name}")
            runs.append(replace(side_of(run, name), unread=original.unread))
            numerics.append(name)
        except (InputError, SimulationError) as error:
            numerics.append(f"not {name}: {error}")
    return runs, numerics


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
    solver: Mapping[str, float] | None = None,
) -> Swap:
    """The swap that qualify() describes; InputError where its arguments are wrong."""
    place = system.component(component, f"--as {component}")
    original = place.interface
    former = candidate if isinstance(candidate, Component) else replace(place, values={})
    fmu = former.fmu if isinstance(candidate, Component) else candidate
    new = replaced(former, fmu, rename, units or {}, "")
    if solver is not None:
        new = _solved(new, component, solver)
    interface = renamed(new.sized(describe(fmu)), new.rename, "rename")
    interface = in_units(interface, new.units, "units")
    _check_renamed(rename, original, interface)
    common, extra = _divided(values, component, original, interface)
    extra = {n: v for n, v in new.values.items() if n not in original.by_name} | extra
    system = system.with_overrides(as_overrides(common, SET)).untriggered()
    system = replace(system, record=system.record.with_outputs(system.components))
    use = use_of(system, component)
    differences = interface_differences(original, interface, use, extra)
    swapped = None
    if not any(d.severity == "blocks" for d in differences):
        used = {n: v for n, v in use.values.items() if n in interface.by_name}
        new_values = converted(used, original, interface) | dict(new.values)
        for name, value in extra.items():
            text = f"--set {component}.{name}"
            new_values |= parse_values(interface, text, name, value, text=True)
        # The file itself is to be judged, not a twin of it.
        new = replace(
            new, name=component, values=new_values, isolation=isolation, native=None, as_named=True
        )
        try:
            swapped = _with_component(system, new)
        except InputError as error:
            differences.append(Difference("blocks", "system", component, str(error)))
    differences.sort(key=lambda d: SEVERITIES.index(d.severity))
    recorded = [v for port, v in system.recorded.items() if port.component == component]
    back = {
        f"{component}.{v.name}": _conversion_back(v, interface, original)
        for v in recorded
        if v.name in interface.by_name
    }
    nominals = {
        str(port): v.magnitude if isinstance(v.magnitude, float) else None
        for port, v in system.recorded.items()
    }
    return Swap(system, component, fmu, tuple(differences), swapped, back, nominals)


def _solved(candidate: Component, name: str, solver: Mapping[str, float]) -> Component:
    """The candidate, which is to have this name, with other options of its solver."""
    place = f"components.{name}.solver"
    options = {key: Override(f"{place}.{key}", value, SET) for key, value in solver.items()}
    return replace(candidate, solver=with_options(place, candidate.solver or Solver(), options))


def _divided(
    values: Mapping[str, Value], component: str, original: Interface, candidate: Interface
) -> tuple[dict[str, Value], dict[str, Value]]:
    """Start values for both systems, and those of variables that only the candidate has."""
    arrays = [name for name in candidate.arrays if name not in original.arrays]
    new_names = [n for n in (*candidate.by_name, *arrays) if n not in original.by_name]
    name_at = {f"{component}.{name}": name for name in new_names}
    common = {place: value for place, value in values.items() if place not in name_at}
    extra = {name_at[place]: value for place, value in values.items() if place in name_at}
    return common, extra


def _with_component(system: System, new: Component) -> System:
    """The system with another component of that name, without what it can no longer record."""
    components = tuple(new if c.name == new.name else c for c in system.components)
    record, _ = system.record.without_missing(system.components, components)
    return replace(system, components=components, record=record)


def _conversion_back(
    variable: Variable, candidate: Interface, original: Interface
) -> Conversion | None:
    """How a signal of the candidate is converted to the unit of the original."""
    unit = unit_of(candidate, candidate.by_name[variable.name])
    former_unit = unit_of(original, variable)
    if unit and former_unit:
        return conversion(unit, former_unit)
    return candidate.conversion(variable.name, original)


def component_of(origin: System, name: str, system: System) -> Component:
    """The component of that name in another system, as a candidate for the one in `system`.

    It runs on the connections of `system`. InputError where one of them passes on other values
    than the same one does there, as by a factor: what the component puts out would be misread.
    """
    component = origin.component(name, origin.name)
    connected = {port for c in system.connections for port in (c.source, c.target)}
    connection_here = {(c.source, c.target): c for c in system.connections}
    passed = transforms(origin)
    for c in origin.connections:
        if not any(port.component == name and port in connected for port in (c.source, c.target)):
            continue
        own_connection = connection_here.get((c.source, c.target), Connection(c.source, c.target))
        factor, offset = connection_transform(origin, own_connection)
        values_there = passed[c.target]
        if not (isclose(values_there[0], factor) and isclose(values_there[1], offset)):
            raise InputError(
                f"{origin.name}: {c}: has factor = {values_there[0]:g}, offset = "
                f"{values_there[1]:g}, which the connections of {system.name}, on which the "
                "candidate runs, do not have; must be units of its component instead, in "
                f"[components.{name}] or --set"
            )
    return component


def _check_renamed(rename: Mapping[str, str], original: Interface, candidate: Interface) -> None:
    """InputError where the candidate's variables get names that the original does not have."""
    for new, name in rename.items():
        for called in candidate.elements(new):
            entry = f"rename: {new!r} = {name!r}"
            known(
                f"{entry}: the original has no variable",
                called,
                original.by_name,
                see=original.listing,
            )
