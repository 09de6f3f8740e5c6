"""Overrides: values that change a system, each by its place in a system file.

A text of the command line, a Python value, an entry of a file and a cell of a sweep all become an
Override once. It keeps the origin for messages. grouped() reads their places against a system; what
they make of it: entries.py for the sections, changes.py for a component.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

from ..base.checks import integer, known, real
from ..base.errors import InputError, nearest
from ..base.quantity import unwrapped
from .parts import Acceptance, Initialisation, Realtime
from .structure import Structure

SECTIONS = (
    "experiment", "components", "connections", "initialisation", "events", "faults", "roles",
    "presets", "input", "realtime", "metrics", "limits", "verdict",
)  # fmt: skip
"""The entries of a system file, which are no names of components."""

RECORD, SIGNALS = "record", "signals"
"""Another entry, and the list in it, which no --set changes. A component may have its name."""

ENTRIES_OF_SECTIONS: Mapping[str, Sequence[str]] = {
    "experiment": ("step", "stop", "scheme", "diverging", "start", "variant"),
    "components": (),
    "initialisation": Initialisation.__slots__,
    "roles": (),
    "realtime": Realtime.__slots__,
    "verdict": Acceptance.__slots__,
    "input": ("file", "interpolation"),
    RECORD: ("trigger", "before", "after"),
}
"""The sections that have single values, each with its entries, where these are always the same."""

TABLES_OF_NAMES = ("rename", "units")
TABLES_OF_COMPONENT = ("values", *TABLES_OF_NAMES, "solver")
ENTRIES_OF_COMPONENT = (
    *("fmu", "step", "isolation", "logging", "trace"),
    *TABLES_OF_COMPONENT,
)
"""The entries of a component, of which some are tables."""

METRICS = "metrics."
"""What the entries of [verdict.metrics] begin with, behind [verdict]."""

PLACE = "{place}"
"""What stands for the place in the origin of an override."""


@dataclass(frozen=True, slots=True)
class Override:
    """A value for a place of a system, like "experiment.step" or "plant.object_width".

    origin says for messages where it comes from, with {place} for the place: "--set {place}",
    "grasp.toml: {place}", or just "--step".
    """

    place: str
    value: Any
    origin: str = PLACE

    @property
    def label(self) -> str:
        """What a message on it begins with."""
        return self.label_of(self.place)

    def label_of(self, place: str) -> str:
        """What a message on another spelling, or on a part, of its place begins with."""
        return self.origin.replace(PLACE, place)


class Place(NamedTuple):
    """A place taken apart: components.plant.values.object_width has all four parts.

    component is empty in other sections, and name where the entry is no table.
    """

    section: str
    component: str
    entry: str
    name: str = ""

    @property
    def is_value(self) -> bool:
        """True for the place of the value of a variable."""
        return bool(self.component) and self.entry == "values"


@dataclass(slots=True)
class ComponentOverrides:
    """The overrides of a component: of its single entries, and of each of its tables by name."""

    entries: dict[str, Override] = field(default_factory=dict)
    tables: dict[str, dict[str, Override]] = field(default_factory=dict)

    def table(self, name: str) -> Mapping[str, Override]:
        """Those of a table, by the names in it."""
        return self.tables.get(name, {})


@dataclass(slots=True)
class Overrides:
    """Overrides by where they go: section and entry, or the component."""

    sections: dict[str, dict[str, Override]] = field(default_factory=dict)
    components: dict[str, ComponentOverrides] = field(default_factory=dict)

    def table_of(self, place: Place) -> dict[str, Override]:
        """The table that a place is in."""
        if not place.component:
            return self.sections.setdefault(place.section, {})
        component = self.components.setdefault(place.component, ComponentOverrides())
        return component.tables.setdefault(place.entry, {}) if place.name else component.entries


def as_overrides(values: Mapping[str, Any], origin: str) -> list[Override]:
    """Values by place as overrides of one origin; InputError where they are none."""
    if not isinstance(values, Mapping):
        label = Override(repr(values), None, origin).label
        raise InputError(f"{label}: must be a mapping of keys to values")
    overrides = [Override(place, value, origin) for place, value in values.items()]
    for override in overrides:
        if not isinstance(override.place, str):
            label = override.label_of(repr(override.place))
            raise InputError(f"{label}: must be a key of the system, a text")
    return overrides


def grouped(system: Structure, overrides: Iterable[Override]) -> Overrides:
    """Overrides by where they go in a system; InputError where one has no place, or two the same.

    A text for a number or a boolean becomes that, but for the value of a variable, which decides
    for itself what a text means.
    """
    groups = Overrides()
    components = [component.name for component in system.components]
    for override in overrides:
        if "." not in override.place:
            near = nearest(override.place, _all_places(system))
            raise InputError(f"{override.label}: no key of a system file; {near}")
        place = parse_place(components, override.place, override.label)
        table = groups.table_of(place)
        name = place.name or place.entry
        if name in table:
            raise InputError(f"{override.label}: this key is set twice; must be set once")
        if not _takes_texts(place):
            override = Override(override.place, plain(override.value), override.origin)
        table[name] = override
    return groups


def _all_places(system: Structure) -> list[str]:
    """The places of a system that may be overridden, for a message."""
    entries = [
        f"{section}.{entry}"
        for section, entries in ENTRIES_OF_SECTIONS.items()
        for entry in entries
    ]
    values = [
        f"{component.name}.{variable.name}"
        for component in system.components
        for variable in component.interface.variables
        if variable.settable
    ]
    return [*system.inputs, *entries, *values]


def _takes_texts(place: Place) -> bool:
    """True where a text means itself, or what a variable makes of it."""
    if place.component:
        return place.entry in ("fmu", "values", *TABLES_OF_NAMES)
    return place.section in ("roles", "input")


def parse_place(components: Collection[str], text: str, label: str) -> Place:
    """The place that a text names in a system of these components.

    COMPONENT.VARIABLE is short for a value. InputError, which begins with the label, where there is
    no such place.
    """
    section, _, path = text.partition(".")
    if section in components:
        section, path = "components", f"{section}.values.{path}"
    if section == RECORD and path == SIGNALS:
        raise InputError(f"{label}: is a list; must be given by --record, or with_record()")
    known(f"{label}: no component", section, [*components, *ENTRIES_OF_SECTIONS])
    if section != "components":
        entries = ENTRIES_OF_SECTIONS[section] or [path]
        if section != "verdict" or not path.startswith(METRICS):
            known(f"{label}: no entry", path, entries, f" of [{section}]")
        return Place(section, "", path)
    component, _, path = path.partition(".")
    entry, _, name = path.partition(".")
    known(f"{label}: no component", component, components)
    known(f"{label}: no entry", entry, ENTRIES_OF_COMPONENT, " of a component")
    is_table = entry in TABLES_OF_COMPONENT
    if bool(name) != is_table:
        form = f"components.{component}.{entry}"
        raise InputError(f"{label}: must be {form}{'.NAME' if is_table else ''}")
    return Place(section, component, entry, name)


def plain(value: Any) -> Any:
    """A text from a command line as the number or boolean that it spells, without NumPy's types."""
    value = unwrapped(value)
    if not isinstance(value, str):
        return value
    if value in ("true", "false"):
        return value == "true"
    for number_of in (integer, real):
        with suppress(ValueError):
            return number_of(value)
    return value
