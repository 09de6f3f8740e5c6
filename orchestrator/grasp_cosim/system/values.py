"""Values that a component is given, of variables and of whole arrays."""

from collections.abc import Callable, Mapping
from dataclasses import replace

from ..base.errors import InputError
from ..interface.expansion import values_of
from ..interface.interface import Given, Value
from .parts import Component


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
