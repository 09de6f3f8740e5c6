"""The system of a recorded run, from its run.json: so a run is repeated, with the same bits.

run.json has all that a system file has, but not the FMUs and the table of stimuli. These are looked
for at their paths from the folder of the run, then in that folder, and must be those that ran.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

from ..base.errors import InputError, choices
from ..interface.read import read_interface
from ..system.description import System
from ..system.overrides import RECORD, Override
from ..system.parts import Component
from ..system.settings import settings
from ..system.stimuli import Stimuli, read_stimuli
from ..system.toml import check_sections, described, with_entries
from .folder import file_hash
from .run_json import RunJson, read_run_json

MAX_NAMED = 3
"""So many signals are named in a message."""

OF_COMPONENT = ("values", "step", "isolation", "rename", "units", "solver", "logging")
"""The entries of a component that a system file has under the same names."""


def read_run_as_system(
    path: Path, times: Iterable[Override], stimuli: Stimuli | None, variant: str | None
) -> System:
    """The system of the run of a run.json, with what was set in it as events.

    times are not needed, as a run has its own; stimuli go before those of the run. InputError where
    the file is damaged, or what ran cannot be had from it.
    """
    if variant is not None:
        raise InputError(f"{path}: variant = {variant!r}: only an .ssp may have variants")
    run = read_run_json(path)
    name = run["system"]
    of_system = [signal for signal in run["units"] if "." not in signal]
    if of_system:
        raise InputError(
            f"{path}: {choices(of_system, MAX_NAMED)}: outputs of the system itself are not in a "
            "run.json; must be run from its archive"
        )
    file = _sections(run)
    check_sections(file, name)
    components = [
        with_entries(Component(component, _fmu(path, run, component), {}), table, name)
        for component, table in file["components"].items()
    ]
    driven_by = stimuli or _stimuli(path, run)
    attributes = described(file, name, components, stimuli=driven_by)
    system = System(**attributes, steered=run.get("steered", False))
    _check_same(path, run, system, but="input" if stimuli else "")
    return system


def _sections(run: RunJson) -> dict[str, Any]:
    """The sections of a system file that the entries of a run.json stand for."""
    entries: Mapping[str, Any] = run
    experiment = ("step", "stop", "start", "scheme", "diverging")
    return {
        "experiment": {key: entries[key] for key in experiment if key in entries},
        "components": {name: _component(entry) for name, entry in run["components"].items()},
        "connections": [_without_none(connection) for connection in run["connections"]],
        "initialisation": dict(run["initialisation"]),
        "events": [dict(event) for event in run["events"]],
        "faults": [dict(fault) for fault in run["faults"]],
        "limits": [dict(limit) for limit in run.get("limits", [])],
        "roles": dict(run.get("roles", {})),
        "metrics": list(run.get("metrics", [])),
        "realtime": _without_none(run.get("realtime", {})),
        "verdict": _verdict(run.get("acceptance", {})),
        RECORD: _record(run),
    }


def _verdict(limits: Mapping[str, Any]) -> dict[str, Any]:
    """The limits of the verdict, of each metric those that there are."""
    metrics = limits.get("metrics", {})
    return {**limits, "metrics": {name: _without_none(limit) for name, limit in metrics.items()}}


def _record(run: RunJson) -> dict[str, Any]:
    """The signals that were recorded, and the trigger."""
    trigger = dict(run.get("trigger", {}))
    if trigger:
        trigger["trigger"] = trigger.pop("when")
    return {"signals": list(run.get("record", [])), **trigger}


def _component(entry: Mapping[str, Any]) -> dict[str, Any]:
    """The table of a component in a system file, but for its FMU."""
    table = _without_none({key: entry[key] for key in OF_COMPONENT if key in entry})
    if "tolerance" in entry:
        table["solver"] = {"relative_tolerance": entry["tolerance"]}
    elif "solver" in table:
        table["solver"] = _without_none(table["solver"])
    return table


def _without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    """The entries that have a value: a system file leaves out what there is none of."""
    return {key: value for key, value in table.items() if value is not None}


def _fmu(path: Path, run: RunJson, component: str) -> Path:
    """The FMU of a component that ran; InputError where it is not there, or is another one."""
    file, ran = run["components"][component]["fmu"], run.get("fmus", {}).get(component, {})
    place = f"{path}: components.{component}.fmu = {file!r}"
    wanted = "the FMU that ran, at its path then or next to run.json"
    for candidate in _candidates(path, ran.get("path"), file):
        twin_of, digest = ran.get("native_twin_of"), ran.get("sha256")
        if twin_of is not None:
            is_same = read_interface(candidate).guid == twin_of
        else:
            is_same = digest is None or file_hash(candidate) == digest
        if not is_same:
            raise InputError(f"{place}: {candidate} is not the FMU that ran; must be {wanted}")
        return candidate
    raise InputError(f"{place}: is not there; must be {wanted}")


def _stimuli(path: Path, run: RunJson) -> Stimuli | None:
    """The stimuli of the run, from their table; InputError where that is not there."""
    entry = run.get("input")
    if entry is None:
        return None
    file = entry["file"]
    for candidate in _candidates(path, run.get("input_path"), file):
        return read_stimuli(candidate, entry["interpolation"], f"{path}: input.interpolation")
    raise InputError(
        f"{path}: input.file = {file!r}: is not there; must be the table that drove the run, at its"
        " path then or next to run.json"
    )


def _candidates(path: Path, recorded: str | None, name: str) -> Iterator[Path]:
    """The files that there are of one that a run had: at its path then, and next to run.json."""
    places = (path.parent / file for file in dict.fromkeys((recorded or name, name)))
    return (place for place in places if place.exists())


def _check_same(path: Path, run: RunJson, system: System, but: str) -> None:
    """InputError where an entry of the system is not as in the run, as one of a later version."""
    entries: Mapping[str, Any] = run
    for key, value in json.loads(json.dumps(settings(system))).items():
        if key != but and entries.get(key) != value:
            raise InputError(
                f"{path}: {key}: reads as {json.dumps(value)[:80]}, which is not as it ran; must "
                "be the file of a run with this version"
            )
