"""What must hold of events and faults: they act on what exists, in a way that it permits."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from ..errors import InputError, choices
from .parts import FAULTS, NANOSECONDS, RANDOM, RELATIONS, Condition, Event, Fault, Port

if TYPE_CHECKING:
    from ..interface.interface import Value
    from .description import System


@dataclass(frozen=True, slots=True)
class Range:
    """Where a parameter of a fault may lie, and whether it must be given."""

    low: float = -math.inf
    high: float = math.inf
    above: bool = False
    """Whether low itself is too low."""
    needed: bool = True

    def holds(self, value: Any) -> bool:
        """Whether the value is a finite number in this range."""
        number = isinstance(value, float | int) and not isinstance(value, bool)
        return (
            number
            and math.isfinite(value)
            and self.low <= value <= self.high
            and not (self.above and value == self.low)
        )

    def __str__(self) -> str:
        if math.isfinite(self.high):
            return f"a number from {self.low:g} to {self.high:g}"
        if math.isfinite(self.low):
            return f"a finite number {'above' if self.above else 'of at least'} {self.low:g}"
        return "a finite number"


PARAMETERS: Mapping[str, Mapping[str, Range]] = MappingProxyType(
    {
        "stuck": {},  # its value is one that the input takes
        "dropout": {"probability": Range(0.0, 1.0)},
        "bias": {"value": Range()},
        "noise": {"standard_deviation": Range(0.0)},
        "delay": {"time": Range(0.0)},
        "saturation": {"low": Range(needed=False), "high": Range(needed=False)},
        "quantisation": {"step": Range(0.0, above=True)},
    }
)
"""By kind of fault, but for the value of a stuck one."""

DISCRETE = ("stuck", "dropout", "delay")
"""The kinds of faults that make sense for an Integer or a Boolean."""


def check_scenario(system: System) -> None:
    """InputError at the first event or fault that is not as it must be."""
    for i, event in enumerate(system.events):
        _check_event(system, event, f"{system.name}: events[{i}]")
    for i, fault in enumerate(system.faults):
        _check_fault(system, fault, f"{system.name}: faults[{i}]")


def _check_event(system: System, event: Event, place: str) -> None:
    if (event.at_ns is None) == (event.when is None):
        raise InputError(f"{place}: must have either at, a time in s, or when, a condition")
    if not event.set:
        raise InputError(f"{place}: set is empty; valid: {choices(_settable(system))}")
    if event.when is not None:
        _check_condition(system, event.when, f"{place}: when = '{event.when}'")
    for port, value in event.set.items():
        check_setting(system, port, value, f"{place}: set.{port}")


def _settable(system: System) -> list[Port]:
    """What an event may set: tunable parameters and inputs without a connection."""
    connected = {connection.target for connection in system.connections}
    return [
        port
        for component in system.components
        for v in component.interface.of("input", "parameter")
        if v.supported
        and (port := Port(component.name, v.name)) not in connected
        and (v.causality == "input" or v.variability == "tunable")
    ]


def check_setting(system: System, port: Port, value: Value, place: str) -> None:
    """InputError where the value cannot be set at the port during a run."""
    interface = system.component(port.component, place).interface
    for connection in system.connections:
        if connection.target == port:
            raise InputError(
                f"{place}: has a connection, from {connection.source}; put a fault of kind 'stuck' "
                "on it, with a value"
            )
    settable = _settable(system)
    if port not in settable:
        variable = interface.by_name.get(port.variable)
        found = f"is a {variable.variability} {variable.causality}" if variable else "not there"
        raise InputError(
            f"{place}: {found}; must be a tunable parameter or an input without a connection; "
            f"valid: {choices(settable)}"
        )
    interface.parse(place, port.variable, value)


def _check_condition(system: System, condition: Condition, place: str) -> None:
    interface = system.component(condition.port.component, place).interface
    valid = [v.name for v in interface.of("output") if v.supported and v.kind != "String"]
    if condition.port.variable not in valid:
        raise InputError(
            f"{place}: {condition.port.component} has no numeric output "
            f"{condition.port.variable!r}; valid: {choices(valid)}"
        )
    kind = interface.by_name[condition.port.variable].kind
    relations = {"Real": RELATIONS[:4], "Boolean": RELATIONS[4:]}.get(kind, RELATIONS)
    if condition.relation not in relations:
        raise InputError(
            f"{place}: {condition.port} is {kind}; must be compared with {choices(relations)}"
        )
    boolean = isinstance(condition.value, bool)
    if boolean != (kind == "Boolean") or not math.isfinite(condition.value):
        expected = "true or false" if kind == "Boolean" else "a finite number"
        raise InputError(f"{place}: {condition.port} is {kind}; must be compared with {expected}")


def _check_fault(system: System, fault: Fault, place: str) -> None:
    targets = [connection.target for connection in system.connections]
    if fault.target not in targets:
        raise InputError(
            f"{place}: connection = '{fault.target}': no connection ends there; "
            f"valid: {choices(targets)}"
        )
    if fault.kind not in FAULTS:
        raise InputError(f"{place}: kind = {fault.kind!r}: must be one of {choices(FAULTS)}")
    interface = system.component(fault.target.component, place).interface
    kind = interface.by_name[fault.target.variable].kind
    possible = {"Real": FAULTS, "Integer": DISCRETE, "Boolean": DISCRETE}.get(kind, ())
    if fault.kind not in possible:
        raise InputError(
            f"{place}: kind = {fault.kind!r}: {fault.target} is {kind}; "
            f"must be one of {choices(possible)}"
        )
    _check_parameters(fault, place)
    if "value" in fault.parameters and fault.kind == "stuck":
        interface.parse(f"{place}: value", fault.target.variable, fault.parameters["value"])
    _check_window(system, fault, place)
    if fault.when is not None:
        _check_condition(system, fault.when, f"{place}: when = '{fault.when}'")
    whole = isinstance(fault.seed, int) and not isinstance(fault.seed, bool)
    if not whole or fault.seed < 0:
        raise InputError(f"{place}: seed = {fault.seed!r}: must be a whole number, at least 0")


def _check_parameters(fault: Fault, place: str) -> None:
    ranges = PARAMETERS[fault.kind]
    known = ["value"] if fault.kind == "stuck" else list(ranges)
    for name in fault.parameters:
        if name not in known:
            others = ["connection", "kind", "from", "until", "when"]
            others += ["seed"] if fault.kind in RANDOM else []
            raise InputError(
                f"{place}: unknown entry {name!r}; valid for {fault.kind}: "
                f"{choices(known + others)}"
            )
    for name, valid in ranges.items():
        given = fault.parameters.get(name)
        if (valid.needed or name in fault.parameters) and not valid.holds(given):
            raise InputError(f"{place}: {name} = {given!r}: must be {valid}")
    if fault.kind == "saturation":
        low, high = (fault.parameters.get(name) for name in ("low", "high"))
        if low is None and high is None:
            raise InputError(f"{place}: a saturation must have low, high or both")
        if low is not None and high is not None and not low < high:
            raise InputError(f"{place}: high = {high!r}: must be above low = {low!r}")


def _check_window(system: System, fault: Fault, place: str) -> None:
    step = system.step_ns
    if fault.end_ns is not None and -(-fault.start_ns // step) >= -(-fault.end_ns // step):
        raise InputError(
            f"{place}: from {fault.start_ns / NANOSECONDS:.9g} s until "
            f"{fault.end_ns / NANOSECONDS:.9g} s: must hold a communication point, "
            f"a multiple of {step / NANOSECONDS:.9g} s"
        )
    if fault.kind == "delay":
        time = fault.parameters["time"]
        count = round(time * NANOSECONDS / step)
        if abs(count * step - time * NANOSECONDS) > 1e-12 * time * NANOSECONDS:
            raise InputError(
                f"{place}: time = {time:.9g} s: must be a whole number of steps of "
                f"{step / NANOSECONDS:.9g} s; could be {max(1, count) * step / NANOSECONDS:.9g} s"
            )
