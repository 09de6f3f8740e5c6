"""Places in a system file, like experiment.step or components.plant.values.object_width."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any, TypeVar

from ..base.checks import as_table, check_keys, integer, known, real
from ..base.errors import InputError, nearest
from ..interface.interface import SETTABLE
from .parts import Initialisation, Realtime
from .structure import Structure

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
            near = nearest(key, _listed(system))
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


def _listed(system: Structure) -> list[str]:
    """The places that are most like what a user means: variables, and the entries of sections."""
    ports = [f"{c.name}.{v.name}" for c in system.components for v in c.interface.of(*SETTABLE)]
    return [f"{section}.{entry}" for section, found in PLACES.items() for entry in found] + ports


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
