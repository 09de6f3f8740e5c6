"""Units as FMI and SSP define them, and the conversion from one to another."""

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple, TypeVar

if TYPE_CHECKING:  # reading a description needs no numpy, which takes time to load
    import numpy as np
    import numpy.typing as npt

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")
Number = TypeVar("Number", float, "npt.NDArray[np.float64]")


@dataclass(frozen=True, slots=True)
class Unit:
    """value in base units = factor * value + offset; exponents in the order of BASE."""

    name: str
    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0


class Conversion(NamedTuple):
    """target = factor * source + offset."""

    factor: float
    offset: float

    def __call__(self, value: Number) -> Number:
        """Return `value`, a number or an array, in the target's unit."""
        return self.factor * value + self.offset


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
