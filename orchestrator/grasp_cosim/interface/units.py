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


def conversion(source: Unit, target: Unit) -> tuple[float, float] | None:
    """Factor and offset so that target value = factor * source value + offset.

    None where the dimensions differ.
    """
    if source.exponents != target.exponents:
        return None
    return source.factor / target.factor, (source.offset - target.offset) / target.factor
