"""A variable of an FMU, and what belongs to it: its array, its enumeration, its clock."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import product

from .fmi_types import SUPPORTED_KINDS, Kind, Value, as_float, typed

PARAMETERS = ("parameter", "structuralParameter")
SETTABLE = ("input", *PARAMETERS)
"""The causalities of parameters, and of all that can be set whatever their start value is."""

MAX_ELEMENTS = 100_000
"""Of all arrays of an FMU that are taken apart; what would be more is left out."""


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


@dataclass(frozen=True, slots=True)
class Clock:
    """When a clock of FMI 3.0 ticks.

    variability is that of its interval: constant, fixed, calculated, tunable, changing, countdown,
    or triggered where it has none. interval and shift, from the start to the first tick, are in s,
    None where that is not declared. fractions says that the FMU gives them as fractions.
    """

    variability: str
    interval: Fraction | None = None
    shift: Fraction = Fraction(0)
    fractions: bool = False


@dataclass(frozen=True, slots=True)
class Enumeration:
    """A type of whole numbers that have names."""

    name: str
    items: tuple[tuple[str, int], ...]


def size_of(shape: Sequence[int]) -> int:
    """The number of elements; no more than one beyond MAX_ELEMENTS where there are more."""
    size = 1
    for length in shape if 0 not in shape else [0]:
        size = min(size * length, MAX_ELEMENTS + 1)
    return size


def element_names(name: str, shape: Sequence[int]) -> tuple[str, ...]:
    """The names of the elements, row by row."""
    places = product(*(range(1, length + 1) for length in shape))
    return tuple(f"{name}[{','.join(map(str, place))}]" for place in places)


@dataclass(slots=True, unsafe_hash=True)  # to make a frozen one takes three times as long
class Variable:
    """A variable; unit, start, minimum, maximum and magnitude are None if they are not declared.

    initial is how its value at the start comes about: "exact", "approx" or "calculated", as the
    standard derives it where it is not declared; None where the standard has none.

    type is the FMI type (Real, Float32, Int8, ...), kind what the system makes of it. start is its
    text, of an array that of all elements or, in starts, of each. minimum, maximum and magnitude,
    the nominal value, are as typed() gives them. dependencies are the variables an output depends
    on directly, None where that is not declared, which means all inputs; initial_dependencies the
    same in initialisation mode. shape is () but for an array, and sizes then names by dimension the
    variable that holds its length, None where that is fixed. element is its place in an array that
    was taken apart. relative says that it is a difference, to which the offset of a unit does not
    apply. enumeration is the type of an Enumeration. alias marks another name of a variable that
    comes before, infinite a variable that may be inf, as a distance to nothing. clock is there for
    a Clock, and clocks are the references of those with which the variable changes, where that is
    declared.
    """

    name: str
    kind: Kind
    causality: str
    reference: int
    unit: str | None
    start: str | None
    minimum: Value | None
    maximum: Value | None
    type: str = "Real"
    variability: str = "continuous"
    dependencies: tuple[str, ...] | None = None
    initial_dependencies: tuple[str, ...] | None = None
    shape: tuple[int, ...] = ()
    description: str | None = None
    magnitude: Value | None = None
    relative: bool = False
    enumeration: Enumeration | None = None
    initial: str | None = None
    display_unit: str | None = None
    starts: tuple[str, ...] = ()
    alias: bool = False
    infinite: bool = False
    sizes: tuple[str | None, ...] = ()
    element: Element | None = None
    clock: Clock | None = None
    clocks: tuple[int, ...] = ()

    @property
    def low(self) -> float:
        """The smallest value that is declared valid; beyond that a value must fit into its type."""
        return as_float(self.minimum, -math.inf)

    @property
    def high(self) -> float:
        """The largest value that is declared valid."""
        return as_float(self.maximum, math.inf)

    @property
    def nominal(self) -> float:
        """The magnitude that its values are compared with, 1 if none is declared, as FMI has it."""
        return abs(as_float(self.magnitude, 1.0)) or 1.0

    @property
    def start_value(self) -> Value | list[Value | None] | None:
        """The start value as typed() gives it, a list for an array."""
        if not self.shape or self.start is None:
            return typed(self.type, self.start)
        return [typed(self.type, text) for text in self.texts]

    @property
    def items(self) -> dict[str, int]:
        """Of an Enumeration, its numbers by name; empty for any other."""
        return dict(self.enumeration.items) if self.enumeration else {}

    @property
    def settable(self) -> bool:
        """True if it can be given a value before the initialisation."""
        if self.variability == "constant" and self.causality != "input":
            return False
        return self.causality in SETTABLE or self.initial in ("exact", "approx")

    @property
    def unsettable(self) -> str:
        """Why it cannot be given a value, as the end of a sentence that begins with its name."""
        if self.causality == "independent":
            return "is the time of the FMU"
        if self.variability == "constant":
            return "is a constant of the FMU"
        nouns = {"output": "an output", "calculatedParameter": "a calculated parameter"}
        noun = nouns.get(self.causality, "a local variable")
        return f"is {noun} that the FMU calculates from the start on"

    @property
    def supported(self) -> bool:
        """True if a master can set, connect and record it."""
        return self.kind in SUPPORTED_KINDS and not self.shape

    @property
    def is_number(self) -> bool:
        """True if it is supported, and a Real, an Integer or a Boolean."""
        return self.supported and self.kind != "String"

    @property
    def nature(self) -> str:
        """Its type in words, as of what is not supported: array of Float64, Binary, Clock."""
        if size_of(self.shape) > MAX_ELEMENTS:
            return f"array of {self.type} with more than {MAX_ELEMENTS} elements"
        return f"array of {self.type}" if self.shape else self.type

    @property
    def texts(self) -> tuple[str, ...]:
        """Of an array, its start values as they are declared: of each element, or one for all."""
        return self.starts or tuple((self.start or "").split())
