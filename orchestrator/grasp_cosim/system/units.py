"""Units as FMI and SSP define them: factor, offset and exponents of the SI base units."""

from dataclasses import dataclass

BASE = ("kg", "m", "s", "A", "K", "mol", "cd", "rad")


@dataclass(frozen=True, slots=True)
class Unit:
    """value in base units = factor * value + offset; exponents in the order of BASE."""

    name: str
    exponents: tuple[int, ...]
    factor: float = 1.0
    offset: float = 0.0
