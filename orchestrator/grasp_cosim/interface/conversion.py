"""Conversion between the units of two FMUs."""

from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from . import units
from .interface import read_units
from .model_description import read_description
from .units import Unit

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
    """From one unit to another, each as its FMU defines it; None where there is none.

    A unit that is not declared is taken as the other one.
    """
    if source is None or target is None or source == target:
        return IDENTITY
    start, end = source_units.get(source), target_units.get(target)
    found = units.conversion(start, end) if start and end else None
    return None if found is None else Conversion(*found)


def units_of(path: Path) -> Units:
    """The units that the FMU at path defines, whether the master would take it or not."""
    _, root, _ = read_description(path)
    try:
        return {unit.name: unit for unit in read_units(root)}
    except ValueError as error:
        raise InputError(f"{path}: not a readable FMU: {error}") from error
