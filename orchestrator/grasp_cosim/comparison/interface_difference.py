"""What a candidate declares otherwise than the FMU it is to replace, and what that means here.

A difference blocks where the closed loop could not run, or would not be the same experiment: a port
that is connected is missing, of another type or direction, or in a unit that cannot be converted.
It warns where results may differ, and is a note where nothing in this system depends on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import isclose
from typing import Any, Literal

from ..base.checks import is_number
from ..base.errors import choices, nearest
from ..interface.fmi_types import Value, as_float
from ..interface.interface import Interface
from ..interface.obstacles import FMU_KINDS
from ..interface.units import IDENTITY, Conversion
from ..interface.variables import PARAMETERS, SETTABLE, Variable
from ..system.changes import stated
from ..system.description import System
from ..system.parts import Port, literal
from ..system.times import in_seconds

Severity = Literal["blocks", "warns", "notes"]
SEVERITIES: tuple[Severity, ...] = ("blocks", "warns", "notes")
Kind = Literal[
    "missing", "extra", "type", "causality", "variability", "unit", "range", "items", "start",
    "dependency", "capability", "system",
]  # fmt: skip
COMPARED = (*SETTABLE, "output")
"""Other variables are an FMU's own business."""

RESTRICTIONS: Mapping[str, tuple[Severity, bool, str]] = {
    "canGetAndSetFMUstate": (
        "warns", True, "its state cannot be saved: a step that fails is not retried",
    ),
    "canSerializeFMUstate": ("notes", True, "its state cannot be written to a file"),
    "providesDirectionalDerivative": ("notes", True, "it gives no derivatives"),
    "needsExecutionTool": ("warns", False, "it runs only where its tool is installed"),
    "canBeInstantiatedOnlyOncePerProcess": ("warns", False, "one instance per process"),
    "mightReturnEarlyFromDoStep": ("warns", False, "it may end a step before its end"),
}  # fmt: skip
"""What a candidate lacks that the original can (True), or declares that the original does not."""

SAME = 1e-12
"""Relative; starts and limits this close are the same number, written or converted otherwise."""


@dataclass(frozen=True, slots=True)
class Difference:
    """One difference; variable is the system's name, or that of a capability.

    original and candidate are what the two declare, ready for JSON, each in its own unit.
    """

    severity: Severity
    kind: Kind
    variable: str
    text: str
    original: Any = None
    candidate: Any = None


@dataclass(frozen=True, slots=True)
class Use:
    """The use that a system makes of the variables of a component, by the system's names.

    values are what the original is given. stated are variables for which the system states other
    numbers in the unit of the original: in events, conditions, faults and factors of connections.
    tuned are those that events set.
    """

    component: str
    connected: frozenset[str]
    values: Mapping[str, Value]
    stated: frozenset[str]
    tuned: frozenset[str]
    step: float

    def uses(self, name: str) -> bool:
        """True if the system depends on the variable."""
        return name in self.connected or name in self.values or name in self.stated


def use_of(system: System, name: str) -> Use:
    """Return the use that the system makes of the component of that name."""
    component = system.component(name, system.name)

    def variables_of(ports: Iterable[Port]) -> frozenset[str]:
        return frozenset(p.variable for p in ports if p.component == name)

    return Use(
        name,
        variables_of(port for c in system.connections for port in (c.source, c.target)),
        component.values,
        stated(system, name),
        variables_of(
            p for event in system.events for port in event.set for p in system.elements(port)
        ),
        in_seconds(system.step_of(component)),
    )


def interface_differences(
    original: Interface, candidate: Interface, use: Use, values_of_new: Mapping[str, Value]
) -> list[Difference]:
    """All differences, in the order of the original's variables, then those of capabilities.

    Both are under the system's names. values_of_new are values, in the candidate's unit, for
    variables that only the candidate has.
    """
    differences: list[Difference] = []
    for old in original.of(*COMPARED):
        if new := candidate.by_name.get(old.name):
            differences += _changed(old, new, use, original.conversion(old.name, candidate))
        else:
            differences.append(_missing(old, use, candidate))
    old_by_name = original.by_name
    differences += [
        _extra(v, use, values_of_new) for v in candidate.of(*COMPARED) if v.name not in old_by_name
    ]
    differences += capability_differences(original, candidate, use.step)
    for new in candidate.of("output"):
        if (old_one := old_by_name.get(new.name)) and old_one.causality == "output":
            differences += _feedthrough(old_one, new, original, candidate, use)
    return differences


def _missing(old: Variable, use: Use, candidate: Interface) -> Difference:
    name, causality = old.name, old.causality
    severity: Severity = "warns" if causality == "output" else "notes"
    text = f"{causality} is missing"
    if name in use.values and name not in use.stated:
        value = f"{literal(use.values[name])} {old.unit or ''}".rstrip()
        severity = "warns"
        text = f"{causality} is set to {value} in the system, but missing: left out"
    elif use.uses(name):
        severity = "blocks"
        how = "connected" if name in use.connected else "set" if name in use.values else "used"
        alike = nearest(name, [v.name for v in candidate.of(causality)], candidate.listing)
        text = (
            f"{causality} is {how} in the system, but missing; if it has another name: "
            f"--set components.{use.component}.rename.{name}=NAME; {alike}"
        )
    return Difference(severity, "missing", name, text)


def _extra(new: Variable, use: Use, values_of_new: Mapping[str, Value]) -> Difference:
    name, text = new.name, f"new {new.causality}"
    if new.causality == "input" and not new.supported:
        text = "new input that keeps its start value"
    elif new.causality == "input" and name not in values_of_new:
        text = f"new input without a source; give it a value: --set '{use.component}.{name}=VALUE'"
        return Difference("blocks", "extra", name, text)
    return Difference("notes", "extra", name, text)


def _changed(
    old: Variable, new: Variable, use: Use, change: Conversion | None
) -> Iterator[Difference]:
    """Of a variable that both have; change is from the old unit to the new, None for no way."""
    name = old.name
    serious: Severity = "blocks" if use.uses(name) else "warns"
    if (old.kind, old.shape) != (new.kind, new.shape):
        old_type, new_type = (
            f"{v.type}{f' of {list(v.shape)}' if v.shape else ''}" for v in (old, new)
        )
        yield Difference(
            serious, "type", name, f"is {new_type}, must be {old_type}", old_type, new_type
        )
        return
    if new.type == "Float32" != old.type:
        text = "is Float32: 7 digits instead of 16"
        yield Difference("warns", "type", name, text, old.type, new.type)
    if old.causality != new.causality:
        severity, text = _causality(old, new, use)
        yield Difference(severity, "causality", name, text, old.causality, new.causality)
    elif old.variability != new.variability:
        severity = "notes" if old.causality in PARAMETERS else "warns"
        text = f"is {new.variability} instead of {old.variability}"
        if name in use.tuned and new.variability in ("fixed", "constant"):
            severity = "blocks"
            text = f"is {new.variability}, but an event sets it; must be {old.variability}"
        yield Difference(severity, "variability", name, text, old.variability, new.variability)
    if old.unit != new.unit:
        severity, text = _unit(old, new, use, change)
        yield Difference(severity, "unit", name, text, old.unit, new.unit)
    if change is not None and old.kind in ("Real", "Integer"):
        yield from _range(old, new, use, change)
    if old.items and new.items and old.items != new.items:  # the system gives and takes numbers
        moved = [item for item in old.items if new.items.get(item) != old.items[item]]
        text = f"has other items; not as before: {choices(moved)}"
        severity = serious if moved else "notes"
        yield Difference(severity, "items", name, text, old.items, new.items)
    first, start = old.start_value, new.start_value
    both = old.settable and new.settable and name not in use.values
    if both and not _same(first, start, change):
        units = [f" {v.unit}" if v.unit else "" for v in (new, old)]
        text = f"starts with {_in_words(start)}{units[0]} instead of {_in_words(first)}{units[1]}"
        severity = "notes" if name in use.connected else "warns"
        yield Difference(severity, "start", name, text, first, start)


def _causality(old: Variable, new: Variable, use: Use) -> tuple[Severity, str]:
    name, old_causality, new_causality = old.name, old.causality, new.causality
    lonely = new_causality == "input" and name not in use.connected and name not in use.values
    value_only = old.settable and new.settable and name not in use.connected
    severity: Severity = "blocks" if lonely or (use.uses(name) and not value_only) else "warns"
    remedy = f", or have a value: --set '{use.component}.{name}=VALUE'" if lonely else ""
    return severity, f"is {_a(new_causality)}, must be {_a(old_causality)}{remedy}"


def _unit(
    old: Variable, new: Variable, use: Use, change: Conversion | None
) -> tuple[Severity, str]:
    name, old_unit, new_unit = old.name, old.unit, new.unit
    if change is None:
        serious: Severity = "blocks" if use.uses(name) else "warns"
        return serious, f"is in {new_unit}, which cannot be converted to {old_unit}"
    text = f"unit {new_unit or 'not declared'} instead of {old_unit or 'not declared'}"
    if old_unit is None or new_unit is None:
        return "notes" if {old_unit, new_unit} == {
            None,
            "1",
        } else "warns", f"{text}: taken as the same"
    if change == IDENTITY:
        return "notes", f"{text}, which is the same"
    if name in use.stated:
        place = "an event, a fault or the factor of a connection"
        return "blocks", f"is in {new_unit}, but {place} is meant in {old_unit}"
    if name in use.values:
        value = float(use.values[name])
        return "warns", f"{text}: {value:.9g} {old_unit} becomes {change(value):.9g} {new_unit}"
    return "warns", f"{text}: converted"


def _range(old: Variable, new: Variable, use: Use, change: Conversion) -> Iterator[Difference]:
    """Of what the original takes or gives, that which the candidate does not declare valid."""
    unit, old_low, old_high = f" {new.unit}" if new.unit else "", change(old.low), change(old.high)
    declared = [old.minimum, old.maximum], [new.minimum, new.maximum]
    value = change(float(use.values[old.name])) if old.name in use.values else new.low
    valid = f"{new.low:g} to {new.high:g}{unit}"
    if not new.low <= value <= new.high:
        text = f"value {value:.9g}{unit} is set in the system; must be {valid}"
        yield Difference("blocks", "range", old.name, text, *declared)
    elif _less(old_low, new.low) or _less(new.high, old_high):
        text = f"takes {valid} instead of {old_low:g} to {old_high:g}{unit}"
        severity: Severity = "notes" if old.causality == "output" else "warns"
        yield Difference(severity, "range", old.name, text, *declared)


def capability_differences(
    original: Interface, candidate: Interface, step: float
) -> Iterator[Difference]:
    """Version, kind and step capability; step in s is the one the component is to make."""
    versions = original.version, candidate.version
    if versions[0] != versions[1]:
        text = f"FMI {versions[1]} instead of {versions[0]}"
        yield Difference("notes", "capability", "fmiVersion", text, *versions)
    old_kinds, new_kinds = (
        [FMU_KINDS[kind] for kind in fmu.kinds] for fmu in (original, candidate)
    )
    if not {"CoSimulation", "ModelExchange"} & set(candidate.kinds):
        text = f"is for {choices(new_kinds)}; must be for co-simulation or model exchange"
        yield Difference("blocks", "capability", "kind", text, old_kinds, new_kinds)
        return
    if "CoSimulation" in original.kinds and "CoSimulation" not in candidate.kinds:
        text = "is for model exchange, and is integrated by CVode here"
        yield Difference("notes", "capability", "kind", text, old_kinds, new_kinds)
    for flag, (severity, lost, text) in RESTRICTIONS.items():
        had, has = bool(original.capability(flag)), bool(candidate.capability(flag))
        if had != has and had == lost:
            yield Difference(severity, "capability", flag, text, had, has)
    flag = "canHandleVariableCommunicationStepSize"
    able = [original.capability(flag), candidate.capability(flag)]
    if "CoSimulation" in candidate.kinds and able[0] and not able[1]:
        default = candidate.experiment.get("step_size")
        same = isclose(as_float(default, step), step, rel_tol=SAME)
        text = f"steps of one size only: {step:g} s here, its default is {_in_words(default)} s"
        yield Difference("notes" if same else "warns", "capability", flag, text, True, False)


def _less(a: float, b: float) -> bool:
    return a < b and not isclose(a, b, rel_tol=SAME)


def _same(old_value: Any, new_value: Any, change: Conversion | None) -> bool:
    if isinstance(old_value, list) and isinstance(new_value, list):
        return len(old_value) == len(new_value) and all(
            map(_same, old_value, new_value, [change] * len(old_value))
        )
    if change is None or not is_number(old_value) or not is_number(new_value):
        return bool(old_value == new_value)
    return isclose(change(float(old_value)), float(new_value), rel_tol=SAME)


def _in_words(value: Any) -> str:
    return "none" if value is None else f"{value:.9g}" if isinstance(value, float) else str(value)


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeio" else f"a {noun}"


def _feedthrough(
    old: Variable, new: Variable, original: Interface, candidate: Interface, use: Use
) -> Iterator[Difference]:
    """An output that depends directly on other inputs than that of the original.

    What is connected may so be part of an algebraic loop, which is solved or refused in the run.
    """
    old_needs, new_needs = _needs(old, original), _needs(new, candidate)
    added, gone = (
        [i for i in a if i not in b] for a, b in ((new_needs, old_needs), (old_needs, new_needs))
    )
    severity: Severity = "notes"
    if added:
        text = f"depends directly on {choices(added)}"
        if new.dependencies is None:
            text = f"may depend directly on {choices(added)}, as it declares no dependencies"
        if new.name in use.connected and use.connected & set(added):
            severity, text = "warns", f"{text}: there may be an algebraic loop"
    elif gone and new.dependencies is not None:
        late = "a change there shows one step later"
        text = f"does not depend directly on {choices(gone)}: {late}"
    else:
        return
    declared = (None if v.dependencies is None else [*v.dependencies] for v in (old, new))
    yield Difference(severity, "dependency", new.name, text, *declared)


def _needs(variable: Variable, interface: Interface) -> Sequence[str]:
    """Inputs that an output depends on directly: all where that is not declared."""
    inputs = [v.name for v in interface.of("input")]
    needs = inputs if variable.dependencies is None else variable.dependencies
    return [name for name in needs if name in inputs]
