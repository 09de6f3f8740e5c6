"""Arrays of numbers taken apart: an interface with a variable for each element, u[2] or A[1,2]."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from typing import Any

from ..base.errors import InputError
from ..base.quantity import Quantity, as_quantity, is_nested, unwrapped
from .fmi_types import Value
from .interface import Interface
from .values import Given, parse_value
from .variables import MAX_ELEMENTS, Array, Element, Variable, element_names, size_of

Names = tuple[str, ...] | None


def expanded(interface: Interface, lengths: Mapping[str, Value | None]) -> Interface:
    """An interface of arrays with elements in the place of arrays of numbers.

    lengths are values of the variables of sized_by; where one is None, its start counts. An array
    is left as it is if it has too many elements, or if a variable has the name of an element.
    """
    known = {n: v for n, v in lengths.items() if isinstance(v, int) and v >= 0}
    return interface.variant(("sizes", *known.items()), lambda: _expanded(interface, known))


def parse_values(
    interface: Interface, place: str, name: str, value: Given, text: bool = False
) -> dict[str, Value]:
    """The typed values of the variables that a name stands for: a variable, or a whole array.

    A value is as of parse_value(); for an array nested lists of its shape, a list of all elements
    row by row, or one value for all. With text, a text may stand for these, as on a command line.
    InputError, which begins with the place, where the value does not fit.
    """
    array: Array | None = interface.arrays.get(name)
    if array is None and isinstance(value, str):
        return {name: parse_value(interface, place, name, value, text)}
    value = as_quantity(value) or unwrapped(value)
    if array is None:
        several = is_nested(value.value if isinstance(value, Quantity) else value)
        if several or not isinstance(value, float | int | bool | str | Quantity):
            raise InputError(f"{place}: {name} = {value!r}: is not an array; must be one value")
        return {name: parse_value(interface, place, name, value, text)}
    try:
        elements = _elements_of(
            from_text(value) if text and isinstance(value, str) else value, array
        )
    except ValueError as error:
        raise InputError(
            f"{place}: {name} = {value!r}: {error}; must be {shape_text(array.shape)}, or "
            "a list of all elements row by row, or one value for all"
        ) from error
    return {
        element: parse_value(interface, place, element, element_value, text)
        for element, element_value in zip(array.names, elements, strict=True)
    }


def _elements_of(value: Any, array: Array) -> list[Any]:
    """The values of the elements of an array, row by row, each with the unit of all."""
    if isinstance(value, Quantity):
        return [Quantity(number, value.unit) for number in flattened(value.value, array.shape)]
    return flattened(value, array.shape)


def _expanded(interface: Interface, lengths: Mapping[str, int]) -> Interface:
    shapes = {
        v.name: tuple(
            lengths.get(name or "", length) for name, length in zip(v.sizes, v.shape, strict=True)
        )
        for v in interface.variables
    }
    apart = _taken_apart(interface, shapes)
    arrays = {v.name: apart[v.name] for v in interface.variables if v.name in apart}
    variables: list[Variable] = []
    for v in interface.variables:
        if v.name in arrays:
            variables += _elements(v, arrays[v.name].shape, arrays[v.name].names)
        else:
            shape = shapes[v.name]
            variables.append(replace(v, shape=shape) if shape != v.shape else v)

    @cache  # thousands of outputs depend on the same inputs
    def elements_of(names: Names) -> Names:
        if names is None:
            return None
        elements: list[str] = []
        for name in names:
            elements += arrays[name].names if name in arrays else (name,)
        return tuple(elements)

    variables = [
        replace(
            v,
            dependencies=elements_of(v.dependencies),
            initial_dependencies=elements_of(v.initial_dependencies),
        )
        for v in variables
    ]
    return replace(interface, variables=tuple(variables), arrays=arrays)


def _taken_apart(interface: Interface, shapes: Mapping[str, tuple[int, ...]]) -> dict[str, Array]:
    """The shapes and the names of the elements of the arrays that are taken apart, by name."""
    numbers = [
        v for v in interface.variables if v.shape and v.kind in ("Real", "Integer", "Boolean")
    ]
    apart, room = {}, MAX_ELEMENTS
    numbers.sort(key=lambda v: not (v.settable or v.causality == "output"))  # what is most used
    for v in numbers:
        shape, size = shapes[v.name], size_of(shapes[v.name])
        names = element_names(v.name, shape) if size <= room else ()
        if size <= room and interface.by_name.keys().isdisjoint(names):
            room -= size
            apart[v.name] = Array(shape, names)
    return apart


def _elements(v: Variable, shape: tuple[int, ...], names: tuple[str, ...]) -> list[Variable]:
    """The elements; they have no start value where it is not declared for their number."""
    starts: tuple[str | None, ...] = v.texts
    if len(starts) == 1:
        starts *= len(names)
    elif shape != v.shape or len(starts) != len(names):
        starts = (None,) * len(names)
    plain = replace(v, shape=(), sizes=(), starts=())
    return [
        replace(plain, name=name, start=start, element=Element(v.name, place, len(names)))
        for place, (name, start) in enumerate(zip(names, starts, strict=True))
    ]


def shape_text(shape: Sequence[int]) -> str:
    """A shape as messages have it, like '[2, 3]'."""
    return f"[{', '.join(map(str, shape))}]"


def from_text(text: str) -> Any:
    """Values as on a command line: 1,2,3 or [[1,2],[3,4]]; the text itself where it is one value.

    ValueError where brackets do not close.
    """
    if text.lstrip().startswith("["):
        return json.loads(text)
    return [part.strip() for part in text.split(",")] if "," in text else text


def flattened(value: Any, shape: Sequence[int]) -> list[Any]:
    """The elements row by row of nested lists of that shape, of a list of all, or of one for all.

    ValueError with its description, where it is none of these.
    """
    value = value.tolist() if hasattr(value, "tolist") else value
    if not is_nested(value):
        return [value] * size_of(shape)
    value_shape, flat = [len(value)], list(value)
    while flat and all(map(is_nested, flat)):
        lengths = {len(part) for part in flat}
        flat = [entry for part in flat for entry in part]
        if len(lengths) > 1:
            raise ValueError("has rows of different lengths")
        value_shape.append(lengths.pop())
    if any(map(is_nested, flat)):
        raise ValueError("has rows of different lengths")
    if tuple(value_shape) != tuple(shape) and value_shape != [size_of(shape)]:
        raise ValueError(f"is {shape_text(value_shape)}")
    return flat
