"""An interface under other names, and in other units, as a system has it."""

from collections.abc import Mapping
from dataclasses import replace

from ..base.checks import known
from ..base.errors import InputError, choices
from ..base.si_units import Unit, known_unit, spelt_like
from .interface import Interface
from .variables import Array, Variable


def renamed(interface: Interface, rename: Mapping[str, str], place: str = "rename") -> Interface:
    """The same under other names: `rename` maps a new name to that of the FMU.

    `place` says where the table comes from. InputError where a name of the FMU does not exist or is
    renamed twice, or a new one is taken. An array is renamed whole, or by elements; so are scalars
    that are named as its elements.
    """
    if not rename:
        return interface
    key = ("rename", *rename.items())
    return interface.variant(key, lambda: _renamed(interface, rename, place))


def _renamed(interface: Interface, rename: Mapping[str, str], place: str) -> Interface:
    new_names = _new_names(interface, rename, place)
    new_arrays = {name: new for new, name in rename.items() if name in interface.arrays}

    def new_dependencies(names: tuple[str, ...] | None) -> tuple[str, ...] | None:
        return None if names is None else tuple(new_names.get(name, name) for name in names)

    variables: list[Variable] = []
    for variable in interface.variables:
        element = variable.element
        if element and element.array in new_arrays:
            element = replace(element, array=new_arrays[element.array])
        variables.append(
            replace(
                variable,
                name=new_names.get(variable.name, variable.name),
                dependencies=new_dependencies(variable.dependencies),
                initial_dependencies=new_dependencies(variable.initial_dependencies),
                element=element,
            )
        )
    arrays = {
        new_arrays.get(name, name): Array(
            array.shape, tuple(new_names.get(element, element) for element in array.names)
        )
        for name, array in interface.arrays.items()
    }
    return replace(interface, variables=tuple(variables), arrays=arrays)


def _new_names(interface: Interface, rename: Mapping[str, str], place: str) -> dict[str, str]:
    """The new names of variables, of arrays those of their elements, by the names of the FMU."""
    old_names: dict[str, str] = {}
    for new, old in rename.items():
        for element in interface.elements(old):
            old_names[new + element.removeprefix(old)] = element
    new_names: dict[str, str] = {}
    for new, old in old_names.items():
        entry = f"{place}: {new!r} = {old!r}"
        _check_variable(interface, entry, old)
        if old in new_names:
            raise InputError(
                f"{entry}: {old!r} is renamed to {new_names[old]!r} already; must have one name"
            )
        new_names[old] = new
    for old, new in new_names.items():
        if new in interface.by_name and new not in new_names:
            raise InputError(
                f"{place}: {new!r} = {old!r}: {interface.path.name} has a variable {new!r} itself; "
                "must be a name that is free, or rename that one, too"
            )
    return new_names


def in_units(interface: Interface, units: Mapping[str, str], place: str = "units") -> Interface:
    """The same with other units: `units` maps a variable to the name of its unit.

    That is one of the FMU's own definitions, or else a known one, with a minus before it where
    the FMU counts the other way. `place` says where the table comes from. InputError where there
    is no such variable, or no such unit.
    """
    if not units:
        return interface
    key = ("units", *units.items())
    return interface.variant(key, lambda: _in_units(interface, units, place))


def _in_units(interface: Interface, units: Mapping[str, str], place: str) -> Interface:
    defined = dict(interface.units)
    unit_names = {
        element: unit for name, unit in units.items() for element in interface.elements(name)
    }
    for name, unit in unit_names.items():
        entry = f"{place}: {name!r} = {unit!r}"
        _check_variable(interface, entry, name)
        variable = interface.by_name[name]
        if variable.kind != "Real":
            raise InputError(
                f"{entry}: is of type {variable.nature}; must be a Real, as only these have units"
            )
        defined[unit] = _unit(interface, entry, unit, defined)
    variables = (
        replace(variable, unit=unit_names[variable.name], display_unit=None)
        if variable.name in unit_names
        else variable
        for variable in interface.variables
    )
    return replace(interface, variables=tuple(variables), units=defined)


def _check_variable(interface: Interface, entry: str, name: str) -> None:
    """InputError where the FMU has no variable of that name; `entry` begins the message."""
    lacking = f"{entry}: {interface.short} has no variable"
    known(lacking, name, interface.by_name, see=interface.listing)


def _unit(interface: Interface, entry: str, name: str, defined: Mapping[str, Unit]) -> Unit:
    """The unit of a name that is defined or known, with a minus reversed; else InputError."""
    unsigned = name.removeprefix("-")
    unit = defined.get(name) or known_unit(name) or defined.get(unsigned) or known_unit(unsigned)
    if unit is None:
        alike = spelt_like(unsigned, defined)
        advice = "must be like 'mm', 'N.s/m', 'degC', '1', or '-mm' for what counts the other way"
        if alike:
            advice = f"did you mean {choices(alike)}?"
        raise InputError(
            f"{entry}: no unit that {interface.path.name} defines, or that is known; {advice}"
        )
    return unit if unit.name == name else unit.reversed(name)
