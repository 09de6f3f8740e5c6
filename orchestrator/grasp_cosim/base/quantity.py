"""A number, or an array of numbers, with its unit, as a caller says it: 50 mm."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from .checks import is_number
from .errors import InputError

_TEXT = re.compile(r"\s*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][-+]?[0-9]+)?)\s+([^\s,\[\]]+)\s*")


@dataclass(frozen=True, slots=True)
class Quantity:
    """A value with its unit: Quantity(50, "mm"), or Quantity("50 mm").

    Args:
        value: A number, of an array a list of numbers; or a text with number and unit, "50 mm".
        unit: One that an FMU defines, or a known one: SI with prefixes, deg, degC, min, ... It is
            left out where the value is a text.

    Raises:
        InputError: It is no number with a unit.

    Example:
        >>> from grasp_cosim import Quantity, grasp_system
        >>> system = grasp_system().with_values({"plant.object_width": Quantity("50 mm")})
        >>> system.start("plant.object_width")
        0.05
    """

    value: Any
    unit: str = ""

    def __post_init__(self) -> None:
        value, unit = unwrapped(self.value), self.unit
        if not unit and isinstance(value, str) and (parts := _TEXT.fullmatch(value)):
            value, unit = float(parts[1]), parts[2]
        several = isinstance(value, list | tuple) or hasattr(value, "tolist")
        if not isinstance(unit, str) or not unit or not (is_number(value) or several):
            raise InputError(f"{self.value!r}: must be a number with its unit, like '50 mm'")
        object.__setattr__(self, "value", value)
        object.__setattr__(self, "unit", unit)

    def __str__(self) -> str:
        text = repr(self.value)
        return f"{text.removesuffix('.0')} {self.unit}"


def as_quantity(value: Any) -> Quantity | None:
    """What a Quantity, a pair like (50, "mm") or a text like "50 mm" says; None for all else."""
    if isinstance(value, Quantity):
        return value
    if isinstance(value, str):
        return Quantity(value) if _TEXT.fullmatch(value) else None
    is_pair = isinstance(value, tuple) and len(value) == 2 and isinstance(value[1], str)
    return Quantity(*value) if is_pair and not isinstance(value[0], str) else None


def is_nested(value: Any) -> bool:
    """True for a list of values, which a pair like (50, "mm") is not."""
    several = isinstance(value, Sequence) and not isinstance(value, str)
    return several and as_quantity(value) is None


def unwrapped(value: Any) -> Any:
    """A scalar of NumPy or the like, or an array without dimensions, as Python's own."""
    return value.item() if getattr(value, "ndim", None) == 0 else value
