"""System files to start from: a foreign FMU in the place of a component, or FMUs alone.

What is not known is a TODO: as a value it is refused where the file is read, in a comment it is
nothing that a run needs.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path

from ..base.errors import choices
from ..base.text import on_one_line
from ..interface.fmi_types import Value
from ..interface.interface import Interface
from ..interface.renaming import renamed
from ..interface.variables import PARAMETERS, SETTABLE, Variable
from ..system.changes import converted, stated
from ..system.parts import Component
from ..system.record import by_default
from ..system.structure import Structure
from ..system.times import (
    LONGEST,
    NANOSECONDS,
    Time,
    in_seconds,
    nearest_time,
    step_of,
    written,
)
from .alike import Match, candidates, matches

FEW = 6
"""Variables that a TODO names at most."""

MOST = 100
"""Parameters and outputs of an FMU alone that are listed."""

STEPS = 1000
"""Steps of an experiment for which no FMU recommends one."""

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

# [record]  # in the place of the outputs
# signals = ["{name}.*"]
"""

_BARE = re.compile(r"[A-Za-z0-9_-]+")


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
    variables = [
        v
        for v in ours.variables
        if v.supported and (v.causality in (*SETTABLE, "output") or v.name in was.values)
    ]
    likely = matches(ours, theirs)
    names = [v.name for v in variables if v.name in likely]
    found = {n: likely[n] for n in names if n in asked or not likely[n].doubt}
    own = {n: m.variable.name for n, m in found.items()}
    theirs = renamed(theirs, {n: its for n, its in own.items() if its != n})
    draft = Draft(name, "", found, ours, theirs, {})
    listed = [v.name for v in variables if v.name in asked]
    units = {n: text for n in listed if (text := _unit(draft, n, n in needed))}
    draft = replace(draft, unknown=units)
    rename = [
        _line(n, _quoted(m.variable.name), m.check + _told(m.variable))
        for n, m in found.items()
        if m.variable.name != n or m.doubt
    ]
    rename += [_lost(draft, v, v.name in needed) for v in variables if v.name not in found]
    tables = [
        _component(name, path, theirs),
        _table(f"[components.{name}.rename]  # the system's name = the FMU's", rename),
        _table(
            f"[components.{name}.units]  # what the FMU does not declare",
            [_line(n, text) for n, text in units.items()],
        ),
        _table(f"[components.{name}.values]  # in the FMU's units", _values(draft, was)),
    ]
    return replace(draft, text="\n\n".join(filter(None, tables)))


def _lost(draft: Draft, variable: Variable, needed: bool) -> str:
    """The line of rename of a variable that is not found; empty where nobody may want it."""
    name, there = variable.name, _names(draft, variable.name)
    kind = "" if variable.kind == "Real" else f"{variable.type} "
    unit = f" in {variable.unit}" if variable.unit else ""
    what = f"the FMU's name of the {kind}{variable.causality}{unit}: {there or 'it has none left'}"
    if needed:
        return _line(name, _todo(what if there else f"{what}; then no line, and no connection"))
    entry = f"# TODO {_key(name)} = {what}; metrics and figures may want it"
    return entry if variable.causality == "output" else ""


def _unit(draft: Draft, name: str, needed: bool) -> str:
    """What is to be done for the unit of a variable that declares none; empty if nothing is.

    One that is not found is one that none of those that it could be declares a unit of.
    """
    here, found = draft.ours.by_name[name], name in draft.found
    if here.kind != "Real" or draft.ours.unit(here) is None or here.unit == "1":
        return ""
    able = [draft.theirs.by_name[name]] if found else needed and _able(draft, name)
    if not able or any(map(draft.theirs.unit, able)):
        return ""
    declared = f"{able[0].unit!r}, which is not known" if able[0].unit else "none"
    return _todo(f"its unit, like {here.unit}; the FMU declares {declared}")


def _able(draft: Draft, name: str) -> list[Variable]:
    return candidates(draft.ours, name, draft.theirs, draft.found)


def _values(draft: Draft, was: Component) -> list[str]:
    """The values of the component in the units of the FMU, and inputs that have no source."""
    lines = []
    for name, value in was.values.items():
        unit = draft.ours.by_name[name].unit
        meant = f"{_number(value)}{f' {unit}' if unit else ''}"
        if name in draft.unknown:
            lines.append(_line(name, _todo(f"{meant}, in the unit that it has")))
        elif name in draft.found:
            new = converted({name: value}, draft.ours, draft.theirs)[name]
            lines.append(_line(name, _number(_neat(new)), _told(draft.theirs.by_name[name])))
        else:
            there = _names(draft, name)
            said = f"# TODO {_key(name)} = {meant} in the system: not found in the FMU, left out"
            lines.append(f"{said}; it has {there}" if there else said)
    for v in draft.theirs.of("input"):
        if v.supported and v.name not in draft.found:
            what = f"{_start(v)} or another value; no line here if connected or named above"
            lines.append(_line(v.name, _todo(f"{what}; {_told(v)}")))
    return lines


def alone(fmus: Mapping[str, tuple[Path, str]]) -> tuple[str, list[str]]:
    """The text of a system of FMUs, by component, each with its path in the file; and notes.

    It has their default experiment, and each input at its start value.
    """
    interfaces = {name: Component(name, fmu, {}).interface for name, (fmu, _) in fmus.items()}
    step, start, stop, notes = _experiment(interfaces.values())
    head = HEAD.format(
        name=next(iter(fmus)),
        step=_entry(step),
        stop=_entry(stop),
        start=f"start = {_entry(start)}  # s\n" if start else "",
    )
    parts = [_listed(name, i, fmus[name][1]) for name, i in interfaces.items()]
    return "\n".join([head, *parts]), notes


def _listed(name: str, interface: Interface, path: str) -> str:
    """The tables of an FMU alone: its inputs, and in comments what else there is.

    These are its parameters, the values that others may start from, and its outputs.
    """
    variables = [
        v for v in interface.variables if v.supported and v.name not in interface.main_names
    ]
    inputs = [v for v in variables if v.causality == "input"]
    parameters = [v for v in variables if v.causality in PARAMETERS]
    initial = [v for v in variables if v.settable and v.causality not in SETTABLE]
    lines = [_line(v.name, _start(v), _told(v)) for v in inputs]
    comments = [f"# {_line(v.name, _start(v), _told(v))}" for v in parameters]
    comments += [f"# {_line(v.name, _start(v), f'at the start, {_told(v)}')}" for v in initial]
    comments += [f"# {v.name}, recorded: {_told(v)}" for v in by_default(interface)]
    lines += comments[:MOST]
    if len(comments) > MOST:
        lines.append(f"# and {len(comments) - MOST} more: grasp-cosim inspect {path}")
    tables = _component(name, path, interface), _table(f"[components.{name}.values]", lines)
    return "".join(f"{text}\n\n" for text in tables if text)[:-1]


def _experiment(fmus: Collection[Interface]) -> tuple[Time, Time, Time, list[str]]:
    """Step, start and stop time, and notes: the shortest step that an FMU recommends, from where
    the first one begins until the last one ends.

    The step is as the FMU says, or where no system can have that, the next longer one.
    """
    keys = ("start_time", "stop_time", "step_size")
    begins, ends, steps = ([_time(i.experiment.get(key)) for i in fmus] for key in keys)
    start, last = nearest_time(min(begins)), nearest_time(max(ends))
    recommended = min((s for s in steps if s > 0.0), default=None)
    missing = []
    if recommended is None:
        missing.append("step")
    if last <= start:
        missing.append("stop time")
        last = start + NANOSECONDS
    step = step_of(in_seconds(last - start) / STEPS if recommended is None else recommended)
    stop = start + max(1, round((last - start) / step)) * step
    notes = []
    if missing:
        chosen = f"chosen, step = {in_seconds(step):g} s, stop = {in_seconds(stop):g} s"
        notes.append(f"no FMU recommends a {' and a '.join(missing)}: {chosen}")
    if recommended is not None and not math.isclose(in_seconds(step), recommended, rel_tol=1e-9):
        notes.append(f"an FMU recommends a step of {recommended!r} s: {written(step)} s chosen")
    return step, start, stop, notes


def _entry(time: Time) -> str:
    """A time as the file has it: a number, or in quotes a fraction."""
    return _quoted(written(time)) if time.denominator > 1 else repr(in_seconds(time))


def _time(value: Value | None) -> float:
    """A time of a default experiment; 0 where there is none that a system can have."""
    return value if isinstance(value, float) and abs(value) <= LONGEST else 0.0


def _table(heading: str, lines: Iterable[str]) -> str:
    """The text of a table; empty without lines."""
    there = [line for line in lines if line]
    return "\n".join([heading, *there]) if there else ""


def _line(key: str, value: str, comment: str = "") -> str:
    return f"{_key(key)} = {value}{comment and f'  # {comment}'}"


def _component(name: str, path: str, fmu: Interface) -> str:
    """The first table of a component: one made here needs no process of its own."""
    trust = _line("isolation", '"process"', "in a process of its own, until you trust its binary")
    lines = [_line("fmu", _quoted(path)), "" if fmu.ours else trust]
    return _table(f"[components.{name}]", lines)


def _names(draft: Draft, name: str) -> str:
    """The variables that one could be, as messages list them; empty if there are none."""
    there = [v.name for v in _able(draft, name)]
    return choices(there, FEW) if there else ""


def _todo(what: str) -> str:
    return _quoted(f"TODO: {what}")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _quoted(name)


def _number(value: Value) -> str:
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
