"""Units in SSP: read from and written to an element Units, and converted into each other."""

from collections.abc import Iterable, Mapping
from typing import Any

from ..errors import InputError
from ..system.units import BASE, Unit
from .document import add, child, children


def read_units(parent: Any, prefix: str) -> Mapping[str, Unit]:
    """The units below an element of the format with that prefix."""
    return {
        unit.get("name"): _unit(unit) for unit in children(parent, f"{prefix}:Units", "ssc:Unit")
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
    """Whether they mean the same, whatever they are called."""
    return (a.exponents, a.factor, a.offset) == (b.exponents, b.factor, b.offset)


def conversion(place: str, source: Unit, target: Unit) -> tuple[float, float]:
    """(factor, offset) such that target value = factor * source value + offset.

    Exactly (1.0, 0.0) where they mean the same; InputError where they are of different kinds.
    """
    if same(source, target):
        return 1.0, 0.0
    if source.exponents != target.exponents:
        raise InputError(
            f"{place}: {source.name} cannot be converted to {target.name}; "
            "units must be of the same quantity, or suppressUnitConversion set"
        )
    return source.factor / target.factor, (source.offset - target.offset) / target.factor


def _unit(element: Any) -> Unit:
    base = child(element, "ssc:BaseUnit")
    return Unit(
        element.get("name"),
        tuple(int(base.get(name, "0")) for name in BASE),
        float(base.get("factor", "1")),
        float(base.get("offset", "0")),
    )
