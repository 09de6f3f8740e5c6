"""The units in which the values of a system are meant, as far as it tells them, and doubts of them.

A variable is in the unit that the `units` of its component name, or else in the one that its FMU
declares. An output without one is in the unit of the inputs that take its values as they are.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from math import isclose
from typing import NamedTuple

from si_units import Unit

from ..base.errors import InputError, choices
from ..interface.interface import SETTABLE, Interface, Variable
from ..interface.units import IDENTITY, Conversion, between_units, conversion
from .parts import Connection, Port
from .structure import Structure


class Reading(NamedTuple):
    """The unit of an output, None where nothing tells it; doubt is why it may be another one.

    contested says that what takes its values has a unit: then it is in doubt for everyone, and not
    only for those who expect one.
    """

    unit: Unit | None
    doubt: str = ""
    contested: bool = False

    @property
    def conversion(self) -> Conversion | None:
        """The conversion to SI base units; None where it is in these, or not known."""
        unit = self.unit
        return None if unit is None or unit.si else Conversion(unit.factor, unit.offset)


def readings(system: Structure) -> dict[Port, Reading]:
    """The reading of each Real or Integer output."""
    interfaces = {c.name: c.interface for c in system.components}
    taken: dict[Port, list[_Taken]] = {}
    for connection in system.connections:
        interface = interfaces[connection.target.component]
        unit = unit_of(interface, interface.by_name[connection.target.variable])
        taken.setdefault(connection.source, []).append(_Taken(connection, unit))
    return {
        port: _reading(interfaces[c.name], v, c.names_unit(v), taken.get(port, ()))
        for c in system.components
        for v in interfaces[c.name].of("output")
        if v.supported and v.kind in ("Real", "Integer") and (port := Port(c.name, v.name))
    }


def in_other_units(system: Structure) -> dict[Port, Unit]:
    """The units other than of SI that are told for variables of any kind.

    An input without a unit has that of the output which it takes, times the factor of its
    connection where that is one between units. It has no exponents where the output has no unit.
    """
    told: dict[Port, Unit | None] = {port: r.unit for port, r in system.once(readings).items()}
    for component in system.components:
        interface = component.interface
        for v in interface.of(*SETTABLE):
            told[Port(component.name, v.name)] = unit_of(interface, v)
    for connection in system.connections:
        if told[connection.target] is None:
            told[connection.target] = _Taken(connection, told.get(connection.source)).passed
    return {port: unit for port, unit in told.items() if unit and not unit.si}


def unit_of(interface: Interface, variable: Variable) -> Unit | None:
    """The unit that a variable has, without its offset where that is a difference."""
    unit = interface.unit(variable)
    return unit.without_offset if unit and variable.relative else unit


def between(system: Structure, place: str, source: Port, target: Port) -> Conversion:
    """The conversion of a number for one variable into that for another, in the units they have.

    Without a unit, it is taken as the other one. InputError where there is no way.
    """
    ends = [system.component(p.component, place).interface for p in (source, target)]
    start, end = (i.by_name[p.variable] for i, p in zip(ends, (source, target), strict=True))
    units = unit_of(ends[0], start), unit_of(ends[1], end)
    if start.unit is None or end.unit is None or (start.unit == end.unit and None in units):
        return IDENTITY
    found = conversion(units[0], units[1]) if units[0] and units[1] else None
    if found is None:
        raise InputError(
            f"{place}: {source} is in {start.unit} and {target} in {end.unit}, which cannot be "
            "converted; must be of one quantity"
        )
    return found


def parameter_in_si(system: Structure, place: str, port: Port) -> Conversion:
    """The conversion of a parameter to SI base units, the identity without a unit.

    InputError where its unit is not defined, or where it has none while its component has others
    that are not of SI.
    """
    interface = system.component(port.component, place).interface
    variable = interface.by_name.get(port.variable)
    unit = unit_of(interface, variable) if variable else None
    if unit:
        return Conversion(unit.factor, unit.offset)
    if variable and variable.kind == "Real":
        units = {v.unit: unit_of(interface, v) for v in interface.of(*SETTABLE, "output")}
        other = next((name for name, u in units.items() if u and not u.si), None)
        if variable.unit or other:
            reason = f"is in {variable.unit!r}" if variable.unit else f"has no unit, others {other}"
            raise InputError(
                f"{place}: {port} {reason}: cannot be told in SI units; must be named: "
                f"{naming(port.component, [port.variable])}"
            )
    return IDENTITY


def naming(component: str, variables: Iterable[str]) -> str:
    """The entry of a system file in which the units of variables are to be named."""
    entries = ", ".join(f'"{name}" = "..."' for name in variables)
    return f"[components.{component}] units = {{ {entries} }}"


class _Taken(NamedTuple):
    """A connection from an output, and the unit of the one or the other of its ends."""

    connection: Connection
    unit: Unit | None

    @property
    def factor(self) -> float:
        return 1.0 if self.connection.factor is None else float(self.connection.factor)

    @property
    def scales(self) -> bool:
        """True if it makes another number of a value, beyond its sign."""
        return abs(self.factor) != 1.0 or bool(self.connection.offset)

    @property
    def passed(self) -> Unit | None:
        """The unit of the input, if the connection's factor is one between units or there is none.

        unit is that of the output.
        """
        if not self.scales:
            return self.unit
        factor = abs(self.factor)
        if not between_units(factor):
            return None
        if self.unit is None:
            return Unit(f"another unit, by factor = {self.factor:g}", (), 1.0 / factor)
        scale = self.unit.factor / factor
        return Unit(
            f"{1.0 / factor:g} {self.unit.name}",
            self.unit.exponents,
            1.0 if isclose(scale, 1.0, rel_tol=1e-9) else scale,
        )


def _reading(
    interface: Interface, variable: Variable, named: bool, taken: Sequence[_Taken]
) -> Reading:
    unit = unit_of(interface, variable)
    if variable.unit is None:
        return _by_its_inputs(taken)
    if unit is None:
        return Reading(None, f"is in {variable.unit!r}, which its FMU does not define in SI units")
    return Reading(unit, "" if named else _contradiction(unit, taken))


def _contradiction(unit: Unit, taken: Iterable[_Taken]) -> str:
    """Why a declared unit may be wrong: a factor that only other units of its quantity explain."""
    for t in taken:
        given = (t.connection.factor, t.connection.offset) != (None, None)
        expected = conversion(unit, t.unit) if given and t.unit else None
        if expected and between_units(abs(t.factor / expected.factor)):
            return (
                f"is declared in {unit.name}, but its connection to {t.connection.target} has "
                f"factor = {t.factor:g} where the units give {expected.factor:g}"
            )
    return ""


def _by_its_inputs(taken: Sequence[_Taken]) -> Reading:
    """The reading of an output without a unit."""
    for t in taken:
        if t.scales:
            return Reading(
                None,
                f"has no unit, and its connection to {t.connection.target} has "
                f"factor = {t.factor:g}, offset = {t.connection.offset or 0.0:g}",
                t.unit is not None,
            )
    told = {(t.unit.exponents, t.unit.factor, t.unit.offset): t for t in taken if t.unit}
    if len(told) > 1:
        ends = choices(f"{t.connection.target} in {t.unit.name}" for t in told.values() if t.unit)
        return Reading(None, f"has no unit, and goes to {ends}", True)
    return Reading(next((t.unit for t in told.values()), None))
