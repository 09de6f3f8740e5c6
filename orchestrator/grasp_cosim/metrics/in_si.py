"""Metrics get values in SI base units, or a system is refused before it runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from si_units import Unit, known_unit

from ..base.errors import InputError, choices
from ..interface.units import Conversion
from ..system.structure import Structure, naming, output_units
from .metric import Metric, available, resolved


class InSi(NamedTuple):
    """How the outputs of a system are converted to SI base units, and what was taken for granted.

    conversions are by name of the signal; one that is not there is in SI. notes are lines for the
    log.
    """

    conversions: Mapping[str, Conversion]
    notes: tuple[str, ...]


class _Expected(NamedTuple):
    """The unit that a signal is to have or convert to, and for what."""

    unit: str
    purpose: str
    quantity: Unit


def in_si(system: Structure, metrics: Iterable[Metric]) -> InSi:
    """How `metrics` get the outputs of a system.

    InputError where a signal that one of those interprets which the system permits is of another
    quantity than it expects, or its unit is not defined. Signals without any unit are in SI.
    """
    asked, recorded = tuple(metrics), {str(port): v for port, v in system.recorded.items()}
    units = {str(port): unit for port, unit in system.once(output_units).items()}
    expected = _expected(system, asked)
    for name, expects in expected.items():
        declared, unit = recorded[name].unit, units.get(name)
        if (
            name in units
            and declared is not None
            and not (unit and unit.measures(expects.quantity))
        ):
            undefined = "" if unit else ", which its FMU does not define in SI units"
            component, _, variable = name.partition(".")
            raise InputError(
                f"{system.name}: {name} is in {unit.name if unit else repr(declared)}{undefined}; "
                f"{expects.purpose} must know its unit, one like {expects.unit}: "
                f"{naming(component, [variable])}"
            )
    free = any(not m.expects for m in asked)
    silent = [n for n, v in recorded.items() if v.kind == "Real" and v.unit is None]
    read = [name for name in silent if free or name in expected]
    others = {name: unit for name, unit in units.items() if unit and not unit.si}
    return InSi(
        {name: Conversion(unit.factor, unit.offset) for name, unit in others.items()},
        (f"{choices(read, 6)}: no unit, taken to be in SI",) if read else (),
    )


def _expected(system: Structure, metrics: Iterable[Metric]) -> dict[str, _Expected]:
    """What is expected of signals by their names, by the first metric that does."""
    recorded = {str(port) for port in system.recorded}
    found: dict[str, _Expected] = {}
    for metric in available(metrics, recorded, system.roles)[0]:
        purpose = f"the metrics of the {metric.group}" if metric.group else metric.name
        for name, unit in metric.expects.items():
            if unit is None:
                continue
            quantity = known_unit(unit)
            if quantity is None or not quantity.si:
                raise InputError(
                    f"{purpose}: needs {name} in {unit!r}; must be a unit of SI like 'm' or "
                    "'N.s/m', as signals come in these"
                )
            own = _Expected(unit, purpose, quantity)
            first = found.setdefault(resolved(name, system.roles), own)
            if not first.quantity.measures(quantity):
                raise InputError(
                    f"{purpose}: needs {name} in {unit}, {first.purpose} in {first.unit}; must "
                    "be of one quantity"
                )
    return found
