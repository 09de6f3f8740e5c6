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
from ..interface.interface import SETTABLE, Interface, Value, Variable, as_float
from ..interface.obstacles import KINDS
from ..interface.units import IDENTITY, Conversion
from ..system.changes import stated
from ..system.description import System
from ..system.parts import NANOSECONDS, Port, literal

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

    def own(ports: Iterable[Port]) -> frozenset[str]:
        return frozenset(p.variable for p in ports if p.component == name)

    return Use(
        name,
        own(port for c in system.connections for port in (c.source, c.target)),
        component.values,
        stated(system, name),
        own(port for event in system.events for port in event.set),
        (component.step_ns or system.step_ns) / NANOSECONDS,
    )


def interface_differences(
    original: Interface, candidate: Interface, use: Use, given: Mapping[str, Value]
) -> list[Difference]:
    """All differences of variables and capabilities, in the order of the original's variables.

    Both are under the system's names. given are values, in the candidate's unit, for variables
    that only the candidate has.
    """
    ours, theirs = original.by_name, candidate.by_name
    found: list[Difference] = []
    for variable in original.of(*COMPARED):
        if variable.name in theirs:
            change = original.conversion(variable.name, candidate)
            for severity, kind, text, was, now in _changed(
                variable, theirs[variable.name], use, change
            ):
                found.append(Difference(severity, kind, variable.name, text, was, now))
        else:
            found.append(_missing(variable, use, candidate))
    found += [_extra(v, use, given) for v in candidate.of(*COMPARED) if v.name not in ours]
    return found + list(capability_differences(original, candidate, use.step))


def _missing(old: Variable, use: Use, candidate: Interface) -> Difference:
    name, causality = old.name, old.causality
    if name in use.values and name not in use.stated:
        text = f"{causality} is set to {literal(use.values[name])} in the system, but missing"
        return Difference("warns", "missing", name, f"{text}: left out")
    if use.uses(name):
        alike = [v.name for v in candidate.of(causality)]
        how = "connected" if name in use.connected else "set" if name in use.values else "used"
        found = nearest(name, alike, candidate.listing)
        text = (
            f"{causality} is {how} in the system, but missing; if it has another name: "
            f"--set components.COMPONENT.rename.{name}=NAME; {found}"
        )
        return Difference("blocks", "missing", name, text)
    severity: Severity = "warns" if causality == "output" else "notes"
    return Difference(severity, "missing", name, f"{causality} is missing")


def _extra(new: Variable, use: Use, given: Mapping[str, Value]) -> Difference:
    name, causality = new.name, new.causality
    if causality == "input" and not new.supported:
        return Difference("notes", "extra", name, "new input that keeps its start value")
    if causality == "input" and name not in given:
        text = f"new input without a source; give it a value: --set '{use.component}.{name}=VALUE'"
        return Difference("blocks", "extra", name, text)
    return Difference("notes", "extra", name, f"new {causality}")


Found = tuple[Severity, Kind, str, Any, Any]
"""A Difference without the name of its variable."""


def _changed(old: Variable, new: Variable, use: Use, change: Conversion | None) -> Iterator[Found]:
    """Of a variable that both have; change is from the old unit to the new, None for no way."""
    serious: Severity = "blocks" if use.uses(old.name) else "warns"
    if old.kind != new.kind:
        yield serious, "type", f"is {new.type}, must be {old.type}", old.type, new.type
        return
    if old.shape != new.shape:
        was, now = list(old.shape), list(new.shape)
        yield serious, "type", f"has dimensions {now}, must have {was}", was, now
        return
    if new.type == "Float32" != old.type:
        yield "warns", "type", "is Float32: 7 digits instead of 16", old.type, new.type
    if old.causality != new.causality:
        yield _causality(old, new, use)
    elif old.variability != new.variability:
        yield _variability(old, new, use)
    if old.unit != new.unit:
        severity, text = _unit(old, new, use, change)
        yield severity, "unit", text, old.unit, new.unit
    if change is not None and old.kind in ("Real", "Integer"):
        yield from _range(old, new, use, change)
    if old.items and new.items and old.items != new.items:  # the system gives and takes numbers
        moved = [item for item in old.items if new.items.get(item) != old.items[item]]
        text = f"has other items; not as before: {choices(moved)}"
        yield serious if moved else "notes", "items", text, old.items, new.items
    if old.settable and new.settable and old.name not in use.values:
        first, start = old.start_value, new.start_value
        if not _same(first, start, change):
            units = [f" {v.unit}" if v.unit else "" for v in (new, old)]
            text = f"starts with {_shown(start)}{units[0]} instead of {_shown(first)}{units[1]}"
            yield "notes" if old.name in use.connected else "warns", "start", text, first, start


def _causality(old: Variable, new: Variable, use: Use) -> Found:
    name, was, now = old.name, old.causality, new.causality
    lonely = now == "input" and name not in use.connected and name not in use.values
    value_only = old.settable and new.settable and name not in use.connected
    severity: Severity = "blocks" if lonely or (use.uses(name) and not value_only) else "warns"
    more = f", or have a value: --set '{use.component}.{name}=VALUE'" if lonely else ""
    return severity, "causality", f"is {_a(now)}, must be {_a(was)}{more}", was, now


def _variability(old: Variable, new: Variable, use: Use) -> Found:
    was, now = old.variability, new.variability
    if old.name in use.tuned and now in ("fixed", "constant"):
        return "blocks", "variability", f"is {now}, but an event sets it; must be {was}", was, now
    severity: Severity = "notes" if old.settable and old.causality != "input" else "warns"
    return severity, "variability", f"is {now} instead of {was}", was, now


def _unit(
    old: Variable, new: Variable, use: Use, change: Conversion | None
) -> tuple[Severity, str]:
    name, was, now = old.name, old.unit, new.unit
    if change is None:
        serious: Severity = "blocks" if use.uses(name) else "warns"
        return serious, f"is in {now}, which cannot be converted to {was}"
    said = f"unit {now or 'not declared'} instead of {was or 'not declared'}"
    if was is None or now is None:
        return "notes" if {was, now} == {None, "1"} else "warns", f"{said}: taken as the same"
    if change == IDENTITY:
        return "notes", f"{said}, which is the same"
    if name in use.stated:
        place = "an event, a fault or the factor of a connection"
        return "blocks", f"is in {now}, but {place} is meant in {was}"
    if name in use.values:
        value = float(use.values[name])
        return "warns", f"{said}: {value:.9g} {was} becomes {change(value):.9g} {now}"
    return "warns", f"{said}: converted"


def _range(old: Variable, new: Variable, use: Use, change: Conversion) -> Iterator[Found]:
    """Of what the original takes or gives, that which the candidate does not declare valid."""
    unit, was, now = f" {new.unit}" if new.unit else "", change(old.low), change(old.high)
    declared = [old.minimum, old.maximum], [new.minimum, new.maximum]
    value = change(float(use.values[old.name])) if old.name in use.values else new.low
    valid = f"{new.low:g} to {new.high:g}{unit}"
    if not new.low <= value <= new.high:
        text = f"value {value:.9g}{unit} is set in the system; must be {valid}"
        yield "blocks", "range", text, *declared
    elif _less(was, new.low) or _less(new.high, now):
        text = f"takes {valid} instead of {was:g} to {now:g}{unit}"
        yield "notes" if old.causality == "output" else "warns", "range", text, *declared


def capability_differences(
    original: Interface, candidate: Interface, step: float
) -> Iterator[Difference]:
    """Version, kind and step capability; step in s is the one the component is to make."""
    versions = original.version, candidate.version
    if versions[0] != versions[1]:
        text = f"FMI {versions[1]} instead of {versions[0]}"
        yield Difference("notes", "capability", "fmiVersion", text, *versions)
    was, now = ([KINDS[kind] for kind in fmu.kinds] for fmu in (original, candidate))
    if not {"CoSimulation", "ModelExchange"} & set(candidate.kinds):
        text = f"is for {choices(now)}; must be for co-simulation or model exchange"
        yield Difference("blocks", "capability", "kind", text, was, now)
        return
    if "CoSimulation" in original.kinds and "CoSimulation" not in candidate.kinds:
        text = "is for model exchange, and is integrated by CVode here"
        yield Difference("notes", "capability", "kind", text, was, now)
    for flag, (severity, lost, text) in RESTRICTIONS.items():
        had, has = bool(original.capability(flag)), bool(candidate.capability(flag))
        if had != has and had == lost:
            yield Difference(severity, "capability", flag, text, had, has)
    flag = "canHandleVariableCommunicationStepSize"
    able = [original.capability(flag), candidate.capability(flag)]
    if "CoSimulation" in candidate.kinds and able[0] and not able[1]:
        default = candidate.experiment.get("step_size")
        same = isclose(as_float(default, step), step, rel_tol=SAME)
        text = f"steps of one size only: {step:g} s here, its default is {_shown(default)} s"
        yield Difference("notes" if same else "warns", "capability", flag, text, True, False)


def _less(a: float, b: float) -> bool:
    return a < b and not isclose(a, b, rel_tol=SAME)


def _same(was: Any, now: Any, change: Conversion | None) -> bool:
    """True if two start values are one, in the unit of each."""
    if isinstance(was, list) and isinstance(now, list):
        return len(was) == len(now) and all(map(_same, was, now, [change] * len(was)))
    if change is None or not is_number(was) or not is_number(now):
        return bool(was == now)
    return isclose(change(float(was)), float(now), rel_tol=SAME)


def _shown(value: Any) -> str:
    return "none" if value is None else f"{value:.9g}" if isinstance(value, float) else str(value)


def _a(noun: str) -> str:
    return f"an {noun}" if noun[0] in "aeio" else f"a {noun}"


def feedthrough_differences(
    original: Interface, candidate: Interface, use: Use
) -> Iterator[Difference]:
    """Of outputs that depend directly on other inputs than those of the original.

    What is connected may so be part of an algebraic loop, which is solved or refused in the run.
    """
    for new in candidate.of("output"):
        old = original.by_name.get(new.name)
        if old is None or old.causality != "output":
            continue
        before, now = _needs(old, original), _needs(new, candidate)
        added = [i for i in now if i not in before]
        gone = [i for i in before if i not in now]
        severity: Severity = "notes"
        if added:
            text = f"depends directly on {choices(added)}"
            if new.dependencies is None:
                text = f"may depend directly on {choices(added)}, as it declares no dependencies"
            if use.connected >= {new.name} and use.connected & set(added):
                severity, text = "warns", f"{text}: there may be an algebraic loop"
        elif gone and new.dependencies is not None:
            late = "a change there shows one step later"
            text = f"does not depend directly on {choices(gone)}: {late}"
        else:
            continue
        was, is_now = (None if v.dependencies is None else [*v.dependencies] for v in (old, new))
        yield Difference(severity, "dependency", new.name, text, was, is_now)


def _needs(variable: Variable, interface: Interface) -> Sequence[str]:
    """Inputs that an output depends on directly: all where that is not declared."""
    inputs = [v.name for v in interface.of("input")]
    needs = inputs if variable.dependencies is None else variable.dependencies
    return [name for name in needs if name in inputs]
