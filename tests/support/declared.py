"""What the parameters of a block declare about themselves: names, units and valid ranges."""

from dataclasses import dataclass, is_dataclass
from math import inf, nan, nextafter
from typing import Any, get_type_hints


@dataclass(frozen=True)
class Parameter:
    """A parameter with a range; default is a number, or a pair with a number per finger."""

    name: str
    unit: str
    low: float
    high: float
    default: Any

    @property
    def valid(self):
        """The end of the message about another number."""
        in_unit = f" {self.unit}" if self.unit else ""
        return f"must be from {self.low:g} to {self.high:g}{in_unit}"

    def variants(self, value):
        """The default with value in place of the number, or of either number of the pair."""
        if isinstance(self.default, tuple):
            first, second = self.default
            return [(value, second), (first, value)]
        return [value]

    def invalid(self):
        """Numbers that are not in the range, each with the parameter values that contain it."""
        outside = (nextafter(self.low, -inf), nextafter(self.high, inf), nan, inf, -inf)
        return [(number, value) for number in outside for value in self.variants(number)]


def parameters(block):
    """The parameters of a block, or of a part of one, that are numbers; not those of its parts."""
    default = block()
    found = []
    for name, hint in get_type_hints(block, include_extras=True).items():
        if not is_dataclass(hint) and hint.__origin__ is not bool:
            (declared,) = hint.__metadata__
            found.append(
                Parameter(name, declared.unit, declared.low, declared.high, getattr(default, name))
            )
    return found
