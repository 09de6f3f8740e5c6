"""A component filled in for a foreign FMU: names, units, values, and what is missing."""

from __future__ import annotations

import json
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from si_units import known_unit

from ..base.errors import choices
from ..interface.interface import SETTABLE, Interface, Variable
from ..system.parts import Component
from ..system.structure import Structure
from ..system.swap import converted, stated
from .alike import Match, candidates, matches
from .text import FEW, Row, a, component_table, key, neat, number, quoted, start, table, todo, told

_UNIT_IN_TEXT = re.compile(r"(?:[\[(]|\bin )\s*([^\s\])(,;]+)")


@dataclass(frozen=True, slots=True)
class Draft:
    """A component that is filled in: its tables, and its matches by the system's names.

    ours is the interface of the FMU that it had, theirs that of the new one under the same names
    and with the units that are known; of those in unknown the unit is left to do.
    """

    name: str
    text: str
    found: Mapping[str, Match]
    ours: Interface
    theirs: Interface
    unknown: Collection[str]

    def put_into(self, text: str) -> str:
        """The text of a system file with this component, and its values in presets.

        A table of the file begins with its heading and ends with an empty line.
        """
        own = f"[components.{self.name}]"
        line = re.compile(rf'^("{re.escape(self.name)}\.(.+?)") = (\S+)(.*)$', re.MULTILINE)
        chunks = text.split("\n\n")
        return "\n\n".join(
            self.text if c.startswith(own) else line.sub(self._preset, c) for c in chunks
        )

    def _preset(self, match: re.Match[str]) -> str:
        """A line of a preset in the unit of the FMU; a comment where it has no such variable."""
        whole, key, name, value, rest = match[0], *match.groups()
        if name not in self.found:
            return f"# {whole}  # not in {self.theirs.path.name}"
        if name in self.unknown:
            return f"# {whole}  # TODO: in the unit that it has"
        change = self.ours.conversion(name, self.theirs)
        if change is None or self.ours.by_name[name].kind != "Real":
            return whole
        return f"{key} = {number(neat(change(float(value))))}{rest}"


def replacing(system: Structure, name: str, fmu: Path, path: str, presets: Iterable[str]) -> Draft:
    """A foreign FMU in the place of that of a component; path is how the file names it.

    presets are the variables of the component that presets give a value.
    """
    was = system.component(name, name)
    ours, theirs = was.interface, Component(name, fmu, {}).interface
    ends = [port for c in system.connections for port in (c.source, c.target)]
    needed = {port.variable for port in ends if port.component == name} | stated(system, name)
    asked = {*needed, *was.values, *presets, *(v.name for v in ours.of("output"))}
    variables = [v for v in ours.of(*SETTABLE, "output") if v.supported]
    found = matches(ours, [v.name for v in variables], theirs)
    found = {n: m for n, m in found.items() if n in asked or not m.doubt}
    rename = [*_names(variables, ours, theirs, found, needed)]
    names = {m.variable.name: n for n, m in found.items()}
    names |= {json.loads(r.value): r.key for r in rename if r.key.endswith(OTHER)}
    theirs = theirs.renamed({new: own for own, new in names.items() if own != new})
    wanted = [*(n for n in found if n in asked), *(row.key for row in rename if row.open)]
    units = [*_units(ours, theirs, wanted, found)]
    theirs = theirs.in_units({row.key: json.loads(row.value) for row in units if not row.open})
    unknown = {row.key for row in units if row.open}
    draft = Draft(name, "", found, ours, theirs, unknown)
    tables = [
        component_table(name, path),
        table(f"[components.{name}.rename]  # the system's name = the FMU's", rename),
        table(f"[components.{name}.units]  # what the FMU does not declare", units),
        table(f"[components.{name}.values]  # in the FMU's units", [*_values(draft, was)]),
    ]
    text = "\n\n".join(t for t in tables if t)
    return Draft(name, text, found, ours, theirs, unknown)


OTHER = "_of_the_FMU"
"""The ending of a name that means something else in the FMU."""


def _names(
    variables: Iterable[Variable],
    ours: Interface,
    theirs: Interface,
    found: Mapping[str, Match],
    needed: Collection[str],
) -> Iterator[Row]:
    """The entries of rename; last what the FMU calls by a name that means something else here."""
    own = [m.variable.name for m in found.values()]
    renamed = []
    for variable in variables:
        name, match = variable.name, found.get(variable.name)
        if match and (match.variable.name != name or match.doubt):
            renamed.append(name)
            check = f"CHECK, found {match.doubt}; " if match.doubt else ""
            yield Row(name, quoted(match.variable.name), check + told(match.variable))
        elif not match and (name in needed or variable.causality == "output"):
            there = [v.name for v in candidates(ours, name, theirs, own)]
            what = f"the FMU's name of {a(variable)}"
            if name in needed:
                renamed.append(name)
                none = f"{what}; it has none left: without it, no line here and no connection"
                yield Row(name, todo(what if there else none, there))
            else:
                such = f": {choices(there, FEW)}" if there else "; it has none left"
                yield Row(
                    "", "", f"TODO {key(name)} = {what}{such}; metrics and figures may want it"
                )
    for name in renamed:
        if name in theirs.by_name and name not in own:
            yield Row(f"{name}{OTHER}", quoted(name), "something else than the system's")


def _units(
    ours: Interface, theirs: Interface, names: Iterable[str], found: Collection[str]
) -> Iterator[Row]:
    """The entries of units of variables that declare none: as their description says, or to do.

    One that is not found is one that none of those that it could be declares a unit of.
    """
    for name in names:
        here, unit = ours.by_name[name], ours.unit(ours.by_name[name])
        able = [theirs.by_name[name]] if name in found else candidates(ours, name, theirs, found)
        if unit is None or here.unit == "1" or here.kind != "Real":
            continue
        if not able or any(map(theirs.unit, able)):
            continue
        there = able[0]
        texts = _UNIT_IN_TEXT.findall(there.description or "") if name in found else []
        said = next((t for t in texts if (u := known_unit(t)) and u.measures(unit)), None)
        if said:
            yield Row(name, quoted(said), "CHECK, found by its description")
        else:
            declared = f"{there.unit!r}, which is not known" if there.unit else "none"
            yield Row(name, todo(f"its unit, like {here.unit}; the FMU declares {declared}"))


def _values(draft: Draft, was: Component) -> Iterator[Row]:
    """The values of the component in the units of the FMU, and inputs that have no source."""
    found = draft.found
    for name, value in was.values.items():
        before = draft.ours.by_name[name]
        meant = f"{number(value)}{f' {before.unit}' if before.unit else ''}"
        if name in draft.unknown:
            yield Row(name, todo(f"{meant}, in the unit that it has"))
        elif name in found:
            now = draft.theirs.by_name[name]
            new = converted({name: value}, draft.ours, draft.theirs)[name]
            yield Row(name, number(neat(new)), told(now))
        else:
            there = [v.name for v in candidates(draft.ours, name, draft.theirs, found)]
            meant = f"TODO {key(name)} = {meant} in the system: not found in the FMU, left out"
            yield Row("", "", f"{meant}; it has {choices(there, FEW)}" if there else meant)
    for v in draft.theirs.of("input"):
        if v.supported and v.name not in found:
            what = f"{number(start(v))} or another value; no line here if connected or named above"
            yield Row(v.name, todo(f"{what}; {told(v)}"))
