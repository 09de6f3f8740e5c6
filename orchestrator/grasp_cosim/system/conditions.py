"""The condition of an event, a fault, a limit or a trigger as numbers, for who looks at them."""

import operator
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ..interface.fmi_types import Value
from ..interface.units import Conversion
from .connectors import read_at
from .parts import Condition, Port
from .structure import Structure

COMPARE: Mapping[str, Callable[[Any, Any], Any]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
"""The relations: of two numbers, or of each number of an array and one."""


class Compared(NamedTuple):
    """The signal of a component that a condition is about, what converts it, and the constant."""

    source: Port
    change: Conversion
    constant: float


def compared(system: Structure, condition: Condition) -> Compared:
    """What a condition of a system that was checked compares."""
    source, change = read_at(system, condition.port)
    return Compared(source, change, number_of(system, source, condition.value))


def number_of(system: Structure, port: Port, value: Value) -> float:
    """The number of a constant for a port, which may be the name of an item."""
    if not isinstance(value, str):
        return float(value)
    interface = system.component(port.component, str(port)).interface
    return interface.by_name[port.variable].items[value]
