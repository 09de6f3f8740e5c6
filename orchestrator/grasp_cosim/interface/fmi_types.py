"""Values, and the types that FMI 1.0 to 3.0 has for them."""

import math
from functools import cache
from typing import Literal, get_args

from ..base.checks import integer, real

Value = float | int | bool | str
"""A value of a variable."""

Kind = Literal["Real", "Integer", "Boolean", "String", "Binary", "Clock"]
VARIABLE_KINDS: tuple[str, ...] = get_args(Kind)
"""What the system makes of the types of FMI; whole numbers and enumerations are Integer."""

SUPPORTED_KINDS = ("Real", "Integer", "Boolean", "String")
"""The kinds a master can set, connect and record; it leaves the others out."""

_WHOLE_NUMBER_LIMITS = {
    **{f"Int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"UInt{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
}
"""The smallest and the largest value of each type of whole numbers."""

FMI_1_AND_2_TYPES = ("Real", "Integer", "Boolean", "String", "Enumeration")
FMI_3_TYPES = (
    "Float64",
    "Float32",
    *_WHOLE_NUMBER_LIMITS,
    "Boolean",
    "String",
    "Binary",
    "Enumeration",
    "Clock",
)
"""The types of variables in FMI 1.0 and 2.0, and in FMI 3.0."""


def limits(fmi_type: str, version: str) -> tuple[float, float]:
    """The smallest and largest value of a numeric FMI type in a version; exact for integers."""
    if fmi_type in ("Integer", "Enumeration"):
        return _WHOLE_NUMBER_LIMITS["Int64" if version.startswith("3") else "Int32"]
    if fmi_type == "Float32":
        largest = (2.0 - 2.0**-23) * 2.0**127
        return -largest, largest
    return _WHOLE_NUMBER_LIMITS.get(fmi_type, (-math.inf, math.inf))


@cache  # of few types, for each of a great many variables
def kind_of(fmi_type: str) -> Kind:
    """The kind that the system makes of an FMI type of any version."""
    if fmi_type.startswith(("Real", "Float")):
        return "Real"
    return fmi_type if fmi_type in VARIABLE_KINDS else "Integer"  # type: ignore[return-value]


def typed(fmi_type: str, text: str | None) -> Value | None:
    """The value in its type; the text itself where it is none, and for what JSON has no number."""
    kind = kind_of(fmi_type)
    if text is None or kind in ("String", "Binary", "Clock"):
        return text
    if kind == "Boolean":
        return {"true": True, "1": True, "false": False, "0": False}.get(text.strip(), text)
    try:
        number = real(text) if kind == "Real" else integer(text)
        return number if math.isfinite(number) else str(number)
    except (ValueError, OverflowError):
        return text


def as_float(value: Value | None, absent: float) -> float:
    """A declared number as a float; `absent` where there is none, or none that is a number."""
    try:
        return absent if value is None else float(value)
    except ValueError:
        return absent
