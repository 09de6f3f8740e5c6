"""Changes of a system by places in its file, like experiment.step or components.plant.fmu.

With another FMU, what the system says of a component is meant in units of the former one.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from shlex import quote
from typing import Any, TypeVar

from ..base.checks import as_table, check_keys, choice, integer, known, real, text
from ..base.errors import InputError, choices, nearest
from ..interface.interface import SETTABLE, Interface, Value
from ..interface.read import describe
from ..interface.units import IDENTITY
from .arrays import with_given
from .parts import (
    ISOLATIONS,
    Component,
    Initialisation,
    Port,
    Realtime,
    Solver,
    in_nanoseconds,
    literal,
)
from .structure import Structure, unit_of

LOGGER = logging.getLogger(__name__)
Options = TypeVar("Options")

SECTIONS = (
    "experiment", "components", "connections", "initialisation", "events", "faults", "roles",
    "presets", "input", "realtime", "metrics",
)  # fmt: skip
"""The entries of a system file, which are no names of components."""

PLACES: Mapping[str, Sequence[str]] = {
    "experiment": ("step", "stop", "scheme", "diverging", "start"),
    "components": (),
    "initialisation": Initialisation.__slots__,
    "roles": (),
    "realtime": Realtime.__slots__,
    "input": ("file", "interpolation"),
}
"""The sections that have single values, each with its entries, where these are always the same."""

TABLES = ("values", "rename", "units", "solver")
ENTRIES = ("fmu", "step", "isolation", *TABLES)
"""The entries of a component, of which some are tables."""


def as_file(
    system: Structure, settings: Mapping[str, Any], place: Callable[[str], str]
) -> dict[str, Any]:
    """The tables that a file of the system with these settings would have.

    InputError, with what `place` makes of a key, where there is no such place, or one is given
    twice.
    """
    root: dict[str, Any] = {}
    names = [component.name for component in system.components]
    for key, value in settings.items():
        if "." not in key:
            entries = [f"{section}.{e}" for section, found in PLACES.items() for e in found]
            of = [(c.name, v) for c in system.components for v in c.interface.of(*SETTABLE)]
            near = nearest(key, entries + [f"{name}.{v.name}" for name, v in of])
            raise InputError(f"{place(key)}: no place in a system file; {near}")
        *tables, name = _place(names, key, place(key))
        table = root
        for entry in tables:
            table = table.setdefault(entry, {})
        if name in table:
            raise InputError(f"{place(key)}: this place is given twice; must be given once")
        table[name] = value
    return root


def _place(names: Collection[str], key: str, said: str) -> tuple[str, ...]:
    """The entries of the tables that lead to a place; COMPONENT.VARIABLE is short for a value."""
    section, _, rest = key.partition(".")
    if section in names:
        section, rest = "components", f"{section}.values.{rest}"
    known(f"{said}: no component", section, [*names, *PLACES])
    if section != "components":
        known(f"{said}: no entry", rest, PLACES[section] or [rest], f" of [{section}]")
        return section, rest
    name, _, rest = rest.partition(".")
    entry, _, last = rest.partition(".")
    known(f"{said}: no component", name, names)
    known(f"{said}: no entry", entry, ENTRIES, " of a component")
    if bool(last) != (entry in TABLES):
        form = f"components.{name}.{entry}"
        raise InputError(f"{said}: must be {form}{'.NAME' if entry in TABLES else ''}")
    return (section, name, entry, last) if last else (section, name, entry)


def plain(value: Any) -> Any:
    """A text from a command line as the number or boolean that it spells; all else as it is."""
    if not isinstance(value, str):
        return value
    if value in ("true", "false"):
        return value == "true"
    for kind in (integer, real):
        with suppress(ValueError):
            return kind(value)
    return value


def changed(place: str, options: Options, table: Any, text: bool = False) -> Options:
    """Options such as Initialisation with those of a table; with text, texts may stand for numbers.

    InputError, which begins with the place, where an entry is unknown or not as it must be.
    """
    given = as_table(place, table)
    check_keys(place, given, options.__slots__)  # type: ignore[attr-defined]
    values = {key: plain(value) if text else value for key, value in given.items()}
    try:
        return replace(options, **values)  # type: ignore[type-var]
    except InputError as error:
        raise InputError(f"{place}: {error}") from error


@dataclass(frozen=True, slots=True)
class Replacement:
    """An FMU for a component, with names and units of its variables as a Component has them.

    They go before those that the component has already.
    """

    fmu: Path
    rename: Mapping[str, str] = field(default_factory=dict)
    units: Mapping[str, str] = field(default_factory=dict)


def with_entries(
    system: Structure, was: Component, table: Mapping[str, Any], place: Callable[[str], str]
) -> tuple[Component, list[str]]:
    """The component with entries of a system file, of which texts may stand for numbers; and notes.

    With an FMU, names and units are those of its variables, and so are values, in its units.
    """
    notes: list[str] = []
    own = f"{was.name}."
    values, rename, units = (table.get(entry, {}) for entry in ("values", "rename", "units"))
    for entry, names in (("rename", rename), ("units", units)):
        for key, name in names.items():
            text(place(f"components.{own}{entry}.{key}"), name, "a string")
    if "fmu" in table:
        where = place(f"components.{own}fmu")
        if not isinstance(table["fmu"], str | Path):
            raise InputError(f"{where} = {table['fmu']!r}: must be the path of an FMU")
        now, notes = with_fmu(
            system, was, Replacement(Path(table["fmu"]), rename, units), values, where
        )
    elif rename or units:
        now = replace(was, rename={**was.rename, **rename}, units={**was.units, **units})
    else:
        now = was
    where = place(f"components.{own}")
    if "step" in table:
        now = replace(now, step_ns=in_nanoseconds(f"{where}step", plain(table["step"])))
    if "isolation" in table:
        chosen = choice(f"{where}isolation", table["isolation"], ISOLATIONS)
        now = replace(now, isolation=chosen)
    if "solver" in table:
        given = changed(f"{where}solver", now.solver or Solver(), table["solver"], text=True)
        now = replace(now, solver=given)
    if values:
        now = with_given(now, lambda name: place(own + name), values, text=True)
    return now, notes


def with_fmu(
    system: Structure, was: Component, new: Replacement, anew: Collection[str], place: str
) -> tuple[Component, list[str]]:
    """The component with another FMU, its values converted to the units of that; and notes.

    `anew` are variables, or arrays, that get another value. A value of a variable that the new FMU
    lacks is left out, which a note says. InputError where a value, or another number that the
    system states, has no meaning in the new unit.
    """
    now = replaced(was, new, f"{place}: ")
    before, after = was.interface, now.interface
    arrays = before.arrays
    anew = {v for name in anew for v in (arrays[name].names if name in arrays else (name,))}
    _check_ends(system, was, after, place)
    given = {n: value for n, value in was.values.items() if n in after.by_name}
    kept = {name: value for name, value in given.items() if name not in anew}
    for name in [*kept, *sorted(stated(system, was.name))]:
        reason = _lost(before, after, name, name in kept)
        if reason:
            raise InputError(f"{place}: {name} {reason}")
    notes = [
        f"{place}: {new.fmu.name} has no {before.by_name[name].causality} {name}: its value "
        f"{literal(value)} is left out"
        for name, value in was.values.items()
        if name not in given
    ]
    had = {v.name for v in before.variables if v.unit not in (None, "1")}
    bare = [v.name for v in after.variables if v.kind == "Real" and not v.unit]
    if silent := [name for name in bare if name in had]:
        LOGGER.error(
            "%s: %s tells no unit of %s, as %s does: taken to be in SI; `units` names others",
            place, new.fmu.name, choices(silent, 6), was.fmu.name,
        )  # fmt: skip
    now = replace(now, values={**given, **converted(kept, before, after)})
    _check_items(was, now, [name for name in now.values if name not in anew], place)
    return now, notes


def _check_items(was: Component, now: Component, variables: Sequence[str], place: str) -> None:
    """InputError where a value that a component keeps stands for another item in its new FMU."""
    before, after = was.interface.by_name, now.interface.by_name
    for name in variables:
        value = now.values[name]
        items = [v[name].items if name in v else {} for v in (before, after)]
        label, meant = (next((k for k, n in i.items() if n == value), None) for i in items)
        if all(items) and label != meant:
            raise InputError(
                f"{place}: {name} = {value!r} is {label} in {was.fmu.name} and "
                f"{meant or 'nothing'} in {now.fmu.name}; must be set anew, as one of "
                f"{choices(items[1])}"
            )


def _check_ends(system: Structure, was: Component, after: Interface, place: str) -> None:
    """InputError where another FMU lacks what the system connects: it may call that otherwise."""
    ends = [port for c in system.connections for port in (c.source, c.target)]
    names = dict.fromkeys(p.variable for p in ends if p.component == was.name)
    lacking = [n for n in names if n in was.interface.by_name and n not in after.by_name]
    if lacking:
        causality = was.interface.by_name[lacking[0]].causality
        more = f", and {len(lacking) - 1} more that are connected" if lacking[1:] else ""
        its = nearest(lacking[0], [v.name for v in after.of(causality)], after.listing)
        fmu = quote(str(after.path))
        raise InputError(
            f"{place}: {after.path.name} has no {causality} {lacking[0]!r}{more}; {its}; if "
            f"they have other names: --set 'components.{was.name}.rename.{lacking[0]}=NAME', or "
            f"`grasp-cosim init my_system.toml --as {was.name}={fmu}` finds them"
        )


def replaced(was: Component, new: Replacement, place: str) -> Component:
    """The component with another FMU, without a look at its values; place begins its errors.

    Of the names and units that it has, those stay that fit: an FMU's name that the new one has,
    too; a unit where the FMUs declare the same one, or the new FMU none.
    """
    ours = was.sized(describe(was.fmu)).renamed(was.rename)
    theirs = was.sized(describe(new.fmu))
    rename = {
        name: own
        for name, own in was.rename.items()
        if theirs.sample(own) and name not in new.rename and own not in new.rename.values()
    } | dict(new.rename)
    while taken := (rename.keys() & theirs.by_name) - {*new.rename, *rename.values()}:
        rename = {name: own for name, own in rename.items() if name not in taken}
    found = theirs.renamed(rename, f"{place}rename")
    units = {
        name: unit
        for name, unit in was.units.items()
        if (now := found.sample(name)) and now.unit in (None, getattr(ours.sample(name), "unit", 0))
    }
    units |= new.units
    solver = was.solver if theirs.exchange else None
    return replace(was, fmu=new.fmu, native=None, rename=rename, units=units, solver=solver)


def stated(system: Structure, name: str) -> frozenset[str]:
    """The variables of a component for which the system states numbers, beside its values.

    In events, conditions, faults, factors of connections and columns without a unit.
    """
    ends = [(port, c) for c in system.connections for port in (c.source, c.target)]
    scaled = [port for port, c in ends if (c.factor, c.offset) != (None, None)]
    faulty = {fault.target for fault in system.faults}
    through = [port for port, c in ends if c.target in faulty]
    tuned = [port for event in system.events for port in event.set]
    conditions = [*(e.when for e in system.events), *(f.when for f in system.faults)]
    asked = [condition.port for condition in conditions if condition]
    columns = system.input.columns.items() if system.input else ()
    driven = [port for port, column in columns if column.unit is None]
    ports: list[Port] = [*scaled, *through, *tuned, *asked, *driven]
    return frozenset(port.variable for port in ports if port.component == name)


def converted(values: Mapping[str, Value], before: Interface, after: Interface) -> dict[str, Value]:
    """Values of one FMU in the units of another that has the same variables."""
    result: dict[str, Value] = {}
    for name, value in values.items():
        if name in after.by_name and after.by_name[name].kind == "Real":
            change = before.conversion(name, after)
            value = change(float(value)) if change and change != IDENTITY else value
        result[name] = value
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
        return (
            f"is in {now.unit}, which its value in {was.unit} cannot be converted to; set it anew"
        )
    if change != IDENTITY and not value:
        return (
            f"is in {now.unit}, but an event, a fault or the factor of a connection, or an input "
            f"file, is meant in {was.unit}; must be in that"
        )
    return ""
