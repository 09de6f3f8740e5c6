"""What overrides make of the sections of a system, and of a component.

A reader of files gives all that a file has, as overrides of the defaults; a system that is changed
gives what is changed.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, TypeVar

from ..base.checks import as_table, check_keys, choice, number, text
from ..base.errors import InputError
from ..interface.read import read_interface
from .changes import replaced, with_old_values, with_values
from .overrides import ENTRIES_OF_SECTIONS, METRICS, RECORD, ComponentOverrides, Override
from .parts import (
    ISOLATIONS,
    Acceptance,
    Component,
    Initialisation,
    Logging,
    MetricLimit,
    Realtime,
    Solver,
)
from .record import Record, Trigger
from .scenario import read_condition
from .stimuli import INTERPOLATIONS, Stimuli, read_stimuli
from .structure import DIVERGING, SCHEMES, Structure
from .times import LONGEST, Time, in_nanoseconds

Options = TypeVar("Options")

ENDS = ("low", "high")
"""The bounds of a metric in [verdict.metrics]."""

MUST_OF_NAMES = {
    "rename": "a variable of the FMU, a string",
    "units": "the name of a unit, like 'mm'",
}
"""The tables of names that a component has, and what these must be."""


def experiment(overrides: Iterable[Override]) -> dict[str, Any]:
    """The attributes of a system that overrides of its [experiment] stand for."""
    attributes: dict[str, Any] = {}
    for override in overrides:
        label, value = override.label, override.value
        entry = override.place.removeprefix("experiment.")
        if entry == "start":
            attributes["start_ns"] = in_nanoseconds(label, value, zero=True, low=-LONGEST)
        elif entry == "variant":
            raise InputError(
                f"{label} = {value!r}: only an .ssp has variants, chosen as it is read: "
                "--set experiment.variant=NAME, or System.load(path, variant=NAME)"
            )
        elif entry in ("step", "stop"):
            attributes[f"{entry}_ns"] = in_nanoseconds(label, value)
        else:
            attributes[entry] = choice(label, value, SCHEMES if entry == "scheme" else DIVERGING)
    return attributes


def sections(
    system: Structure | None,
    overrides: Mapping[str, Mapping[str, Override]],
    folder: Path = Path(),
) -> dict[str, Any]:
    """The attributes of a system that stand in sections of single values, with overrides of them.

    These are by section and entry. Without a system they override the defaults. Paths of files are
    from the folder.
    """
    tables = {section: overrides.get(section, {}) for section in ENTRIES_OF_SECTIONS}
    roles = dict(system.roles) if system else {}
    for role, override in tables["roles"].items():
        roles[role] = text(override.label, override.value, "the name of a component")
    loops = system.initialisation if system else Initialisation()
    pace = system.realtime if system else Realtime()
    verdict = system.verdict if system else Acceptance()
    stimuli = system.input if system else None
    record = system.record if system else Record()
    return {
        **experiment(tables["experiment"].values()),
        "initialisation": with_options("initialisation", loops, tables["initialisation"]),
        "realtime": with_options("realtime", pace, tables["realtime"]),
        "verdict": _with_verdict(verdict, tables["verdict"]),
        "roles": roles,
        "input": _with_input(stimuli, tables["input"], folder),
        "record": with_trigger(record, tables[RECORD]),
    }


def with_trigger(record: Record, overrides: Mapping[str, Override]) -> Record:
    """The record with another trigger, or other times of it: overrides of "trigger", "before" and
    "after". The trigger false takes it away.
    """
    trigger, times = record.trigger, dict(overrides)
    when = trigger.when if trigger else None
    if override := times.pop("trigger", None):
        is_gone = override.value is False
        when = None if is_gone else read_condition(override.label, override.value)
    if when is None:
        for override in times.values():
            raise InputError(
                f"{override.label} = {override.value!r}: there is no trigger; must have one, like "
                'record.trigger = "plant.contact[1] == true"'
            )
        return record.untriggered()
    spans: dict[str, Time] = {"before": 0}
    if trigger:
        spans = {"before": trigger.before_ns, "after": trigger.after_ns}
    for entry, override in times.items():
        spans[entry] = in_nanoseconds(override.label, override.value, zero=True)
    if "after" not in spans:
        label = next(iter(overrides.values())).label_of("record.after")
        raise InputError(f"{label}: no entry; a trigger must have one, a time in s, at least 0")
    return replace(record, trigger=Trigger(when, spans["before"], spans["after"]))


def _with_input(
    stimuli: Stimuli | None, overrides: Mapping[str, Override], folder: Path
) -> Stimuli | None:
    """The stimuli with another file, or another way between its rows."""
    if not overrides:
        return stimuli
    label_of = next(iter(overrides.values())).label_of
    label = label_of("input.interpolation")
    interpolation = overrides["interpolation"].value if "interpolation" in overrides else "linear"
    file = overrides["file"].value if "file" in overrides else None
    if file is None and stimuli:
        return replace(stimuli, interpolation=choice(label, interpolation, INTERPOLATIONS))
    if not isinstance(file, str | Path):
        raise InputError(f"{label_of('input.file')} = {file!r}: must be the path of a CSV file")
    return read_stimuli(folder / file, interpolation, label)


def _with_verdict(verdict: Acceptance, overrides: Mapping[str, Override]) -> Acceptance:
    """The verdict with overrides of its entries, and of the limits of metrics by name."""
    entry_of = {f"{METRICS}{limit.name}": limit for limit in verdict.metrics}
    single: dict[str, Override] = {}
    for entry, override in overrides.items():
        of_metrics = [override] if entry.startswith(METRICS) else []
        if entry == METRICS.rstrip("."):
            of_metrics = [*_of_table(override)]
        elif not of_metrics:
            single[entry] = override
        for limit in of_metrics:
            place = limit.place.removeprefix("verdict.")
            end = next((end for end in ENDS if place.endswith(f".{end}")), "")
            name = place.removesuffix(f".{end}") if end else place
            older = entry_of.get(name, MetricLimit(name.removeprefix(METRICS)))
            entry_of[name] = _metric_limit(older, end, limit)
    options = with_options("verdict", verdict, single)
    return replace(options, metrics=tuple(entry_of.values()))


def _of_table(override: Override) -> Iterator[Override]:
    """The overrides that a table of limits of metrics stands for, a place for each number."""
    for name, entry in as_table(override.label, override.value).items():
        place = f"{override.place}.{name}"
        if not isinstance(entry, Mapping):
            yield Override(place, entry, override.origin)
            continue
        check_keys(override.label_of(place), entry, ENDS)
        for end, value in entry.items():
            yield Override(f"{place}.{end}", value, override.origin)


def _metric_limit(limit: MetricLimit, end: str, override: Override) -> MetricLimit:
    """The limit of a metric with another end; without one both are new."""
    label, value = override.label, override.value
    if not end and isinstance(value, bool):
        return MetricLimit(limit.name, float(value), float(value))
    must = "a finite number" if end else "the highest value, a finite number, or true or false"
    bound = number(label, value, must=must)
    if not end:
        return MetricLimit(limit.name, None, bound)
    changed = replace(limit, low=bound) if end == "low" else replace(limit, high=bound)
    if changed.low is not None and changed.high is not None and changed.low > changed.high:
        raise InputError(
            f"{label} = {bound:g}: low = {changed.low:g} must be at most high = {changed.high:g}"
        )
    return changed


def with_options(place: str, options: Options, overrides: Mapping[str, Override]) -> Options:
    """Options such as Initialisation, or a Solver, with overrides of their entries.

    The place is that of the table which has these.
    """
    if not overrides:
        return options
    label = next(iter(overrides.values())).label_of(place)
    check_keys(label, overrides, options.__slots__)  # type: ignore[attr-defined]
    values = {entry: override.value for entry, override in overrides.items()}
    try:
        return replace(options, **values)  # type: ignore[type-var]
    except InputError as error:
        raise InputError(f"{label}: {error}") from error


def with_overrides(
    component: Component, overrides: ComponentOverrides, system: Structure | None = None
) -> tuple[Component, list[str]]:
    """The component with overrides of its entries; and notes.

    Those for a component of a system are changes: texts may stand for numbers, and with an FMU,
    names and units are those of its variables, and so are values, in its units.
    """
    notes: list[str] = []
    rename = _names(overrides, "rename")
    units = _names(overrides, "units")
    values = overrides.table("values")
    fmu = overrides.entries.get("fmu")
    if system and fmu:
        if not isinstance(fmu.value, str | Path):
            raise InputError(f"{fmu.label} = {fmu.value!r}: must be the path of an FMU")
        label = fmu.label_of(f"components.{component.name}.fmu")
        swapped = replaced(component, Path(fmu.value), rename, units, f"{label}: ")
        component, notes = with_old_values(system, component, swapped, values, label)
    if rename or units:
        component = _with_names(component, overrides, rename, units)
    component = _with_entries(component, overrides)
    if values:
        component = with_values(component, values, from_text=system is not None)
    return component, notes


def _names(overrides: ComponentOverrides, table: str) -> dict[str, str]:
    """The names in a table of a component: what it renames, or the units of variables."""
    return {
        name: text(override.label, override.value, MUST_OF_NAMES[table])
        for name, override in overrides.table(table).items()
    }


def _with_names(
    component: Component,
    overrides: ComponentOverrides,
    rename: Mapping[str, str],
    units: Mapping[str, str],
) -> Component:
    """The component with more names and units, which its FMU must have variables for."""
    component = replace(
        component,
        rename={**component.rename, **rename},
        units={**component.units, **units},
    )
    read_interface(component.fmu)  # what is wrong in the FMU has its own place
    try:
        component.interface  # noqa: B018 - it is worked out
    except InputError as error:
        table = overrides.table("rename") or overrides.table("units")
        label = next(iter(table.values())).label_of(f"components.{error}")
        raise InputError(label) from error
    return component


def _with_entries(component: Component, overrides: ComponentOverrides) -> Component:
    """The component with another step, isolation, logging or trace, or other solver options."""
    if step := overrides.entries.get("step"):
        component = replace(component, step_ns=in_nanoseconds(step.label, step.value))
    if isolation := overrides.entries.get("isolation"):
        chosen = choice(isolation.label, isolation.value, ISOLATIONS)
        component = replace(component, isolation=chosen)
    if logging := overrides.entries.get("logging"):
        component = replace(component, logging=_logging(logging))
    if trace := overrides.entries.get("trace"):
        must = "the path of a file, as a string"
        file = Path(text(trace.label, trace.value, must))
        component = replace(component, trace=file.absolute())
    tolerances = overrides.tables.get("solver")
    if tolerances is not None:  # an empty table asks for the default solver
        place = f"components.{component.name}.solver"
        solver = component.solver or Solver()
        component = replace(component, solver=with_options(place, solver, tolerances))
    return component


def _logging(override: Override) -> Logging:
    """What an FMU is to log: true or false, a category, or several, in a list or with commas."""
    entry = override.value
    if isinstance(entry, bool):
        return entry
    names = entry.split(",") if isinstance(entry, str) else entry
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise InputError(
            f"{override.label} = {entry!r}: must be true, false, the name of a category, or a list "
            "of such"
        )
    return tuple(name.strip() for name in names)
