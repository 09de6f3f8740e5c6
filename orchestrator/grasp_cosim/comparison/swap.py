"""A candidate FMU in the place of another: what it declares otherwise, and the system with it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import isclose
from pathlib import Path

from ..base.checks import known
from ..base.errors import InputError
from ..interface.expansion import values_of
from ..interface.interface import Interface, Value
from ..interface.read import describe
from ..interface.units import Conversion, conversion
from ..system.conversions import between, output_units
from ..system.description import System
from ..system.parts import Component, Isolation
from ..system.swap import Replacement, converted, replaced
from ..system.validity import transforms
from .feedthrough import feedthrough_differences
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
    candidate: Path | Component,
    rename: Mapping[str, str],
    values: Mapping[str, Value],
    isolation: Isolation,
    units: Mapping[str, str] | None = None,
) -> Swap:
    """The swap that qualify() describes; InputError where its arguments are wrong."""
    place = system.component(component, f"--as {component}")
    interfaces = {
        c.name: c.sized(describe(c.fmu)).renamed(c.rename).in_units(c.units)
        for c in system.components
    }
    ours = interfaces[component]
    was = candidate if isinstance(candidate, Component) else replace(place, values={})
    fmu = was.fmu if isinstance(candidate, Component) else candidate
    now = replaced(was, Replacement(fmu, rename, units or {}), "")
    theirs = now.sized(describe(fmu)).renamed(now.rename, "rename")
    theirs = theirs.in_units(now.units, "units")
    _check_renamed(rename, ours, theirs)
    names = (*theirs.by_name, *(n for n in theirs.arrays if n not in ours.arrays))
    extra = {f"{component}.{name}": name for name in names if name not in ours.by_name}
    own = {n: v for n, v in now.values.items() if n not in ours.by_name}
    own |= {extra[key]: value for key, value in values.items() if key in extra}
    common = {key: value for key, value in values.items() if key not in extra}
    system = system.with_settings(common, "--set ".__add__)
    use = use_of(system, component)
    differences = [
        *interface_differences(ours, theirs, use, own),
        *feedthrough_differences(system, component, interfaces, theirs, use),
    ]
    swapped = None
    if not any(d.severity == "blocks" for d in differences):
        given = {n: v for n, v in use.values.items() if n in theirs.by_name}
        given = converted(given, ours, theirs) | dict(now.values)
        for name, value in own.items():
            text = f"--set {component}.{name}"
            given |= values_of(theirs, text, name, value, text=True)
        place = replace(now, name=component, values=given, isolation=isolation)
        try:
            swapped = _with(system, place)
        except InputError as error:
            differences.append(Difference("blocks", "system", component, str(error)))
    differences.sort(key=lambda d: SEVERITIES.index(d.severity))
    back = _back(component, ours, theirs)
    back |= _between(swapped, system, component) if swapped else {}
    nominals = _nominals(interfaces)
    return Swap(system, component, fmu, tuple(differences), swapped, back, nominals)


def _with(system: System, place: Component) -> System:
    """The system with a component in the place of that of its name; InputError as of a system."""
    components = tuple(place if c.name == place.name else c for c in system.components)
    return replace(system, components=components)


def _back(component: str, ours: Interface, theirs: Interface) -> dict[str, Conversion | None]:
    """The conversions of outputs that both declare to the units of the original."""
    return {
        f"{component}.{v.name}": theirs.conversion(v.name, ours)
        for v in ours.of("output")
        if v.name in theirs.by_name
    }


def component_of(found: System, name: str, system: System) -> Component:
    """The component of that name in another system, as a candidate for the one in `system`.

    It runs on the connections of `system`. InputError where one of its own passes on other values
    than the same one does there, as by a factor: what the component puts out would be misread.
    """
    component = found.component(name, found.name)
    connected = {port for c in system.connections for port in (c.source, c.target)}
    there = {(c.source, c.target): c for c in system.connections}
    passed = transforms(found)
    for c in found.connections:
        if not any(port.component == name and port in connected for port in (c.source, c.target)):
            continue
        place, same = f"{found.name}: {c}", there.get((c.source, c.target))
        if same and (same.factor, same.offset) != (None, None):
            factor, offset = same.factor or 1.0, same.offset or 0.0
        else:
            factor, offset = between(found, place, c.source, c.target)
        own = passed[c.target]
        if not (isclose(own[0], factor) and isclose(own[1], offset)):
            raise InputError(
                f"{place}: has factor = {own[0]:g}, offset = {own[1]:g}, which the connections of "
                f"{system.name}, on which the candidate runs, do not have; must be units of its "
                f"component instead, in [components.{name}] or --set"
            )
    return component


def _check_renamed(rename: Mapping[str, str], ours: Interface, theirs: Interface) -> None:
    """InputError where the candidate's variables get names that the original does not have."""
    for new, name in rename.items():
        for called in theirs.arrays[new].names if new in theirs.arrays else (new,):
            entry = f"rename: {new!r} = {name!r}"
            known(f"{entry}: the original has no variable", called, ours.by_name, see=ours.listing)


def _nominals(interfaces: Mapping[str, Interface]) -> dict[str, float | None]:
    """The nominal values of all outputs, by signal name."""
    return {
        f"{name}.{v.name}": v.magnitude if isinstance(v.magnitude, float) else None
        for name, interface in interfaces.items()
        for v in interface.of("output")
    }


def _between(source: System, target: System, name: str) -> dict[str, Conversion | None]:
    """The conversions of the outputs of a component whose units both systems tell."""
    ends = output_units(source), output_units(target)
    return {
        str(port): conversion(start, end)
        for port in ends[0].keys() & ends[1].keys()
        if port.component == name and (start := ends[0][port]) and (end := ends[1][port])
    }
