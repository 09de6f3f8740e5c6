"""The native twins of FMUs: those of our own blocks, which are built, and those that a user built.

A twin has the same variables and gives the same bits. Of an FMU in Python that has no binary for
this machine the twin is run in any case.
"""

from __future__ import annotations

import logging
from pathlib import Path

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
    found, failure = _twins([c for c in system.components if not c.native])
    if native and failure:
        raise InputError(f"native FMUs cannot be built: {failure}")
    without = [c for c in system.components if not c.native and c.name not in found]
    left = {c.name: _why(c) for c in without if c.interface.python}
    if failure:
        LOGGER.warning("FMUs run in Python, which takes longer: %s", failure)
    elif left:
        odd = native or any(p.is_file() for c in without for p in _users_twins(c))
        but = choices((f"{name} ({why})" for name, why in left.items()), FEW)
        LOGGER.log(logging.WARNING if odd else logging.INFO, "no native FMU runs as %s", but)
    return {**found}


def needed_twins(system: Structure) -> dict[str, Path | None]:
    """The twins of FMUs in Python that have no binary for this machine, by component."""
    return {**_twins([c for c in system.components if c.needs_native])[0]}


def _lacking(component: Component) -> str:
    """The binary that the FMU of a component lacks, in words."""
    obstacle = of_binary(component.interface)
    return f"{component.interface.called} {obstacle.what if obstacle else ''}"


def _users_twins(component: Component) -> list[Path]:
    """Where a twin may be that the user has built; nowhere of an FMU that is no block of ours."""
    if not _is_ours(component):
        return []
    folders = NATIVE_FOLDER, component.fmu.parent.parent / NATIVE_FOLDER.name
    return [folder / f"{component.interface.identifier}.fmu" for folder in folders]


def _twins(components: list[Component]) -> tuple[dict[str, Path], str]:
    """The twins that there are or can be built, and why one of our own blocks has none, or "".

    An FMU without a twin has none here, and so has one that needs no Python. InputError where one
    that has no binary for this machine lacks its twin because none can be built.
    """
    ours = [c for c in components if _is_ours(c)]
    if not ours:
        return {}, ""
    from grasp_fmus.build import NoTwinsError, shipped_twins
    from grasp_fmus.shipped import together

    folders, failure = {}, ""
    shipped = {c.name: names for c in ours if (names := together(c.interface.identifier))}
    for names in dict.fromkeys(shipped.values()):
        try:
            folders[names] = shipped_twins(names)
            LOGGER.info("native FMUs: %s", folders[names])
        except NoTwinsError as error:
            failure = str(error)
    built = {name: folders.get(names) for name, names in shipped.items()}
    found = {c.name: twin for c in ours if (twin := _twin(c, built.get(c.name)))}
    missing = [c for c in ours if c.name in shipped and c.name not in found]
    for component in missing:
        if failure and component.needs_native:
            raise InputError(f"{component.name}: {_lacking(component)}; {failure}")
    return found, failure if missing else ""


def _is_ours(component: Component) -> bool:
    """True for an FMU that runs a block of ours in Python."""
    made = component.interface
    return made.python and (made.tool or "").startswith("grasp-cosim ")


def _twin(component: Component, shipped: Path | None) -> Path | None:
    """The native FMU of the same content as the component's, of those built and of the user's."""
    from grasp_fmus.build import is_twin

    built = [shipped / f"{component.interface.identifier}.fmu"] if shipped else []
    places = (*built, *_users_twins(component))
    return next((p for p in places if is_twin(p, component.interface.guid)), None)


def _why(component: Component) -> str:
    there = [p for p in _users_twins(component) if p.is_file()]
    name = component.fmu.name
    if there:
        return f"{there[0]} is not the twin of this {name}, or not for this machine"
    return f"{name} has no native twin"
