"""Metrics get values in SI base units, or a system is refused before it runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from ..base.errors import InputError, choices
from ..base.si_units import known_unit
from ..interface.units import Conversion
from ..interface.variables import Variable
from ..system.connectors import Tap, taps
from ..system.structure import Structure, naming, signal_units
from .metric import Metric, available, resolved


class InSi(NamedTuple):
    """How the signals of a system are converted to SI base units, and what was taken for granted.

    conversions are by name of the signal; one that is not there is in SI. notes are lines for the
    log.
    """

    conversions: Mapping[str, Conversion]
    notes: tuple[str, ...]


def in_si(system: Structure, metrics: Iterable[Metric]) -> InSi:
    """How `metrics` get the signals of a system.

    InputError if a signal that one of the permitted metrics interprets is of another quantity than
    expected, or its unit is not defined. Signals without any unit are in SI.
    """
    chosen, of_system = tuple(metrics), system.once(taps)
    observed: dict[str, Variable | Tap] = {str(port): v for port, v in system.observed.items()}
    observed |= of_system
    units = {str(port): unit for port, unit in system.once(signal_units).items()}
    numbers = (name for name, tap in of_system.items() if tap.kind in ("Real", "Integer"))
    units |= {name: of_system[name].quantity for name in numbers}
    expected = set()
    for metric in available(chosen, observed, system.roles)[0]:
        purpose = f"the metrics of the {metric.group}" if metric.group else metric.name
        for need, expected_unit in metric.expects.items():
            name = resolved(need, system.roles)
            if expected_unit is None or name not in observed:
                continue
            quantity = known_unit(expected_unit)
            if quantity is None or not quantity.si:
                raise InputError(
                    f"{purpose}: needs {need} in {expected_unit!r}; must be a unit of SI like 'm' "
                    "or 'N.s/m', as signals come in these"
                )
            expected.add(name)
            declared, unit = observed[name].unit, units.get(name)
            is_of_quantity = declared is None or (unit and unit.measures(quantity))
            if name in units and not is_of_quantity:
                undefined = "" if unit else ", which its FMU does not define in SI units"
                component, _, variable = name.partition(".")
                remedy = naming(component, variable)
                if name in of_system:
                    remedy = "its connector in the archive must name it"
                raise InputError(
                    f"{system.name}: {name} is in {unit.name if unit else repr(declared)}"
                    f"{undefined}; {purpose} must know its unit, one like {expected_unit}: "
                    f"{remedy}"
                )
    reads_any = any(not m.expects for m in chosen)
    without_unit = [n for n, v in observed.items() if v.kind == "Real" and v.unit is None]
    assumed_si = [name for name in without_unit if reads_any or name in expected]
    not_si = {name: unit for name, unit in units.items() if unit and not unit.si}
    return InSi(
        {name: Conversion(unit.factor, unit.offset) for name, unit in not_si.items()},
        (f"{choices(assumed_si, 6)}: no unit, taken to be in SI",) if assumed_si else (),
    )
