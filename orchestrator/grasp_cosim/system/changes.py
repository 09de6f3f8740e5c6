"""A component with other values, or with another FMU, in whose units its values then are."""

from __future__ import annotations

import logging
import math
from collections.abc import Collection, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from shlex import quote

from ..base.errors import InputError, choices, nearest
from ..interface.expansion import parse_values
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.read import describe
from ..interface.renaming import renamed
from ..interface.units import IDENTITY
from ..interface.variables import Variable
from .overrides import Override
from .parts import Component, literal
from .structure import Structure, unit_of

LOGGER = logging.getLogger(__name__)


def with_values(
    component: Component, overrides: Mapping[str, Override], from_text: bool = False
) -> Component:
    """The component with more values, by variable or array; InputError where one does not fit.

    Structural parameters come first: they decide sizes. A value of a whole array takes the place of
    all that its elements had. With from_text a text may stand for a number, as on a command line.
    """
    old = component.interface
    sizes, others = dict[str, Override](), dict[str, Override]()
    for name, override in overrides.items():
        variable = old.by_name.get(name)
        is_size = variable is not None and variable.causality == "structuralParameter"
        (sizes if is_size else others)[name] = override
    for name, override in sizes.items():
        size = _parsed(component, name, override, from_text)
        component = replace(component, values={**component.values, **size})
    remaining = _without_arrays(component.values, old, overrides)
    _check_remaining(component, remaining, old, sizes)
    values: dict[str, Value] = {}
    labels: dict[str, str] = {}
    for name, override in others.items():
        parsed = _parsed(component, name, override, from_text)
        values |= parsed
        labels |= {element: override.label_of(f"{component.name}.{element}") for element in parsed}
    new = component.interface.by_main_names(values, labels.__getitem__)
    return replace(component, values={**remaining, **new})


def _parsed(
    component: Component, name: str, override: Override, from_text: bool
) -> dict[str, Value]:
    """The typed values of the variables that an override stands for."""
    label = override.label_of(f"{component.name}.{name}")
    return parse_values(component.interface, label, name, override.value, from_text)


def _without_arrays(
    values: Mapping[str, Value], interface: Interface, overrides: Mapping[str, Override]
) -> dict[str, Value]:
    """Values without those of elements of arrays that are overridden as a whole."""
    names = map(interface.main_name, overrides)
    arrays = [interface.arrays[name] for name in names if name in interface.arrays]
    overridden = {element for array in arrays for element in array.names}
    return {name: value for name, value in values.items() if name not in overridden}


def _check_remaining(
    component: Component,
    values: Mapping[str, Value],
    old: Interface,
    sizes: Mapping[str, Override],
) -> None:
    """InputError where another size leaves a value without its element of an array."""
    for element in values:
        if element not in old.by_name or element in component.interface.by_name:
            continue
        name, size = next(iter(sizes.items()))
        label = size.label_of(f"{component.name}.{name}")
        array = next(name for name, array in old.arrays.items() if element in array.names)
        raise InputError(
            f"{label} = {size.value!r}: there is then no {element}, which has a value; {array} "
            "must be given anew, too"
        )


def replaced(
    was: Component, fmu: Path, rename: Mapping[str, str], units: Mapping[str, str], place: str
) -> Component:
    """The component with another FMU, without a look at its values; place begins its errors.

    rename and units are as a Component has them. Of those that it has, those stay that fit: an
    FMU's name that the new one has, too; a unit where the FMUs declare the same one, or the new FMU
    none.
    """
    before = was.code.interface if was.code else describe(was.fmu)
    ours, theirs = renamed(was.sized(before), was.rename), was.sized(describe(fmu))
    names = {
        name: own
        for name, own in was.rename.items()
        if theirs.sample(own) and name not in rename and own not in rename.values()
    } | dict(rename)
    while taken := (names.keys() & theirs.by_name) - {*rename, *names.values()}:
        names = {name: own for name, own in names.items() if name not in taken}
    found = renamed(theirs, names, f"{place}rename")
    kept = {
        name: unit
        for name, unit in was.units.items()
        if (now := found.sample(name)) and now.unit in (None, getattr(ours.sample(name), "unit", 0))
    }
    alike = (ours.exchange is None) == (theirs.exchange is None)
    return replace(
        was,
        fmu=fmu,
        native=None,
        code=None,
        rename=names,
        units={**kept, **units},
        solver=was.solver if alike else None,
    )


def with_old_values(
    system: Structure, was: Component, now: Component, anew: Collection[str], place: str
) -> tuple[Component, list[str]]:
    """A component with another FMU with its former values, in the units of that; and notes.

    `anew` are variables, or arrays, that get another value. A value of a variable that the new FMU
    lacks is left out, which a note says, as does one where the new FMU has other start values.
    InputError where a value, or another number that the system states, has no meaning in the new
    unit.
    """
    before, after = was.interface, now.interface
    arrays = before.arrays
    anew = {v for name in anew for v in (arrays[name].names if name in arrays else (name,))}
    _check_ends(system, was, after, place)
    values = {
        name: value
        for name, value in was.values.items()
        if name in after.by_name and after.by_name[name].settable
    }
    kept = {name: value for name, value in values.items() if name not in anew}
    for name in [*kept, *sorted(stated(system, was.name))]:
        if reason := _lost(before, after, name, name in kept):
            raise InputError(f"{place}: {name} {reason}")
    notes = [
        f"{place}: {_no_place(before, now, name)}: its value {literal(value)} is left out"
        for name, value in was.values.items()
        if name not in values
    ]
    had = {v.name for v in before.variables if v.unit not in (None, "1")}
    bare = [v.name for v in after.variables if v.kind == "Real" and not v.unit and v.name in had]
    if bare:
        LOGGER.error(
            "%s: %s tells no unit of %s, as %s does: taken to be in SI; `units` names others",
            place, now.fmu.name, choices(bare, 6), was.fmu.name,
        )  # fmt: skip
    values |= converted(kept, before, after)
    for name in kept:
        old, new = before.by_name[name].items, after.by_name[name].items
        label, meant = (
            next((k for k, n in items.items() if n == values[name]), None) for items in (old, new)
        )
        if old and new and label != meant:
            raise InputError(
                f"{place}: {name} = {values[name]!r} is {label} in {was.fmu.name} and "
                f"{meant or 'nothing'} in {now.fmu.name}; must be set anew, as one of "
                f"{choices(new)}"
            )
    still_set = {name: values[name] for name in kept}
    return replace(now, values=values), [*_other_than_own(now, still_set, place), *notes]


def _other_than_own(now: Component, kept: Mapping[str, Value], place: str) -> Iterator[str]:
    """A note on the values that the system sets and the new FMU has otherwise, if there are any."""
    others = []
    for name, value in kept.items():
        variable = now.interface.by_name[name]
        own = variable.start_value
        if _is_own(variable) and own is not None and not _same(value, own):
            unit = "" if variable.unit in (None, "1") else f" {variable.unit}"
            others.append(f"{name} = {literal(value)}{unit} (its own is {own!r}{unit})")
    if others:
        yield (
            f"{place}: the values of the system stay: {', '.join(others)}; --own-values, or "
            f"swap(..., own_values=True), takes those of {now.fmu.name}"
        )


def _is_own(variable: Variable) -> bool:
    """True for what an FMU may have a value of its own for: not what the system has to feed."""
    return variable.causality not in ("input", "structuralParameter")


def _same(value: Value, own: object) -> bool:
    """True for equal values, but for the rounding of a conversion."""
    if isinstance(value, float) and isinstance(own, float):
        return math.isclose(value, own, rel_tol=1e-12)
    return value == own


def with_own_values(component: Component) -> Component:
    """The component with the values of its FMU, but for inputs and what decides on sizes."""
    by_name = component.interface.by_name
    fed = {name: value for name, value in component.values.items() if not _is_own(by_name[name])}
    return replace(component, values=fed)


def _no_place(before: Interface, now: Component, name: str) -> str:
    """Why a value of the former FMU cannot be given to the new one."""
    variable = now.interface.by_name.get(name)
    if variable is None:
        return f"{now.fmu.name} has no {before.by_name[name].causality} {name}"
    return f"in {now.fmu.name} {name} {variable.unsettable}"


def _check_ends(system: Structure, was: Component, after: Interface, place: str) -> None:
    """InputError where another FMU lacks what the system connects: it may call that otherwise."""
    ends = [port for c in system.connections for port in (c.source, c.target)]
    names = dict.fromkeys(p.variable for p in ends if p.component == was.name)
    lacking = [n for n in names if n in was.interface.by_name and n not in after.by_name]
    if lacking:
        causality = was.interface.by_name[lacking[0]].causality
        more = f", and {len(lacking) - 1} more that are connected" if lacking[1:] else ""
        its = nearest(lacking[0], [v.name for v in after.of(causality)], after.listing)
        raise InputError(
            f"{place}: {after.path.name} has no {causality} {lacking[0]!r}{more}; {its}; if "
            f"they have other names: --set 'components.{was.name}.rename.{lacking[0]}=NAME', or "
            f"`grasp-cosim init my_system.toml --as {was.name}={quote(str(after.path))}` finds them"
        )


def stated(system: Structure, name: str) -> frozenset[str]:
    """The variables of a component for which the system states numbers, beside its values."""
    faulty = {fault.target for fault in system.faults}
    ports = [
        port
        for c in system.connections
        for port in (c.source, c.target)
        if (c.factor, c.offset) != (None, None) or c.target in faulty
    ]
    ways = [way for given in system.inputs.values() for way in given.ways]
    ways += [output.way for output in system.outputs.values()]
    ports += [way.port for way in ways if way.factor is not None]
    for event in system.events:
        for port in event.set:
            ports += system.elements(port)
    conditions = [*(e.when for e in system.events), *(f.when for f in system.faults)]
    conditions += [limit.when for limit in system.limits]
    ports += [condition.port for condition in conditions if condition]
    columns = system.input.columns if system.input else {}
    ports += [port for port, column in columns.items() if column.unit is None]
    return frozenset(port.variable for port in ports if port.component == name)


def converted(values: Mapping[str, Value], before: Interface, after: Interface) -> dict[str, Value]:
    """Values of one FMU in the units of another that has the same variables."""
    result = dict(values)
    for name, value in values.items():
        if name in after.by_name and after.by_name[name].kind == "Real":
            change = before.conversion(name, after)
            if change and change != IDENTITY:
                result[name] = change(float(value))
    return result


def _lost(before: Interface, after: Interface, name: str, value: bool) -> str:
    """Why a number for a variable cannot be meant in its new unit; empty where it can."""
    if name not in before.by_name or name not in after.by_name:
        return ""
    was, now = before.by_name[name], after.by_name[name]
    unit, change = unit_of(before, was), before.conversion(name, after)
    if was.unit and now.unit is None and now.kind == "Real" and (unit is None or not unit.si):
        return f"has no unit in {after.path.name}, but is set in {was.unit}; must be named in units"
    if change is None:
        return f"is in {now.unit}, which {was.unit} cannot be converted to; must be set anew"
    if change != IDENTITY and not value:
        return (
            f"is in {now.unit}, but an event, a fault or the factor of a connection, or an input "
            f"file, is meant in {was.unit}; must be in that"
        )
    return ""
