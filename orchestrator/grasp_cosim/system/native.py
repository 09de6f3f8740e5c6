"""The native twins of FMUs: those of our own blocks, which are built, and those that a user built.

A twin has the same variables and gives the same bits. Of an FMU in Python that has no binary for
this machine the twin is run in any case.
"""

from __future__ import annotations

import logging
from pathlib import Path
from typing import Any

from ..base.errors import InputError, choices
from ..base.files import NATIVE_FOLDER
from ..interface.obstacles import of_binary
from .parts import Component
from .structure import Structure

LOGGER = logging.getLogger(__name__)
"""Gets which native FMUs run, and as a warning what does not run as it was asked for."""

FEW = 3
"""Components without a twin that are named at most."""


def natives(system: Structure, native: bool | None) -> dict[str, Path | None]:
    """The native twins by component that run in the place of FMUs; see System.natively()."""
    if native is False:
        if needy := next((c for c in system.components if c.needs_native), None):
            raise InputError(f"{needy.name}: {_lacking(needy)}; its native twin must run")
        return {c.name: None for c in system.components}
    asked = [c for c in system.components if not c.native]
    found, failure = _twins(asked)
    if native and failure:
        raise InputError(f"native FMUs cannot be built: {failure}")
    left, odd = [], bool(native)
    for c in asked:
        if c.interface.python and c.name not in found:
            users = next((path for path in _users_twins(c) if path.is_file()), None)
            odd, why = odd or bool(users), f"{c.fmu.name} has no native twin"
            if users:
                why = f"{users} is not the twin of this {c.fmu.name}, or not for this machine"
            left.append(f"{c.name} ({why})")
    if failure:
        LOGGER.warning("FMUs run in Python, which takes longer: %s", failure)
    elif left:
        level = logging.WARNING if odd else logging.INFO
        LOGGER.log(level, "no native FMU runs as %s", choices(left, FEW))
    return {**found}


def needed_twins(system: Structure) -> dict[str, Path | None]:
    """The twins of FMUs in Python that have no binary for this machine, by component."""
    return {**_twins([c for c in system.components if c.needs_native])[0]}


def _lacking(component: Component) -> str:
    """The binary that the FMU of a component lacks, in words."""
    obstacle = of_binary(component.interface)
    return f"{component.interface.called} {obstacle.reason if obstacle else ''}"


def _users_twins(component: Component) -> list[Path]:
    """Where a twin may be that the user has built; nowhere of an FMU that is no block of ours."""
    if not _is_ours(component):
        return []
    folders = NATIVE_FOLDER, component.fmu.parent.parent / NATIVE_FOLDER.name
    return [folder / f"{component.interface.identifier}.fmu" for folder in folders]


def _twins(components: list[Component]) -> tuple[dict[str, Path], str]:
    """The twins that there are or can be built, and why one of our own blocks has none, or "".

    InputError where the twin of an FMU that has no binary for this machine cannot be built.
    """
    ours = [c for c in components if _is_ours(c)]
    if not ours:
        return {}, ""
    from ..fmu_export.build import NoTwinsError, is_twin, shipped_twins
    from ..fmu_export.shipped import together

    folders: dict[Any, Path | None] = {None: None}
    found, failure, why = dict[str, Path](), "", ""
    for c in ours:
        names, file = together(c.interface.identifier), f"{c.interface.identifier}.fmu"
        if names not in folders:
            try:
                folders[names] = shipped_twins(names)
                LOGGER.info("native FMUs: %s", folders[names])
            except NoTwinsError as error:
                folders[names], failure = None, str(error)
        folder = folders[names]
        places = [folder / file, *_users_twins(c)] if folder else _users_twins(c)
        twin = next((path for path in places if is_twin(path, c.interface.guid)), None)
        if twin:
            found[c.name] = twin
        elif names and not folder:
            why = failure
            if c.needs_native:
                raise InputError(f"{c.name}: {_lacking(c)}; {failure}")
    return found, why


def _is_ours(component: Component) -> bool:
    """True for an FMU that runs a block of ours in Python."""
    made = component.interface
    return made.python and (made.tool or "").startswith("grasp-cosim ")
