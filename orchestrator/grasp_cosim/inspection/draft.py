"""System files to start from: a foreign FMU in the place of a component, or FMUs only.

What is not known is marked as a TODO. The reader of system files refuses it as a value; a TODO in
a comment is nothing that a run needs.
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
from .name_matching import Match, candidates, match_variables

MAX_NAMES = 6
"""So many variables, or items of an enumeration, a comment names at most."""

MAX_COMMENTS = 100
"""So many parameters and outputs of a single FMU are listed as comments."""

DEFAULT_STEPS = 1000
"""Communication steps of an experiment for which no FMU recommends a step size."""

FILE_HEAD = """# A system of FMUs. Run it: grasp-cosim run FILE

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

_BARE_KEY = re.compile(r"[A-Za-z0-9_-]+")


@dataclass(frozen=True, slots=True)
class Draft:
    """The tables of a component with a foreign FMU, as far as they are filled in.

    `matches` are its variables by the system's names. `old` is the interface of the FMU that the
    component had, `foreign` that of the foreign one under the same names. `unit_todos` say of
    variables, by name, that the user has to give their unit.
    """

    name: str
    text: str
    matches: Mapping[str, Match]
    old: Interface
    foreign: Interface
    unit_todos: Mapping[str, str]

    def put_into(self, text: str) -> str:
        """The text of a system file with this component, and its values in presets.

        A table of the file begins with its heading and ends with an empty line.
        """
        heading = f"[components.{self.name}]"
        preset = re.compile(rf'^("{re.escape(self.name)}\.(.+?)") = (\S+)(.*)$', re.MULTILINE)
        tables = [
            self.text if table.startswith(heading) else preset.sub(self._preset_line, table)
            for table in text.split("\n\n")
        ]
        return "\n\n".join(tables)

    def _preset_line(self, match: re.Match[str]) -> str:
        """A line of a preset in the unit of the FMU; a comment where it has no such variable."""
        line = match[0]
        key, name, value, comment = match.groups()
        if name not in self.matches:
            return f"# {line}  # not in {self.foreign.path.name}"
        if name in self.unit_todos:
            return f"# {line}  # TODO: in the unit that it has"
        change = self.old.conversion(name, self.foreign)
        if change is None or self.old.by_name[name].kind != "Real":
            return line
        return f"{key} = {_rounded(change(float(value)))}{comment}"


def draft_of(system: Structure, name: str, fmu: Path, path: str, presets: Iterable[str]) -> Draft:
    """A foreign FMU in the place of that of a component, filled in as far as names tell.

    Args:
        system: The system in which the component is.
        name: The component.
        fmu: The foreign FMU.
        path: How the system file names it.
        presets: The variables of the component that presets give a value.

    Raises:
        InputError: There is no such component, or no such FMU.
    """
    component = system.component(name, name)
    old = component.interface
    unrenamed = Component(name, fmu, {}).interface
    connected = _connected_variables(system, name) | stated(system, name)
    outputs = {v.name for v in old.of("output")}
    requested = {*connected, *component.values, *presets, *outputs}
    variables = [v for v in old.variables if v.supported and _may_be_named(v, component)]
    likely = match_variables(old, unrenamed)
    matches = {
        v.name: likely[v.name]
        for v in variables
        if v.name in likely and (v.name in requested or not likely[v.name].doubt)
    }
    foreign_names = {key: match.variable.name for key, match in matches.items()}
    renames = {key: foreign for key, foreign in foreign_names.items() if key != foreign}
    draft = Draft(name, "", matches, old, renamed(unrenamed, renames), {})
    draft = replace(draft, unit_todos=_unit_todos(draft, variables, requested, connected))
    heading = f"[components.{name}"
    tables = [
        _component_table(name, path, draft.foreign),
        _table(
            f"{heading}.rename]  # the system's name = the FMU's",
            _rename_lines(draft, variables, connected),
        ),
        _table(
            f"{heading}.units]  # what the FMU does not declare",
            [_line(key, todo) for key, todo in draft.unit_todos.items()],
        ),
        _table(f"{heading}.values]  # in the FMU's units", _value_lines(draft, component)),
    ]
    return replace(draft, text="\n\n".join(table for table in tables if table))


def _connected_variables(system: Structure, name: str) -> set[str]:
    """The variables of a component that connections begin or end at."""
    ports = [port for c in system.connections for port in (c.source, c.target)]
    return {port.variable for port in ports if port.component == name}


def _may_be_named(variable: Variable, component: Component) -> bool:
    """True if a system file may name a variable: to connect, to set or to record it."""
    if variable.causality == "output" or variable.causality in SETTABLE:
        return True
    return variable.name in component.values


def _rename_lines(
    draft: Draft, variables: Iterable[Variable], connected: Collection[str]
) -> list[str]:
    """The lines of matches whose names differ or are in doubt, then those of missing variables."""
    lines = [
        _line(key, _quoted(match.variable.name), match.check_comment + _comment_on(match.variable))
        for key, match in draft.matches.items()
        if match.variable.name != key or match.doubt
    ]
    missing = [v for v in variables if v.name not in draft.matches]
    lines += [_missing_line(draft, v, v.name in connected) for v in missing]
    return lines


def _missing_line(draft: Draft, variable: Variable, connected: bool) -> str:
    """The line of rename of a variable without a match; empty where nobody may want it."""
    name = variable.name
    names = _candidate_names(draft, name)
    kind = "" if variable.kind == "Real" else f"{variable.type} "
    unit = f" in {variable.unit}" if variable.unit else ""
    remark = (
        f"the FMU's name of the {kind}{variable.causality}{unit}: {names or 'it has none left'}"
    )
    if connected:
        return _line(name, _todo(remark if names else f"{remark}; then no line, and no connection"))
    if variable.causality == "output":
        return f"# TODO {_key(name)} = {remark}; metrics and figures may want it"
    return ""


def _unit_todos(
    draft: Draft,
    variables: Iterable[Variable],
    requested: Collection[str],
    connected: Collection[str],
) -> dict[str, str]:
    """What is to be done for the units of requested variables, by name, where anything is."""
    todos = {
        v.name: _unit_todo(draft, v, v.name in connected) for v in variables if v.name in requested
    }
    return {name: todo for name, todo in todos.items() if todo}


def _unit_todo(draft: Draft, variable: Variable, connected: bool) -> str:
    """What is to be done for the unit of a variable that declares none; empty if nothing is.

    A connected variable without a match has something to be done if none of those that it could
    be declares a unit.
    """
    if variable.kind != "Real" or variable.unit == "1" or draft.old.unit(variable) is None:
        return ""
    if variable.name in draft.matches:
        meant = [draft.foreign.by_name[variable.name]]
    elif connected:
        meant = _candidates(draft, variable.name)
    else:
        meant = []
    if not meant or any(map(draft.foreign.unit, meant)):
        return ""
    declared = f"{meant[0].unit!r}, which is not known" if meant[0].unit else "none"
    return _todo(f"its unit, like {variable.unit}; the FMU declares {declared}")


def _candidates(draft: Draft, name: str) -> list[Variable]:
    """The foreign variables without a match that could be one of the system."""
    return candidates(draft.old, name, draft.foreign, draft.matches)


def _value_lines(draft: Draft, component: Component) -> list[str]:
    """The values of the component in the units of the FMU, then inputs that have no source."""
    lines = [_value_line(draft, name, value) for name, value in component.values.items()]
    for v in draft.foreign.of("input"):
        if v.supported and v.name not in draft.matches:
            remark = f"{_start(v)} or another value; no line here if connected or named above"
            lines.append(_line(v.name, _todo(f"{remark}; {_comment_on(v)}")))
    return lines


def _value_line(draft: Draft, name: str, value: Value) -> str:
    """The line of a value of the component; a TODO where its unit or its variable is not known."""
    unit = draft.old.by_name[name].unit
    quantity = f"{_number(value)} {unit}" if unit else _number(value)
    if name in draft.unit_todos:
        return _line(name, _todo(f"{quantity}, in the unit that it has"))
    if name in draft.matches:
        new = converted({name: value}, draft.old, draft.foreign)[name]
        return _line(name, _number(_rounded(new)), _comment_on(draft.foreign.by_name[name]))
    line = f"# TODO {_key(name)} = {quantity} in the system: not found in the FMU, left out"
    names = _candidate_names(draft, name)
    return f"{line}; it has {names}" if names else line


def system_of_fmus(fmus: Mapping[str, tuple[Path, str]]) -> tuple[str, list[str]]:
    """The text of a system of FMUs, by component, each with its path in the file; and notes.

    It has their default experiment, and each input at its start value.
    """
    interfaces = {name: Component(name, fmu, {}).interface for name, (fmu, _) in fmus.items()}
    step, start, stop, notes = _experiment(interfaces.values())
    head = FILE_HEAD.format(
        name=next(iter(fmus)),
        step=_time_text(step),
        stop=_time_text(stop),
        start=f"start = {_time_text(start)}  # s\n" if start else "",
    )
    tables = [
        _tables_of_fmu(name, interface, fmus[name][1]) for name, interface in interfaces.items()
    ]
    return "\n".join([head, *tables]), notes


def _tables_of_fmu(name: str, interface: Interface, path: str) -> str:
    """The tables of a single FMU: its inputs, and in comments what else there is.

    These are its parameters, the values that others may start from, and its outputs.
    """
    variables = [
        v for v in interface.variables if v.supported and v.name not in interface.main_names
    ]
    lines = [_start_line(v) for v in variables if v.causality == "input"]
    comments = [f"# {_start_line(v)}" for v in variables if v.causality in PARAMETERS]
    for v in variables:
        if v.settable and v.causality not in SETTABLE:
            comments.append(f"# {_line(v.name, _start(v), f'at the start, {_comment_on(v)}')}")
    comments += [f"# {v.name}, recorded: {_comment_on(v)}" for v in by_default(interface)]
    lines += comments[:MAX_COMMENTS]
    if len(comments) > MAX_COMMENTS:
        lines.append(f"# and {len(comments) - MAX_COMMENTS} more: grasp-cosim inspect {path}")
    tables = [
        _component_table(name, path, interface),
        _table(f"[components.{name}.values]", lines),
    ]
    return "\n\n".join(table for table in tables if table) + "\n"


def _start_line(variable: Variable) -> str:
    """A line that gives a variable its start value."""
    return _line(variable.name, _start(variable), _comment_on(variable))


def _experiment(fmus: Collection[Interface]) -> tuple[Time, Time, Time, list[str]]:
    """Step, start and stop time, and notes: the shortest step that an FMU recommends, from where
    the first one begins until the last one ends.

    The step is that of the FMU, or where no system can have that, the next longer one.
    """
    first_start = min(_declared_time(fmu, "start_time") for fmu in fmus)
    last_stop = max(_declared_time(fmu, "stop_time") for fmu in fmus)
    step_sizes = [_declared_time(fmu, "step_size") for fmu in fmus]
    recommended = min((size for size in step_sizes if size > 0.0), default=None)
    start, end = nearest_time(first_start), nearest_time(last_stop)
    missing = []
    if recommended is None:
        missing.append("step")
    if end <= start:
        missing.append("stop time")
        end = start + NANOSECONDS
    step = step_of(in_seconds(end - start) / DEFAULT_STEPS if recommended is None else recommended)
    stop = start + max(1, round((end - start) / step)) * step
    notes = []
    if missing:
        chosen = f"chosen, step = {in_seconds(step):g} s, stop = {in_seconds(stop):g} s"
        notes.append(f"no FMU recommends a {' and a '.join(missing)}: {chosen}")
    if recommended is not None and not math.isclose(in_seconds(step), recommended, rel_tol=1e-9):
        notes.append(f"an FMU recommends a step of {recommended!r} s: {written(step)} s chosen")
    return step, start, stop, notes


def _time_text(time: Time) -> str:
    """A time as the file has it: a number, or in quotes a fraction."""
    return _quoted(written(time)) if time.denominator > 1 else repr(in_seconds(time))


def _declared_time(fmu: Interface, key: str) -> float:
    """A time in s of the default experiment; 0 where there is none that a system can have."""
    value = fmu.experiment.get(key)
    return value if isinstance(value, float) and abs(value) <= LONGEST else 0.0


def _table(heading: str, lines: Iterable[str]) -> str:
    """The text of a table; empty where no line has a text."""
    written_lines = [line for line in lines if line]
    return "\n".join([heading, *written_lines]) if written_lines else ""


def _line(key: str, value: str, comment: str = "") -> str:
    line = f"{_key(key)} = {value}"
    return f"{line}  # {comment}" if comment else line


def _component_table(name: str, path: str, fmu: Interface) -> str:
    """The first table of a component. An FMU that was made here needs no separate process."""
    lines = [_line("fmu", _quoted(path))]
    if not fmu.ours:
        comment = "in its own process, until you trust its binary"
        lines.append(_line("isolation", '"process"', comment))
    return _table(f"[components.{name}]", lines)


def _candidate_names(draft: Draft, name: str) -> str:
    """The variables that one could be, as messages list them; empty if there are none."""
    names = [v.name for v in _candidates(draft, name)]
    return choices(names, MAX_NAMES) if names else ""


def _todo(remark: str) -> str:
    return _quoted(f"TODO: {remark}")


def _quoted(text: str) -> str:
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def _key(name: str) -> str:
    return name if _BARE_KEY.fullmatch(name) else _quoted(name)


def _number(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return _quoted(value) if isinstance(value, str) else repr(value)


def _rounded(value: Value) -> Value:
    """A converted number, to the 15 digits that it has."""
    return float(f"{value:.15g}") if isinstance(value, float) else value


def _start(variable: Variable) -> str:
    """The start value of a variable, in its type; zero, false or nothing where it has none."""
    zeros: dict[str, Value] = {"Boolean": False, "Integer": 0, "String": ""}
    zero = zeros.get(variable.kind, 0.0)
    value = variable.start_value
    return _number(value if isinstance(value, type(zero)) else zero)


def _comment_on(variable: Variable) -> str:
    """A comment on a variable: its causality, unit, items and description."""
    properties = [variable.causality]
    if variable.unit and variable.unit != "1":
        properties.append(variable.unit)
    if variable.items:
        items = [f"{number} {name}" for name, number in variable.items.items()]
        properties.append(choices(items, MAX_NAMES))
    comment = ", ".join(properties)
    description = on_one_line(" ".join((variable.description or "").split()))
    return f"{comment}: {description}" if description else comment
