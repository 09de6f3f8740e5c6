"""Metrics get values in SI base units, or a system is refused before it runs."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from ..errors import InputError
from ..interface.units import Conversion, known_unit
from ..system.readings import Reading, naming, readings
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


def in_si(system: Structure, metrics: Iterable[Metric]) -> InSi:
    """How `metrics` get the outputs of a system.

    InputError where a signal that one of those interprets which the system permits is of another
    quantity than it expects, or its unit is in doubt. Signals without any unit are taken to be in
    that of SI.
    """
    found = {str(port): r for port, r in readings(system).items()}
    expected = {n: e for n, e in _expected(system, metrics).items() if n in found}
    doubts = {n: d for n, e in expected.items() if (d := _doubt(n, found, expected, e))}
    if doubts:
        raise InputError(_refusal(system, doubts, found, expected))
    return InSi(
        {
            name: None if r.contested else r.conversion
            for name, r in found.items()
            if r.contested or r.conversion
        },
        tuple(
            f"{name} has no unit, taken to be in {e.unit}"
            for name, e in expected.items()
            if found[name].unit is None
        ),
    )


def _expected(system: Structure, metrics: Iterable[Metric]) -> dict[str, _Expected]:
    """What is expected of signals by their names, by the first metric that does."""
    outputs = [
        f"{c.name}.{v.name}"
        for c in system.components
        for v in c.interface.of("output")
        if v.supported and v.kind != "String"
    ]
    found: dict[str, _Expected] = {}
    for metric in available(metrics, outputs, system.roles)[0]:
        purpose = f"the metrics of the {metric.group}" if metric.group else metric.name
        for name, unit in metric.expects.items():
            if unit is not None:
                found.setdefault(resolved(name, system.roles), _Expected(unit, purpose))
    return found


def _doubt(
    name: str,
    found: Mapping[str, Reading],
    expected: Mapping[str, _Expected],
    wanted: _Expected,
) -> str:
    """Why a signal cannot be taken to be in the unit that is wanted of it."""
    unit, quantity = found[name].unit, known_unit(wanted.unit)
    if found[name].doubt:
        return found[name].doubt
    if unit is None:
        component = name.partition(".")[0]
        others = (n for n in expected if n.partition(".")[0] == component and found[n].conversion)
        other = next(others, None)
        return f"has no unit, while {other} is in {_name(found, other)}" if other else ""
    return "" if quantity and unit.measures(quantity) else f"is in {unit.name}"


def _name(found: Mapping[str, Reading], name: str) -> str:
    unit = found[name].unit
    return unit.name if unit else ""


def _refusal(
    system: Structure,
    doubts: Mapping[str, str],
    found: Mapping[str, Reading],
    expected: Mapping[str, _Expected],
) -> str:
    """The line for the first doubt, with an entry for all of its component whose unit is open."""
    first = next(iter(doubts))
    component, unit, purpose = first.partition(".")[0], *expected[first]
    open_ = [n for n in expected if n in doubts or found[n].unit is None]
    variables = [n.partition(".")[2] for n in open_ if n.partition(".")[0] == component]
    return (
        f"{system.name}: {first} {doubts[first]}; {purpose} must know its unit, one like {unit}: "
        f"{naming(component, variables)}"
    )
