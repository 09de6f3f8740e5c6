"""Conversion between the units of two FMUs."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

import fmpy
import numpy as np
import numpy.typing as npt

from ..system.units import BASE, Unit

Units = Mapping[str, Unit]
Number = TypeVar("Number", float, npt.NDArray[np.float64])


class Conversion(NamedTuple):
    """target = factor * source + offset."""

    factor: float
    offset: float

    def __call__(self, value: Number) -> Number:
        """The value, a number or an array, in the target's unit."""
        return self.factor * value + self.offset


IDENTITY = Conversion(1.0, 0.0)


def conversion(
    source_units: Units, source: str | None, target_units: Units, target: str | None
) -> Conversion | None:
    """From one unit to another; None where there is none. No unit is taken as the other one."""
    if source is None or target is None or source == target:
        return IDENTITY
    a, b = source_units.get(source), target_units.get(target)
    if a is None or b is None or a.exponents != b.exponents:
        return None
    return Conversion(a.factor / b.factor, (a.offset - b.offset) / b.factor)


def units_of(path: Path) -> Units:
    """The units that an FMU defines."""
    found = fmpy.read_model_description(path, validate=False).unitDefinitions
    return {
        u.name: Unit(
            u.name,
            tuple(getattr(u.baseUnit, base) for base in BASE),
            u.baseUnit.factor,
            u.baseUnit.offset,
        )
        for u in found
        if u.baseUnit is not None
    }
