"""Where an element stands: the document, its archive, and what its sources and units refer to."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from posixpath import dirname
from typing import Any

from si_units import Unit, known_unit

from ..base.checks import known
from ..base.errors import InputError
from .archive import STRUCTURE, Archive, Notes
from .document import ROOTS, checked, child, parse, read_units

_KINDS = {
    "ssv": "parameter-set",
    "ssm": "parameter-mapping",
    "ssb": "signal-dictionary",
}


@dataclass(frozen=True, slots=True)
class Origin:
    """A document, an entry of an archive, with its units and the documents that it is nested in.

    fmu is the entry of the component that an element stands in, empty where it stands in none.
    """

    archive: Archive
    entry: str
    notes: Notes
    units: Mapping[str, Unit] = field(default_factory=dict)
    around: tuple[str, ...] = ()
    fmu: str = ""

    @property
    def place(self) -> str:
        """The name of the document in messages."""
        return f"{self.archive.place}: {self.entry}"

    def resolve(self, place: str, uri: str) -> str:
        """The entry of a source, relative to the document."""
        return self.archive.resolve(place, uri, dirname(self.entry))

    def inside(self, fragment: str = "") -> "Origin":
        """The same, in what is nested in it; InputError where that is nested in itself."""
        place = f"{self.place}{fragment}"
        if place in self.around:
            raise InputError(f"{place}: contains itself, which is not allowed")
        return replace(self, around=(*self.around, place))

    def unit(self, place: str, name: str | None, own: str | None) -> Unit | None:
        """The unit of that name, None for none; own is how the FMU names it, if it does.

        InputError where nothing says what it is.
        """
        if name == "":
            self.notes.add(place, "unit '' is taken as no unit")
        if not name or name in self.units:
            return self.units.get(name or "")
        if own == name:
            self.notes.add(place, f"unit {name!r} is not defined; taken as the FMU's")
            return None
        meant = known_unit(name) if own is None else None
        if meant is None:
            known(f"{place}: unit", name, self.units, " is not defined")
        self.notes.add(place, f"unit {name!r} is not defined; known by its name")
        return meant

    def inner(self, place: str, entry: Any, form: str, holder: Any) -> tuple["Origin", Any]:
        """A set, mapping or dictionary: the file that `entry` names, or inline in `holder`.

        With what its units refer to.
        """
        kind = _KINDS[form]
        named_type = entry.get("type", f"application/x-ssp-{kind}")
        if named_type != f"application/x-ssp-{kind}":
            raise InputError(
                f"{place}: type {named_type!r} is not supported; must be application/x-ssp-{kind}"
            )
        source, inline = entry.get("source"), None if holder is None else child(holder, ROOTS[form])
        if (source is None) == (inline is None):
            raise InputError(
                f"{place}: {kind}: must have either a source or an inline {ROOTS[form]}"
            )
        if source is None:
            root = checked(self.place, inline, form, self.notes)
            return replace(self, units={**self.units, **read_units(self.place, root, form)}), root
        found = self._within_fmu(place) if entry.get("sourceBase") == "component" else self
        found = replace(found, entry=found.resolve(place, source), units={})
        root = parse(found.place, found.archive.read(found.entry), form, self.notes)
        return replace(found, units=read_units(found.place, root, form)), root

    def _within_fmu(self, place: str) -> "Origin":
        """The place of the files in the component's FMU."""
        if not self.fmu:
            raise InputError(f"{place}: sourceBase 'component': must be at a component with an FMU")
        within = f"{self.archive.place}: {self.fmu}"
        path = self.archive.extract(self.fmu)
        archive = Archive(path, self.notes, within, "modelDescription.xml")
        return replace(self, archive=archive, entry="")


def open_structure(
    archive: Archive, notes: Notes, entry: str = STRUCTURE, around: tuple[str, ...] = ()
) -> tuple[Origin, Any]:
    """The structure of an archive: where its elements stand, and its root."""
    origin = Origin(archive, entry, notes, around=around).inside()
    root = parse(origin.place, archive.read(entry), "ssd", notes)
    return replace(origin, units=read_units(origin.place, root, "ssd")), root
