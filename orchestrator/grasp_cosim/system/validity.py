"""Checks of a system before it is run: every input has one source, every port exists.

A connection between whole arrays becomes one for each element. Stimuli drive inputs without another
source, with values that these take.
"""

from __future__ import annotations

import math
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from ..base.checks import exact, known, number
from ..base.errors import InputError, choices, nearest
from ..base.si_units import known_unit
from ..base.text import counted
from ..interface.expansion import shape_text
from ..interface.fmi_types import SUPPORTED_KINDS, Value, limits
from ..interface.interface import Interface
from ..interface.obstacles import FMU_KINDS
from ..interface.units import IDENTITY, Conversion, conversion, no_conversion
from ..interface.values import parse_value
from ..interface.variables import Clock, Variable
from .declared_steps import of_declared_steps
from .parts import Component, Connection, Port, Solver
from .stimuli import Stimuli, Stimulus
from .structure import Structure, unit_of
from .times import NANOSECONDS, seconds, written

MAX_NAMED = 6
"""Variables that a message names at most."""

LARGEST_COUNT = 2**62
"""Ticks that the times of stimuli may be away from 0, so that their distances fit into 64 bits."""


def as_written(system: Structure) -> tuple[Connection, ...]:
    """The connections as they were given: of whole arrays one."""
    return tuple(dict.fromkeys(c.of_arrays or c for c in system.connections))


def by_element(
    name: str, components: Sequence[Component], connections: Sequence[Connection]
) -> tuple[Connection, ...]:
    """The connections, between whole arrays one for each element; InputError for other shapes."""
    arrays = {c.name: c.interface.arrays for c in components}
    by_elements: list[Connection] = []
    for connection in connections:
        ends = (connection.source, connection.target)
        source, target = (arrays.get(p.component, {}).get(p.variable) for p in ends)
        if source is None and target is None:
            by_elements.append(connection)
            continue
        if source is None or target is None or source.shape != target.shape:
            has = [shape_text(array.shape) if array else "no array" for array in (source, target)]
            raise InputError(
                f"{name}: connection '{connection}': {ends[0]} is {has[0]} and {ends[1]} is "
                f"{has[1]}; must have equal shapes, or be of elements, like u[1]"
            )
        for start, end in zip(source.names, target.names, strict=True):
            first, last = Port(ends[0].component, start), Port(ends[1].component, end)
            by_elements.append(replace(connection, source=first, target=last, of_arrays=connection))
    return tuple(by_elements)


def _end_of_connection(
    system: Structure, port: Port, causality: str, place: str
) -> tuple[Interface, Variable]:
    """The interface and the variable at an end of a connection; InputError where there is none."""
    interface = system.component(port.component, place).interface
    valid = {v.name: v for v in interface.of(causality)}
    message = f"{place}: {port.component} has no {causality}"
    known(message, port.variable, valid, see=interface.listing)
    return interface, valid[port.variable]


def check_components(system: Structure) -> None:
    """InputError where a process cannot have an FMU twice, or a solver has no use."""
    first_by_fmu: dict[Path, str] = {}
    traced: dict[Path, str] = {}
    for component in system.components:
        interface, fmu, name = component.interface, component.loaded, component.name
        if component.code and (component.isolation != "none" or component.rename):
            raise InputError(
                f"{system.name}: {name}: is Python code of this process; must be without isolation "
                "and rename"
            )
        if component.trace:
            _check_trace(f"{system.name}: {name}: trace", component, component.trace, traced)
        once = interface.capability("canBeInstantiatedOnlyOncePerProcess") is True
        if once and component.isolation == "none":
            earlier = first_by_fmu.setdefault(interface.path, name)
            if earlier != name:
                raise InputError(
                    f"{system.name}: {name} and {earlier} are both {interface.path.name}, which a "
                    'process can have once; must have isolation = "process" but for one'
                )
        if component.solver and fmu.exchange is None:
            _check_own_solver(f"{system.name}: {name}: solver", fmu, component.solver)
        if not isinstance(component.logging, bool):
            _check_categories(f"{system.name}: {name}: logging", fmu, component.logging)


def _check_trace(place: str, component: Component, path: Path, traced: dict[Path, str]) -> None:
    """InputError where a component has no calls to trace, or another one is traced to its file."""
    if component.code:
        raise InputError(f"{place}: is Python code, without calls of FMI; must be left out")
    first = traced.setdefault(path, component.name)
    if first != component.name:
        raise InputError(f"{place}: {path} is that of {first}; must be another file")


def _check_own_solver(place: str, fmu: Interface, solver: Solver) -> None:
    """InputError where the solver of a co-simulation FMU would need what it is not told."""
    for entry in ("absolute_tolerance", "maximum_step"):
        if getattr(solver, entry) is not None:
            kinds = choices(FMU_KINDS[kind] for kind in fmu.kinds)
            raise InputError(
                f"{place}: {entry}: {fmu.path.name} is for {kinds} "
                "only, with its own solver, which gets relative_tolerance; must be left out"
            )


def _check_categories(place: str, fmu: Interface, categories: Sequence[str]) -> None:
    """InputError at the first category of messages that an FMU does not declare."""
    if not fmu.log_categories:
        raise InputError(f"{place}: {fmu.path.name} declares no categories; must be true or false")
    for category in categories:
        known(f"{place}: {fmu.path.name} has no category", category, fmu.log_categories)


def check_connections(system: Structure) -> None:
    """InputError at the first connection or input that is not as it must be."""
    sources: dict[Port, Port] = {}
    for connection in system.connections:
        source, target = connection.source, connection.target
        connection_transform(system, connection)
        valued = target.variable in system.component(target.component, "").values
        if valued or target in sources:
            two = "the connection and a value" if valued else f"{sources[target]} and {source}"
            raise InputError(
                f"{system.name}: connection '{connection}': {target} has two sources, {two}; must "
                "have one"
            )
        sources[target] = source
    fed = _fed_inputs(system)
    missing = [
        Port(c.name, v.name)
        for c in system.components
        for v in c.interface.of("input")
        if v.supported and not v.element and v.name not in c.values and v.name not in fed[c.name]
    ]
    if missing:
        check_stimuli(system, all_columns=True)
        outputs = [
            Port(c.name, v.name) for c in system.components for v in c.interface.of("output")
        ]
        raise InputError(
            f"{system.name}: no source for {choices(missing, MAX_NAMED)}; must have a connection "
            f"from one of {choices(outputs, MAX_NAMED)}, or a value in the system file, "
            f"or --set {missing[0]}=VALUE if another FMU has it; or drive it with --input"
        )


def check_arrays(system: Structure) -> None:
    """InputError where a part of an array is given, and the rest has no start for its size."""
    fed, stimuli = _fed_inputs(system), driven(system)
    for c in system.components:
        valued = {*c.values, *(p.variable for p in stimuli if p.component == c.name)}
        for name, elements in c.interface.arrays.items():
            if name in c.interface.main_names:
                continue
            silent = [n for n in elements.names if c.interface.by_name[n].start is None]
            missing = [n for n in silent if n not in valued and n not in fed[c.name]]
            if missing and not valued.isdisjoint(elements.names):
                raise InputError(
                    f"{system.name}: {c.name}.{name}: no value for {choices(missing, 6)}, "
                    "and no start value for this size; must be given, too"
                )


def _fed_inputs(system: Structure) -> Mapping[str, set[str]]:
    """The inputs that have a connection, or that stimuli drive, by component."""
    inputs: dict[str, set[str]] = {c.name: set() for c in system.components}
    for port in (*(connection.target for connection in system.connections), *driven(system)):
        inputs[port.component].add(port.variable)
    return inputs


def connection_transform(system: Structure, connection: Connection) -> tuple[float, float]:
    """Factor and offset of a connection, (1.0, 0.0) for the identity.

    What the connection declares, or else the conversion between the units of its ends. InputError
    where an end does not exist, and where values cannot be passed from one end to the other.
    """
    place = f"{system.name}: connection '{connection}'"
    source_fmu, source = _end_of_connection(system, connection.source, "output", place)
    target_fmu, target = _end_of_connection(system, connection.target, "input", place)
    ranges = limits(source.type, source_fmu.version), limits(target.type, target_fmu.version)
    _check_types(place, connection, (source, target), ranges)
    if connection.factor is not None or connection.offset is not None:
        return _declared_transform(place, connection, target)
    source_unit, target_unit = source.unit, target.unit
    if source_unit is None or target_unit is None or source_unit == target_unit:
        return 1.0, 0.0
    start, end = source_fmu.unit(source), target_fmu.unit(target)
    change = conversion(start, end) if start and end else None
    if change and (source.relative == target.relative or not change.offset):
        return change.factor, 0.0 if target.relative else change.offset
    why = "which cannot be converted" if change is None else "and only one of them is a difference"
    if not (start and end):
        why = "which their FMUs do not define in SI units"
    raise InputError(
        f"{place}: {connection.source} is in {source_unit} and {connection.target} in "
        f"{target_unit}, {why}; "
        f'{{ from = "{connection.source}", to = "{connection.target}", factor = ... }} '
        f"gives the factor from {source_unit} to {target_unit}, and a component's units correct a "
        "wrong one"
    )


def transforms(system: Structure) -> dict[Port, tuple[float, float]]:
    """Factor and offset of every connection, by its target: see connection_transform()."""
    return {c.target: connection_transform(system, c) for c in system.connections}


def _check_types(
    place: str,
    connection: Connection,
    ends: tuple[Variable, Variable],
    ranges: tuple[tuple[float, float], tuple[float, float]],
) -> None:
    """InputError where the target's type does not hold what the source puts out."""
    for port, v in zip((connection.source, connection.target), ends, strict=True):
        if not v.supported:
            raise InputError(
                f"{place}: {port} is of type {v.nature}, which is not supported; must be "
                f"{choices(SUPPORTED_KINDS)}"
            )
    (source, target), ((least, most), (low, high)) = ends, ranges
    fits, must = True, ""
    if (source.kind, target.kind) == ("Integer", "Real"):
        fits = target.type != "Float32" or -(2**24) <= least <= most <= 2**24
        must = "Float64, which holds all its values"
    elif source.kind != target.kind:
        fits, must = False, "both Real, Integer, Boolean or String, or from Integer to Real"
    elif source.kind == "Integer":
        fits, must = low <= least <= most <= high, f"a type that holds {least} to {most}"
    if not fits:
        raise InputError(
            f"{place}: {connection.source} is {source.type} and {connection.target} is "
            f"{target.type}; must be {must}"
        )


def _declared_transform(
    place: str, connection: Connection, target: Variable
) -> tuple[float, float]:
    factor = 1.0 if connection.factor is None else float(connection.factor)
    offset = 0.0 if connection.offset is None else float(connection.offset)
    if not factor or not math.isfinite(factor):
        raise InputError(f"{place}: factor = {factor!r}: must be a finite number other than 0")
    number(f"{place}: offset", offset)
    if target.kind != "Real" and (factor, offset) != (1.0, 0.0):
        raise InputError(
            f"{place}: factor = {factor!r}, offset = {offset!r}: {connection.target} is "
            f"{target.type}; must be Real to be scaled"
        )
    return factor, offset


def check_steps(system: Structure) -> None:
    """InputError where a step does not divide what it must."""
    step, start, stop = system.step_ns, system.start_ns, system.stop_ns
    until = f"stop = {written(stop)} s{f' from start = {written(start)} s' if start else ''}"
    if stop <= start:
        raise InputError(f"start = {written(start)} s: must be before stop = {written(stop)} s")
    if (stop - start) % step:
        near = max(1, round((stop - start) / step)) * step
        raise InputError(
            f"step = {written(step)} s does not divide {until}; "
            f"stop could be {written(start + near)} s"
        )
    _check_exact(system)
    for component in system.components:
        component_step = step if component.step_ns is None else component.step_ns
        place = f"{system.name}: {component.name}: step = {written(component_step)} s"
        if component_step % step:
            raise InputError(
                f"{place} is not a whole multiple of the base step {written(step)} s; "
                f"could be {written(max(1, round(component_step / step)) * step)} s"
            )
        if (stop - start) % component_step:
            raise InputError(f"{place} does not divide {until}; must end with a whole step")


def _check_exact(system: Structure) -> None:
    """InputError where times that are no whole numbers of ns are too long to be exact."""
    grid = system.time_grid
    last = system.input.times[-1] if system.input else 0
    furthest = max(-system.start_ns, system.stop_ns, last)
    if furthest > grid.last * NANOSECONDS:
        raise InputError(
            f"step = {written(system.step_ns)} s from start = {written(system.start_ns)} s: times "
            f"are exact until {grid.last:.4g} s; all must be before that, or whole numbers of ns"
        )


def remarks(system: Structure) -> tuple[str, ...]:
    """Remarks on a system that is valid, a line each."""
    return (
        *_remarks_on_connections(system),
        *_remarks_on_components(system),
        *of_declared_steps(system),
    )


def _remarks_on_components(system: Structure) -> Iterator[str]:
    fed = _fed_inputs(system)
    of_locals: Counter[str] = Counter()
    if not system.record.takes_in:
        of_locals.update(p.component for p, v in system.recorded.items() if v.causality == "local")
    for c in system.components:
        if solver := c.integrated:
            yield (
                f"{c.name}: {c.fmu.name} runs by model exchange, integrated by CVode with a "
                f"relative tolerance of {solver.relative_tolerance:g}"
            )
        if names := c.interface.ambiguous:
            yield (
                f"{c.name}: several variables of {c.fmu.name} are called {choices(names)}: they "
                "are left out"
            )
        for v in c.interface.of("input", "output"):
            if v.clock and v.causality == "input":
                ticks = _ticks_in_words(v.clock)
                yield f"{Port(c.name, v.name)} is a clock that ticks by time: {ticks}"
            elif not v.supported:
                outcome = "keeps its start value" if v.causality == "input" else "not recorded"
                yield f"{Port(c.name, v.name)} is of type {v.nature}: {outcome}"
        if of_locals[c.name]:
            stand_in = counted(of_locals[c.name], "local")
            yield f"{c.name}: {c.fmu.name} has no output: recorded by default: {stand_in}"
        free: list[str] = []
        for name, elements in c.interface.arrays.items():
            without = [n for n in elements.names if n not in fed[c.name] and n not in c.values]
            if name in c.interface.main_names:
                continue
            if without and c.interface.by_name[without[0]].causality == "input":
                is_whole = len(without) == len(elements.names)
                free += [name] if is_whole else without
        if free:
            yield f"{c.name}: no source for {choices(free, MAX_NAMED)}: kept as the FMU starts with"
    if system.record.trigger:
        yield (
            "record.trigger: the metrics of the run are of every step, those of a window are of "
            "its rows"
        )
    if not system.recorded:
        yield (
            f"{system.name}: nothing is recorded; must have an output or a local that is a Real, "
            "Integer, Boolean or String, or name another such signal under [record]"
        )


def _ticks_in_words(clock: Clock) -> str:
    """When a clock ticks, in words."""
    if clock.variability in ("constant", "fixed") and clock.interval is not None:
        shift = f", the first {float(clock.shift):g} s after the start" if clock.shift else ""
        return f"every {float(clock.interval):g} s{shift}"
    return f"when the FMU requests it ({clock.variability})"


def _remarks_on_connections(system: Structure) -> Iterator[str]:
    """Remarks on connections that round values, or lack a unit at one end; and on stimuli."""
    for as_given, connection in {c.of_arrays or c: c for c in system.connections}.items():
        _, source = _end_of_connection(system, connection.source, "output", "")
        _, target = _end_of_connection(system, connection.target, "input", "")
        if target.type == "Float32" and source.type in ("Real", "Float64"):
            yield f"{as_given}: from {source.type} to Float32, rounded to 7 digits"
        if target.kind == "Real" and connection.factor is None and connection.offset is None:
            ends = ((as_given.source, source.unit), (as_given.target, target.unit))
            missing = [port for port, unit in ends if unit is None]
            if len(missing) == 1:
                unit = source.unit or target.unit
                yield f"{as_given}: {missing[0]} has no unit, taken to be in {unit}"
    if system.input:
        ports = ", ".join(_driven_in_words(system, system.input))
        yield f"{system.input.file} drives {ports}, each step by the values at its beginning"
        for port in driven(system):
            unit = system.input.columns[port].unit
            if unit is not None and _variable_of(system, port).unit is None:
                yield f"{system.input.file}: {port} has no unit, taken to be in {unit}"


def driven(system: Structure) -> tuple[Port, ...]:
    """The inputs and tunable parameters that stimuli drive, in the order of their columns."""
    if system.input is None:
        return ()
    ports = system.input.columns
    if not system.input.partial:
        return tuple(ports)
    drivable = {
        (component.name, v.name)
        for component in system.components
        for v in component.interface.of("input", "parameter")
        if is_drivable(v)
    }
    return tuple(p for p in ports if (p.component, p.variable) in drivable)


def driven_inputs(system: Structure) -> tuple[Port, ...]:
    """The inputs among these, which get a value for each step."""
    return tuple(p for p in driven(system) if _variable_of(system, p).causality == "input")


def driven_parameters(system: Structure) -> tuple[Port, ...]:
    """The tunable parameters among these, which are set where their values change."""
    return tuple(p for p in driven(system) if _variable_of(system, p).causality != "input")


def is_drivable(variable: Variable) -> bool:
    """True for an input, and for a parameter that may change in the run."""
    tunable = variable.causality == "parameter" and variable.variability == "tunable"
    return variable.causality == "input" or tunable


def _variable_of(system: Structure, port: Port) -> Variable:
    return system.component(port.component, str(port)).interface.by_name[port.variable]


def check_stimuli(system: Structure, all_columns: bool = False) -> None:
    """InputError at the first column that does not fit an input or a tunable parameter, or has one
    with another source.

    A value is no source: the column goes before it. all_columns says that all of them count, also
    where FMUs may yet be swapped.
    """
    stimuli = system.input
    if stimuli is None:
        return
    sources = {c.target: f"a connection, from {c.source}" for c in system.connections}
    for event in system.events:
        for port in event.set:
            sources |= dict.fromkeys(system.elements(port), "an event")
    longest = LARGEST_COUNT // system.time_grid.per_nanosecond
    if stimuli.times[0] < -longest or stimuli.times[-1] > longest:
        raise InputError(
            f"{stimuli.file}: from {seconds(stimuli.times[0])} to {seconds(stimuli.times[-1])}; "
            f"must be within {seconds(longest)}, in steps of {seconds(system.step_ns)}"
        )
    for port in stimuli.columns if all_columns else driven(system):
        place, column = stimuli.place(port), stimuli.columns[port]
        interface = system.component(port.component, place).interface
        drivable = [
            str(Port(port.component, v.name))
            for v in interface.of("input", "parameter")
            if is_drivable(v)
        ]
        v = interface.by_name.get(port.variable)
        if v is None:
            lacking = f"{place}: no input or tunable parameter"
            known(lacking, str(port), drivable, see=interface.listing)
        elif not is_drivable(v):
            raise InputError(
                f"{place}: is a {v.variability} {v.causality}, which cannot be set in the run; "
                "must be an input or a tunable parameter; "
                f"{nearest(str(port), drivable, interface.listing)}"
            )
        v = interface.by_name[port.variable]
        if not v.is_number or (column.unit is not None and v.kind != "Real"):
            must = "have no unit" if v.is_number else "be a Real, Integer, Boolean or Enumeration"
            raise InputError(f"{place}: is of type {v.nature}; must {must}")
        if port in sources:
            two = f"{stimuli.file} and {sources[port]}"
            raise InputError(f"{place}: {port} has two sources, {two}; must have one")
        numbers = v.kind == "Real" and not column.texts
        for row in column.extremes if numbers else column.distinct:
            value = _value_of_row(stimuli, port, interface, row)
            exact(stimuli.place(port, row), value, column.text(row))


def samples_of(system: Structure, port: Port) -> array[float]:
    """The samples of what is driven, in its unit."""
    assert system.input is not None  # noqa: S101 - it drives
    column = system.input.columns[port]
    interface = system.component(port.component, str(port)).interface
    if column.texts:
        values = [float(_value_of_row(system.input, port, interface, r)) for r in column.distinct]
        return array("d", (values[int(i)] for i in column.samples))
    change = _conversion_of_column(system.input.place(port), interface, port, column)
    same = change == IDENTITY
    return array("d", column.samples if same else (change(x) for x in column.samples))


def _driven_in_words(system: Structure, stimuli: Stimuli) -> Iterator[str]:
    """What stimuli drive, and whether it is interpolated between two rows."""
    ports = driven(system)
    linear_ports = [port for port in ports if is_linear(stimuli, _variable_of(system, port))]
    if linear_ports:
        yield f"{choices(linear_ports, 6)} (linear)"
    held_ports = [port for port in ports if not is_linear(stimuli, _variable_of(system, port))]
    if held_ports:
        yield f"{choices(held_ports, 6)} (held)"


def is_linear(stimuli: Stimuli, variable: Variable) -> bool:
    """True if the values of a variable change between two rows, as no parameter's do."""
    continuous = variable.kind == "Real" and variable.variability == "continuous"
    return stimuli.interpolation == "linear" and continuous


def _value_of_row(stimuli: Stimuli, port: Port, interface: Interface, row: int) -> Value:
    """The sample of a row as a value of its input; InputError where it is none."""
    column = stimuli.columns[port]
    change = _conversion_of_column(stimuli.place(port), interface, port, column)
    value: Value = column.text(row)
    if change != IDENTITY and not column.texts:
        value = change(column.samples[row])
    return parse_value(interface, stimuli.place(port, row), port.variable, value, text=True)


def _conversion_of_column(
    place: str, interface: Interface, port: Port, column: Stimulus
) -> Conversion:
    """The conversion of a column into the unit of its input; InputError where there is none."""
    variable = interface.by_name[port.variable]
    if column.unit is None or variable.unit in (None, column.unit):
        return IDENTITY
    source = interface.units.get(column.unit) or known_unit(column.unit)
    if source and variable.relative:
        source = source.without_offset
    target = unit_of(interface, variable)
    change = conversion(source, target) if source and target else None
    if change is None:
        raise no_conversion(place, column.unit, str(variable.unit))
    return change
