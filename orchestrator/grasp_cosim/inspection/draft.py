"""System files to start from: a foreign FMU in the place of a component, or FMUs alone.

What is not known is a TODO: as a value it is refused where the file is read, in a comment it is
nothing that a run needs.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

from ..base.errors import choices
from ..base.text import on_one_line
from ..interface.interface import PARAMETERS, SETTABLE, Interface, Value, Variable
from ..system.changes import converted, stated
from ..system.parts import NANOSECONDS, Component
from ..system.structure import Structure
from .alike import Match, candidates, matches

FEW = 6
"""Variables that a TODO names at most."""

MOST = 100
"""Parameters and outputs of an FMU alone that are listed."""

STEPS = 1000
"""Steps of an experiment for which no FMU recommends one."""

ISOLATED = "in a process of its own, until you trust its binary"

HEAD = """# A system of FMUs. Run it: grasp-cosim run FILE

# From an output to an input. Each input has one source: a connection, or a value below its
# component. Units that differ are converted.
connections = [
  # "{name}.OUTPUT -> COMPONENT.INPUT",
]

[experiment]
step = {step}  # s, communication step
stop = {stop}  # s, a whole number of steps
{start}scheme = "sequential"  # in the order of the components below; or "jacobi", all at once
"""

_BARE = re.compile(r"[A-Za-z0-9_-]+")
_FMU = re.compile(r'^(fmu = )"([^"]*)"', re.MULTILINE)


class _Row(NamedTuple):
    """An entry of a table as TOML has it, and its comment; without a key a comment alone."""

    key: str
    value: str
    comment: str = ""

    @property
    def open(self) -> bool:
        """True if it is left to do."""
        return self.value.startswith('"TODO')


@dataclass(frozen=True, slots=True)
class Draft:
    """A component that is filled in: its tables, and its matches by the system's names.

    ours is the interface of the FMU that it had, theirs that of the new one under the same names;
    of those in unknown the unit is left to do.
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
        return f"{key} = {_neat(change(float(value)))}{rest}"


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
    own = {n: m.variable.name for n, m in found.items() if m.variable.name != n}
    theirs = theirs.renamed(own)
    wanted = [*(n for n in found if n in asked), *(row.key for row in rename if row.open)]
    units = [*_units(ours, theirs, wanted, found)]
    draft = Draft(name, "", found, ours, theirs, {row.key for row in units})
    tables = [
        _component_table(name, path),
        _table(f"[components.{name}.rename]  # the system's name = the FMU's", rename),
        _table(f"[components.{name}.units]  # what the FMU does not declare", units),
        _table(f"[components.{name}.values]  # in the FMU's units", [*_values(draft, was)]),
    ]
    return replace(draft, text="\n\n".join(t for t in tables if t))


def _names(
    variables: Iterable[Variable],
    ours: Interface,
    theirs: Interface,
    found: Mapping[str, Match],
    needed: Collection[str],
) -> Iterator[_Row]:
    """The entries of rename."""
    own = [m.variable.name for m in found.values()]
    for variable in variables:
        name, match = variable.name, found.get(variable.name)
        if match and (match.variable.name != name or match.doubt):
            check = f"CHECK, found {match.doubt}; " if match.doubt else ""
            yield _Row(name, _quoted(match.variable.name), check + _told(match.variable))
        elif not match and (name in needed or variable.causality == "output"):
            there = [v.name for v in candidates(ours, name, theirs, own)]
            kind = "" if variable.kind == "Real" else f"{variable.type} "
            a = f"{kind}{variable.causality}{f' in {variable.unit}' if variable.unit else ''}"
            what = f"the FMU's name of {'an' if a[0] in 'aeiouEI' else 'a'} {a}"
            if name in needed:
                none = f"{what}; it has none left: without it, no line here and no connection"
                yield _Row(name, _todo(what if there else none, there))
            else:
                such = f": {choices(there, FEW)}" if there else "; it has none left"
                text = f"TODO {_key(name)} = {what}{such}; metrics and figures may want it"
                yield _Row("", "", text)


def _units(
    ours: Interface, theirs: Interface, names: Iterable[str], found: Collection[str]
) -> Iterator[_Row]:
    """The entries of units of variables that declare none.

    One that is not found is one that none of those that it could be declares a unit of.
    """
    for name in names:
        here, unit = ours.by_name[name], ours.unit(ours.by_name[name])
        able = [theirs.by_name[name]] if name in found else candidates(ours, name, theirs, found)
        if unit is None or here.unit == "1" or here.kind != "Real":
            continue
        if able and not any(map(theirs.unit, able)):
            declared = f"{able[0].unit!r}, which is not known" if able[0].unit else "none"
            yield _Row(name, _todo(f"its unit, like {here.unit}; the FMU declares {declared}"))


def _values(draft: Draft, was: Component) -> Iterator[_Row]:
    """The values of the component in the units of the FMU, and inputs that have no source."""
    found = draft.found
    for name, value in was.values.items():
        before = draft.ours.by_name[name]
        meant = f"{_number(value)}{f' {before.unit}' if before.unit else ''}"
        if name in draft.unknown:
            yield _Row(name, _todo(f"{meant}, in the unit that it has"))
        elif name in found:
            new = converted({name: value}, draft.ours, draft.theirs)[name]
            yield _Row(name, _number(_neat(new)), _told(draft.theirs.by_name[name]))
        else:
            there = [v.name for v in candidates(draft.ours, name, draft.theirs, found)]
            meant = f"TODO {_key(name)} = {meant} in the system: not found in the FMU, left out"
            yield _Row("", "", f"{meant}; it has {choices(there, FEW)}" if there else meant)
    for v in draft.theirs.of("input"):
        if v.supported and v.name not in found:
            what = f"{_start(v)} or another value; no line here if connected or named above"
            yield _Row(v.name, _todo(f"{what}; {_told(v)}"))


def alone(fmus: Mapping[str, tuple[Path, str]]) -> tuple[str, list[str]]:
    """The text of a system of FMUs, by component, each with its path in the file; and notes.

    It has their default experiment, and each input at its start value.
    """
    interfaces = {name: Component(name, fmu, {}).interface for name, (fmu, _) in fmus.items()}
    step, start, stop, notes = _experiment(interfaces)
    head = HEAD.format(
        name=next(iter(fmus)), step=step, stop=stop, start=f"start = {start}  # s\n" * bool(start)
    )
    parts = [_listed(name, i, fmus[name][1]) for name, i in interfaces.items()]
    return "\n".join([head, *parts]), notes


def _listed(name: str, interface: Interface, path: str) -> str:
    """The tables of an FMU alone: its inputs, and in comments what else there is."""
    variables = [v for v in interface.variables if v.supported]
    rows = [_Row(v.name, _start(v), _told(v)) for v in variables if v.causality == "input"]
    said = [
        f"{_key(v.name)} = {_start(v)}  # {_told(v)}"
        for v in interface.of(*PARAMETERS)
        if v.supported
    ]
    said += [f"{v.name}, recorded: {_told(v)}" for v in variables if v.causality == "output"]
    rows += [_Row("", "", text) for text in said[:MOST]]
    if len(said) > MOST:
        rows.append(_Row("", "", f"and {len(said) - MOST} more: grasp-cosim inspect {path}"))
    tables = _component_table(name, path), _table(f"[components.{name}.values]", rows)
    return "".join(f"{text}\n\n" for text in tables if text)[:-1]


def _experiment(interfaces: Mapping[str, Interface]) -> tuple[float, float, float, list[str]]:
    """Step, start and stop time in s: the shortest step and the longest span that the FMUs
    recommend, from where all of them begin; and notes.
    """
    keys = ("start_time", "stop_time", "step_size")
    times = [[_finite(i.experiment.get(key)) for key in keys] for i in interfaces.values()]
    begins = {begin for begin, _, _ in times}
    start = begins.pop() if len(begins) == 1 else 0.0
    notes = [f"the default experiments begin at other times, the run at {start:g} s"] * bool(begins)
    spans = [end - begin for begin, end, _ in times if end > begin]
    steps = [step for _, _, step in times if step > 0.0]
    span = max(spans, default=1.0)
    step = min(steps, default=span / STEPS)
    missing = [word for word, given in (("step", steps), ("stop time", spans)) if not given]
    if missing:
        chosen = f"chosen, step = {step:g} s, stop = {start + span:g} s"
        notes.append(f"no FMU recommends a {' and a '.join(missing)}: {chosen}")
    step_ns = max(1, round(step * NANOSECONDS))
    span_ns = max(1, round(span * NANOSECONDS / step_ns)) * step_ns
    stop = (round(start * NANOSECONDS) + span_ns) / NANOSECONDS
    if abs(span_ns / NANOSECONDS - span) > 1e-9:
        notes.append(f"stop = {start + span:g} s: {stop:g} s is a whole number of steps")
    return step_ns / NANOSECONDS, start, stop, notes


def _finite(value: Any) -> float:
    """A number of a default experiment; 0 where there is none."""
    return float(value) if isinstance(value, float) and math.isfinite(value) else 0.0


def with_paths(text: str, paths: Mapping[str, str]) -> str:
    """The text of a system file with other paths of FMUs, by the ones in it."""
    return _FMU.sub(lambda m: m[1] + _quoted(paths.get(m[2], m[2])), text)


def _table(heading: str, rows: Sequence[_Row]) -> str:
    """The text of a table, comments below each other; empty without rows."""
    if not rows:
        return ""
    entries = [f"{_key(r.key)} = {r.value}" if r.key else "" for r in rows]
    width = max((len(e) for e, r in zip(entries, rows, strict=True) if not r.open), default=0)
    lines = [
        f"{entry:{width if entry else 0}}  # {row.comment}".lstrip() if row.comment else entry
        for entry, row in zip(entries, rows, strict=True)
    ]
    return "\n".join([heading, *lines])


def _component_table(name: str, path: str) -> str:
    """The table of a component with a foreign FMU."""
    rows = _Row("fmu", _quoted(path)), _Row("isolation", _quoted("process"), ISOLATED)
    return _table(f"[components.{name}]", rows)


def _quoted(text: str) -> str:
    """A string as TOML writes it."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    """A key of a table as TOML writes it."""
    return name if _BARE.fullmatch(name) else _quoted(name)


def _todo(what: str, names: Collection[str] = ()) -> str:
    """The value that says what is to be put in its place, and names what that may be."""
    return _quoted(f"TODO: {what}: {choices(names, FEW)}" if names else f"TODO: {what}")


def _number(value: Value) -> str:
    """A value as TOML writes it."""
    if isinstance(value, bool):
        return str(value).lower()
    return _quoted(value) if isinstance(value, str) else repr(value)


def _neat(value: Value) -> Value:
    """A converted number, to the 15 digits that it has."""
    return float(f"{value:.15g}") if isinstance(value, float) else value


def _start(variable: Variable) -> str:
    """The start value of a variable, in its type; zero, false or nothing where it has none."""
    zeros: dict[str, Value] = {"Boolean": False, "Integer": 0, "String": ""}
    zero = zeros.get(variable.kind, 0.0)
    value = variable.start_value
    return _number(value if isinstance(value, type(zero)) else zero)


def _told(variable: Variable) -> str:
    """A comment on a variable: its causality, unit, items and description."""
    unit = "" if variable.unit in (None, "1") else str(variable.unit)
    items = [f"{number} {name}" for name, number in variable.items.items()]
    parts = [variable.causality, unit, choices(items, FEW) if items else ""]
    said = on_one_line(" ".join((variable.description or "").split()))
    return f"{', '.join(p for p in parts if p)}{said and f': {said}'}"
