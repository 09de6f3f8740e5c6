"""Units in SSP: read from and written to an element Units, and converted into each other."""

import math
from collections.abc import Iterable, Mapping
from typing import Any

from si_units import BASE, Unit

from ..base.errors import InputError
from ..interface.units import conversion
from .document import add, at, child, children


def read_units(file: str, parent: Any, prefix: str) -> Mapping[str, Unit]:
    """The units below an element of the format with that prefix; file is for error messages."""
    return {
        unit.get("name"): _unit(file, unit)
        for unit in children(parent, f"{prefix}:Units", "ssc:Unit")
    }


def write_units(parent: Any, prefix: str, units: Iterable[Unit]) -> None:
    """The reverse; nothing where there are none."""
    listed = list(units)
    if not listed:
        return
    element = add(parent, f"{prefix}:Units")
    for unit in listed:
        exponents = zip(BASE, unit.exponents, strict=True)
        base = {name: str(exponent) for name, exponent in exponents if exponent}
        if unit.factor != 1.0:
            base["factor"] = repr(unit.factor)
        if unit.offset != 0.0:
            base["offset"] = repr(unit.offset)
        add(add(element, "ssc:Unit", name=unit.name), "ssc:BaseUnit", **base)


def same(a: Unit, b: Unit) -> bool:
    """Return True if they mean the same, whatever they are called."""
    return (a.exponents, a.factor, a.offset) == (b.exponents, b.factor, b.offset)


def change(place: str, source: Unit, target: Unit) -> tuple[float, float]:
    """(factor, offset) such that target value = factor * source value + offset.

    Exactly (1.0, 0.0) where they mean the same; InputError where they are of different quantities.
    """
    found = conversion(source, target)
    if found is None:
        raise InputError(
            f"{place}: {source.name} cannot be converted to {target.name}; "
            "units must be of the same quantity, or suppressUnitConversion set"
        )
    return found


def _unit(file: str, element: Any) -> Unit:
    base = child(element, "ssc:BaseUnit")
    factor, offset = float(base.get("factor", "1")), float(base.get("offset", "0"))
    if not factor or not math.isfinite(factor) or not math.isfinite(offset):
        raise InputError(
            f"{at(file, base)}: unit {element.get('name')!r}: factor = {factor:g}, "
            f"offset = {offset:g}: must be finite, and the factor other than 0"
        )
    exponents = tuple(int(base.get(name, "0")) for name in BASE)
    return Unit(element.get("name"), exponents, factor, offset)
