"""Values that a component is given, of variables and of whole arrays."""

from collections.abc import Callable, Mapping
from dataclasses import replace

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
    kept = dict(component.values)
    parsed: dict[str, Value] = {}
    for name, value in given.items():
        if name not in sizes:
            for element in before.arrays[name].names if name in before.arrays else ():
                kept.pop(element, None)
            parsed |= values_of(interface, place(name), name, value, text)
    return replace(component, values={**kept, **parsed})
