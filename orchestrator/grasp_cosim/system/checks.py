"""What must hold of a system before it is run: every input has one source, every port exists."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

from ..errors import InputError, choices
from ..interface.interface import SUPPORTED, Value, Variable, limits
from ..interface.units import conversion
from .parts import LOOPS, NANOSECONDS, Component, Connection, Port
from .structure import Structure


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


def check_items(was: Component, now: Component, variables: Sequence[str], place: str) -> None:
    """InputError where a value that a component keeps stands for another item in its new FMU."""
    before, after = was.interface.by_name, now.interface.by_name
    for name in variables:
        items = [v[name].items if name in v else {} for v in (before, after)]
        label, meant = (_label(known, now.values[name]) for known in items)
        if all(items) and label != meant:
            raise InputError(
                f"{place}: {name} = {now.values[name]!r} is {label} in {was.fmu.name} and "
                f"{meant or 'nothing'} in {now.fmu.name}; must be set anew, as one of "
                f"{choices(items[1])}"
            )


def _label(items: Mapping[str, int], value: Value) -> str | None:
    return next((name for name, number in items.items() if number == value), None)


def check_connections(system: Structure) -> None:
    """InputError at the first connection or input that is not as it must be."""
    sources: dict[Port, Connection] = {}
    for connection in system.connections:
        place = _place(system, connection)
        connection_transform(system, connection)
        if (
            connection.target.variable
            in system.component(connection.target.component, place).values
        ):
            raise InputError(
                f"{place}: {connection.target} has two sources, the connection and a value; "
                "must have one"
            )
        if connection.target in sources:
            raise InputError(
                f"{place}: {connection.target} has two sources, "
                f"{sources[connection.target].source} and {connection.source}; must have one"
            )
        sources[connection.target] = connection
    outputs = [
        str(Port(c.name, v.name)) for c in system.components for v in c.interface.of("output")
    ]
    missing = [
        Port(component.name, variable.name)
        for component in system.components
        for variable in component.interface.of("input")
        if variable.supported and variable.name not in component.values
    ]
    if missing := [port for port in missing if port not in sources]:
        plural = len(missing) > 1
        raise InputError(
            f"{system.name}: input{'s' * plural} {choices(missing)} {'have' if plural else 'has'} "
            f"no source; connect one of {choices(outputs)} to {'each' if plural else 'it'}, or "
            f"give it a value: --set {missing[0]}=VALUE, or in the system file"
        )


def connection_transform(system: Structure, connection: Connection) -> tuple[float, float]:
    """Factor and offset of a connection, (1.0, 0.0) for the identity.

    What the connection declares, or else the conversion between the units of its ends. InputError
    where an end does not exist, and where values cannot be passed from one end to the other.
    """
    place = _place(system, connection)
    source, target = (_end(system, connection, causality) for causality in ("output", "input"))
    _check_types(system, connection, source, target)
    if connection.factor is not None or connection.offset is not None:
        return _declared(place, connection, target)
    if source.unit is None or target.unit is None or source.unit == target.unit:
        return 1.0, 0.0
    units = [
        system.component(port.component, place).interface.units.get(v.unit or "")
        for port, v in ((connection.source, source), (connection.target, target))
    ]
    ends = (
        f"{place}: {connection.source} is in {source.unit} and {connection.target} in {target.unit}"
    )
    advice = (
        f'{{ from = "{connection.source}", to = "{connection.target}", factor = ... }} '
        f"gives the factor from {source.unit} to {target.unit}"
    )
    if units[0] is None or units[1] is None:
        raise InputError(f"{ends}, which their FMUs do not define in SI units; {advice}")
    found = conversion(units[0], units[1])
    if found is None:
        raise InputError(
            f"{ends}, which cannot be converted; must be the same quantity, or {advice}"
        )
    factor, offset = found
    if offset and source.relative != target.relative:
        raise InputError(
            f"{ends}, and only one of them is a difference (relativeQuantity); must be both, or "
            f"{advice}"
        )
    return factor, 0.0 if target.relative else offset


def transforms(system: Structure) -> dict[Port, tuple[float, float]]:
    """Factor and offset of every connection, by its target: see connection_transform()."""
    return {
        connection.target: connection_transform(system, connection)
        for connection in system.connections
    }


def remarks(system: Structure) -> tuple[str, ...]:
    """What a user should know of a system that is valid, a line each.

    Values that lose digits, units that cannot be compared, variables that are left alone.
    """
    lines = []
    for connection in system.connections:
        source, target = (_end(system, connection, causality) for causality in ("output", "input"))
        arrow = str(connection)
        if target.type == "Float32" and source.type in ("Real", "Float64"):
            lines.append(f"{arrow}: from {source.type} to Float32, rounded to 7 digits")
        if target.kind == "Real" and connection.factor is None and connection.offset is None:
            missing = [
                str(port)
                for port, v in ((connection.source, source), (connection.target, target))
                if v.unit is None
            ]
            if len(missing) == 1:
                unit = source.unit or target.unit
                lines.append(f"{arrow}: {missing[0]} has no unit, taken to be in {unit}")
    for component in system.components:
        for variable in component.interface.of("input", "output"):
            if not variable.supported:
                port = Port(component.name, variable.name)
                left = "keeps its start value" if variable.causality == "input" else "not recorded"
                lines.append(f"{port} is of type {variable.nature}: {left}")
    return tuple(lines)


def _place(system: Structure, connection: Connection) -> str:
    return f"{system.name}: connections[{system.connections.index(connection)}] '{connection}'"


def _end(system: Structure, connection: Connection, causality: str) -> Variable:
    """The variable at the end of a connection that has the causality."""
    place = _place(system, connection)
    port = connection.source if causality == "output" else connection.target
    interface = system.component(port.component, place).interface
    valid = [v.name for v in interface.of(causality)]
    if port.variable not in valid:
        raise InputError(
            f"{place}: {port.component} has no {causality} {port.variable!r}; "
            f"valid: {choices(valid)}"
        )
    return interface.by_name[port.variable]


def _check_types(
    system: Structure, connection: Connection, source: Variable, target: Variable
) -> None:
    """InputError where the target's type does not hold what the source puts out."""
    place = _place(system, connection)
    for port, variable in ((connection.source, source), (connection.target, target)):
        if not variable.supported:
            raise InputError(
                f"{place}: {port} is of type {variable.nature}, which is not supported; "
                f"must be {choices(SUPPORTED)}, no array"
            )
    types = (
        f"{place}: {connection.source} is {source.type} and {connection.target} is {target.type}"
    )
    if (source.kind, target.kind) == ("Integer", "Real"):
        if target.type == "Float32" and not _holds_singles(system, connection, source):
            raise InputError(f"{types}, which does not hold all its values; must be Float64")
    elif source.kind != target.kind:
        raise InputError(
            f"{types}; must be both Real, both Integer, both Boolean or both String, "
            "or from Integer to Real"
        )
    elif source.kind == "Integer":
        low, high = _limits(system, connection.target, target)
        least, most = _limits(system, connection.source, source)
        if not low <= least <= most <= high:
            raise InputError(
                f"{types}, which does not hold all its values; must be a type that holds "
                f"{least} to {most}"
            )


def _limits(system: Structure, port: Port, variable: Variable) -> tuple[float, float]:
    version = system.component(port.component, str(port)).interface.version
    return limits(variable.type, version)


def _holds_singles(system: Structure, connection: Connection, source: Variable) -> bool:
    """Whether a Float32 holds every value of an integer exactly."""
    low, high = _limits(system, connection.source, source)
    return -(2**24) <= low <= high <= 2**24


def _declared(place: str, connection: Connection, target: Variable) -> tuple[float, float]:
    factor = 1.0 if connection.factor is None else float(connection.factor)
    offset = 0.0 if connection.offset is None else float(connection.offset)
    if not factor or not math.isfinite(factor):
        raise InputError(f"{place}: factor = {factor!r}: must be a finite number other than 0")
    if not math.isfinite(offset):
        raise InputError(f"{place}: offset = {offset!r}: must be a finite number")
    if target.kind != "Real" and (factor, offset) != (1.0, 0.0):
        raise InputError(
            f"{place}: factor = {factor!r}, offset = {offset!r}: {connection.target} is "
            f"{target.type}; must be Real to be scaled"
        )
    return factor, offset


def check_steps(system: Structure) -> None:
    """InputError where a step does not divide what it must."""
    step, stop = system.step_ns / NANOSECONDS, system.stop_ns / NANOSECONDS
    if system.stop_ns % system.step_ns:
        count = max(1, round(system.stop_ns / system.step_ns))
        raise InputError(
            f"step = {step:.9g} s does not divide stop = {stop:.9g} s; "
            f"stop could be {count * system.step_ns / NANOSECONDS:.9g} s"
        )
    for component in system.components:
        own = component.step_ns
        if own is not None and own % system.step_ns:
            count = max(1, round(own / system.step_ns))
            raise InputError(
                f"{system.name}: {component.name}: step = {own / NANOSECONDS:.9g} s is no whole "
                f"multiple of the base step {step:.9g} s; "
                f"could be {count * system.step_ns / NANOSECONDS:.9g} s"
            )
        if own is not None and system.stop_ns % own:
            raise InputError(
                f"{system.name}: {component.name}: step = {own / NANOSECONDS:.9g} s does not "
                f"divide stop = {stop:.9g} s; must end with a whole step"
            )


def check_initialisation(system: Structure) -> None:
    """InputError where an option of the initialisation is not as it must be."""
    place, chosen = f"{system.name}: [initialisation]", system.initialisation
    if chosen.loops not in LOOPS:
        raise InputError(f"{place}: loops = {chosen.loops!r}: must be one of {choices(LOOPS)}")
    number = isinstance(chosen.tolerance, float | int) and not isinstance(chosen.tolerance, bool)
    if not number or not 0.0 < chosen.tolerance < 1.0:
        raise InputError(
            f"{place}: tolerance = {chosen.tolerance!r}: must be a number between 0 and 1"
        )
    whole = isinstance(chosen.iterations, int) and not isinstance(chosen.iterations, bool)
    if not whole or chosen.iterations < 1:
        raise InputError(
            f"{place}: iterations = {chosen.iterations!r}: must be a whole number, at least 1"
        )
