"""The native twins of FMUs: those of our own blocks, which are built, and those that a user built.

Of an FMU in Python that has no binary for this machine the twin is run in any case.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError
from ..files import NATIVE_FOLDER
from ..interface.obstacles import of_binary
from .description import System
from .parts import Component

LOGGER = logging.getLogger(__name__)


class Twins(NamedTuple):
    """The native twins by component, and why one of our own blocks has none, or ""."""

    found: dict[str, Path]
    failure: str


def twins(
    system: System, during: Callable[[str], AbstractContextManager[object]] = nullcontext
) -> Twins:
    """The twins that there are or can be built, which is done in the context `during`.

    An FMU without a twin has none here, and so has one that needs no Python. InputError where one
    that has no binary for this machine lacks its twin because none can be built.
    """
    from grasp_fmus.build import NoTwinsError, shipped_twins
    from grasp_fmus.shipped import SHIPPED

    folder, failure = None, ""
    ours = [c for c in system.components if _is_ours(c)]
    shipped = [c for c in ours if c.interface.identifier in SHIPPED]
    if shipped:
        try:
            folder = shipped_twins(during)
        except NoTwinsError as error:
            failure = str(error)
    if folder:
        LOGGER.info("native FMUs: %s", folder)
    found = {c.name: twin for c in ours if (twin := _twin(c, folder))}
    missing = [c for c in shipped if c.name not in found]
    for component in missing:
        if failure and component.needs_native:
            raise InputError(f"{component.name}: {lacking(component)}; {failure}")
    return Twins(found, failure if missing else "")


def with_needed_twins(system: System) -> System:
    """The system with the twins of FMUs in Python that have no binary for this machine."""
    needed = {c.name for c in system.components if c.needs_native}
    if not needed:
        return system
    return system.with_natives({n: fmu for n, fmu in twins(system).found.items() if n in needed})


def lacking(component: Component) -> str:
    """The binary that the FMU of a component lacks, in words."""
    obstacle = of_binary(component.interface)
    return f"{component.interface.called} {obstacle.what if obstacle else ''}"


def users_twins(component: Component) -> list[Path]:
    """Where a twin may be that the user has built; nowhere of an FMU that is no block of ours."""
    if not _is_ours(component):
        return []
    folders = NATIVE_FOLDER, component.fmu.parent.parent / NATIVE_FOLDER.name
    return [folder / _file(component) for folder in folders]


def _is_ours(component: Component) -> bool:
    """True for an FMU that runs a block of ours in Python."""
    made = component.interface
    return made.python and (made.tool or "").startswith("grasp-cosim ")


def _twin(component: Component, shipped: Path | None) -> Path | None:
    """The native FMU of the same content as the component's, of those built and of the user's."""
    from grasp_fmus.build import is_twin

    places = [*([shipped / _file(component)] if shipped else []), *users_twins(component)]
    return next((p for p in places if is_twin(p, component.interface.guid)), None)


def _file(component: Component) -> str:
    """The name of the FMU as it was built, whatever it is called now."""
    return f"{component.interface.identifier}.fmu"
