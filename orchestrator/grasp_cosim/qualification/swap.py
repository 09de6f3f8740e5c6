"""A candidate FMU in the place of another: what it declares otherwise, and the system with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..errors import InputError, choices
from ..inspection.inspection import inspect_fmu
from ..interface.conversion import IDENTITY, Conversion, conversion, units_of
from ..interface.interface import Value, check_rename
from ..system.description import System
from ..system.parts import Component, Isolation
from .feedthrough import Reports, feedthrough_differences
from .interface_difference import (
    SEVERITIES,
    Declared,
    Difference,
    family,
    interface_differences,
    renamed,
    use_of,
)


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
    reports = {c.name: renamed(inspect_fmu(c.fmu), c.rename) for c in system.components}
    ours = Declared(reports[component], units_of(place.fmu))
    theirs = _candidate(candidate, rename, ours)
    common, own = _split(component, values, ours, theirs)
    system = system.revised({}, common, ("--as", "--set"))
    use = use_of(system, component)
    differences = [
        *interface_differences(ours, theirs, use, own),
        *feedthrough_differences(system, component, reports, theirs.report, use),
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
        _nominals(reports),
    )


def _candidate(path: Path, rename: Mapping[str, str], ours: Declared) -> Declared:
    report = inspect_fmu(path)
    check_rename(rename, [v["name"] for v in report["variables"]], path, "--rename")
    for new, own in rename.items():
        if new not in ours.variables:
            raise InputError(
                f"--rename: {new!r} = {own!r}: the original has no variable {new!r}; "
                f"valid: {choices(ours.variables)}"
            )
    return Declared(renamed(report, rename), units_of(path))


def _split(
    component: str, values: Mapping[str, Value], ours: Declared, theirs: Declared
) -> tuple[dict[str, Value], dict[str, Value]]:
    """The values for the original's system, and by variable those for the candidate alone."""
    common: dict[str, Value] = {}
    own: dict[str, Value] = {}
    for key, value in values.items():
        name, _, variable = key.partition(".")
        known = variable in ours.variables or variable not in theirs.variables
        if name != component or known:
            common[key] = value
        else:
            own[variable] = value
    return common, own


def _converted(values: Mapping[str, Value], ours: Declared, theirs: Declared) -> dict[str, Value]:
    """The original's values in the candidate's units."""
    result: dict[str, Value] = {}
    for name, value in values.items():
        change = _between(name, ours, theirs)
        real = family(theirs.variables[name]["type"]) == "Real"
        result[name] = change(float(value)) if real and change not in (None, IDENTITY) else value
    return result


def _between(name: str, source: Declared, target: Declared) -> Conversion | None:
    units = source.variables[name]["unit"], target.variables[name]["unit"]
    return conversion(source.units, units[0], target.units, units[1])


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


def _back(component: str, ours: Declared, theirs: Declared) -> dict[str, Conversion | None]:
    return {
        f"{component}.{name}": _between(name, theirs, ours)
        for name, variable in ours.variables.items()
        if variable["causality"] == "output" and name in theirs.variables
    }


def _nominals(reports: Reports) -> dict[str, float | None]:
    return {
        f"{component}.{v['name']}": v["nominal"] if isinstance(v["nominal"], float) else None
        for component, report in reports.items()
        for v in report["variables"]
        if v["causality"] == "output"
    }
