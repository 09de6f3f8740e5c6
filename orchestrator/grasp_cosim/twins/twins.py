"""The native twins of FMUs: those of our own blocks, which are built, and those that a user built.

A twin has the same variables and gives the same bits. Of an FMU in Python that has no binary for
this machine the twin is run in any case.
"""

from __future__ import annotations

import logging
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from ..base.errors import InputError, choices
from ..base.files import NATIVE_FOLDER
from ..interface.obstacles import of_binary
from ..system.parts import Component
from ..system.structure import Structure

LOGGER = logging.getLogger(__name__)
"""Gets which native FMUs run, and as a warning what does not run as it was asked for."""

MAX_LISTED = 3
"""The most components without a twin that a line of the log names."""


class Twins(NamedTuple):
    """The native twins by component, and why those of our blocks could not be built, or ""."""

    by_component: dict[str, Path]
    failure: str


def natives(system: Structure, native: bool | None) -> dict[str, Path | None]:
    """The native twins by component that run in the place of FMUs: see System.natively().

    None stands for an FMU that runs itself.
    """
    if native is False:
        _check_python_runs(system.components)
        return {c.name: None for c in system.components}
    return _chosen([c for c in system.components if not c.native], bool(native))


def twins_of_run(system: Structure) -> dict[str, Path | None]:
    """The same for a run, of components for which nothing is chosen, or whose FMU cannot run here.

    That is an FMU in Python without a binary for this machine.
    """
    return _chosen([c for c in system.components if not c.is_chosen], requested=False)


def _chosen(components: Sequence[Component], requested: bool) -> dict[str, Path | None]:
    """The twins of components, None where there is none of an FMU in Python.

    InputError where they are requested, and cannot be built.
    """
    twins, failure = _twins(components)
    if requested and failure:
        raise InputError(f"native FMUs cannot be built: {failure}")
    in_python = [c for c in components if c.interface.python and c.name not in twins]
    if failure:
        LOGGER.warning("FMUs run in Python, which takes longer: %s", failure)
    else:
        _log_what_stays(in_python, requested)
    return {**{c.name: None for c in in_python}, **twins}


def _check_python_runs(components: Iterable[Component]) -> None:
    """InputError for an FMU in Python that has no binary for this machine."""
    for component in components:
        if component.needs_native:
            obstacle = _missing_binary(component)
            raise InputError(f"{component.name}: {obstacle}; its native twin must run")


def _log_what_stays(in_python: Sequence[Component], requested: bool) -> None:
    """Log the components that stay in Python.

    It is a warning where native ones were requested, and where one may be expected: an FMU of a
    block of ours is of other sources, or a user has built a native one that does not fit.
    """
    remarks = []
    unexpected, remedy = requested, ""
    for component in in_python:
        file, name = component.fmu.name, component.interface.identifier
        built_by_user = next((path for path in _users_twins(component) if path.is_file()), None)
        if built_by_user:
            unexpected = True
            reason = f"{built_by_user} is not the twin of this {file}, or not for this machine"
        elif _is_shipped(component):
            unexpected = True
            remedy = "; `grasp-cosim build` makes those of our blocks again"
            reason = f"{file} is of other sources than our {name}"
        else:
            reason = f"{file} has no native twin"
        remarks.append(f"{component.name} ({reason})")
    if remarks:
        level = logging.WARNING if unexpected else logging.INFO
        LOGGER.log(level, "no native FMU runs as %s%s", choices(remarks, MAX_LISTED), remedy)


def _is_shipped(component: Component) -> bool:
    """True for an FMU of the name of a block that comes with the package."""
    if not _is_ours(component):
        return False
    from ..fmu_export.shipped import together

    return together(component.interface.identifier) is not None


def _missing_binary(component: Component) -> str:
    """The binary that the FMU of a component lacks, in words."""
    obstacle = of_binary(component.interface)
    return f"{component.interface.called} {obstacle.reason if obstacle else ''}"


def _users_twins(component: Component) -> list[Path]:
    """The paths where a user may have built a twin; none for an FMU of another maker."""
    if not _is_ours(component):
        return []
    folders = NATIVE_FOLDER, component.fmu.parent.parent / NATIVE_FOLDER.name
    return [folder / f"{component.interface.identifier}.fmu" for folder in folders]


def _twins(components: Iterable[Component]) -> Twins:
    """The twins of components that are there or can be built.

    InputError where the twin of an FMU that has no binary for this machine cannot be built.
    """
    ours = [c for c in components if _is_ours(c)]
    if not ours:
        return Twins({}, "")
    from ..fmu_export.build import NoTwinsError, is_twin, shipped_twins
    from ..fmu_export.shipped import together

    folders: dict[tuple[str, ...], Path] = {}
    failures: dict[tuple[str, ...], str] = {}
    twins: dict[str, Path] = {}
    failure = ""
    for component in ours:
        file = f"{component.interface.identifier}.fmu"
        paths = _users_twins(component)
        shipped = together(component.interface.identifier)
        if shipped and shipped not in folders and shipped not in failures:
            try:
                folders[shipped] = shipped_twins(shipped)
                LOGGER.info("native FMUs: %s", folders[shipped])
            except NoTwinsError as error:
                failures[shipped] = str(error)
        if shipped in folders:
            paths = [folders[shipped] / file, *paths]
        twin = next((path for path in paths if is_twin(path, component.interface.guid)), None)
        if twin:
            twins[component.name] = twin
        elif shipped in failures:
            failure = failures[shipped]
            if component.needs_native:
                raise InputError(f"{component.name}: {_missing_binary(component)}; {failure}")
    return Twins(twins, failure)


def _is_ours(component: Component) -> bool:
    """True for an FMU that runs our block in Python."""
    interface = component.interface
    return interface.python and (interface.tool or "").startswith("grasp-cosim ")
