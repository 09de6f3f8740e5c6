"""The inputs and outputs of a system itself: what is given to them, and what they show.

An archive has them: Alt is an output of the system, aircraft.Alt that of a component behind it. A
value for an input of the system, or a column of a file, goes to each variable behind it. It is in
the unit of that variable.
"""

from __future__ import annotations

from array import array
from collections.abc import Iterable
from dataclasses import replace
from typing import NamedTuple

from ..base.errors import InputError, nearest
from ..base.quantity import Quantity, as_quantity
from ..base.si_units import Unit, known_unit
from ..interface.units import IDENTITY, Conversion, conversion, converted, no_conversion
from ..interface.variables import SETTABLE, Variable
from .overrides import Override
from .parts import Link, Port
from .stimuli import Stimuli, Stimulus
from .structure import Structure, unit_of


class Tap(NamedTuple):
    """What an output of the system shows: the output of a component, converted.

    unit is its name, None without one; quantity is what that means, None where nothing says so.
    """

    source: Port
    change: Conversion
    kind: str
    unit: str | None
    quantity: Unit | None
    description: str


def taps(system: Structure) -> dict[str, Tap]:
    """What the outputs of the system show, by their names."""
    by_name: dict[str, Tap] = {}
    for name, output in system.outputs.items():
        source = _variable(system, name, output.link.port, ("output",))
        unit, quantity = source.unit, _unit(system, output.link.port, source)
        change = _change(system, name, quantity, output.unit, output.link)
        if output.unit is not None:
            unit, quantity = output.unit.name, output.unit
        elif change != IDENTITY:
            unit, quantity = None, None
        kind = output.kind or source.kind
        description = output.description or source.description or ""
        by_name[name] = Tap(output.link.port, change, kind, unit, quantity, description)
    return by_name


def read_at(system: Structure, port: Port) -> tuple[Port, Conversion]:
    """The signal of a component that a name stands for, and what is made of its value.

    That is the one behind an output of the system, or the one of that name, as it is.
    """
    tap = system.once(taps).get(str(port))
    return (tap.source, tap.change) if tap else (port, IDENTITY)


def change_along(system: Structure, name: str, link: Link) -> Conversion:
    """What a value of an input of the system becomes along a link; InputError where it cannot."""
    variable = _variable(system, name, link.port, SETTABLE)
    unit = _unit(system, link.port, variable)
    return _change(system, name, system.inputs[name].unit, unit, link)


def check_connectors(system: Structure) -> None:
    """InputError at the first input or output of the system that does not fit what is behind it."""
    system.once(taps)
    for name, system_input in system.inputs.items():
        for link in system_input.links:
            change_along(system, name, link)


def reached(system: Structure, name: str) -> list[str]:
    """The variables that a value goes to by its name: its own, or those behind an input."""
    if name not in system.inputs:
        return [name]
    return [str(link.port) for link in system.inputs[name].links]


def behind_connectors(system: Structure, overrides: Iterable[Override]) -> list[Override]:
    """Overrides with those of inputs of the system as values of the variables behind them.

    InputError where two give a variable its value.
    """
    passed_on: dict[str, Override] = {}
    for override in overrides:
        variables = [override]
        if override.place in system.inputs:
            variables = _values(system, override)
        for variable in variables:
            if first := passed_on.get(variable.place):
                raise InputError(
                    f"{first.label} and {variable.label}: both give {variable.place} a value; "
                    "must be given once"
                )
            passed_on[variable.place] = variable
    return [*passed_on.values()]


def driven_by_connectors(system: Structure, stimuli: Stimuli) -> Stimuli:
    """Stimuli with the columns of inputs of the system as columns of the variables behind them."""
    if all(str(port) not in system.inputs and port.component for port in stimuli.columns):
        return stimuli
    columns: dict[Port, Stimulus] = {}
    behind: dict[Port, Port] = {}
    for port, column in stimuli.columns.items():
        name, place = str(port), stimuli.place(port)
        passed_on = {port: column}
        if name in system.inputs:
            links = system.inputs[name].links
            passed_on = {link.port: _column(system, place, name, column, link) for link in links}
        elif not port.component:
            inputs = [
                Port(c.name, v.name) for c in system.components for v in c.interface.of("input")
            ]
            raise InputError(
                f"{place}: no input {name!r}; {nearest(name, [*system.inputs, *inputs])}"
            )
        for target, samples in passed_on.items():
            if target in columns:
                two = f"{stimuli.place(behind[target])} and {place}"
                raise InputError(f"{two}: both drive {target}; must be driven by one")
            columns[target], behind[target] = samples, port
    return replace(stimuli, columns=columns, behind=behind)


def _values(system: Structure, override: Override) -> list[Override]:
    """The values of the variables behind an input of the system, in their units."""
    label, value = override.label, override.value
    system_input = system.inputs[override.place]
    if (quantity := as_quantity(value)) and system_input.unit:
        value = in_unit(label, quantity, system_input.unit)
    overrides: list[Override] = []
    for link in system_input.links:
        change = change_along(system, override.place, link)
        passed_on = value
        if change != IDENTITY:
            try:
                passed_on = change(float(value))
            except (TypeError, ValueError):
                raise InputError(f"{label} = {value!r}: must be a number") from None
        overrides.append(Override(str(link.port), passed_on, label))
    return overrides


def in_unit(place: str, quantity: Quantity, unit: Unit) -> float:
    """The number of a quantity in a unit; InputError where it is another quantity."""
    source = unit if quantity.unit == unit.name else known_unit(quantity.unit)
    if source is None or conversion(source, unit) is None:
        raise no_conversion(place, quantity.unit, unit.name)
    return converted(quantity.value, source, unit)


def _column(system: Structure, place: str, name: str, column: Stimulus, link: Link) -> Stimulus:
    """The column of a variable behind an input of the system, in the variable's unit."""
    change, unit = change_along(system, name, link), system.inputs[name].unit
    if unit is None and change == IDENTITY:
        return column
    into_unit = IDENTITY
    if column.unit is not None and unit is None:
        raise InputError(f"{place} [{column.unit}]: cannot be converted; must be left out")
    if column.unit is not None and unit is not None and column.unit != unit.name:
        source = known_unit(column.unit)
        conversion_or_none = conversion(source, unit) if source else None
        if conversion_or_none is None:
            raise no_conversion(place, column.unit, unit.name)
        into_unit = conversion_or_none
    if (into_unit, change) == (IDENTITY, IDENTITY):
        return replace(column, unit=None)
    if column.texts:
        raise InputError(f"{place} = {column.texts[0]!r}: must be a number")
    samples = array("d", (change(into_unit(sample)) for sample in column.samples))
    return replace(column, samples=samples, unit=None)


def _variable(system: Structure, name: str, port: Port, causalities: tuple[str, ...]) -> Variable:
    """The variable behind an input or output of the system; InputError where there is none."""
    place = f"{system.name}: {name}"
    interface = system.component(port.component, place).interface
    valid = {v.name: v for v in interface.of(*causalities) if v.supported}
    if port.variable not in valid:
        near = nearest(port.variable, valid, interface.listing)
        raise InputError(f"{place}: {port.component} has no {port.variable!r} for it; {near}")
    return valid[port.variable]


def _unit(system: Structure, port: Port, variable: Variable) -> Unit | None:
    return unit_of(system.component(port.component, str(port)).interface, variable)


def _change(
    system: Structure, name: str, start: Unit | None, end: Unit | None, link: Link
) -> Conversion:
    """The conversion along a link; InputError where units do not fit."""
    if link.factor is not None or link.offset is not None:
        factor = 1.0 if link.factor is None else link.factor
        return Conversion(factor, 0.0 if link.offset is None else link.offset)
    if start is None or end is None:
        return IDENTITY
    change = conversion(start, end)
    if change is None:
        raise InputError(
            f"{system.name}: {name}: {start.name} cannot be converted to {end.name}, for "
            f"{link.port}; must be of the same quantity"
        )
    return change
