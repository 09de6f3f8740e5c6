"""The built-in system and its FMUs, and the controllers by the names of their laws."""

import re
from collections.abc import Collection
from pathlib import Path

from ..base.checks import choice
from ..base.errors import InputError
from ..base.files import FMU_FOLDER
from ..fmu_export.build import shipped_fmus
from ..metrics.metric import resolved
from ..system.description import System
from .presets import SYSTEM

CONTROLLERS = {"published": "", "adaptive": "Adaptive"}
"""The published law, and the one that learns how the reflectances of the faces differ; what the
names of their FMUs have behind GraspController, or HandController.
"""

_FMU = re.compile(r"(Grasp|Hand)Controller(?:Adaptive)?(\d?)")


def with_controller(system: System, law: str, swapped: Collection[str] = ()) -> System:
    """The system with the controller of that law in the place of the one that it has.

    Its FMU is the one beside that of the component in the role "controller", else of the cache.
    `swapped` are the components that get another FMU. InputError where it is one of them, where no
    component has the role, and where that FMU does not fit.
    """
    place = f"controller {choice('controller', law, tuple(CONTROLLERS))}"
    name = controller_name(system)
    if name not in (c.name for c in system.components):
        raise InputError(
            f"{place}: {system.name} has no component {name!r}; must have one, or one that "
            'is named under [roles]: controller = "..."'
        )
    if name in swapped:
        raise InputError(f"{place}: cannot be used with another FMU for {name}")
    now = system.component(name, place)
    ours = _FMU.fullmatch(now.interface.identifier)
    of, fingers = ours.groups() if ours else ("Grasp", "")
    file = f"{of}Controller{CONTROLLERS[law]}{fingers}.fmu"
    beside = now.fmu.with_name(file)
    fmu = beside if beside.is_file() else shipped_fmus(int(fingers) if fingers else None) / file
    return system.with_settings({f"components.{name}.fmu": fmu}, lambda _: place)


def controller_name(system: System) -> str:
    """The name of the component in the role "controller", which need not exist."""
    return resolved("controller.", system.roles)[:-1]


def grasp_system(controller: str = "published", native: bool | None = None) -> System:
    """The built-in grasp; its FMUs are in the user's cache, built first if need be.

    controller is the name of the law: "published", or "adaptive", which minds no colours. native
    says which FMUs run, as of System.natively(): by default native ones, if they can be built.
    """
    system = as_named()
    chosen = system if controller == "published" else with_controller(system, controller)
    return chosen.natively(native)


def as_named() -> System:
    """The built-in grasp with FMUs that Python runs."""
    return System.load(SYSTEM, shipped_fmus())


def built(folder: Path, fingers: int | None = None) -> Path:
    """Where the FMUs are below a folder, built first where they are missing or out of date.

    With `fingers` those of a hand that has so many are among them.
    """
    from ..fmu_export.build import build, build_chosen

    try:
        build(folder / FMU_FOLDER)
        if fingers is not None:
            build_chosen(None, folder / FMU_FOLDER, fingers=fingers)
    except OSError as error:
        where = f"below {folder}" if folder != Path() else "below the current folder"
        raise InputError(
            f"{error.filename}: {error.strerror}; the FMUs are built into {FMU_FOLDER} {where}, "
            "which must be one that can be written to"
        ) from error
    return folder / FMU_FOLDER
