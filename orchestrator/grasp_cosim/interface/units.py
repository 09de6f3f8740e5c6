"""Conversions between units."""

import math
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple, TypeVar

from ..base.errors import InputError
from ..base.si_units import Unit

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


def converted(value: float, source: Unit, target: Unit) -> float:
    """A number of one unit in another one of its quantity.

    As if factors were the decimals that they are written as, so that 50 mm have the bits of 0.05 m.
    """
    if not math.isfinite(value):
        return value if source.factor * target.factor > 0.0 else -value
    number, factor, offset, per, zero = (
        Fraction(repr(float(x)))
        for x in (value, source.factor, source.offset, target.factor, target.offset)
    )
    return float((number * factor + offset - zero) / per)


def no_conversion(place: str, unit: str | None, target: str) -> InputError:
    """The error for a column in a unit that is not known, or not of the quantity of the target."""
    return InputError(
        f"{place} [{unit}]: cannot be converted into {target}; must be a unit of that quantity"
    )
