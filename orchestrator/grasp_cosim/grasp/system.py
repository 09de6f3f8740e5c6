"""The built-in system: the published grasp and its FMUs."""

from pathlib import Path

from grasp_fmus.build import shipped_fmus

from ..base.errors import InputError
from ..base.files import FMU_FOLDER
from ..system.description import System
from .controllers import with_controller
from .presets import SYSTEM


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
    from grasp_fmus.build import build, build_chosen

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
