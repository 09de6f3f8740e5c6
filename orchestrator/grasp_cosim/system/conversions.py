"""The units in which the values of a system are: named by a component's `units`, else declared by
its FMU. What has neither is in SI.
"""

from __future__ import annotations

from collections.abc import Iterable

from si_units import Unit

from ..base.errors import InputError
from ..interface.interface import Interface, Variable
from ..interface.units import IDENTITY, Conversion, conversion
from .parts import Port
from .structure import Structure


def output_units(system: Structure) -> dict[Port, Unit | None]:
    """The unit of each Real or Integer output; None where none is told, or it is not defined."""
    return {
        port: unit_of(system.component(port.component, str(port)).interface, v)
        for port, v in system.recorded.items()
        if v.kind in ("Real", "Integer")
    }


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

    InputError where its unit is not defined.
    """
    interface = system.component(port.component, place).interface
    variable = interface.by_name.get(port.variable)
    unit = unit_of(interface, variable) if variable else None
    if unit:
        return Conversion(unit.factor, unit.offset)
    if variable and variable.kind == "Real" and variable.unit:
        raise InputError(
            f"{place}: {port} is in {variable.unit!r}: cannot be told in SI units; must be named: "
            f"{naming(port.component, [port.variable])}"
        )
    return IDENTITY


def naming(component: str, variables: Iterable[str]) -> str:
    """The entry of a system file in which the units of variables are to be named."""
    entries = ", ".join(f'"{name}" = "..."' for name in variables)
    return f"[components.{component}] units = {{ {entries} }}"
