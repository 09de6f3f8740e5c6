"""A candidate FMU in the place of another: what it declares otherwise, and the system with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError, choices
from ..interface.interface import Interface, Value
from ..interface.read import describe
from ..interface.units import IDENTITY, Conversion
from ..system.description import System
from ..system.parts import Component, Isolation
from .feedthrough import Interfaces, feedthrough_differences
from .interface_difference import SEVERITIES, Difference, interface_differences, use_of


@dataclass(frozen=True, slots=True)
class Swap:
    """The system with the original, and with the candidate unless a difference blocks that.

    differences are the worst first. back converts outputs of the candidate to the units of the
    original, by signal name, None where that cannot be. nominals are those of all signals.
    """

    system: System
    component: str
    candidate: Path
    differences: tuple[Difference, ...]
    swapped: System | None
    back: Mapping[str, Conversion | None]
    nominals: Mapping[str, float | None]

    @property
    def original(self) -> Path:
        """The FMU that the candidate is to replace."""
        return self.system.component(self.component, "swap").fmu


def prepare_swap(
    system: System,
    component: str,
    candidate: Path,
    rename: Mapping[str, str],
    values: Mapping[str, Value],
    isolation: Isolation,
) -> Swap:
    """The swap that qualify() describes; InputError where its arguments are wrong."""
    place = system.component(component, f"--as {component}")
    interfaces = {c.name: describe(c.fmu).renamed(c.rename) for c in system.components}
    ours = interfaces[component]
    theirs = _candidate(candidate, rename, ours)
    common, own = _split(component, values, ours, theirs)
    system = system.revised({}, common, ("--as", "--set"))
    use = use_of(system, component)
    differences = [
        *interface_differences(ours, theirs, use, own),
        *feedthrough_differences(system, component, interfaces, theirs, use),
    ]
    swapped = None
    if not any(d.severity == "blocks" for d in differences):
        converted = _converted(use.values, ours, theirs)
        place = replace(place, fmu=candidate, rename=rename, values=converted, isolation=isolation)
        outcome = _put_in(system, place, own)
        if isinstance(outcome, Difference):
            differences.append(outcome)
        else:
            swapped = outcome
    return Swap(
        system,
        component,
        candidate,
        tuple(sorted(differences, key=lambda d: SEVERITIES.index(d.severity))),
        swapped,
        _back(component, ours, theirs),
        _nominals(interfaces),
    )


def _candidate(path: Path, rename: Mapping[str, str], ours: Interface) -> Interface:
    theirs = describe(path).renamed(rename, "--rename")
    for new, own in rename.items():
        if new not in ours.by_name:
            raise InputError(
                f"--rename: {new!r} = {own!r}: the original has no variable {new!r}; "
                f"valid: {choices(ours.by_name)}"
            )
    return theirs


def _split(
    component: str, values: Mapping[str, Value], ours: Interface, theirs: Interface
) -> tuple[dict[str, Value], dict[str, Value]]:
    """The values for the original's system, and by variable those for the candidate alone."""
    common: dict[str, Value] = {}
    own: dict[str, Value] = {}
    for key, value in values.items():
        name, _, variable = key.partition(".")
        known = variable in ours.by_name or variable not in theirs.by_name
        if name != component or known:
            common[key] = value
        else:
            own[variable] = value
    return common, own


def _converted(values: Mapping[str, Value], ours: Interface, theirs: Interface) -> dict[str, Value]:
    """The original's values in the candidate's units."""
    result: dict[str, Value] = {}
    for name, value in values.items():
        change = ours.conversion(name, theirs)
        if change and change != IDENTITY and theirs.by_name[name].kind == "Real":
            value = change(float(value))
        result[name] = value
    return result


def _put_in(system: System, place: Component, own: Mapping[str, Value]) -> System | Difference:
    """The system with the component in its place; a difference where it refuses that."""
    try:
        interface = place.interface
    except InputError as error:
        return Difference("blocks", "system", place.name, str(error))
    parsed = {
        name: interface.parse(f"--set {place.name}.{name}", name, value, text=True)
        for name, value in own.items()
    }
    place = replace(place, values={**place.values, **parsed})
    components = [place if c.name == place.name else c for c in system.components]
    try:
        return replace(system, components=tuple(components))
    except InputError as error:
        return Difference("blocks", "system", place.name, str(error))


def _back(component: str, ours: Interface, theirs: Interface) -> dict[str, Conversion | None]:
    return {
        f"{component}.{v.name}": theirs.conversion(v.name, ours)
        for v in ours.of("output")
        if v.name in theirs.by_name
    }


def _nominals(interfaces: Interfaces) -> dict[str, float | None]:
    return {
        f"{component}.{v.name}": v.magnitude if isinstance(v.magnitude, float) else None
        for component, interface in interfaces.items()
        for v in interface.of("output")
    }
