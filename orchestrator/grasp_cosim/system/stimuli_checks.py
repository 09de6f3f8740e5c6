"""Checks of stimuli: they drive inputs that have no other source, with values that these take."""

from __future__ import annotations

from array import array

from si_units import known_unit

from ..base.checks import exact, known
from ..base.errors import InputError, choices
from ..interface.interface import Interface, Value, Variable
from ..interface.units import IDENTITY, Conversion, conversion
from .parts import Port
from .stimuli import Column, Stimuli
from .structure import Structure, unit_of


def driven(system: Structure) -> tuple[Port, ...]:
    """The inputs that stimuli drive, in the order of their columns."""
    if system.input is None:
        return ()
    there = {(c.name, v.name) for c in system.components for v in c.interface.of("input")}
    ports = system.input.columns
    return tuple(p for p in ports if not system.input.partial or (p.component, p.variable) in there)


def check_stimuli(system: Structure, whole: bool = False) -> None:
    """InputError at the first column that does not fit an input, or has one with another source.

    A value is no source: the column goes before it. whole says that all columns count, also where
    FMUs may yet be swapped.
    """
    stimuli = system.input
    sources = {c.target: f"a connection, from {c.source}" for c in system.connections}
    for event in system.events:
        sources |= dict.fromkeys(event.set, "an event")
    for port in stimuli.columns if stimuli and whole else driven(system):
        assert stimuli is not None  # noqa: S101 - it drives
        place = stimuli.place(port)
        interface = system.component(port.component, place).interface
        inputs = [Port(port.component, v.name) for v in interface.of("input")]
        known(f"{place}: no input", str(port), [*map(str, inputs)], see=interface.listing)
        variable = interface.by_name[port.variable]
        if not variable.is_number:
            raise InputError(
                f"{place}: is of type {variable.nature}; must be a Real, Integer, Boolean or "
                "Enumeration to be driven"
            )
        if port in sources:
            raise InputError(
                f"{place}: {port} has two sources, {stimuli.file} and {sources[port]}; must have "
                "one"
            )
        _check_samples(stimuli, port, interface)


def samples_of(system: Structure, port: Port) -> array[float]:
    """The samples of an input that is driven, in its unit."""
    assert system.input is not None  # noqa: S101 - it drives
    column = system.input.columns[port]
    interface = system.component(port.component, str(port)).interface
    if column.texts:
        values = [float(_value(system.input, port, interface, r)) for r in column.distinct]
        return array("d", (values[int(i)] for i in column.samples))
    change = _conversion(system.input.place(port), interface, port, column)
    same = change == IDENTITY
    return array("d", column.samples if same else (change(x) for x in column.samples))


def is_linear(stimuli: Stimuli, variable: Variable) -> bool:
    """True if the values of an input change between two rows."""
    continuous = variable.kind == "Real" and variable.variability == "continuous"
    return stimuli.interpolation == "linear" and continuous


def stimuli_remarks(system: Structure) -> list[str]:
    """A line on what drives which inputs."""
    if system.input is None:
        return []
    listed = f"{choices(driven(system), 6)} ({system.input.interpolation})"
    return [f"{system.input.file} drives {listed}, each step by the values at its beginning"]


def _check_samples(stimuli: Stimuli, port: Port, interface: Interface) -> None:
    """InputError at a sample that is not of the type and range of its input."""
    column, variable = stimuli.columns[port], interface.by_name[port.variable]
    place = stimuli.place(port)
    if column.unit is not None and variable.kind != "Real":
        raise InputError(f"{place} [{column.unit}]: is of type {variable.type}; must have no unit")
    _conversion(place, interface, port, column)
    numbers = variable.kind == "Real" and not column.texts
    for row in column.extremes if numbers else column.distinct:
        value = _value(stimuli, port, interface, row)
        exact(stimuli.place(port, row), value, column.text(row))


def _value(stimuli: Stimuli, port: Port, interface: Interface, row: int) -> Value:
    """The sample of a row as a value of its input; InputError where it is none."""
    column = stimuli.columns[port]
    change = _conversion(stimuli.place(port), interface, port, column)
    value: Value = column.text(row)
    if change != IDENTITY and not column.texts:
        value = change(column.samples[row])
    return interface.parse(stimuli.place(port, row), port.variable, value, text=True)


def _conversion(place: str, interface: Interface, port: Port, column: Column) -> Conversion:
    """The conversion of a column into the unit of its input; InputError where there is none."""
    variable = interface.by_name[port.variable]
    if column.unit is None or variable.unit in (None, column.unit):
        return IDENTITY
    given = interface.units.get(column.unit) or known_unit(column.unit)
    if given and variable.relative:
        given = given.without_offset
    own = unit_of(interface, variable)
    found = conversion(given, own) if given and own else None
    if found is None:
        raise InputError(
            f"{place} [{column.unit}]: cannot be converted into {variable.unit}; must be a unit "
            "of that quantity"
        )
    return found
