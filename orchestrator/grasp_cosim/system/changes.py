"""A component with other values, or with another FMU, in whose units its values then are."""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from shlex import quote

from ..base.errors import InputError, choices, nearest
from ..interface.expansion import parse_values
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.read import describe
from ..interface.renaming import renamed
from ..interface.units import IDENTITY
from ..interface.variables import Variable
from .overrides import Override
from .parts import Component, literal
from .structure import Structure, unit_of

LOGGER = logging.getLogger(__name__)


def with_values(
    component: Component, overrides: Mapping[str, Override], from_text: bool = False
) -> Component:
    """The component with more values, by variable or array; InputError where one does not fit.

    Structural parameters come first: they decide sizes. A value of a whole array takes the place of
    all that its elements had. With from_text a text may stand for a number, as on a command line.
    """
    old = component.interface
    sizes = {
        name: override for name, override in overrides.items() if _is_size(old.by_name.get(name))
    }
    for name, override in sizes.items():
        size = _parsed(component, name, override, from_text)
        component = replace(component, values={**component.values, **size})
    remaining = _without_arrays(component.values, old, overrides)
    _check_remaining(component, remaining, old, sizes)
    values: dict[str, Value] = {}
    labels: dict[str, str] = {}
    for name, override in overrides.items():
        if name in sizes:
            continue
        parsed = _parsed(component, name, override, from_text)
        values |= parsed
        labels |= {element: override.label_of(f"{component.name}.{element}") for element in parsed}
    new = component.interface.by_main_names(values, labels.__getitem__)
    return replace(component, values={**remaining, **new})


def _is_size(variable: Variable | None) -> bool:
    """True for a structural parameter, which decides on the sizes of arrays."""
    return variable is not None and variable.causality == "structuralParameter"


def _parsed(
    component: Component, name: str, override: Override, from_text: bool
) -> dict[str, Value]:
    """The typed values of the variables that an override stands for."""
    label = override.label_of(f"{component.name}.{name}")
    return parse_values(component.interface, label, name, override.value, from_text)


def _without_arrays(
    values: Mapping[str, Value], interface: Interface, overrides: Mapping[str, Override]
) -> dict[str, Value]:
    """Values without those of elements of arrays that are overridden as a whole."""
    names = map(interface.main_name, overrides)
    arrays = [interface.arrays[name] for name in names if name in interface.arrays]
    overridden = {element for array in arrays for element in array.names}
    return {name: value for name, value in values.items() if name not in overridden}


def _check_remaining(
    component: Component,
    values: Mapping[str, Value],
    old: Interface,
    sizes: Mapping[str, Override],
) -> None:
    """InputError where another size leaves a value without its element of an array."""
    for element in values:
        if element not in old.by_name or element in component.interface.by_name:
            continue
        name, size = next(iter(sizes.items()))
        label = size.label_of(f"{component.name}.{name}")
        array = next(name for name, array in old.arrays.items() if element in array.names)
        raise InputError(
            f"{label} = {size.value!r}: there is then no {element}, which has a value; {array} "
            "must be given again, too"
        )


def replaced(
    component: Component,
    fmu: Path,
    rename: Mapping[str, str],
    units: Mapping[str, str],
    place: str,
) -> Component:
    """The component with another FMU, without a look at its values; place begins its errors.

    rename and units are as a Component has them. Of those that it has, those stay that fit: an
    FMU's name that the new one has, too; a unit where the FMUs declare the same one, or the new FMU
    none.
    """
    old_fmu = component.code.interface if component.code else describe(component.fmu)
    old = renamed(component.sized(old_fmu), component.rename)
    new_fmu = component.sized(describe(fmu))
    names = _remaining_names(component.rename, rename, new_fmu)
    new = renamed(new_fmu, names, f"{place}rename")
    remaining_units = {
        name: unit for name, unit in component.units.items() if _keeps_unit(old, new, name)
    }
    solved_alike = (old.exchange is None) == (new_fmu.exchange is None)
    return replace(
        component,
        fmu=fmu,
        native=None,
        as_named=False,
        code=None,
        rename=names,
        units={**remaining_units, **units},
        solver=component.solver if solved_alike else None,
    )


def _remaining_names(
    old: Mapping[str, str], rename: Mapping[str, str], fmu: Interface
) -> dict[str, str]:
    """The names of an FMU by those of the system: those of rename, and of the old ones what fits.

    An old one does not where the FMU lacks what it names, or where it is taken.
    """
    names = {
        name: fmu_name
        for name, fmu_name in old.items()
        if fmu.sample(fmu_name) and name not in rename and fmu_name not in rename.values()
    }
    names |= rename
    while taken := (names.keys() & fmu.by_name) - {*rename, *names.values()}:
        names = {name: fmu_name for name, fmu_name in names.items() if name not in taken}
    return names


def _keeps_unit(old: Interface, new: Interface, name: str) -> bool:
    """True if a unit that the system names for a variable is that of another FMU's, too.

    So it is where both FMUs declare the same one, or the new FMU none.
    """
    old_variable, new_variable = old.sample(name), new.sample(name)
    if new_variable is None:
        return False
    if new_variable.unit is None:
        return True
    return old_variable is not None and old_variable.unit == new_variable.unit


def with_old_values(
    system: Structure,
    old: Component,
    new: Component,
    overridden: Collection[str],
    place: str,
) -> tuple[Component, list[str]]:
    """The new component, which has another FMU, with the values of the old one; and notes.

    The values are in the units of the new FMU. Those of overridden variables or arrays are not
    looked at: they get others. A value of a variable that the new FMU lacks is left out with a
    note. So is one where the new FMU has other start values. InputError where a value, or another
    number that the system states, has no meaning in the new unit.
    """
    old_fmu, new_fmu = old.interface, new.interface
    _check_ends(system, old, new_fmu, place)
    values = {
        name: value
        for name, value in old.values.items()
        if name in new_fmu.by_name and new_fmu.by_name[name].settable
    }
    overridden = {
        element
        for name in overridden
        for element in (old_fmu.arrays[name].names if name in old_fmu.arrays else (name,))
    }
    remaining = {name: value for name, value in values.items() if name not in overridden}
    for name in [*remaining, *sorted(stated(system, old.name))]:
        if reason := _meaningless(old_fmu, new_fmu, name, is_value=name in remaining):
            raise InputError(f"{place}: {name} {reason}")
    left_out = [
        f"{place}: {_unsettable(old_fmu, new, name)}: its value {literal(value)} is left out"
        for name, value in old.values.items()
        if name not in values
    ]
    _warn_of_missing_units(old, new, place)
    values |= converted(remaining, old_fmu, new_fmu)
    remaining = {name: values[name] for name in remaining}
    for name, value in remaining.items():
        _check_item(old, new, name, value, place)
    return replace(new, values=values), [*_other_start_values(new, remaining, place), *left_out]


def _warn_of_missing_units(old: Component, new: Component, place: str) -> None:
    """Log which variables have a unit in the old FMU, and none in the new one."""
    with_unit = {v.name for v in old.interface.variables if v.unit not in (None, "1")}
    missing = [
        v.name
        for v in new.interface.variables
        if v.kind == "Real" and not v.unit and v.name in with_unit
    ]
    if missing:
        LOGGER.error(
            "%s: %s tells no unit of %s, as %s does: taken to be in SI; `units` names others",
            place, new.fmu.name, choices(missing, 6), old.fmu.name,
        )  # fmt: skip


def _check_item(old: Component, new: Component, name: str, value: Value, place: str) -> None:
    """InputError where a number of an enumeration is another item of it in the new FMU."""
    old_items = old.interface.by_name[name].items
    new_items = new.interface.by_name[name].items
    if not old_items or not new_items:
        return
    old_item = next((item for item, number in old_items.items() if number == value), None)
    new_item = next((item for item, number in new_items.items() if number == value), None)
    if old_item != new_item:
        raise InputError(
            f"{place}: {name} = {value!r} is {old_item} in {old.fmu.name} and "
            f"{new_item or 'nothing'} in {new.fmu.name}; must be set again, as one of "
            f"{choices(new_items)}"
        )


def _other_start_values(
    component: Component, values: Mapping[str, Value], place: str
) -> Iterator[str]:
    """A note on the values of the system that its new FMU starts with otherwise, if there are."""
    differences = []
    for name, value in values.items():
        variable = component.interface.by_name[name]
        start = variable.start_value
        if _may_start_itself(variable) and start is not None and not _are_equal(value, start):
            unit = "" if variable.unit in (None, "1") else f" {variable.unit}"
            differences.append(f"{name} = {literal(value)}{unit} (its own is {start!r}{unit})")
    if differences:
        yield (
            f"{place}: the values of the system stay: {', '.join(differences)}; --own-values, or "
            f"swap(..., own_values=True), takes those of {component.fmu.name}"
        )


def _may_start_itself(variable: Variable) -> bool:
    """True for what an FMU may have its own value for: not what the system has to feed."""
    return variable.causality not in ("input", "structuralParameter")


def _are_equal(value: Value, start: object) -> bool:
    """True for equal values, but for the rounding of a conversion."""
    if isinstance(value, float) and isinstance(start, float):
        return math.isclose(value, start, rel_tol=1e-12)
    return value == start


def with_own_values(component: Component) -> Component:
    """The component with the values of its FMU, but for inputs and what decides on sizes."""
    by_name = component.interface.by_name
    fed = {
        name: value
        for name, value in component.values.items()
        if not _may_start_itself(by_name[name])
    }
    return replace(component, values=fed)


def _unsettable(old: Interface, new: Component, name: str) -> str:
    """Why a value of a variable of the old FMU cannot be given to the new one."""
    variable = new.interface.by_name.get(name)
    if variable is None:
        return f"{new.fmu.name} has no {old.by_name[name].causality} {name}"
    return f"in {new.fmu.name} {name} {variable.unsettable}"


def _check_ends(system: Structure, old: Component, new: Interface, place: str) -> None:
    """InputError where another FMU lacks what the system connects: it may call that otherwise."""
    ends = [port for c in system.connections for port in (c.source, c.target)]
    connected = dict.fromkeys(port.variable for port in ends if port.component == old.name)
    old_names = old.interface.by_name
    missing = [name for name in connected if name in old_names and name not in new.by_name]
    if not missing:
        return
    name = missing[0]
    causality = old_names[name].causality
    also = f", and {len(missing) - 1} more that are connected" if missing[1:] else ""
    near = nearest(name, [v.name for v in new.of(causality)], new.listing)
    raise InputError(
        f"{place}: {new.path.name} has no {causality} {name!r}{also}; {near}; if "
        f"they have other names: --set 'components.{old.name}.rename.{name}=NAME', or "
        f"`grasp-cosim init my_system.toml --as {old.name}={quote(str(new.path))}` finds them"
    )


def stated(system: Structure, name: str) -> frozenset[str]:
    """The variables of a component for which the system states numbers, next to its values."""
    faulty = {fault.target for fault in system.faults}
    ports = [
        port
        for c in system.connections
        for port in (c.source, c.target)
        if (c.factor, c.offset) != (None, None) or c.target in faulty
    ]
    links = [link for system_input in system.inputs.values() for link in system_input.links]
    links += [output.link for output in system.outputs.values()]
    ports += [link.port for link in links if link.factor is not None]
    for event in system.events:
        for port in event.set:
            ports += system.elements(port)
    conditions = [*(e.when for e in system.events), *(f.when for f in system.faults)]
    conditions += [limit.when for limit in system.limits]
    ports += [condition.port for condition in conditions if condition]
    columns = system.input.columns if system.input else {}
    ports += [port for port, column in columns.items() if column.unit is None]
    return frozenset(port.variable for port in ports if port.component == name)


def converted(values: Mapping[str, Value], old: Interface, new: Interface) -> dict[str, Value]:
    """Values of one FMU in the units of another that has the same variables."""
    result = dict(values)
    for name, value in values.items():
        if name in new.by_name and new.by_name[name].kind == "Real":
            change = old.conversion(name, new)
            if change and change != IDENTITY:
                result[name] = change(float(value))
    return result


def _meaningless(old: Interface, new: Interface, name: str, is_value: bool) -> str:
    """Why a number for a variable means nothing in the unit of the new FMU; empty where it does.

    A value is converted; a number elsewhere in the system, as of an event, is not.
    """
    if name not in old.by_name or name not in new.by_name:
        return ""
    old_variable, new_variable = old.by_name[name], new.by_name[name]
    old_unit = unit_of(old, old_variable)
    change = old.conversion(name, new)
    loses_unit = old_variable.unit and new_variable.unit is None and new_variable.kind == "Real"
    if loses_unit and (old_unit is None or not old_unit.si):
        return (
            f"has no unit in {new.path.name}, but is set in {old_variable.unit}; must be named in "
            "units"
        )
    if change is None:
        return (
            f"is in {new_variable.unit}, which {old_variable.unit} cannot be converted to; must be "
            "set again"
        )
    if change != IDENTITY and not is_value:
        return (
            f"is in {new_variable.unit}, but an event, a fault or the factor of a connection, or "
            f"an input file, is meant in {old_variable.unit}; must be in that"
        )
    return ""
