"""Checks of a system before it is run: every input has one source, every port exists."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

from ..base.checks import known, number
from ..base.errors import InputError, choices
from ..base.text import counted
from ..interface.interface import SUPPORTED, Interface, Variable, limits
from ..interface.obstacles import KINDS
from ..interface.units import conversion
from .arrays import as_written, unsourced
from .parts import NANOSECONDS, Connection, Port, seconds
from .stimuli_checks import check_stimuli, driven, stimuli_remarks
from .structure import Structure

FEW = 10
"""Steps; a run of fewer is remarked on."""


class _End(NamedTuple):
    port: Port
    interface: Interface
    variable: Variable


def check_components(system: Structure) -> None:
    """InputError where an FMU that a process can have once is in it twice."""
    first: dict[Path, str] = {}
    for component in system.components:
        interface = component.interface
        once = interface.capability("canBeInstantiatedOnlyOncePerProcess") is True
        if once and component.isolation == "none":
            other = first.setdefault(interface.path, component.name)
            if other != component.name:
                raise InputError(
                    f"{system.name}: {component.name} and {other} are both {interface.path.name}, "
                    'of which a process can have one only; must have isolation = "process" but '
                    "for one"
                )


def check_solvers(system: Structure) -> None:
    """InputError where a component cannot be integrated as it says."""
    for component in system.components:
        fmu = component.loaded
        if component.solver and fmu.exchange is None:
            raise InputError(
                f"{system.name}: {component.name}: solver: {fmu.path.name} is for "
                f"{choices(KINDS[k] for k in fmu.kinds)} alone; must be left out"
            )


def check_connections(system: Structure) -> None:
    """InputError at the first connection or input that is not as it must be."""
    sources: dict[Port, Port] = {}
    for connection in system.connections:
        place, source, target = _Place(system, connection), connection.source, connection.target
        connection_transform(system, connection)
        valued = target.variable in system.component(target.component, "").values
        if valued or target in sources:
            two = "the connection and a value" if valued else f"{sources[target]} and {source}"
            raise InputError(f"{place}: {target} has two sources, {two}; must have one")
        sources[target] = source
    others = driven(system)
    missing = [
        port
        for component in system.components
        for v in component.interface.of("input")
        if v.supported and not v.element and v.name not in component.values
        if (port := Port(component.name, v.name)) not in sources and port not in others
    ]
    if missing:
        check_stimuli(system, whole=True)
        outputs = [
            Port(c.name, v.name) for c in system.components for v in c.interface.of("output")
        ]
        plural = len(missing) > 1
        raise InputError(
            f"{system.name}: input{'s' * plural} {choices(missing)} {'have' if plural else 'has'} "
            f"no source; connect one of {choices(outputs)} to {'each' if plural else 'it'}, or "
            f"give it a value in the system file, or --set {missing[0]}=VALUE where another FMU "
            "brings it; or drive it with --input"
        )


def connection_transform(system: Structure, connection: Connection) -> tuple[float, float]:
    """Factor and offset of a connection, (1.0, 0.0) for the identity.

    What the connection declares, or else the conversion between the units of its ends. InputError
    where an end does not exist, and where values cannot be passed from one end to the other.
    """
    place = _Place(system, connection)
    source, target = _ends(system, connection)
    _check_types(place, source, target)
    if connection.factor is not None or connection.offset is not None:
        return _declared(place, connection, target.variable)
    given, taken = source.variable.unit, target.variable.unit
    if given is None or taken is None or given == taken:
        return 1.0, 0.0
    units = source.interface.unit(source.variable), target.interface.unit(target.variable)
    found = conversion(units[0], units[1]) if units[0] and units[1] else None
    if None in units:
        why = "which their FMUs do not define in SI units;"
    elif found is None:
        why = "which cannot be converted; must be the same quantity, or"
    elif found.offset and source.variable.relative != target.variable.relative:
        why = "and only one of them is a difference (relativeQuantity); must be both, or"
    else:
        return found.factor, 0.0 if target.variable.relative else found.offset
    raise InputError(
        f"{place}: {source.port} is in {given} and {target.port} in {taken}, {why} "
        f'{{ from = "{source.port}", to = "{target.port}", factor = ... }} '
        f"gives the factor from {given} to {taken}, and a component's units correct a wrong one"
    )


def transforms(system: Structure) -> dict[Port, tuple[float, float]]:
    """Factor and offset of every connection, by its target: see connection_transform()."""
    return {
        connection.target: connection_transform(system, connection)
        for connection in system.connections
    }


def remarks(system: Structure) -> tuple[str, ...]:
    """Return remarks on a system that is valid, a line each.

    Units other than the declared ones, values that lose digits, units that cannot be compared,
    variables that are left alone.
    """
    lines = [
        f"{component.name}: {component.fmu.name} runs by model exchange, integrated by CVode with "
        f"a relative tolerance of {chosen.relative_tolerance:g}"
        for component in system.components
        if (chosen := component.integrated)
    ]
    lines += [
        f"{component.name}: several variables of {component.fmu.name} are called {choices(names)}: "
        "they are left alone"
        for component in system.components
        if (names := component.interface.ambiguous)
    ]
    for component in system.components:
        declared = component.declared
        lines += [
            f"{Port(component.name, name)} is declared in {v.unit}, but named in {unit}: taken to "
            "be in that"
            for name, unit in component.units.items()
            if (v := declared.sample(name)) and v.unit not in (None, unit)
        ]
    lines += _of_connections(system)
    for component in system.components:
        for variable in component.interface.of("input", "output"):
            if not variable.supported:
                port = Port(component.name, variable.name)
                left = "keeps its start value" if variable.causality == "input" else "not recorded"
                lines.append(f"{port} is of type {variable.nature}: {left}")
        lines += unsourced(system, component)
    lines += stimuli_remarks(system)
    steps = system.total_steps
    if system.connections and steps < FEW:
        lines.append(
            f"{system.name}: the whole run is {counted(steps, 'step')} of "
            f"{system.step_ns / NANOSECONDS:g} s, and values are passed on only between steps; "
            "take a shorter --step"
        )
    if not system.recorded:
        lines.append(
            f"{system.name}: nothing is recorded; must have an output that is a Real, Integer, "
            "Boolean or String"
        )
    return tuple(lines)


def _of_connections(system: Structure) -> Iterator[str]:
    """Remarks on connections that round values, or that lack a unit at one end."""
    for named, connection in {c.whole or c: c for c in system.connections}.items():
        source, target = (end.variable for end in _ends(system, connection))
        if target.type == "Float32" and source.type in ("Real", "Float64"):
            yield f"{named}: from {source.type} to Float32, rounded to 7 digits"
        if target.kind == "Real" and connection.factor is None and connection.offset is None:
            ends = ((named.source, source), (named.target, target))
            missing = [port for port, variable in ends if variable.unit is None]
            if len(missing) == 1:
                unit = source.unit or target.unit
                yield f"{named}: {missing[0]} has no unit, taken to be in {unit}"


class _Place:
    """Where a connection is, as text once it is needed: a system may have thousands."""

    def __init__(self, system: Structure, connection: Connection) -> None:
        self._system, self._connection = system, connection

    def __str__(self) -> str:
        written = as_written(self._system)
        number = written.index(self._connection.whole or self._connection)
        return f"{self._system.name}: connections[{number}] '{self._connection}'"


def _ends(system: Structure, connection: Connection) -> tuple[_End, _End]:
    """Source and target of a connection; InputError where one does not exist."""

    def end(port: Port, causality: str) -> _End:
        interface = system.component(port.component, _Place(system, connection)).interface
        found = interface.by_name.get(port.variable)
        if found is None or found.causality != causality:
            valid = [v.name for v in interface.of(causality)]
            said = f"{_Place(system, connection)}: {port.component} has no {causality}"
            known(said, port.variable, valid, see=interface.listing)
            raise AssertionError(port)  # pragma: no cover
        return _End(port, interface, found)

    return end(connection.source, "output"), end(connection.target, "input")


def _check_types(place: _Place, source: _End, target: _End) -> None:
    """InputError where the target's type does not hold what the source puts out."""
    for port, _, variable in (source, target):
        if not variable.supported:
            raise InputError(
                f"{place}: {port} is of type {variable.nature}, which is not supported; "
                f"must be {choices(SUPPORTED)}"
            )
    given, taken = source.variable, target.variable

    def types() -> str:
        return f"{place}: {source.port} is {given.type} and {target.port} is {taken.type}"

    (least, most), (low, high) = (
        limits(end.variable.type, end.interface.version) for end in (source, target)
    )
    if (given.kind, taken.kind) == ("Integer", "Real"):
        if taken.type == "Float32" and not -(2**24) <= least <= most <= 2**24:
            raise InputError(f"{types()}, which does not hold all its values; must be Float64")
    elif given.kind != taken.kind:
        raise InputError(
            f"{types()}; must be both Real, both Integer, both Boolean or both String, "
            "or from Integer to Real"
        )
    elif given.kind == "Integer" and not low <= least <= most <= high:
        raise InputError(
            f"{types()}, which does not hold all its values; must be a type that holds "
            f"{least} to {most}"
        )


def _declared(place: _Place, connection: Connection, target: Variable) -> tuple[float, float]:
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
    until = f"stop = {seconds(stop)}{f' from start = {seconds(start)}' if start else ''}"
    if stop <= start:
        raise InputError(f"start = {seconds(start)}: must be before stop = {seconds(stop)}")

    def nearest(time: int) -> int:
        return max(1, round(time / step)) * step

    if (stop - start) % step:
        raise InputError(
            f"step = {seconds(step)} does not divide {until}; "
            f"stop could be {seconds(start + nearest(stop - start))}"
        )
    for component in system.components:
        own = step if component.step_ns is None else component.step_ns
        place = f"{system.name}: {component.name}: step = {seconds(own)}"
        if own % step:
            raise InputError(
                f"{place} is not a whole multiple of the base step {seconds(step)}; "
                f"could be {seconds(nearest(own))}"
            )
        if (stop - start) % own:
            raise InputError(f"{place} does not divide {until}; must end with a whole step")
