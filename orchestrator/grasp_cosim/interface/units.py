"""Conversions between units."""

import math
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from si_units import OTHER, Unit

if TYPE_CHECKING:  # reading a description needs no numpy, which takes time to load
    import numpy as np
    import numpy.typing as npt

Number = TypeVar("Number", float, "npt.NDArray[np.float64]")


class Conversion(NamedTuple):
    """target = factor * source + offset."""

    factor: float
    offset: float

    def __call__(self, value: Number) -> Number:
        """Return `value`, a number or an array, in the target's unit."""
        return self.factor * value + self.offset

    def back(self, value: float) -> float:
        """Return a number in the target's unit in that of the source."""
        return (value - self.offset) / self.factor


IDENTITY = Conversion(1.0, 0.0)


def conversion(source: Unit, target: Unit) -> Conversion | None:
    """The conversion of values from one unit to another.

    None where the dimensions differ, or the factor or offset is beyond what a number can be.
    """
    if source.exponents != target.exponents:
        return None
    factor, offset = source.factor / target.factor, (source.offset - target.offset) / target.factor
    possible = factor != 0.0 and math.isfinite(factor) and math.isfinite(offset)
    return Conversion(factor, offset) if possible else None


def between_units(ratio: float) -> bool:
    """True if a number > 0 looks like one between two units and not like a gain: 1000, 25.4, 60."""
    digits = math.log10(ratio)
    if abs(digits - round(digits)) < 1e-9:
        return round(digits) != 0
    shifts = (sign * math.log10(factor) for factor, *_ in OTHER.values() for sign in (-1, 1))
    return any(abs(digits - s - round(digits - s)) < 1e-4 for s in shifts if s % 1.0)
