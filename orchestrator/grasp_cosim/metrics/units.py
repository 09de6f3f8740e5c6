"""Metrics get values in SI base units, or a system is refused before it runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import NamedTuple

from si_units import Unit, known_unit

from ..base.errors import InputError, choices
from ..interface.units import Conversion
from ..system.parts import Port
from ..system.readings import Reading, in_other_units, naming, readings
from ..system.structure import Structure
from .metric import Metric, available, resolved


class InSi(NamedTuple):
    """How the outputs of a system are converted to SI base units, and what was taken for granted.

    conversions are by name of the signal; one that is not there is in SI, None stands for one that
    is in doubt. notes are lines for the log.
    """

    conversions: Mapping[str, Conversion | None]
    notes: tuple[str, ...]


class _Expected(NamedTuple):
    """The unit that a signal is to have or convert to, and for what."""

    unit: str
    purpose: str
    quantity: Unit


def in_si(system: Structure, metrics: Iterable[Metric]) -> InSi:
    """How `metrics` get the outputs of a system.

    InputError where a signal that one of those interprets which the system permits is of another
    quantity than it expects, or its unit is in doubt. Signals without any unit are taken to be in
    that of SI.
    """
    asked = tuple(metrics)
    read = system.once(readings)
    found = {str(port): r for port, r in read.items()}
    expected = {n: e for n, e in _expected(system, asked).items() if n in found}
    others = {str(port): u for port, u in system.once(in_other_units).items()} if expected else {}
    doubts = {n: d for n, e in expected.items() if (d := _doubt(n, found[n], expected, others))}
    if doubts:
        raise InputError(_refusal(system, doubts, found, expected))
    return InSi(
        {
            name: None if r.contested else r.conversion
            for name, r in found.items()
            if r.contested or r.conversion
        },
        (
            *(
                f"{name} has no unit, taken to be in {e.unit}"
                for name, e in expected.items()
                if found[name].unit is None
            ),
            *_taken_for_granted(system, asked, read, expected),
        ),
    )


def _taken_for_granted(
    system: Structure,
    metrics: Iterable[Metric],
    read: Mapping[Port, Reading],
    expected: Mapping[str, _Expected],
) -> Iterator[str]:
    """A line on what has no unit, if a metric does not say what it reads, and in which unit."""
    recorded = system.recorded
    names = [
        name
        for port, r in read.items()
        if (name := str(port)) not in expected
        and r.unit is None
        and not r.contested
        and recorded[port].kind == "Real"
    ]
    silent = next((m.name for m in metrics if not m.expects), None)
    if names and silent:
        yield f"{choices(names, 6)}: no unit, taken to be in SI, if {silent} reads it"


def _expected(system: Structure, metrics: Iterable[Metric]) -> dict[str, _Expected]:
    """What is expected of signals by their names, by the first metric that does."""
    recorded = {str(port) for port in system.recorded}
    found: dict[str, _Expected] = {}
    first_with: dict[int, Metric] = {}  # metrics of a group share what they need
    for metric in available(metrics, recorded, system.roles)[0]:
        first_with.setdefault(id(metric.needs), metric)
    for metric in first_with.values():
        purpose = f"the metrics of the {metric.group}" if metric.group else metric.name
        for name, unit in metric.expects.items():
            if unit is not None:
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


def _doubt(
    name: str, read: Reading, expected: Mapping[str, _Expected], others: Mapping[str, Unit]
) -> str:
    """Why a signal cannot be taken to be in the unit that is expected of it.

    `others` are units other than of SI by variable. One of these at the same component leaves a
    signal without a unit in doubt, if it is expected, too, or perhaps of the same quantity.
    """
    quantity = expected[name].quantity
    if read.doubt:
        return read.doubt
    if read.unit is not None:
        return "" if read.unit.measures(quantity) else f"is in {read.unit.name}"
    component = name.partition(".")[0]
    for other, unit in others.items():
        alike = other in expected or not unit.exponents or unit.measures(quantity)
        if other.partition(".")[0] == component and alike:
            return f"has no unit, while {other} is in {unit.name}"
    return ""


def _refusal(
    system: Structure,
    doubts: Mapping[str, str],
    found: Mapping[str, Reading],
    expected: Mapping[str, _Expected],
) -> str:
    """The line for the first doubt, with an entry for all of its component whose unit is open."""
    first = next(iter(doubts))
    component, expects = first.partition(".")[0], expected[first]
    open_ = [n for n in expected if n in doubts or found[n].unit is None]
    variables = [n.partition(".")[2] for n in open_ if n.partition(".")[0] == component]
    return (
        f"{system.name}: {first} {doubts[first]}; {expects.purpose} must know its unit, one like "
        f"{expects.unit}: {naming(component, variables)}"
    )
