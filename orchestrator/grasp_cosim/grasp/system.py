"""The built-in system: the published grasp and its FMUs."""

from ..errors import InputError
from ..files import FMU_FOLDER
from ..system.description import System
from .presets import SYSTEM


def grasp_system() -> System:
    """The built-in grasp; its FMUs are built first where they are missing or out of date."""
    from grasp_fmus.build import build

    try:
        build(FMU_FOLDER)
    except OSError as error:
        raise InputError(
            f"{error.filename}: {error.strerror}; the FMUs are built into {FMU_FOLDER} below the "
            "current folder, which must be one that can be written to"
        ) from error
    return System.load(SYSTEM, FMU_FOLDER)
