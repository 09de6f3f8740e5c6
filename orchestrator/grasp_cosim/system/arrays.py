"""Values that a component is given, and connections and values of whole arrays: as of elements."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Set
from dataclasses import replace

from ..base.checks import known
from ..base.errors import InputError, choices
from ..interface.expansion import shape_text, values_of
from ..interface.interface import Given, Value
from .parts import Component, Connection, Port
from .stimuli_checks import driven
from .structure import Structure


def as_written(system: Structure) -> tuple[Connection, ...]:
    """The connections as they were given: of whole arrays one."""
    return tuple(dict.fromkeys(c.whole or c for c in system.connections))


def by_element(system: Structure) -> tuple[Connection, ...]:
    """The connections, with one for each element in the place of one between whole arrays.

    InputError where the shapes differ.
    """
    arrays = {c.name: c.interface.arrays for c in system.components}
    if not any(arrays.values()):
        return system.connections
    made: list[Connection] = []
    for i, connection in enumerate(system.connections):
        ends = (connection.source, connection.target)
        source, target = found = [arrays.get(p.component, {}).get(p.variable) for p in ends]
        if source is None and target is None:
            made.append(connection)
            continue
        place = f"{system.name}: connections[{i}] '{connection}'"
        has = []
        for port, array, causality in zip(ends, found, ("output", "input"), strict=True):
            interface = system.component(port.component, place).interface
            if array is None:
                valid = [v.name for v in interface.of(causality)]
                said = f"{place}: {port.component} has no {causality}"
                known(said, port.variable, valid, see=interface.listing)
                v = interface.by_name[port.variable]
                has.append(f"{port} is {v.nature if v.shape else 'no array'}")
            else:
                has.append(f"{port} is {shape_text(array.shape)}")
        if source is None or target is None or source.shape != target.shape:
            raise InputError(
                f"{place}: {' and '.join(has)}; must have equal shapes, or be of elements, like "
                "u[1]"
            )
        made += (
            replace(
                connection,
                source=Port(connection.source.component, start),
                target=Port(connection.target.component, end),
                whole=connection,
            )
            for start, end in zip(source.names, target.names, strict=True)
        )
    return tuple(made)


def check_arrays(system: Structure) -> None:
    """InputError where only a part of an array is given, and nothing is known of the rest.

    The rest of what is given keeps its start value, which must be declared for the size it has.
    """
    connected = {connection.target for connection in system.connections}
    stimuli = driven(system)
    for component in system.components:
        given = {*component.values, *(p.variable for p in stimuli if p.component == component.name)}
        for name, unknown in _incomplete(component, given):
            missing = [n for n in unknown if Port(component.name, n) not in connected]
            if missing:
                raise InputError(
                    f"{system.name}: {component.name}.{name}: no value for {choices(missing, 6)}, "
                    "and no start value for this size; must be given, too"
                )


def _incomplete(component: Component, given: Set[str]) -> Iterator[tuple[str, list[str]]]:
    """Arrays that are given in part, each with its elements that have no value at all."""
    interface = component.interface
    for name, array in interface.arrays.items():
        if not given.isdisjoint(array.names):
            starts = {n for n in array.names if interface.by_name[n].start is not None}
            yield name, [n for n in array.names if n not in given and n not in starts]


def unsourced(system: Structure, component: Component) -> Iterator[str]:
    """A line on the elements of input arrays that have neither a connection nor a value."""
    ports = (*(connection.target for connection in system.connections), *driven(system))
    targets = {port.variable for port in ports if port.component == component.name}
    interface = component.interface
    free: list[str] = []
    for name, array in interface.arrays.items():
        without = [n for n in array.names if n not in targets and n not in component.values]
        if without and interface.by_name[without[0]].causality == "input":
            free += [name] if len(without) == len(array.names) else without
    if free:
        yield f"{component.name}: no source for {choices(free, 6)}: kept as the FMU starts with"


def with_given(
    component: Component,
    place: Callable[[str], str],
    given: Mapping[str, Given],
    text: bool = False,
) -> Component:
    """The component with more values, structural parameters first: they decide sizes.

    place says for a name where its value comes from. InputError where one does not fit. A value of
    a whole array takes the place of all that were given for its elements.
    """
    interface = component.interface
    sizes = {
        name: value
        for name, value in given.items()
        if name in interface.by_name and interface.by_name[name].causality == "structuralParameter"
    }
    for name, value in sizes.items():
        values = {**component.values, **values_of(interface, place(name), name, value, text)}
        component = replace(component, values=values)
    before, interface = interface, component.interface
    anew = [before.arrays[name].names for name in given if name in before.arrays]
    dropped = {element for names in anew for element in names}
    kept = {name: value for name, value in component.values.items() if name not in dropped}
    lost = next((n for n in kept if n in before.by_name and n not in interface.by_name), None)
    if lost is not None:
        array = next(name for name, a in before.arrays.items() if lost in a.names)
        name, value = next(iter(sizes.items()))
        raise InputError(
            f"{place(name)} = {value!r}: there is then no {lost}, which has a value; {array} must "
            "be given anew, too"
        )
    parsed: dict[str, Value] = {}
    for name, value in given.items():
        if name not in sizes:
            parsed |= values_of(interface, place(name), name, value, text)
    return replace(component, values={**kept, **parsed})
