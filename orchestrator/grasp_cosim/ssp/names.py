"""The names of components and their variables: the archive's, the FMUs' and the system's."""

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import fields, replace

from si_units import known_unit

from ..base.errors import InputError, choices
from ..interface.interface import Value
from ..system.parts import Component, Solver
from .annotation import Beside
from .connectors import Part
from .elements import Path
from .unit_tables import same


class Called:
    """The names of a component's variables, its FMU's and the system's, and units by the latter."""

    def __init__(self, place: str, part: Part, beside: Beside) -> None:
        self._place, self._part, self._beside = place, part, beside
        renamed = part.interface.renamed(beside.rename, f"{place}: rename").variables
        pairs = zip(part.interface.variables, renamed, strict=True)
        self._new = {own: new for new, own in beside.rename.items()}  # of whole arrays, too
        self._new |= {own.name: new.name for own, new in pairs}
        own = {new: own for own, new in self._new.items()}
        self._units = {
            **_units(part),
            **{own.get(name, name): unit for name, unit in beside.units.items()},
        }

    def new(self, own: str) -> str:
        """The system's name of a variable of the FMU."""
        return self._new.get(own, own)

    def in_units(self) -> Part:
        """The part with the units that the archive names."""
        return replace(
            self._part, interface=self._part.interface.in_units(self._units, self._place)
        )

    def component(self, name: str, part: Part, values: Mapping[str, Value]) -> Component:
        """The component with these values, by the FMU's names."""
        own = {self.new(variable): value for variable, value in values.items()}
        units = {self.new(variable): unit for variable, unit in self._units.items()}
        more = {f.name: getattr(self._beside, f.name) for f in fields(Beside)} | {"units": units}
        if part.element.exchange and "CoSimulation" in part.interface.kinds:
            more["solver"] = self._beside.solver or Solver()
        return Component(name, part.interface.path, own, **more)


def _units(part: Part) -> dict[str, str]:
    """The units that connectors name for variables that have none in the FMU."""
    variables = part.interface.by_name
    connectors = {
        c.name: c.unit
        for c in part.element.connectors.values()
        if c.unit and (v := variables.get(c.name)) and v.kind == "Real" and v.unit is None
    }
    meant = {n: (unit, known_unit(unit.name)) for n, unit in connectors.items()}
    return {n: unit.name for n, (unit, known) in meant.items() if known and same(unit, known)}


def component_names(file: str, parts: Iterable[Path]) -> dict[Path, str]:
    """The components' names in the system, where a dot parts component and variable."""
    names = {path: "_".join(path).replace(".", "_") for path in parts}
    for name, count in Counter(names.values()).items():
        if count > 1:
            same = choices(".".join(path) for path in names if names[path] == name)
            raise InputError(f"{file}: components {same} would all be {name!r} here; must differ")
    return names


def renamed(names: Mapping[Path, str]) -> Iterator[str]:
    """Yield a note for each component that is called otherwise here."""
    for path, name in names.items():
        if name != ".".join(path):
            yield f"component {'.'.join(path)} is called {name} here"
