"""A value for a variable, as a user gives it: checked, and in the unit of the variable."""

import math
import re
from collections.abc import Sequence
from contextlib import suppress
from typing import Any, Protocol, runtime_checkable

from ..base.checks import EXACT, integer, known, point_advice, real
from ..base.errors import InputError, choices
from ..base.quantity import Quantity, as_quantity, unwrapped
from ..base.si_units import known_unit, refusal
from .fmi_types import Value, limits
from .interface import Interface
from .units import conversion, converted
from .variables import Variable


@runtime_checkable
class Nested(Protocol):
    """An array like those of NumPy."""

    def tolist(self) -> Any:
        """The same as lists of lists."""


Given = Value | Quantity | tuple[Any, str] | Sequence["Given"] | Nested
"""A value for a variable, or those of an array as lists of lists or so.

A number is in the unit of its variable; one with a unit is a Quantity, (50, "mm") or "50 mm".
"""

_JOINED = re.compile(r"([-+]?[0-9.]+)([^0-9.,\s].*)")
"""A number and a unit without a space between them."""


def parse_value(
    interface: Interface, place: str, name: str, value: Any, text: bool = False
) -> Value:
    """The value for the variable `name`, checked against its type, its range and finiteness.

    `place` says where the value comes from. An item of an enumeration may be given by its name, a
    number with its unit. With `text`, a string may stand for a number or a boolean, as on a command
    line. InputError where the variable cannot be set, or not to that value.
    """
    if type(value) in PLAIN_TYPES:  # as a system has its values, which each copy looks at again
        variable = _settable_variable(interface, place, name, value)
        valid = _valid_value(variable, value, interface.version)
        if valid is None:
            raise _unfitting(variable, place, value)
        return valid
    value = unwrapped(value)
    variable = _settable_variable(interface, place, name, value)
    quoted = value
    if isinstance(value, str):
        value = variable.items.get(value, value)
    if variable.kind != "String" or not isinstance(value, str):
        quantity = as_quantity(value)
        if quantity is not None:
            value = in_own_unit(interface, f"{place}: {name}", name, quantity)
            quoted = str(quantity)
    valid = None
    if text or variable.kind == "String" or not isinstance(value, str):
        valid = _valid_value(variable, value, interface.version)
    if valid is None:
        raise _unfitting(variable, place, quoted)
    return valid


PLAIN_TYPES = (float, int, bool)
"""The types of Python's own numbers, which have no unit; subclasses, as of NumPy, are others."""


def _unfitting(variable: Variable, place: str, value: Any) -> InputError:
    """The error for a value that a variable cannot have."""
    advice = _advice(variable, value)
    return InputError(
        f"{place}: {variable.name} = {value!r}: must be {_expected(variable)}{advice}"
    )


def _settable_variable(interface: Interface, place: str, name: str, value: Any) -> Variable:
    """The variable of that name; InputError where there is none that a value can be given to."""
    variable = interface.by_name.get(name)
    if variable is None:
        settable = [v.name for v in interface.variables if v.settable]
        if name in interface.arrays:
            first = choices(interface.arrays[name].names[:1])
            raise InputError(f"{place}: {name} is an array; must be an element of it: {first}")
        lacking = f"{place}: {interface.short} has no input, parameter or initial value"
        known(lacking, name, settable, see=interface.listing)
        raise AssertionError(name)  # pragma: no cover
    if not variable.settable:
        raise InputError(
            f"{place}: {name} = {value!r}: {variable.unsettable}; must be an input, a "
            f"parameter, or a variable whose initial is exact or approx: {interface.listing}"
        )
    if not variable.supported:
        raise InputError(
            f"{place}: {name} = {value!r}: {name} is of type {variable.nature}, which cannot "
            "be set; must be left out, it keeps the start value of its FMU"
        )
    return variable


def in_own_unit(interface: Interface, place: str, name: str, quantity: Quantity) -> float:
    """The number of a quantity in the unit of a variable; InputError where it has no such unit.

    `place` begins the message.
    """
    variable = interface.by_name[name]
    entry = f"{place} = {quantity}"
    if variable.kind != "Real":
        raise InputError(f"{entry}: is of type {variable.nature}; must have no unit")
    if variable.unit is None:
        raise InputError(
            f"{entry}: {interface.short} declares no unit of it; must have none, or `units` must "
            "name one"
        )
    source = interface.units.get(quantity.unit) or known_unit(quantity.unit)
    target = interface.unit(variable)
    if quantity.unit == variable.unit:
        return float(quantity.value)
    if source is None:
        raise InputError(f"{entry}: {refusal(quantity.unit)}")
    if target is None or conversion(source, target) is None:
        raise InputError(
            f"{entry}: cannot be converted into {variable.unit}; must be in a unit of that quantity"
        )
    if variable.relative:
        source, target = source.without_offset, target.without_offset
    return converted(quantity.value, source, target)


def _advice(variable: Variable, value: Any) -> str:
    """What a text for a Real may have been meant to be; empty where nothing is likely."""
    if variable.kind != "Real":
        return ""
    match = _JOINED.fullmatch(value.strip()) if isinstance(value, str) else None
    if match and known_unit(match[2]):
        return f"; with its unit it is '{match[1]} {match[2]}'"
    return point_advice(value)


def _valid_value(variable: Variable, value: Value, version: str) -> Value | None:
    """The value in the type of the variable; None where it is none, or out of range."""
    if variable.kind == "String":
        return value if isinstance(value, str) else None
    if variable.kind == "Boolean":
        if isinstance(value, str):
            return {"true": True, "1": True, "false": False, "0": False}.get(value.lower())
        return value if isinstance(value, bool) else None
    number = _number(value, variable.kind == "Integer")
    if number is None:
        return None
    low, high = limits(variable.type, version)
    in_range = low <= number <= high and variable.low <= number <= variable.high
    is_item = not variable.items or number in variable.items.values()
    return number if in_range and is_item else None


def _number(value: Value, is_whole: bool) -> float | int | None:
    """A finite number; a whole one is exact where a float is not, 3.0 and "3.0" are whole, too.

    None for a whole one written as a float that cannot tell it from the next.
    """
    if isinstance(value, bool):
        return None
    if is_whole and not isinstance(value, float):
        with suppress(ValueError):
            return integer(value) if isinstance(value, str) else int(value)
    with suppress(ValueError, OverflowError):
        number = real(value) if isinstance(value, str) else float(value)
        if math.isfinite(number) and not is_whole:
            return number
        if number.is_integer() and abs(number) < EXACT:
            return int(number)
    return None


def _expected(variable: Variable) -> str:
    """What is valid for a variable, in words."""
    if variable.kind == "Boolean":
        return "true or false"
    if variable.kind == "String":
        return "a string"
    if variable.items:
        return f"one of {choices(variable.items)}"
    noun = "a whole number" if variable.kind == "Integer" else "a finite number"
    if variable.type not in ("Real", "Float64", "Integer"):
        noun = f"{noun} of type {variable.type}"
    unit = variable.unit if variable.unit != "1" else None
    if math.isinf(variable.low) and math.isinf(variable.high):
        return f"{noun} in {unit}" if unit else noun
    in_range = f"{noun} from {variable.low:g} to {variable.high:g}"
    return f"{in_range} {unit}" if unit else in_range
