"""A scalar variable of an FMU, as its slave and its description need it."""

from dataclasses import dataclass
from math import inf
from typing import Any, Literal, NamedTuple

from block_variables import check_value

Scalar = float | bool | int | str
Causality = Literal["input", "output", "parameter"]

TYPES: dict[type[Scalar], str] = {float: "Real", bool: "Boolean", int: "Integer", str: "String"}
"""What FMI calls a kind of variable."""


class Enumeration(NamedTuple):
    """A type of whole numbers that have names: the items, in the order they are shown in."""

    name: str
    items: tuple[tuple[str, int], ...]


@dataclass(frozen=True, slots=True)
class Variable:
    """A scalar variable; its value reference is its place among all.

    limits are what a host may set; dependencies, by name, what reaches an output without a step,
    and in initialisation mode. To a relative one the offset of its unit does not apply.
    """

    name: str
    kind: type[Scalar]
    causality: Causality
    unit: str = ""
    start: Scalar | None = None
    variability: str = "continuous"
    limits: tuple[float, float] | None = None
    description: str = ""
    nominal: float | None = None
    relative: bool = False
    dependencies: tuple[str, ...] = ()
    initial_dependencies: tuple[str, ...] = ()
    enumeration: Enumeration | None = None

    @property
    def type(self) -> str:
        """What FMI calls its type."""
        return "Enumeration" if self.enumeration else TYPES[self.kind]

    @property
    def in_unit(self) -> str:
        """Its unit after a number, with a space before it; empty where it has none."""
        return f" {self.unit}" if self.unit else ""

    def check(self, value: Any) -> None:
        """Raise ValueError where it may not have this value; the limits of a text are its bytes."""
        low, high = self.limits or (-inf, inf)
        if not isinstance(value, str):
            check_value(self.name, value, self.unit, low, high)
        elif not low <= len(value.encode()) <= high:
            valid = f"must have {low:g} to {high:g} bytes in UTF-8"
            raise ValueError(f"{self.name} = {value!r}: {valid}")
