"""Arrays of FMI 3.0 as their elements: names like u[2] and A[1,2], row by row, counted from 1."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

MOST_ELEMENTS = 100_000
"""Of all arrays of an FMU that are taken apart; what would be more is left alone."""


@dataclass(frozen=True, slots=True)
class Element:
    """Where a variable is in an array of that name: its place, row by row from 0, of size."""

    array: str
    place: int
    size: int


@dataclass(frozen=True, slots=True)
class Array:
    """An array that was taken apart: its shape, and the names of its elements row by row."""

    shape: tuple[int, ...]
    names: tuple[str, ...]


def size_of(shape: Sequence[int]) -> int:
    """The number of elements; no more than one beyond MOST_ELEMENTS where there are more."""
    size = 1
    for length in shape if 0 not in shape else [0]:
        size = min(size * length, MOST_ELEMENTS + 1)
    return size


def element_names(name: str, shape: Sequence[int]) -> tuple[str, ...]:
    """The names of the elements, row by row."""
    places = product(*(range(1, length + 1) for length in shape))
    return tuple(f"{name}[{','.join(map(str, place))}]" for place in places)


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

    ValueError, which says what it is, where it is none of these.
    """
    value = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(value, list | tuple):
        return [value] * size_of(shape)
    found, flat = [len(value)], list(value)
    while flat and all(isinstance(part, list | tuple) for part in flat):
        lengths = {len(part) for part in flat}
        flat = [entry for part in flat for entry in part]
        if len(lengths) > 1:
            raise ValueError("has rows of different lengths")
        found.append(lengths.pop())
    if any(isinstance(entry, list | tuple) for entry in flat):
        raise ValueError("has rows of different lengths")
    if tuple(found) != tuple(shape) and found != [size_of(shape)]:
        raise ValueError(f"is {shape_text(found)}")
    return flat
