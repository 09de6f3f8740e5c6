"""The built-in system: the published grasp and its FMUs."""

from pathlib import Path

from ..errors import InputError
from ..files import FMU_FOLDER
from ..system.description import System
from .controllers import with_controller
from .presets import SYSTEM


def grasp_system(controller: str = "published") -> System:
    """The built-in grasp; its FMUs are built first where they are missing or out of date.

    controller is the name of the law: "published", or "adaptive", which minds no colours.
    """
    system = System.load(SYSTEM, built(Path()))
    return system if controller == "published" else with_controller(system, controller)


def built(folder: Path) -> Path:
    """Where the FMUs are below a folder, built first where they are missing or out of date."""
    from grasp_fmus.build import build

    try:
        build(folder / FMU_FOLDER)
    except OSError as error:
        where = f"below {folder}" if folder != Path() else "below the current folder"
        raise InputError(
            f"{error.filename}: {error.strerror}; the FMUs are built into {FMU_FOLDER} {where}, "
            "which must be one that can be written to"
        ) from error
    return folder / FMU_FOLDER
